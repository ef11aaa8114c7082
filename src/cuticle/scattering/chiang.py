"""Chiang et al. 2016, the hair model of pbrt, Mitsuba and Cycles: near field (offset known) and far field."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle._support.plain_values import plain
from cuticle._support.toml_model import TomlModel
from cuticle._support.values import Value
from cuticle.scattering import conventions
from cuticle.scattering.azimuthal import OFFSETS, ROWS, AzimuthalTables, azimuthal_tables, evaluate_core, lobe_mask
from cuticle.scattering.bcsdf import Plotted, Sample, luminance_weights
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.fibre_tables import FibreTables
from cuticle.scattering.registry import first_class

PARTS = ("R", "TT", "TRT", "rest")
RANGES: validate.Ranges = {
    "beta_m": (conventions.LEAST_ROUGHNESS, 1, "", "hair has 0.2 to 0.4; 0 would be a mirror without a density", False),
    "beta_n": (conventions.LEAST_ROUGHNESS, 1, "", "hair has 0.2 to 0.4; 0 would be a mirror without a density", False),
    "alpha": (-20, 20, "degrees", "hair has 2 to 3; negative leans toward the tip", False),
    "eta": (1, 3, "", "keratin has 1.55", True),
    "eumelanin": (0, 100, "", "blond hair has 0.3, brown 1.3, black 8", False),
    "pheomelanin": (0, 100, "", "red hair has about 1", False),
}


@first_class
@dataclass(frozen=True, init=False, eq=False, repr=False)
class Chiang(TomlModel, Plotted):
    """Far-field scattering of one fibre (Chiang et al. 2016): the near field averaged over the fibre's width.

    `near(h)` returns the near field at a known offset.

    Parameters
    ----------
    beta_m, beta_n
        Longitudinal and azimuthal roughness, 0.01 to 1, without unit. `cuticle.conventions` converts them to widths.
    alpha
        Tilt of the scales, degrees. Positive leans toward the root: R moves by -2 alpha, TT by +alpha and TRT by +4 alpha
        in theta. pbrt-v4 and Mitsuba use the opposite sign; `conventions.from_host` converts.
    eta
        Refractive index.
    sigma_a
        Absorption per fibre radius: one value, or one per channel.
    eumelanin, pheomelanin
        Pigment concentrations, instead of sigma_a.
    color
        The linear RGB colour that many such fibres show, instead of sigma_a.

    Raises
    ------
    ValueError
        One line: the parameter, its range, the value received and a remedy.

    Examples
    --------
    >>> import cuticle
    >>> model = cuticle.Chiang(beta_m=0.3, beta_n=0.3, eumelanin=1.3)
    >>> model.eval([0.1, 0.2], 0.0, 3.0).shape
    (2, 3)
    >>> theta_i, phi, p = model.near(0.5).sample(0.2, [[0.1, 0.6, 0.3]])
    """

    table_name = "chiang"
    table_remedy = "such as beta_m = 0.3"
    many_viewers = True
    even = True

    beta_m: float = 0.3
    beta_n: float = 0.3
    alpha: float = 2.0
    eta: float = 1.55
    sigma_a: tuple[float, ...] | None = None
    eumelanin: float | None = None
    pheomelanin: float | None = None
    color: tuple[float, ...] | None = None

    def __init__(self, **values: Any) -> None:
        super().__init__(**_checked(values))

    def __repr__(self) -> str:
        return f"Chiang({', '.join(f'{k}={v!r}' for k, v in self.values().items())})"

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` needs, as values that JSON can hold."""
        return {"chiang": plain(self.values())}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Chiang:
        """Return the function that `to_dict` described."""
        return cls(**data["chiang"])

    @property
    def absorption(self) -> tuple[float, ...]:
        """Absorption per radius for each channel, from sigma_a, pigments or colour."""
        if self.sigma_a is not None:
            return self.sigma_a
        if self.color is not None:
            return tuple(conventions.sigma_a_of_color(self.color, self.beta_n).tolist())
        pigment = conventions.sigma_a_of_pigment(self.eumelanin or 0.0, self.pheomelanin or 0.0)
        return tuple(pigment.tolist())

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return len(self.absorption)

    @property
    def variance(self) -> NDArray[np.float64]:
        """Variance of M in theta for R, TT, TRT and the rest, radians squared, shape (4,)."""
        return conventions.longitudinal_variance(self.beta_m) * np.array([1, 0.25, 4, 4])

    @property
    def tilt(self) -> NDArray[np.float64]:
        """How far scales move R, TT, TRT and the rest in theta, radians, shape (4,)."""
        return math.radians(self.alpha) * np.array([-2.0, 1.0, 4.0, 0.0])

    @property
    def half_angle_lobes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Shifts and deviations of R, TT and TRT in theta_h, as the core's lobes have them, radians."""
        return self.tilt[:3] / 2, np.sqrt(self.variance[:3]) / 2

    @property
    def scale(self) -> float:
        """Scale of the azimuthal logistic distribution, radians."""
        return conventions.azimuthal_scale(self.beta_n)

    def near(self, h: ArrayLike = 0.0, *, objective: str = "luminance") -> ChiangNear:
        """Return the near field at offset `h` (-1 to 1 over the width), for arrays one offset a direction."""
        return ChiangNear(self, h, objective=objective)

    def with_absorption(self, sigma_a: tuple[float, ...]) -> Chiang:
        """Return the same fibre with another absorption per radius, one value or one a channel."""
        return Chiang(beta_m=self.beta_m, beta_n=self.beta_n, alpha=self.alpha, eta=self.eta, sigma_a=sigma_a)

    def fibre(self) -> Fibre:
        """Return the `Fibre` with these widths as standard deviations: near, not the same (normal, not logistic, N)."""
        tilt, width = self.alpha / 2, [conventions.half_angle_degrees(float(v)) for v in self.variance[:3]]
        return Fibre(
            alpha_R=-2 * tilt, alpha_TT=tilt, alpha_TRT=4 * tilt, beta_R=width[0], beta_TT=width[1], beta_TRT=width[2],
            beta_N=math.degrees(conventions.logistic_deviation(self.scale)), eta=self.eta, sigma_a=self.absorption,
        )  # fmt: skip

    def eval(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, *, lobes: str | Iterable[str] | None = None
    ) -> NDArray[np.float64]:
        """Return the far field's f in 1/sr, without a cosine.

        Parameters
        ----------
        theta_i, theta_r, phi
            Radians; arrays broadcast. theta in [-pi/2, pi/2]; phi = phi_i - phi_r.
        lobes
            One of "R", "TT", "TRT", "rest" or several; all if left out.

        Returns
        -------
        ndarray
            Broadcast shape plus a last axis of channels.

        Raises
        ------
        ValueError
            An angle out of range or not a number; shapes that do not broadcast; an unknown lobe.
        """
        return evaluate_core(self._far, self.channels, lobe_mask(lobes, PARTS), theta_i, theta_r, phi, 0.0)

    @cached_property
    def tables(self) -> AzimuthalTables:
        """The far field's azimuthal tables of R, TT and TRT."""
        deviation = conventions.logistic_deviation(self.scale)
        return azimuthal_tables(self.eta, self.absorption, deviation, False, True)

    @cached_property
    def rest(self) -> NDArray[np.float64]:
        """Energy of the orders past TRT by the viewer's inclination, 0 to pi/2, shape (rows, channels)."""
        energy = np.empty((ROWS, self.channels))
        _core.rest_energies(self.eta, np.array(self.absorption), OFFSETS, energy)
        return energy

    def host_tables(self) -> FibreTables:
        """Return what the core's closed forms read, in single precision."""
        return FibreTables(
            *self.half_angle_lobes, True, self.tables.direct.astype(np.float32), rest=self.rest.astype(np.float32),
            rest_variance=float(self.variance[3]), deviation=conventions.logistic_deviation(self.scale),
        )  # fmt: skip

    @cached_property
    def _far(self) -> _core.Model:
        return _core.Model(*self.half_angle_lobes, self.tables.direct, self.rest, float(self.variance[3]))


class ChiangNear(Value, Plotted):
    """Chiang's near field at a known offset h, with eval, pdf and sample in closed form.

    The pdf is proportional to the luminance of f·cos, or with `objective="rgb"` a compromise between channels.

    Parameters
    ----------
    model
        The fibre.
    h
        Offset of the viewer's ray across the fibre, -1 to 1. An array broadcasts with the angles.
    objective
        "luminance" chooses lobes by their luminance, so that the luminance has an ESS of 1. "rgb" minimises 1/ESS averaged
        over the channels, which improves dark channels at the expense of the luminance.
    """

    even = False
    strands = 0.0

    def __init__(self, model: Chiang, h: ArrayLike = 0.0, *, objective: str = "luminance") -> None:
        self.model = model
        self.objective = validate.choice("objective", objective, ("luminance", "rgb"))
        self.h = validate.array("h", h, -1, 1, np.float64, remedy="h runs over the fibre's width, 0 is its middle")
        self._core  # noqa: B018 - a refusal comes now

    @cached_property
    def _core(self) -> _core.ChiangNear:
        m = self.model
        luminance = luminance_weights(m.channels) if self.objective == "luminance" else np.empty(0)
        return _core.ChiangNear(m.eta, m.scale, m.variance, m.tilt, np.array(m.absorption), luminance)

    def __repr__(self) -> str:
        h = f"{float(self.h):g}" if self.h.ndim == 0 else f"array of shape {self.h.shape}"
        return f"ChiangNear({self.model!r}, h={h})"

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return self.model.channels

    def eval(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, *, lobes: str | Iterable[str] | None = None
    ) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; as `Chiang.eval`, at this offset."""
        shape, arrays = self._angles(theta_i, theta_r, phi)
        out = np.empty((math.prod(shape), self.channels))
        if out.size:
            self._core.eval(*arrays, lobe_mask(lobes, PARTS), out)
        return out.reshape(*shape, self.channels)

    def pdf(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, strands: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the density of `sample`, per steradian. `strands` is ignored."""
        shape, arrays = self._angles(theta_i, theta_r, phi)
        out = np.empty(math.prod(shape))
        if out.size:
            self._core.pdf(*arrays, out)
        return out.reshape(shape)

    def sample(self, theta_r: ArrayLike, u: ArrayLike, strands: ArrayLike | None = None) -> Sample:
        """Draw directions toward the light.

        Parameters
        ----------
        theta_r
            The viewer's inclination, radians. Broadcasts against u.shape[:-1].
        u
            Uniform random numbers in [0, 1), shape (..., 3): for the lobe, theta and phi. The remainder of the first
            rotates the direction about the lobe's axis.
        strands
            Ignored.

        Returns
        -------
        Sample
            theta_i, phi (radians) and their pdf (1/sr).
        """
        us = validate.random_triples(u, np.float64)
        tr = validate.angles("theta_r", theta_r, validate.HALF_PI, np.float64)
        shape = validate.broadcast(theta_r=tr, u=us[..., 0], h=self.h)
        count = math.prod(shape)
        theta_i, phi, density = np.empty(count), np.empty(count), np.empty(count)
        if count:
            flat_u = np.ascontiguousarray(np.broadcast_to(us, (*shape, 3))).reshape(-1)
            self._core.sample(validate.flat(tr, shape), flat_u, validate.flat(self.h, shape), theta_i, phi, density)
        return Sample(theta_i.reshape(shape), phi.reshape(shape), density.reshape(shape))

    def _angles(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike
    ) -> tuple[tuple[int, ...], tuple[NDArray, NDArray, NDArray, NDArray]]:
        ti, tr, ph = validate.directions(theta_i, theta_r, phi)
        shape = validate.broadcast(theta_i=ti, theta_r=tr, phi=ph, h=self.h)
        flat = validate.flat
        return shape, (flat(ti, shape), flat(tr, shape), flat(ph, shape), flat(self.h, shape))


def _checked(values: dict[str, Any]) -> dict[str, Any]:
    unknown = sorted(set(values) - set(Chiang.names()))
    if unknown:
        raise ValueError(f"Chiang has no parameter {unknown[0]!r}; it has {', '.join(Chiang.names())}")
    out = validate.ranges(values, RANGES)
    pigments = {"eumelanin", "pheomelanin"} & out.keys()
    given = [*(["pigments"] if pigments else []), *(name for name in ("sigma_a", "color") if name in out)]
    if len(given) > 1:
        raise ValueError(f"give one of sigma_a, color and eumelanin/pheomelanin, got {' and '.join(given)}")
    if not given:
        raise ValueError("a fibre needs its absorption: give sigma_a (per radius), eumelanin and pheomelanin, or color")
    if "sigma_a" in out:
        out["sigma_a"] = validate.channel_values("sigma_a", out["sigma_a"], 0, 1000, unit="per radius")
    if "color" in out:
        out["color"] = validate.channel_values("color", out["color"], 1e-4, 1, remedy="linear RGB; black hair has 0.01")
    return out
