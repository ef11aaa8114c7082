"""What renderers call the same hair: Chiang's parameter maps, widths in theta and theta_h, tilt signs, pigments.

Every map is a function of plain numbers with its inverse beside it; `HOSTS` says what a renderer calls a parameter and
which way its scales lean, so that `from_host` and `to_host` carry a hair over. docs/conventions.md has the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate

LEAST_ROUGHNESS = 0.01  # below, a lobe is narrower than a tenth of a degree: a mirror to any grid
Pigments = dict[str, tuple[float, float, float]]

# Absorption per fibre radius of a unit of pigment, linear RGB.
PIGMENTS: dict[str, Pigments] = {
    "deon2011": {"eumelanin": (0.419, 0.697, 1.37), "pheomelanin": (0.187, 0.4, 1.05)},
    "blender": {"eumelanin": (0.506, 0.841, 1.653), "pheomelanin": (0.343, 0.733, 1.924)},
}


def longitudinal_variance(beta_m: float) -> float:
    """Return the variance v of R's M in theta (radians squared) for a roughness beta_M; TT has v/4, TRT 4v. Chiang 2016."""
    return (0.726 * beta_m + 0.812 * beta_m**2 + 3.7 * beta_m**20) ** 2


def azimuthal_scale(beta_n: float) -> float:
    """Return the scale s (radians) of the trimmed logistic distribution for a roughness beta_N. Chiang 2016."""
    return math.sqrt(math.pi / 8) * (0.265 * beta_n + 1.194 * beta_n**2 + 5.372 * beta_n**22)


def longitudinal_roughness(variance: float) -> float:
    """Return the roughness beta_M whose `longitudinal_variance` is `variance`."""
    return _inverse("variance", variance, longitudinal_variance)


def azimuthal_roughness(scale: float) -> float:
    """Return the roughness beta_N whose `azimuthal_scale` is `scale`."""
    return _inverse("scale", scale, azimuthal_scale)


def logistic_deviation(scale: float) -> float:
    """Return the standard deviation of a logistic distribution of this scale."""
    return scale * math.pi / math.sqrt(3)


def half_angle_degrees(variance: float) -> float:
    """Return Marschner's beta (degrees, in theta_h) of a longitudinal variance in theta: half the deviation in theta."""
    return math.degrees(math.sqrt(variance)) / 2


def sigma_a_of_color(color: ArrayLike, beta_n: float) -> NDArray[np.float64]:
    """Return the absorption per radius at which multiple scattering shows `color`, each channel up to 1. Chiang 2016."""
    c = validate.array("color", color, 1e-4, 1, np.float64, remedy="a colour is linear RGB; black hair has about 0.01")
    return (np.log(c) / _color_divisor(beta_n)) ** 2


def color_of_sigma_a(sigma_a: ArrayLike, beta_n: float) -> NDArray[np.float64]:
    """Return the colour that `sigma_a_of_color` takes to this absorption."""
    s = validate.array("sigma_a", sigma_a, 0, 1000, np.float64, remedy="absorption is per fibre radius")
    return np.exp(-np.sqrt(s) * _color_divisor(beta_n))


def sigma_a_of_pigment(eumelanin: float, pheomelanin: float = 0.0, *, pigments: str = "deon2011") -> NDArray[np.float64]:
    """Return the absorption per radius (3,) of pigment concentrations in one of the sets of `PIGMENTS`."""
    table = PIGMENTS[validate.choice("pigments", pigments, PIGMENTS)]
    eu = validate.number("eumelanin", eumelanin, 0, 100, remedy="blond hair has 0.3, brown 1.3, black 8")
    pheo = validate.number("pheomelanin", pheomelanin, 0, 100, remedy="red hair has about 1")
    return eu * np.array(table["eumelanin"]) + pheo * np.array(table["pheomelanin"])


def blender_pigment(melanin: float, redness: float) -> tuple[float, float]:
    """Return (eumelanin, pheomelanin) in Blender's set for its sliders melanin in [0, 1] and redness in [0, 1].

    The quantity is -ln(1 - melanin), cut at melanin .9999.
    """
    m = validate.number("melanin", melanin, 0, 1)
    r = validate.number("redness", redness, 0, 1)
    quantity = -math.log(max(1 - m, 1e-4))
    return quantity * (1 - r), quantity * r


@dataclass(frozen=True)
class Host:
    """What a renderer calls things.

    Attributes
    ----------
    beta_m, beta_n, alpha, eta, sigma_a, color, eumelanin, pheomelanin
        The host's name of that parameter; None where it has none.
    tilt
        +1 where a positive angle moves R toward the root, as scales that lean to the root do and as `cuticle.Chiang`
        has it; -1 where it moves R toward the tip (with the tangent toward the tip).
    axis
        The fibre's tangent in the local frame.
    viewer
        What the host calls the given direction, toward the viewer.
    pigments
        Its set in `PIGMENTS`.
    alpha_in_radians
        Whether the tilt is in radians.
    """

    beta_m: str
    beta_n: str
    alpha: str
    eta: str
    sigma_a: str
    color: str | None
    eumelanin: str | None
    pheomelanin: str | None
    tilt: int
    axis: str
    viewer: str
    pigments: str
    alpha_in_radians: bool = False


# Read in each host's own source: pbrt-v4 bxdfs.cpp, Mitsuba 3.9.1 hair.cpp, Cycles bsdf_principled_hair_chiang.h, whose
# set-up negates the tilt; releases before that change are "cycles-legacy".
_CYCLES = ("roughness", "radial_roughness", "offset", "ior", "absorption_coefficient", "color", None, None)
HOSTS: dict[str, Host] = {
    "pbrt-v4": Host(
        "beta_m", "beta_n", "alpha", "eta", "sigma_a", "reflectance", "eumelanin", "pheomelanin", -1, "x", "wo", "deon2011"
    ),
    "mitsuba": Host(
        "longitudinal_roughness", "azimuthal_roughness", "scale_tilt", "int_ior", "sigma_a", None, "eumelanin",
        "pheomelanin", -1, "y", "wi", "deon2011",
    ),
    "cycles": Host(*_CYCLES, -1, "x", "wi", "blender", alpha_in_radians=True),
    "cycles-legacy": Host(*_CYCLES, 1, "x", "wi", "blender", alpha_in_radians=True),
}  # fmt: skip


def from_host(host: str, **parameters: Any) -> dict[str, Any]:
    """Return `cuticle.Chiang`'s parameters for a host's own.

    Parameters
    ----------
    host
        A name in `HOSTS`: "pbrt-v4", "mitsuba", "cycles" or "cycles-legacy".
    parameters
        By the host's names; for "cycles" also `melanin` and `melanin_redness`, its sliders.

    Raises
    ------
    ValueError
        An unknown host or parameter.

    Examples
    --------
    >>> from_host("mitsuba", longitudinal_roughness=0.25, scale_tilt=2.0, eumelanin=1.3)
    {'beta_m': 0.25, 'alpha': -2.0, 'eumelanin': 1.3}
    """
    about = HOSTS[validate.choice("host", host, HOSTS)]
    ours = {getattr(about, name): name for name in _PARAMETERS if getattr(about, name)}
    known = [*ours, *(("melanin", "melanin_redness") if about.pigments == "blender" else ())]
    out: dict[str, Any] = {}
    for key, value in parameters.items():
        if key not in known:
            raise ValueError(f"{host} has no hair parameter {key!r}; it has {', '.join(known)}")
        if key in ours:
            out[ours[key]] = value
    if "alpha" in out:
        degrees = math.degrees(out["alpha"]) if about.alpha_in_radians else out["alpha"]
        out["alpha"] = about.tilt * degrees
    if "melanin" in parameters or "melanin_redness" in parameters:
        amounts = blender_pigment(parameters.get("melanin", 0.8), parameters.get("melanin_redness", 1.0))
        out["sigma_a"] = tuple(float(s) for s in sigma_a_of_pigment(*amounts, pigments="blender"))
    return out


def to_host(host: str, chiang: Any) -> dict[str, Any]:
    """Return a host's parameters for a `cuticle.Chiang`, absorption as sigma_a: what `from_host` takes back."""
    about = HOSTS[validate.choice("host", host, HOSTS)]
    alpha = about.tilt * chiang.alpha
    return {
        about.beta_m: chiang.beta_m,
        about.beta_n: chiang.beta_n,
        about.alpha: math.radians(alpha) if about.alpha_in_radians else alpha,
        about.eta: chiang.eta,
        about.sigma_a: chiang.absorption,
    }


_PARAMETERS = ("beta_m", "beta_n", "alpha", "eta", "sigma_a", "color", "eumelanin", "pheomelanin")


def _color_divisor(beta_n: float) -> float:
    b = validate.number("beta_n", beta_n, 0, 1)
    return 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5


def _inverse(name: str, value: float, function: Any) -> float:
    x = validate.number(name, value, function(LEAST_ROUGHNESS), function(1.0), remedy="roughness runs from 0.01 to 1")
    from scipy.optimize import brentq  # takes longer to import than all of this package

    return float(brentq(lambda b: function(b) - x, LEAST_ROUGHNESS, 1.0, xtol=1e-14))
