"""A scattering function given as a Python function: used as it is where it takes arrays, else tabulated."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, update_wrapper
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.progress import Progress, silent
from cuticle._support.values import Value
from cuticle.scattering.bcsdf import Plotted, checked_even, evaluate
from cuticle.scattering.table_axes import grid_axes
from cuticle.scattering.tabulated import Tabulated

GRID = (25, 91, 181)  # viewers, theta_i, phi over a whole turn
_PROBES = 16


class Function(Value, Plotted):
    """A scattering function that calls a deterministic Python function of arrays. Made by `from_callable`.

    Parameters
    ----------
    function
        function(theta_i, theta_r, phi) returns f in 1/sr without a cosine. It takes arrays of one shape in radians, and
        returns that shape, or that shape plus channels.
    even
        Whether f(phi) = f(-phi).
    """

    strands = 0.0

    def __init__(self, function: Callable[..., Any], even: bool = False) -> None:
        self.function, self.even = function, even

    def __repr__(self) -> str:
        return f"Function({_name(self.function)}{', even' if self.even else ''})"

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; arrays broadcast, the last axis is channels."""
        ti, tr, ph = validate.directions(theta_i, theta_r, phi)
        shape = validate.broadcast(theta_i=ti, theta_r=tr, phi=ph)
        return _call(self.function, *(np.array(np.broadcast_to(x, shape)) for x in (ti, tr, ph)))


def from_callable(
    function: Callable[..., Any],
    *,
    even: bool = False,
    repeats: int = 1,
    grid: tuple[int, int, int] = GRID,
    progress: Progress | None = None,
) -> Function | Tabulated:
    """Make a scattering function of a Python function.

    A deterministic function of arrays is used as it is. A function of single numbers, or an estimator that is averaged over
    `repeats` answers, is tabulated.

    Parameters
    ----------
    function
        function(theta_i, theta_r, phi) returns f in 1/sr without a cosine; angles are radians. It takes arrays of one
        shape and returns that shape, or that shape plus channels; or it takes single numbers and returns one value, or
        one per channel.
    even
        Whether f(phi) = f(-phi). It halves the work, and lobes serve both sides. With `repeats=1` it is checked.
    repeats
        How many answers of an estimator are averaged at each point of the table. 1: the function is deterministic.
    grid
        Numbers of viewers, of theta_i and of phi over a whole turn, for what has to be tabulated.
    progress
        Called with a phase and a fraction from 0 to 1.

    Returns
    -------
    Function or Tabulated
        A table's `source` holds "repeats" and "error", the mean's standard error as a share of f (0 for one repeat).

    Raises
    ------
    ValueError
        A function that raises, or returns a wrong shape, negative values or NaN; with `repeats=1` one that answers two
        equal calls differently, or is said to be even and is not.

    Examples
    --------
    >>> import numpy as np, cuticle
    >>> model = cuticle.from_callable(lambda ti, tr, phi: np.exp(-((ti + tr) ** 2) / 0.05) / 6, even=True)
    >>> model.eval(0.1, -0.1, 2.0).shape
    (1,)
    """
    if not callable(function):
        raise TypeError(f"function must be callable, got {type(function).__name__}")
    validate.integer("repeats", repeats, 1, 1_000_000)
    validate.flag("even", even)
    if not isinstance(grid, (tuple, list)) or len(grid) != 3:
        raise TypeError(f"grid must be three whole numbers, of theta_r, theta_i and phi, got {grid!r}")
    sizes = tuple(
        validate.integer(f"grid ({name})", n, low, 2000)
        for name, n, low in zip(("theta_r", "theta_i", "phi"), grid, (2, 7, 13), strict=True)
    )
    rng = np.random.default_rng(1)
    probe = rng.uniform(-1.5, 1.5, _PROBES), rng.uniform(-1.5, 1.5, _PROBES), rng.uniform(-3, 3, _PROBES)
    vectorised = _takes_arrays(function, *probe)
    ask = update_wrapper(partial(_call if vectorised else _each, function), function)
    if repeats == 1 and not np.array_equal(ask(*probe), ask(*probe), equal_nan=True):
        raise ValueError(
            f"{_name(function)} answers two equal calls differently: for an estimator say repeats=64, how many answers are"
            " averaged at each point of a table"
        )
    if repeats == 1:
        made = Function(function if vectorised else ask, even)
        checked_even(made)
        if vectorised:
            evaluate(made, probe[0], 0.3, probe[2])  # refuses what is below 0 and what is no number
            return made
    return _tabulate(function, ask, even, repeats, sizes, progress or silent)


def _tabulate(
    function: Callable[..., Any],
    ask: Callable[..., NDArray],
    even: bool,
    repeats: int,
    sizes: tuple[int, ...],
    progress: Progress,
) -> Tabulated:
    theta_r, theta_i, phi = grid_axes(sizes, even)
    ti, ph = (x.ravel() for x in np.meshgrid(theta_i, phi, indexing="ij"))
    sheets, error = [], 0.0
    for i, viewer in enumerate(theta_r):
        progress(f"{_name(function)}: theta_r {np.degrees(viewer):.0f}°", i / len(theta_r))
        tr = np.full(len(ti), viewer)
        total = ask(ti, tr, ph)
        squares = total**2
        for _ in range(repeats - 1):
            value = ask(ti, tr, ph)
            total, squares = total + value, squares + value**2
        if repeats > 1:
            error = max(error, _error(total, squares, repeats, np.cos(ti)))
        sheets.append((total / repeats).reshape(len(theta_i), len(phi), -1))
    progress("done", 1.0)
    table = Tabulated(theta_r, theta_i, phi, np.array(sheets))
    table.source = {"function": _name(function), "repeats": repeats, "error": error}
    return table


def _error(total: NDArray, squares: NDArray, count: int, cosine: NDArray) -> float:
    """Standard error as a share of f, averaged over f cos."""
    mean = total / count
    deviation = np.sqrt(np.maximum(squares / count - mean**2, 0) / (count - 1))
    weight = cosine[:, None] ** 2
    return float((weight * deviation).sum() / max(float((weight * np.abs(mean)).sum()), 1e-300))


def _name(function: Callable[..., Any]) -> str:
    return str(getattr(function, "__name__", type(function).__name__))


def _takes_arrays(function: Callable[..., Any], *probe: NDArray) -> bool:
    try:
        shape = np.shape(function(*(x.copy() for x in probe)))
    except Exception:  # whatever a function of single numbers does with arrays
        return False
    return shape[:1] == (_PROBES,) and len(shape) <= 2


def _call(function: Callable[..., Any], ti: NDArray, tr: NDArray, ph: NDArray) -> NDArray[np.float64]:
    try:
        answer = function(ti, tr, ph)
    except Exception as error:
        raise ValueError(f"{_name(function)}(theta_i, theta_r, phi) raised {type(error).__name__}: {error}") from error
    f = validate.real(f"what {_name(function)} returns", answer).astype(np.float64)
    if f.shape == ti.shape:
        return f[..., None]
    if f.shape[:-1] != ti.shape or not 1 <= f.shape[-1] <= 32:
        raise ValueError(
            f"{_name(function)} must return shape {ti.shape}, or that plus channels, for angles of that shape; got {f.shape}"
        )
    return f


def _each(function: Callable[..., Any], ti: NDArray, tr: NDArray, ph: NDArray) -> NDArray[np.float64]:
    points = zip(*(x.ravel().tolist() for x in (ti, tr, ph)), strict=True)
    return np.array([_one(function, *point) for point in points]).reshape(*ti.shape, -1)


def _one(function: Callable[..., Any], ti: float, tr: float, ph: float) -> NDArray[np.float64]:
    where = f"at theta_i {ti:.4g}, theta_r {tr:.4g}, phi {ph:.4g}"
    try:
        answer = function(ti, tr, ph)
    except Exception as error:
        raise ValueError(f"{_name(function)} raised {type(error).__name__} {where}: {error}") from error
    f = np.atleast_1d(validate.real(f"what {_name(function)} returns", answer)).astype(np.float64)
    if f.ndim != 1 or len(f) > 32:
        raise ValueError(f"{_name(function)} must return one value or one a channel, got shape {f.shape} {where}")
    return f
