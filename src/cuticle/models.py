"""Scattering functions of fibres: a single strand, and a strand among others."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core, validate
from cuticle.fibre import LOBES, Fibre

PARTS = (*LOBES, "back")
FORMULATIONS = ("exact", "zinke2008")
LONGITUDINAL = ("gaussian", "energy_conserving")
LONGITUDINAL_OF = {"exact": "energy_conserving", "zinke2008": "gaussian"}

ROWS = 181  # azimuthal tables: theta_d in steps of half a degree
OFFSETS = 1024  # cells of the quadrature over h >= 0
_AVERAGE_ROWS = 181
AVERAGE_LIMIT = np.radians(89.5)  # at the pole itself Fresnel's term is 1 and nothing is ever absorbed
_AVERAGE_QUADRATURE = 1440


@runtime_checkable
class Bcsdf(Protocol):
    """What a model has to offer: `eval` in 1/sr without a cosine, arrays broadcast, last axis = channels.

    A model that is not even in phi says so with an attribute `even = False`.
    """

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f(theta_i, theta_r, phi)."""
        ...


def is_even(model: object) -> bool:
    """Whether a model says that it is even in phi; one that says nothing is taken not to be."""
    return bool(getattr(model, "even", False))


def with_strands(model: Any, strands: float) -> Any:
    """Return a scattering function for a number of strands, or itself where it knows none."""
    return model.with_strands(strands) if hasattr(model, "with_strands") else model


class AzimuthalTables(NamedTuple):
    """N_p and its half-turn average on a grid, and the energies that go on and back."""

    direct: NDArray[np.float64]
    spread: NDArray[np.float64]
    halves: NDArray[np.float64]


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


@lru_cache(maxsize=16)
def azimuthal_tables(
    eta: float, sigma_a: tuple[float, ...], beta_n: float, closed: bool, logistic: bool = False
) -> AzimuthalTables:
    """Tabulate N_p of a fibre; `beta_n` is the deviation of a wrapped normal or a trimmed logistic distribution, radians."""
    # Eight columns a standard deviation over the half circle, twice as many for a logistic's sharper top; a multiple of 32,
    # so that exports can leave every second one out, five times.
    columns = int(np.ceil(np.clip((16 if logistic else 8) * np.pi / beta_n, 256, 16384) / 32)) * 32 + 1
    direct = np.empty((ROWS, columns, len(LOBES), len(sigma_a)))
    spread = np.empty_like(direct)
    halves = np.empty((ROWS, len(LOBES), len(sigma_a), 2))
    _core.azimuthal_tables(eta, np.array(sigma_a), logistic, beta_n, closed, OFFSETS, direct, spread, halves)
    for table in (direct, spread, halves):
        table.setflags(write=False)
    return AzimuthalTables(direct, spread, halves)


def lobe_mask(lobes: str | Iterable[str] | None, known: tuple[str, ...]) -> int:
    """Return the bits of the lobes asked for, out of those that a model knows; all for None."""
    if lobes is None:
        return (1 << len(known)) - 1
    names = [lobes] if isinstance(lobes, str) else list(lobes)
    return sum({1 << known.index(validate.choice("lobes", name, known)) for name in names})


def evaluate_core(
    core: _core.Model,
    channels: int,
    mask: int,
    theta_i: ArrayLike,
    theta_r: ArrayLike,
    phi: ArrayLike,
    strands: ArrayLike = 0.0,
    behind: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return f of the core's model over what broadcasts, last axis = channels, or raise ValueError.

    With `behind`, both numbers of strands are expectations.
    """
    arrays = {
        "theta_i": validate.angles("theta_i", theta_i, validate.HALF_PI, np.float64),
        "theta_r": validate.angles("theta_r", theta_r, validate.HALF_PI, np.float64),
        "phi": validate.angles("phi", phi, 4 * np.pi, np.float64),
        "strands": np.asarray(strands, np.float64),
    }
    if behind is not None:
        arrays["behind"] = behind
    shape = validate.broadcast(**arrays)
    out = np.empty((int(np.prod(shape)), channels))
    if out.size:
        ti, tr, ph, n, *b = (validate.flat(x, shape) for x in arrays.values())
        if b:
            core.expected(ti, tr, ph, n, b[0], mask, out)
        else:
            core.eval(ti, tr, ph, n, mask, out)
    return out.reshape(*shape, channels)


@dataclass(frozen=True)
class Marschner:
    """Far-field scattering of a single fibre: lobes R, TT, TRT with azimuthal roughness.

    f = Σ_p M_p N_p, N_p by quadrature over the offset h smoothed by beta_N. With `longitudinal="gaussian"`
    M_p = g(theta_h - alpha_p)/cos² theta_d (Marschner 2003, Eq. 1), which is reciprocal and does not conserve energy;
    with "energy_conserving" M_p is d'Eon 2011, Eq. 7, over cos theta_i, which does and is not.
    docs/models.md lists where both differ from the papers.

    Parameters
    ----------
    fibre
        The fibre.
    longitudinal
        "gaussian" or "energy_conserving".
    """

    fibre: Fibre
    longitudinal: str = "gaussian"
    even = True
    strands = 0.0

    def __post_init__(self) -> None:
        _check_fibre(self.fibre)
        validate.choice("longitudinal", self.longitudinal, LONGITUDINAL)

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return self.fibre.channels

    @cached_property
    def tables(self) -> AzimuthalTables:
        """The azimuthal tables, shared by models of one fibre."""
        f = self.fibre
        return azimuthal_tables(f.eta, f.absorption, float(np.radians(f.beta_N)), self._conserving)

    @property
    def _conserving(self) -> bool:
        return self.longitudinal == "energy_conserving"

    @cached_property
    def _core(self) -> _core.Model:
        return _core.Model(self.fibre.alpha, self.fibre.beta, self._conserving, self.tables.direct)

    def eval(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, *, lobes: str | Iterable[str] | None = None
    ) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine.

        Parameters
        ----------
        theta_i, theta_r, phi
            Radians; arrays broadcast. theta in [-pi/2, pi/2]; phi = phi_i - phi_r.
        lobes
            One of "R", "TT", "TRT" or several; all if left out.

        Returns
        -------
        ndarray
            Broadcast shape plus a last axis of channels.

        Raises
        ------
        ValueError
            An angle out of range or not a number; shapes that do not broadcast; an unknown lobe.

        Examples
        --------
        >>> import cuticle
        >>> model = cuticle.Marschner(cuticle.Fibre.preset("brown"))
        >>> model.eval([0.1, 0.2], 0.0, 3.0).shape
        (2, 3)
        """
        return evaluate_core(self._core, self.channels, lobe_mask(lobes, LOBES), theta_i, theta_r, phi)


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
        _check_fibre(self.fibre)
        if self.formulation is None:
            object.__setattr__(self, "formulation", self.fibre.formulation)
        validate.choice("formulation", self.formulation, FORMULATIONS)
        object.__setattr__(self, "strands", validate.number("strands", self.strands, 0, validate.MAX_STRANDS))
        self.average_table  # noqa: B018 - refuses a fibre whose multiple scattering diverges before any other work

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


def _check_fibre(fibre: object) -> None:
    if not isinstance(fibre, Fibre):
        raise TypeError(f"fibre must be a cuticle.Fibre, got {type(fibre).__name__}; Fibre.preset('brown') makes one")


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
