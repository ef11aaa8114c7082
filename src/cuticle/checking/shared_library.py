"""A sampler in a shared library, called through the C functions that include/cuticle/audit.h declares."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle.checking.audit import Audit, audit
from cuticle.scattering import frames
from cuticle.scattering.frames import DEFAULT_FRAME

Array = NDArray[np.float64]
PREFIX = "cuticle_audit_"
_UNIT = 1e-3  # how far a direction's length may be from 1
_GUARD = 8  # numbers past the end of an array, which a library must leave alone
_UNTOUCHED = -1.2345678901234567e300


def audit_library(
    library: str | os.PathLike[str] | ctypes.CDLL,
    *,
    frame: str = DEFAULT_FRAME,
    prefix: str = PREFIX,
    name: str | None = None,
    **options: Any,
) -> Audit:
    """Audit a sampler in a shared library: any compiled code, without a file of samples.

    The library has two or three C functions, which include/cuticle/audit.h declares: `cuticle_audit_sample`,
    `cuticle_audit_pdf` and, optionally, `cuticle_audit_eval`.

    Parameters
    ----------
    library
        Path of the library (.so, .dylib, .dll), or a loaded `ctypes.CDLL`.
    frame
        The frame of its directions: "local-x", "local-y", "local-z", "pbrt" (strand along x) or "mitsuba" (along y).
    prefix
        What the names of the functions begin with; a library may hold several samplers.
    name
        Name of the sampler in the report; by default the library's.
    options
        As for `cuticle.audit`: theta_r, samples, level, seed, reciprocity, energy, extra, progress.

    Returns
    -------
    Audit
        Verdicts, and where they fail. A direction whose length is not 1, and a row that the library did not write, count as
        samples that are not valid.

    Raises
    ------
    ValueError
        The library cannot be loaded, lacks a function, or writes past the end of an array. A crash in it, or a call of exit,
        ends the process; the command `cuticle audit` runs it in one of its own.

    Examples
    --------
    >>> import cuticle
    >>> cuticle.audit_library("libmine.so", samples=20_000)  # doctest: +SKIP
    """
    sampler = LibrarySampler(library, frame=frame, prefix=prefix)
    return audit(sampler, name=name or sampler.name, **options)


class LibrarySampler:
    """The functions of a library as `cuticle.audit` takes them: angles in radians, arrays in double precision."""

    def __init__(self, library: str | os.PathLike[str] | ctypes.CDLL, *, frame: str, prefix: str = PREFIX) -> None:
        self._frame, self._prefix = frames.frame(frame), prefix
        loaded = library if isinstance(library, ctypes.CDLL) else _load(Path(library))
        self.name = _name(loaded)
        self._sample = _function(loaded, f"{prefix}sample", 4)
        self._pdf = _function(loaded, f"{prefix}pdf", 3)
        self._eval = _function(loaded, f"{prefix}eval", 3) if hasattr(loaded, f"{prefix}eval") else None
        self.eval = None if self._eval is None else self._f

    def sample(self, theta_r: float, u: ArrayLike) -> tuple[Array, Array, Array]:
        """Return theta_i, phi and the pdf of the directions that `u`, (n, 3), gives."""
        us = np.array(u, np.float64).reshape(-1, 3)
        direction, pdf = _Out(f"{self._prefix}sample", len(us), 3), _Out(f"{self._prefix}sample", len(us))
        self._sample(len(us), self._viewer(theta_r), _pointer(us), direction.pointer, pdf.pointer)
        density = pdf.values()
        along, toward, aside = self._parts(direction.values())
        off = np.abs(np.sqrt(along**2 + toward**2 + aside**2) - 1)
        valid = off <= _UNIT  # false for NaN
        theta = np.where(valid, np.arcsin(np.clip(along, -1, 1)), np.nan)
        return theta, np.where(valid, np.arctan2(aside, toward), np.nan), density

    def pdf(self, theta_i: ArrayLike, theta_r: float, phi: ArrayLike) -> Array:
        """Return the density per steradian, (n,)."""
        direction = self._directions(theta_i, phi)
        out = _Out(f"{self._prefix}pdf", len(direction))
        self._pdf(len(direction), self._viewer(theta_r), _pointer(direction), out.pointer)
        return out.values()

    def _f(self, theta_i: ArrayLike, theta_r: float, phi: ArrayLike) -> Array:
        """Return f in 1/sr without a cosine, (n, 3)."""
        assert self._eval is not None
        direction = self._directions(theta_i, phi)
        out = _Out(f"{self._prefix}eval", len(direction), 3)
        self._eval(len(direction), self._viewer(theta_r), _pointer(direction), out.pointer)
        cosine = np.maximum(np.cos(np.ravel(np.asarray(theta_i, np.float64))), 1e-9)
        return out.values() / cosine[:, None]

    def _viewer(self, theta_r: float) -> Any:
        return _pointer(self._directions([theta_r], [0.0]))

    def _directions(self, theta: ArrayLike, phi: ArrayLike) -> Array:
        t, p = np.broadcast_arrays(np.ravel(np.asarray(theta, np.float64)), np.ravel(np.asarray(phi, np.float64)))
        out = np.empty((len(t), 3))
        for axis, values in zip(self._frame.axes, (np.sin(t), np.cos(t) * np.cos(p), np.cos(t) * np.sin(p)), strict=True):
            out[:, "xyz".index(axis)] = values
        return out

    def _parts(self, direction: Array) -> tuple[Array, Array, Array]:
        along, toward, aside = (direction[:, "xyz".index(axis)] for axis in self._frame.axes)
        return along, toward, aside


class _Out:
    """An array for a library to fill: rows that it leaves out stay NaN, and what it writes past the end is noticed."""

    def __init__(self, function: str, rows: int, columns: int | None = None) -> None:
        self._function, self._rows = function, rows
        self._shape = (rows,) if columns is None else (rows, columns)
        self._data = np.full(int(np.prod(self._shape)) + _GUARD, np.nan)
        self._data[-_GUARD:] = _UNTOUCHED

    @property
    def pointer(self) -> Any:
        return _pointer(self._data)

    def values(self) -> Array:
        if (self._data[-_GUARD:] != _UNTOUCHED).any():
            raise ValueError(f"{self._function} wrote past the end of its array: it was asked for {self._rows:,} rows")
        return self._data[:-_GUARD].reshape(self._shape)


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def _load(path: Path) -> ctypes.CDLL:
    if not path.is_file():
        raise ValueError(f"cannot load library {path}: No such file or directory")
    try:
        return ctypes.CDLL(str(path.resolve()))
    except OSError as error:
        raise ValueError(f"cannot load library {path}: {' '.join(str(error).split())}") from None


def _name(library: ctypes.CDLL) -> str:
    return Path(library._name).name if library._name else "this process"  # of CDLL(None), which has none


def _function(library: ctypes.CDLL, name: str, arrays: int) -> Any:
    try:
        function = library[name]
    except AttributeError:
        raise ValueError(
            f'{_name(library)} exports no function {name}: declare it extern "C", as cuticle/audit.h does'
            " (`cuticle --include-dir` prints where that is)"
        ) from None
    function.restype = None
    function.argtypes = [ctypes.c_size_t, *[ctypes.POINTER(ctypes.c_double)] * arrays]
    return function
