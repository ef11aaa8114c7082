"""A fibre among others: dual scattering (Zinke et al. 2008)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle.scattering.azimuthal import evaluate_core, lobe_mask
from cuticle.scattering.fibre import LOBES, Fibre
from cuticle.scattering.fibre_tables import AVERAGE_LIMIT, FibreTables
from cuticle.scattering.marschner import LONGITUDINAL_OF, Marschner, check_fibre
from cuticle.scattering.registry import first_class

PARTS = (*LOBES, "back")
FORMULATIONS = ("exact", "zinke2008")
_AVERAGE_ROWS = 181
_AVERAGE_QUADRATURE = 1440


class Averages(NamedTuple):
    """Half-sphere averages of a fibre at given inclinations; shapes (..., channels), angles in radians of theta_h.

    `a_f`, `a_b`: fractions of light scattered forward and back; `alpha_f`, `alpha_b`, `beta_f`, `beta_b`: mean shift
    and deviation of one such scattering; `back_energy`, `back_shift`, `back_deviation`: energy, mean shift and
    deviation of all that the strands behind send back.
    """

    a_f: NDArray[np.float64]
    a_b: NDArray[np.float64]
    alpha_f: NDArray[np.float64]
    alpha_b: NDArray[np.float64]
    beta_f: NDArray[np.float64]
    beta_b: NDArray[np.float64]
    back_energy: NDArray[np.float64]
    back_shift: NDArray[np.float64]
    back_deviation: NDArray[np.float64]

    @property
    def pass_on(self) -> NDArray[np.float64]:
        """What each strand passes on in a stack of them, see `pass_on`."""
        return pass_on(self.a_f, self.a_b, self.back_energy)


def pass_on(a_f: NDArray[np.float64], a_b: NDArray[np.float64], back_energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return s = a_f/(1 - a_b R), R = a_b + A_b: of light on a half space of strands s^n comes as far as n strands deep.

    All orders of what goes to and fro between strands (Stokes 1862, a pile of plates); more than a_f^n, which counts light
    that was never turned back.
    """
    return np.vectorize(lambda f, b, back: _core.stack(f, b, back, 0.0, 0.0)[0], otypes=[float])(a_f, a_b, back_energy)


@first_class
@dataclass(frozen=True)
class DualScattering:
    """A fibre among others: light that reaches it directly, or through `strands` others (Zinke et al. 2008).

    With 0 strands f is the fibre's own plus the backscatter of the strands behind; through n > 0 strands light arrives
    dimmed, spread over the front half of the azimuth and widened in theta. A count between 0 and 1 blends the two in
    that proportion; other fractions are fractional powers.

    Parameters
    ----------
    fibre
        The fibre.
    strands
        How many strands lie toward the light, whole or not, 0 to 10,000.
    formulation
        "exact": every part carries the energy it stands for, all orders of scattering are summed, the longitudinal
        function conserves energy. "zinke2008": the formulas as printed, with the Gaussian one. Default: the fibre's
        own, which is "exact" unless it says otherwise.

    Raises
    ------
    ValueError
        Where the fractions of light scattered forward and back reach 1, so that multiple scattering has no sum.
    """

    fibre: Fibre
    strands: float = 0.0
    formulation: str | None = None
    even = True

    def __post_init__(self) -> None:
        check_fibre(self.fibre)
        if self.formulation is None:
            object.__setattr__(self, "formulation", self.fibre.formulation)
        validate.choice("formulation", self.formulation, FORMULATIONS)
        object.__setattr__(self, "strands", validate.number("strands", self.strands, 0, validate.MAX_STRANDS))
        self.average_table  # noqa: B018 - refuses a fibre whose multiple scattering diverges before any other work

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` makes an equal function of, but for the strands; JSON can hold it."""
        return {"fibre": self.fibre.to_dict(), "formulation": self.formulation}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> DualScattering:
        """Return the function that `to_dict` described, with no strands in the way."""
        return cls(Fibre(**data["fibre"]), formulation=data.get("formulation"))

    @property
    def _exact(self) -> bool:
        return self.formulation == "exact"

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return self.fibre.channels

    @cached_property
    def single(self) -> Marschner:
        """The fibre on its own."""
        return Marschner(self.fibre, LONGITUDINAL_OF[str(self.formulation)])

    @property
    def average_table(self) -> NDArray[np.float64]:
        """`Averages` at inclinations from -AVERAGE_LIMIT to AVERAGE_LIMIT, shape (rows, channels, 9)."""
        return _averages(self.fibre, str(self.formulation))

    @cached_property
    def _core(self) -> _core.Model:
        f, tables = self.fibre, self.single.tables
        return _core.Model(
            f.alpha, f.beta, self._exact, tables.direct, tables.spread, self.average_table, AVERAGE_LIMIT, f.d_f, f.d_b
        )  # fmt: skip

    def host_tables(self) -> FibreTables:
        """Return what the core's closed forms read, in single precision."""
        f, tables = self.fibre, self.single.tables
        return replace(
            self.single.host_tables(), spread=tables.spread.astype(np.float32),
            averages=self.average_table.astype(np.float32), formulation=str(self.formulation), d_f=f.d_f, d_b=f.d_b,
        )  # fmt: skip

    def with_strands(self, strands: float) -> DualScattering:
        """Return the same model for another number of strands."""
        return DualScattering(self.fibre, strands, self.formulation)

    def averages(self, theta: ArrayLike) -> Averages:
        """Return the half-sphere averages at inclinations `theta` (radians)."""
        t = validate.angles("theta", theta, validate.HALF_PI, np.float64)
        grid = np.linspace(-AVERAGE_LIMIT, AVERAGE_LIMIT, _AVERAGE_ROWS)
        table = self.average_table
        columns = [
            np.stack([np.interp(t, grid, table[:, c, j]) for c in range(self.channels)], axis=-1)
            for j in range(len(Averages._fields))
        ]
        return Averages(*columns)

    def eval(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, *, lobes: str | Iterable[str] | None = None
    ) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; as `Marschner.eval`, with "back" a fourth part to ask for."""
        mask = lobe_mask(lobes, PARTS)
        return evaluate_core(self._core, self.channels, mask, theta_i, theta_r, phi, self.strands)

    def expected(
        self,
        theta_i: ArrayLike,
        theta_r: ArrayLike,
        phi: ArrayLike,
        strands: ArrayLike,
        *,
        behind: ArrayLike | None = None,
        lobes: str | Iterable[str] | None = None,
    ) -> NDArray[np.float64]:
        """Return f's mean where a density of hair tells how many strands to expect: what a renderer asks for.

        Strands scatter about what is expected of them as counts do, N ~ Poisson(τ). The mean over N of what N strands let
        through is E[a^N g(N)] = exp(τ (a - 1)) E[g(N')] with N' ~ Poisson(τ a), a what one passes on; shift and spread are
        those of N'.
        The strands' own number, `self.strands`, plays no part.

        Parameters
        ----------
        theta_i, theta_r, phi, lobes
            As in `eval`; arrays broadcast.
        strands
            Expected between the strand and the light, 0 to 10,000.
        behind
            Expected beyond the strand, away from the light, 0 to 10,000: a stack of so many sends back less than the half
            space of strands that dual scattering assumes, and that None stands for (Stokes 1862). "exact" only.

        Returns
        -------
        ndarray
            1/sr, without a cosine; broadcast shape plus a last axis of channels.

        Raises
        ------
        ValueError
            An angle or a number of strands out of range; `behind` with "zinke2008", which stays as printed.

        Examples
        --------
        >>> import cuticle
        >>> model = cuticle.DualScattering(cuticle.Fibre.preset("blond"))
        >>> model.expected(0.1, 0.0, 3.0, [0.5, 2.0, 8.0], behind=3.0).shape
        (3, 3)
        """
        n = _expected("strands", strands)
        if behind is not None and not self._exact:
            raise ValueError('behind is for the formulation "exact"; "zinke2008" stays as printed: leave behind out')
        b = np.array(np.finfo(np.float64).max) if behind is None else _expected("behind", behind)
        return evaluate_core(self._core, self.channels, lobe_mask(lobes, PARTS), theta_i, theta_r, phi, n, b)


def _expected(name: str, value: ArrayLike) -> NDArray[np.float64]:
    x = np.asarray(value, np.float64)
    wrong = x[~((x >= 0) & (x <= validate.MAX_STRANDS))]  # a NaN is wrong, too
    if wrong.size:
        raise ValueError(f"{name} must be in [0, {validate.MAX_STRANDS:,.0f}], got {float(wrong.flat[0]):g}")
    return x


@lru_cache(maxsize=16)
def _averages(fibre: Fibre, formulation: str) -> NDArray[np.float64]:
    halves = Marschner(fibre, LONGITUDINAL_OF[formulation]).tables.halves
    table = np.empty((_AVERAGE_ROWS, fibre.channels, _core.average_columns))
    exact = formulation == "exact"
    _core.averages(fibre.alpha, fibre.beta, exact, fibre.d_b, AVERAGE_LIMIT, _AVERAGE_QUADRATURE, halves, table)
    total = table[:, :, 0] + table[:, :, 1]
    row, channel = np.unravel_index(np.argmax(total), total.shape)
    if not total[row, channel] < 1 - 1e-9:
        theta = np.degrees(np.linspace(-AVERAGE_LIMIT, AVERAGE_LIMIT, _AVERAGE_ROWS)[row])
        remedy = "raise sigma_a" if exact else 'raise sigma_a, or use formulation="exact", which conserves energy'
        raise ValueError(
            f"light scattered forward and back, a_f + a_b, must stay below 1, got {total[row, channel]:.4g} at theta"
            f" {theta:.3g}° (channel {channel}): multiple scattering has no sum; {remedy}"
        )
    table.setflags(write=False)
    return table
