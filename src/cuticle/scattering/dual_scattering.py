"""Dual scattering: a fibre among other strands (Zinke et al. 2008)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle._support.values import Value
from cuticle.scattering.azimuthal import evaluate_core, lobe_mask
from cuticle.scattering.bcsdf import Plotted
from cuticle.scattering.fibre import LOBES, Fibre
from cuticle.scattering.fibre_tables import FibreTables
from cuticle.scattering.marschner import LONGITUDINAL_OF, Marschner, check_fibre
from cuticle.scattering.registry import first_class
from cuticle.scattering.through_strands import through_tables

PARTS = (*LOBES, "back")
FORMULATIONS = ("exact", "zinke2008")
_AVERAGE_ROWS = 181
_LEFT_AT_POLE = 1e-6  # of a quarter turn, up to which the averages are tabulated: at the pole itself nothing is absorbed
_AVERAGE_QUADRATURE = 1440


class Averages(NamedTuple):
    """Half-sphere averages of a fibre at given inclinations: shapes (..., channels), angles in radians of theta_h.

    - `a_f`, `a_b`: fractions of light scattered forward and back.
    - `alpha_f`, `alpha_b`, `beta_f`, `beta_b`: mean shift and deviation of one such scattering.
    - `back_energy`, `back_shift`, `back_deviation`: energy, mean shift and deviation of the light that the strands behind
      send back, over all orders.
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


@first_class
@dataclass(frozen=True, eq=False)
class DualScattering(Value, Plotted):
    """Dual scattering: a fibre lit directly, or through other strands (Zinke et al. 2008).

    With 0 strands, f is the fibre's own scattering plus the backscatter of the strands behind. Through n > 0 strands, light
    arrives attenuated, spread in azimuth and widened in theta. A count between 0 and 1 blends the two in that proportion;
    energies between larger counts follow their logarithms.

    Parameters
    ----------
    fibre
        The fibre.
    strands
        The number of strands toward the light, 0 to 10,000; it need not be whole.
    formulation
        "exact" conserves energy and follows light at its true angles, over all orders of scattering. "zinke2008" has the
        formulas as printed, with the Gaussian longitudinal function. Default: the fibre's own, which is "exact" unless
        set. docs/models.md compares them.

    Raises
    ------
    ValueError
        The fractions of light scattered forward and back reach 1, so that multiple scattering has no sum.

    Examples
    --------
    >>> import cuticle
    >>> model = cuticle.DualScattering(cuticle.Fibre.preset("brown"), strands=2)
    >>> model.eval(0.1, 0.2, 3.0).shape
    (3,)
    """

    fibre: Fibre
    strands: float = 0.0
    formulation: str | None = None
    even = True
    many_viewers = True

    def __post_init__(self) -> None:
        check_fibre(self.fibre)
        if self.formulation is None:
            object.__setattr__(self, "formulation", self.fibre.formulation)
        validate.choice("formulation", self.formulation, FORMULATIONS)
        object.__setattr__(self, "strands", validate.number("strands", self.strands, 0, validate.MAX_STRANDS))
        self.average_table  # noqa: B018 - refuses a fibre whose multiple scattering diverges before any other work

    def to_dict(self) -> dict[str, Any]:
        """Return all parameters but the strand count, as values that JSON can hold."""
        return {"fibre": self.fibre.to_dict(), "formulation": self.formulation}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> DualScattering:
        """Return the function that `to_dict` described, for 0 strands."""
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
        """`Averages` at `average_inclinations()`, shape (rows, 9, channels)."""
        return _averages(self.fibre, str(self.formulation))

    def _among(self, random: str | None) -> _core.Model:
        f, tables = self.fibre, self.single.tables
        if self._exact:
            return _core.Model(f.alpha, f.beta, tables.direct, *through_tables(f, random=random), f.d_f, f.d_b)
        averages = self.average_table
        return _core.Model(f.alpha, f.beta, tables.direct, tables.spread, averages, f.d_f, f.d_b)

    @cached_property
    def _lock(self) -> _core.Model:
        return self._among("lock")

    @cached_property
    def _medium(self) -> _core.Model:
        return self._among("medium")

    @cached_property
    def _core(self) -> _core.Model:
        return self._among(None)

    def host_tables(self) -> FibreTables:
        """Return what the core's closed forms read, in single precision."""
        f, tables = self.fibre, self.single.tables
        others: dict[str, Any] = (
            {"through": through_tables(f)}
            if self._exact
            else {"spread": tables.spread.astype(np.float32), "averages": self.average_table.astype(np.float32)}
        )
        return replace(self.single.host_tables(), formulation=str(self.formulation), d_f=f.d_f, d_b=f.d_b, **others)

    def with_strands(self, strands: float) -> DualScattering:
        """Return the same model for another number of strands."""
        return DualScattering(self.fibre, strands, self.formulation)

    def averages(self, theta: ArrayLike) -> Averages:
        """Return the half-sphere averages at inclinations `theta` (radians)."""
        t = validate.angles("theta", theta, validate.HALF_PI, np.float64)
        even = np.linspace(-1, 1, _AVERAGE_ROWS)
        at = np.copysign(1 - np.sqrt(1 - np.abs(t) / (np.pi / 2)), t)
        columns = [
            np.stack([np.interp(at, even, self.average_table[:, j, c]) for c in range(self.channels)], axis=-1)
            for j in range(len(Averages._fields))
        ]
        return Averages(*columns)

    def eval(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, *, lobes: str | Iterable[str] | None = None
    ) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; as `Marschner.eval`. `lobes` may also name "back", the backscatter."""
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
        """Return the mean of f over a random number of strands, of which a renderer knows the expectation.

        The number N of strands on a ray is Poisson distributed, and f the mean over it. With `behind`, hair is a lock: a
        path meets so many strands in whatever direction it goes. Without, "exact" takes it for a medium of strands at
        random, endless to the sides and behind, where slanted paths meet more of them. `self.strands` is not used.

        Parameters
        ----------
        theta_i, theta_r, phi, lobes
            As in `eval`; arrays broadcast.
        strands
            Expected number between this strand and the light, 0 to 10,000.
        behind
            Expected number beyond this strand, away from the light, 0 to 10,000. A finite stack sends back less than the
            half space that dual scattering assumes. None: a half space, of a medium. For "exact" only.

        Returns
        -------
        ndarray
            1/sr, without a cosine; broadcast shape plus a last axis of channels.

        Raises
        ------
        ValueError
            An angle or a number of strands is out of range, or `behind` is given with "zinke2008".

        Examples
        --------
        >>> import cuticle
        >>> model = cuticle.DualScattering(cuticle.Fibre.preset("blond"))
        >>> model.expected(0.1, 0.0, 3.0, [0.5, 2.0, 8.0], behind=3.0).shape
        (3, 3)
        """
        n = validate.strands_of_light("strands", strands)
        if behind is not None and not self._exact:
            raise ValueError('behind is for the formulation "exact"; "zinke2008" stays as printed: leave behind out')
        b = np.array(np.finfo(np.float64).max) if behind is None else validate.strands_of_light("behind", behind)
        core = self._medium if behind is None else self._lock
        return evaluate_core(core, self.channels, lobe_mask(lobes, PARTS), theta_i, theta_r, phi, n, b)


def average_inclinations() -> NDArray[np.float64]:
    """Return inclinations from pole to pole, radians, shape (rows,), among which the core's locate_average finds a place."""
    s = np.linspace(-1, 1, _AVERAGE_ROWS)
    return np.copysign(np.pi / 2 * (1 - np.maximum((1 - np.abs(s)) ** 2, _LEFT_AT_POLE)), s)


@lru_cache(maxsize=16)
def _averages(fibre: Fibre, formulation: str) -> NDArray[np.float64]:
    halves = Marschner(fibre, LONGITUDINAL_OF[formulation]).tables.halves
    table = np.empty((_AVERAGE_ROWS, _core.average_columns, fibre.channels))
    exact, theta = formulation == "exact", average_inclinations()
    _core.averages(fibre.alpha, fibre.beta, exact, fibre.d_b, theta, _AVERAGE_QUADRATURE, halves, table)
    total = table[:, 0] + table[:, 1]
    row, channel = np.unravel_index(np.argmax(total), total.shape)
    if not total[row, channel] < 1 - 1e-9:
        remedy = "raise sigma_a" if exact else 'raise sigma_a, or use formulation="exact", which conserves energy'
        raise ValueError(
            f"light scattered forward and back, a_f + a_b, must stay below 1, got {total[row, channel]:.4g} at theta"
            f" {np.degrees(theta[row]):.3g}° (channel {channel}): multiple scattering has no sum; {remedy}"
        )
    table.setflags(write=False)
    return table
