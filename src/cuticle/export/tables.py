"""What an export carries of a scattering function: its tables, as small as they may be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle.chiang import Chiang
from cuticle.conventions import logistic_deviation
from cuticle.export.function_table import FunctionTable, Progress, tabulate_function
from cuticle.models import AVERAGE_LIMIT, Bcsdf, DualScattering, Marschner
from cuticle.quadrature import gauss_legendre

TOLERANCE = 0.01  # of ∫ f cos
_VIEWERS = np.radians([0, 20, 45, 65, 80])
_COUNTS = (0.0, 0.5, 1.0, 3.0, 10.0)
_STEPS = (1, 2, 3, 4, 5, 6, 9, 10, 12, 15, 18, 20)  # divisors of 180, the rows' steps


@dataclass(frozen=True, eq=False)
class FibreTables:
    """What the core's closed forms read: a fibre's tables with every so many rows and columns left out.

    Attributes
    ----------
    alpha, beta
        Shifts and deviations of R, TT, TRT in theta_h, radians.
    conserving
        Whether the longitudinal function is the energy-conserving one.
    direct, spread
        N_p and its half-turn average, shape (rows, columns, 3, channels), single precision; `spread` is None for a strand
        on its own.
    averages
        Shape (rows, channels, 9), or None.
    formulation, d_f, d_b
        Of dual scattering.
    rest, rest_variance
        Of Chiang 2016: energies of the orders past TRT, shape (rows, channels), and the variance of their M in theta; or
        None.
    error
        Largest ∫|Δf| cos / ∫ f cos over viewers, strand counts and channels, by quadrature.
    """

    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]
    conserving: bool
    direct: NDArray[np.float32]
    spread: NDArray[np.float32] | None = None
    averages: NDArray[np.float32] | None = None
    formulation: str = "exact"
    d_f: float = 0.0
    d_b: float = 0.0
    rest: NDArray[np.float32] | None = None
    rest_variance: float = 0.0
    error: float = 0.0

    @property
    def kind(self) -> str:
        """Which of the core's functions they are for: "dual", "chiang" or "strand"."""
        return "dual" if self.spread is not None else "chiang" if self.rest is not None else "strand"

    @property
    def channels(self) -> int:
        """Length of the last axis of what f returns."""
        return self.direct.shape[3]

    @property
    def size(self) -> int:
        """Bytes in single precision."""
        return sum(t.nbytes for t in (self.direct, self.spread, self.averages, self.rest) if t is not None)

    def thinned(self, row_step: int, column_step: int) -> FibreTables:
        """Return every so many rows and columns of them; all averages, few as they are, whose powers strands take."""

        def thin(table: NDArray | None, columns: int = 1) -> Any:
            return None if table is None else np.ascontiguousarray(table[::row_step, ::columns], np.float32)

        return replace(
            self, direct=thin(self.direct, column_step), spread=thin(self.spread, column_step),
            rest=thin(self.rest),
        )  # fmt: skip

    def core(self) -> _core.Model:
        """Return what evaluates them."""
        direct = self.direct.astype(float)
        if self.spread is not None and self.averages is not None:
            tables = direct, self.spread.astype(float), self.averages.astype(float)
            return _core.Model(self.alpha, self.beta, self.conserving, *tables, AVERAGE_LIMIT, self.d_f, self.d_b)
        if self.rest is not None:
            return _core.Model(self.alpha, self.beta, direct, self.rest.astype(float), self.rest_variance)
        return _core.Model(self.alpha, self.beta, self.conserving, direct)


def reduce_tables(
    model: Bcsdf, counts: Iterable[float] = (0.0,), tolerance: float = TOLERANCE, progress: Progress | None = None
) -> FibreTables | FunctionTable:
    """Return the smallest tables that change f by less than `tolerance`.

    A `Fibre`'s and Chiang's functions keep their closed forms, and their tables lose rows and columns; any other becomes a
    table itself, for the strand counts that a sampler covers.

    Raises
    ------
    ValueError
        A function too sharp for a table.
    """
    whole = whole_tables(model)
    if whole is None:
        return tabulate_function(model, counts, tolerance, progress)
    columns = whole.direct.shape[1]
    # A column a deviation at least: glints that carry little of the integral are seen all the same.
    least = max(16, np.pi / _azimuthal_deviation(model))
    across = [s for s in (1, 2, 4, 8, 16, 32) if (columns - 1) % s == 0 and (columns - 1) // s >= least]
    exact = _values(whole)
    steps = sorted(
        ((r, c) for r in _STEPS for c in across), key=lambda s: ((180 // s[0] + 1) * ((columns - 1) // s[1] + 1), s)
    )
    for step in steps:
        thin = whole.thinned(*step)
        error = _distance(_values(thin), exact)
        if error <= tolerance or step == (1, 1):
            break
    return replace(thin, error=error)


def whole_tables(model: Bcsdf) -> FibreTables | None:
    """The tables of a model that has closed forms in the core; None for any other."""
    if isinstance(model, Chiang):
        return FibreTables(
            *model.half_angle_lobes, True, model.tables.direct.astype(np.float32),
            rest=model.rest.astype(np.float32), rest_variance=float(model.variance[3]),
        )  # fmt: skip
    if not isinstance(model, (DualScattering, Marschner)):
        return None
    single, f = (model.single if isinstance(model, DualScattering) else model), model.fibre
    alone = FibreTables(f.alpha, f.beta, single.longitudinal == "energy_conserving", single.tables.direct.astype(np.float32))
    if isinstance(model, Marschner):
        return alone
    return replace(
        alone, spread=single.tables.spread.astype(np.float32), averages=model.average_table.astype(np.float32),
        formulation=str(model.formulation), d_f=f.d_f, d_b=f.d_b,
    )  # fmt: skip


def _azimuthal_deviation(model: Any) -> float:
    return logistic_deviation(model.scale) if isinstance(model, Chiang) else float(np.radians(model.fibre.beta_N))


def _values(tables: FibreTables) -> NDArray[np.float64]:
    """Values of f cos at quadrature points, times their weights: shape (cases, points, channels)."""
    core = tables.core()
    theta, weight = gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, 61), 2)
    phi = (np.arange(360) + 0.5) * np.pi / 360
    ti, ph = (np.ascontiguousarray(a).reshape(-1) for a in np.broadcast_arrays(theta[:, None], phi))
    solid = (weight * np.cos(theta))[:, None, None]
    cases = []
    for viewer in _VIEWERS:
        for n in _COUNTS if tables.kind == "dual" else (0.0,):
            out = np.empty((ti.size, tables.channels))
            core.eval(ti, np.full(ti.size, viewer), ph, np.array([n]), 15, out)
            cases.append((out.reshape(len(theta), len(phi), -1) * solid).reshape(ti.size, -1))
    return np.array(cases)


def _distance(values: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    return float((np.abs(values - exact).sum(axis=1) / exact.sum(axis=1)).max())
