"""The tables that the core's closed forms read, of one fibre."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle import _core


class ThroughTables(NamedTuple):
    """What the core's ThroughTable views (through_strands.h).

    - `energy`, (2, nodes, rows, 2, parts, channels): its log, and how far that lies halfway to the next node above the mean
      of both. Rows are theta_r from -limit to limit; the first of the 2 are of strands in sheets, the others of a Poisson
      number of them. Nodes are 0, 1, 2, 4, 8 and 16 strands, direct light's backscatter in place of 0 sheets.
    - `along`, (2, nodes, along rows, 8, parts, channels): of three M's the shares of the first two, then axis and variance
      of each, in theta, radians.
    - `azimuth`, (2, nodes, azimuth rows, columns, parts, channels): densities over phi from 0 to pi, which integrate to 1
      over the whole turn.
    - `behind`, (rows, 3, channels): the rates at which the backscatter of direct and of scattered light grows with the
      strands behind, out of a half space's; and what comes through strands where none stands behind, out of what does
      before a half space.
    """

    energy: NDArray[np.float64]
    along: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    behind: NDArray[np.float64]
    limit: float


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
        N_p and, for "zinke2008", its half-turn average, shape (rows, columns, 3, channels), single precision.
    through
        For "exact": what comes through other strands.
    averages
        For "zinke2008": shape (rows, 9, channels).
    formulation, d_f, d_b
        Of dual scattering.
    rest, rest_variance
        Of Chiang 2016: energies of the orders past TRT, shape (rows, channels), and the variance of their M in theta; or
        None.
    deviation
        Of the azimuthal distribution, radians: how coarse its columns may become.
    error
        Largest ∫|Δf| cos / ∫ f cos over viewers, strand counts and channels, by quadrature.
    """

    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]
    conserving: bool
    direct: NDArray[np.float32]
    spread: NDArray[np.float32] | None = None
    through: ThroughTables | None = None
    averages: NDArray[np.float32] | None = None
    formulation: str = "exact"
    d_f: float = 0.0
    d_b: float = 0.0
    rest: NDArray[np.float32] | None = None
    rest_variance: float = 0.0
    deviation: float = 0.0
    error: float = 0.0

    @property
    def kind(self) -> str:
        """Which of the core's functions they are for: "dual", "chiang" or "strand"."""
        return (
            "dual"
            if self.averages is not None or self.through is not None
            else "chiang"
            if self.rest is not None
            else "strand"
        )

    @property
    def channels(self) -> int:
        """Length of the last axis of what f returns."""
        return self.direct.shape[3]

    @property
    def parts(self) -> list[NDArray]:
        """The tables that there are, in the order of exports."""
        through = () if self.through is None else self.through[:4]
        return [t for t in (self.direct, self.spread, *through, self.averages, self.rest) if t is not None]

    @property
    def size(self) -> int:
        """Bytes in single precision."""
        return sum(4 * t.size for t in self.parts)

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
        if self.through is not None:
            return _core.Model(self.alpha, self.beta, direct, *self.through, self.d_f, self.d_b)
        if self.spread is not None and self.averages is not None:
            others = self.spread.astype(float), self.averages.astype(float)
            return _core.Model(self.alpha, self.beta, direct, *others, self.d_f, self.d_b)
        if self.rest is not None:
            return _core.Model(self.alpha, self.beta, direct, self.rest.astype(float), self.rest_variance)
        return _core.Model(self.alpha, self.beta, self.conserving, direct)
