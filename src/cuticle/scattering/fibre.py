"""Fibres: the parameters of one hair, validated and frozen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.plain_values import plain
from cuticle._support.toml_model import TomlModel
from cuticle.scattering import conventions
from cuticle.scattering.presets import PRESETS

LOBES = ("R", "TT", "TRT")

_RANGES: validate.Ranges = {
    "alpha_R": (-45, 45, "degrees", "published fibres have -10 to -5", False),
    "alpha_TT": (-45, 45, "degrees", "leave it out for -alpha_R / 2", False),
    "alpha_TRT": (-45, 45, "degrees", "leave it out for -3 alpha_R / 2", False),
    "beta_R": (0.1, 60, "degrees", "published fibres have 5 to 10", False),
    "beta_TT": (0.1, 60, "degrees", "leave it out for beta_R / 2", False),
    "beta_TRT": (0.1, 90, "degrees", "leave it out for 2 beta_R", False),
    "beta_N": (
        0.2,
        90,
        "degrees",
        "a perfectly smooth cross-section has unbounded caustics; 0.2 is almost smooth",
        False,
    ),
    "eta": (1, 3, "", "keratin has 1.55", True),
    "eumelanin": (0, 100, "", "blond hair has 0.3, brown 1.3, black 8", False),
    "pheomelanin": (0, 100, "", "red hair has about 1", False),
    "d_f": (0, 1, "", "0.7 is usual", True),
    "d_b": (0, 1, "", "0.7 is usual; 0 leaves backscatter out", False),
}


@dataclass(frozen=True, init=False, eq=False)
class Fibre(TomlModel):
    """The parameters of one hair fibre.

    Angles are in degrees. Shifts (alpha) and standard deviations (beta) are those of Marschner et al. 2003, in
    theta_h = (theta_i + theta_r)/2.

    Parameters
    ----------
    alpha_R, alpha_TT, alpha_TRT
        Longitudinal shift of each lobe. TT and TRT default to -alpha_R/2 and -3 alpha_R/2.
    beta_R, beta_TT, beta_TRT
        Longitudinal width of each lobe. TT and TRT default to beta_R/2 and 2 beta_R.
    beta_N
        Azimuthal roughness: standard deviation, degrees.
    eta
        Refractive index.
    sigma_a
        Absorption per fibre radius: one value, or one per channel.
    eumelanin, pheomelanin
        Pigment concentrations, instead of sigma_a; they define three channels of linear RGB.
    d_f, d_b
        Strand density factors of dual scattering, forward and backward.
    formulation
        Which dual scattering this fibre is meant for, "exact" or "zinke2008".

    Raises
    ------
    ValueError
        One line: the parameter, its range, the value received and a remedy.

    Examples
    --------
    >>> import cuticle
    >>> fibre = cuticle.Fibre(alpha_R=-7.5, beta_R=7.5, sigma_a=(0.2, 0.3, 0.8))
    >>> [round(float(b), 2) for b in np.degrees(fibre.beta)]
    [7.5, 3.75, 15.0]
    """

    table_name = "fibre"
    table_remedy = "see `cuticle fibres --toml`"

    alpha_R: float = -7.5
    alpha_TT: float | None = None
    alpha_TRT: float | None = None
    beta_R: float = 7.5
    beta_TT: float | None = None
    beta_TRT: float | None = None
    beta_N: float = 10.0
    eta: float = 1.55
    sigma_a: tuple[float, ...] | None = None
    eumelanin: float | None = None
    pheomelanin: float | None = None
    d_f: float = 0.7
    d_b: float = 0.7
    formulation: Literal["exact", "zinke2008"] = "exact"

    def __init__(self, **values: Any) -> None:
        super().__init__(**_checked(values))

    @property
    def alpha(self) -> NDArray[np.float64]:
        """Shifts of R, TT, TRT in radians of theta_h, shape (3,)."""
        tt = -self.alpha_R / 2 if self.alpha_TT is None else self.alpha_TT
        trt = -1.5 * self.alpha_R if self.alpha_TRT is None else self.alpha_TRT
        return np.radians([self.alpha_R, tt, trt])

    @property
    def beta(self) -> NDArray[np.float64]:
        """Widths of R, TT, TRT in radians of theta_h, shape (3,)."""
        tt = self.beta_R / 2 if self.beta_TT is None else self.beta_TT
        trt = 2 * self.beta_R if self.beta_TRT is None else self.beta_TRT
        return np.radians([self.beta_R, tt, trt])

    @property
    def absorption(self) -> tuple[float, ...]:
        """Absorption per radius for each channel, from sigma_a or the pigments."""
        if self.sigma_a is not None:
            return self.sigma_a
        return tuple(conventions.sigma_a_of_pigment(self.eumelanin or 0.0, self.pheomelanin or 0.0).tolist())

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters that are set, as values that JSON can hold."""
        return dict(plain(self.values()))

    @property
    def channels(self) -> int:
        """Number of channels of the scattering function."""
        return len(self.absorption)

    def replace(self, **changes: Any) -> Fibre:
        """Return a fibre with some parameters changed. Setting sigma_a drops the pigments, and the reverse."""
        values = self.values()
        if "sigma_a" in changes:
            values.pop("eumelanin", None)
            values.pop("pheomelanin", None)
        elif {"eumelanin", "pheomelanin"} & changes.keys():
            values.pop("sigma_a", None)
        return Fibre(**{**values, **changes})

    @classmethod
    def preset(cls, name: str) -> Fibre:
        """Return a published fibre by name; `cuticle.presets` gives the source of each."""
        return cls(**PRESETS[validate.choice("preset", name, PRESETS)].parameters)


def _checked(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return `values` in range and of the right kinds, or raise with one line."""
    unknown = sorted(set(values) - set(Fibre.names()))
    if unknown:
        raise ValueError(f"a fibre has no parameter {unknown[0]!r}; it has {', '.join(Fibre.names())}")
    out = validate.ranges(values, _RANGES)
    pigments = {"eumelanin", "pheomelanin"} & out.keys()
    if "sigma_a" in out:
        if pigments:
            raise ValueError(f"give sigma_a or {' and '.join(sorted(pigments))}, not both")
        out["sigma_a"] = validate.channel_values("sigma_a", out["sigma_a"], 0, 1000, unit="per radius")
    elif not pigments:
        raise ValueError("a fibre needs its absorption: give sigma_a (per radius) or eumelanin and pheomelanin")
    if "formulation" in out:
        out["formulation"] = validate.choice("formulation", out["formulation"], ("exact", "zinke2008"))
    return out
