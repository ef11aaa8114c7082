"""What an export carries: the lobe table, and the scattering function's tables as small as they may be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle.models import AVERAGE_LIMIT, Bcsdf, DualScattering, Marschner
from cuticle.quadrature import gauss_legendre

TOLERANCE = 0.01  # of ∫ f cos
_VIEWERS = np.radians([0, 20, 45, 65, 80])
_COUNTS = (0.0, 0.5, 1.0, 3.0, 10.0)
_STEPS = (1, 2, 3, 4, 5, 6, 9, 10, 12, 15, 18, 20)  # divisors of 180, the rows' steps


@dataclass(frozen=True, eq=False)
class ModelTables:
    """A scattering function's tables with every so many rows and columns left out.

    Attributes
    ----------
    direct, spread
        N_p and its half-turn average, shape (rows, columns, 3, channels), single precision; `spread` is None for a strand
        on its own.
    averages
        Shape (rows, channels, 9), or None.
    error
        Largest ∫|Δf| cos / ∫ f cos over viewers, strand counts and channels, by quadrature.
    """

    model: DualScattering | Marschner
    direct: NDArray[np.float32]
    spread: NDArray[np.float32] | None
    averages: NDArray[np.float32] | None
    error: float

    @property
    def single(self) -> Marschner:
        """The strand on its own."""
        return _single(self.model)

    @property
    def conserving(self) -> bool:
        """Whether the longitudinal function is the energy-conserving one."""
        return self.single.longitudinal == "energy_conserving"

    @cached_property
    def size(self) -> int:
        """Bytes in single precision."""
        return sum(t.nbytes for t in (self.direct, self.spread, self.averages) if t is not None)


def reduce_tables(model: Bcsdf, tolerance: float = TOLERANCE) -> ModelTables:
    """Return the smallest of the model's tables, with rows and columns left out, that change f by less than `tolerance`.

    Raises
    ------
    ValueError
        A model that is not of a `Fibre`: only those can be written so far.
    """
    if not isinstance(model, (DualScattering, Marschner)):
        raise ValueError(
            f"the scattering function of {type(model).__name__} cannot be written, only that of a fibre; export the sampler"
            " without it"
        )
    columns = _single(model).tables.direct.shape[1]
    across = [s for s in (1, 2, 4, 8, 16, 32) if (columns - 1) % s == 0 and (columns - 1) // s >= 16]
    exact = _values(model, *_thinned(model, 1, 1))
    steps = sorted(
        ((r, c) for r in _STEPS for c in across), key=lambda s: ((180 // s[0] + 1) * ((columns - 1) // s[1] + 1), s)
    )
    for rows, columns_step in steps:
        direct, spread, averages = _thinned(model, rows, columns_step)
        error = _distance(_values(model, direct, spread, averages), exact)
        if error <= tolerance or (rows, columns_step) == (1, 1):
            break
    return ModelTables(model, direct, spread, averages, error)


Tables = tuple[NDArray[np.float32], "NDArray[np.float32] | None", "NDArray[np.float32] | None"]


def _thinned(model: DualScattering | Marschner, row_step: int, column_step: int) -> Tables:
    single = _single(model)
    thin = slice(None, None, row_step), slice(None, None, column_step)
    direct = single.tables.direct[thin].astype(np.float32)
    if isinstance(model, Marschner):
        return direct, None, None
    return direct, single.tables.spread[thin].astype(np.float32), model.average_table[::row_step].astype(np.float32)


def _values(
    model: DualScattering | Marschner, direct: NDArray, spread: NDArray | None, averages: NDArray | None
) -> NDArray[np.float64]:
    """Values of f cos at quadrature points, times their weights: shape (cases, points, channels)."""
    f, conserving = model.fibre, _single(model).longitudinal == "energy_conserving"
    if spread is None or averages is None:
        core = _core.Model(f.alpha, f.beta, conserving, direct.astype(float))
        counts: tuple[float, ...] = (0.0,)
    else:
        tables = direct.astype(float), spread.astype(float), averages.astype(float)
        core = _core.Model(f.alpha, f.beta, conserving, *tables, AVERAGE_LIMIT, f.d_f, f.d_b)
        counts = _COUNTS
    theta, weight = gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, 61), 2)
    phi = (np.arange(360) + 0.5) * np.pi / 360
    ti, ph = (np.ascontiguousarray(a).reshape(-1) for a in np.broadcast_arrays(theta[:, None], phi))
    solid = (weight * np.cos(theta))[:, None, None]
    cases = []
    for viewer in _VIEWERS:
        for n in counts:
            out = np.empty((ti.size, model.channels))
            core.eval(ti, np.full(ti.size, viewer), ph, np.array([n]), 15, out)
            cases.append((out.reshape(len(theta), len(phi), -1) * solid).reshape(ti.size, -1))
    return np.array(cases)


def _single(model: DualScattering | Marschner) -> Marschner:
    return model.single if isinstance(model, DualScattering) else model


def _distance(values: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    return float((np.abs(values - exact).sum(axis=1) / exact.sum(axis=1)).max())
