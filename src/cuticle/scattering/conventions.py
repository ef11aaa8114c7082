"""What renderers call the same hair: Chiang's parameter maps, widths in theta and theta_h, tilt signs, pigments.

Every map is a function of plain numbers with its inverse beside it; `HOSTS` says what a renderer calls a parameter and
which way its scales lean, so that `from_host` and `to_host` carry a hair over. docs/conventions.md has the table.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
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
    return _core.longitudinal_deviation(beta_m) ** 2


def azimuthal_scale(beta_n: float) -> float:
    """Return the scale s (radians) of the trimmed logistic distribution for a roughness beta_N. Chiang 2016."""
    return _core.azimuthal_scale(beta_n)


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


def sigma_a_of_color(color: ArrayLike, beta_n: ArrayLike) -> NDArray[np.float64]:
    """Return the absorption per radius at which multiple scattering shows `color`, each channel up to 1. Chiang 2016.

    Arrays broadcast: one roughness for each colour has a last axis of 1.
    """
    c = validate.array("color", color, 1e-4, 1, np.float64, remedy="a colour is linear RGB; black hair has about 0.01")
    return (np.log(c) / _color_divisor(beta_n)) ** 2


def color_of_sigma_a(sigma_a: ArrayLike, beta_n: float) -> NDArray[np.float64]:
    """Return the colour that `sigma_a_of_color` takes to this absorption."""
    s = validate.array("sigma_a", sigma_a, 0, 1000, np.float64, remedy="absorption is per fibre radius")
    return np.exp(-np.sqrt(s) * _color_divisor(beta_n))


def sigma_a_of_pigment(
    eumelanin: ArrayLike, pheomelanin: ArrayLike = 0.0, *, pigments: str = "deon2011"
) -> NDArray[np.float64]:
    """Return the absorption per radius (..., 3) of pigment concentrations in one of the sets of `PIGMENTS`."""
    table = PIGMENTS[validate.choice("pigments", pigments, PIGMENTS)]
    eu = validate.array("eumelanin", eumelanin, 0, 100, np.float64, remedy="blond hair has 0.3, brown 1.3, black 8")
    pheo = validate.array("pheomelanin", pheomelanin, 0, 100, np.float64, remedy="red hair has about 1")
    return eu[..., None] * np.array(table["eumelanin"]) + pheo[..., None] * np.array(table["pheomelanin"])


def blender_pigment(melanin: float, redness: float) -> tuple[float, float]:
    """Return (eumelanin, pheomelanin) in Blender's set for its sliders melanin in [0, 1] and redness in [0, 1].

    The quantity is -ln(1 - melanin), cut at melanin .9999.
    """
    m = validate.number("melanin", melanin, 0, 1)
    r = validate.number("redness", redness, 0, 1)
    quantity = -math.log(max(1 - m, 1e-4))
    return quantity * (1 - r), quantity * r


# Refractive indices by the names that Mitsuba 3.9.1 (ior.h) knows.
INDICES = {
    "vacuum": 1.0, "helium": 1.000036, "hydrogen": 1.000132, "air": 1.000277, "carbon dioxide": 1.00045, "water": 1.333,
    "acetone": 1.36, "ethanol": 1.361, "carbon tetrachloride": 1.461, "glycerol": 1.4729, "benzene": 1.501,
    "silicone oil": 1.52045, "bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458, "pyrex": 1.47,
    "acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544, "amber": 1.55, "pet": 1.575,
    "diamond": 2.419,
}  # fmt: skip


@dataclass(frozen=True)
class Host:
    """What a renderer calls things, and what it takes where a scene says nothing.

    Attributes
    ----------
    beta_m, beta_n, alpha, eta, sigma_a, color
        The host's name of that parameter.
    tilt
        +1 where a positive angle moves R toward the root, as scales that lean to the root do and as `cuticle.Chiang`
        has it; -1 where it moves R toward the tip (with the tangent toward the tip).
    axis
        The fibre's tangent in the local frame.
    viewer
        What the host calls the given direction, toward the viewer.
    pigments
        Its set in `PIGMENTS`.
    versions
        The releases whose source this was read from.
    defaults
        All parameters that are read, by the host's names, with its defaults; None where there is none.
    ways
        The parameters of each way to give the absorption, the default one first.
    lacking
        Those of them that `cuticle.Chiang` has no counterpart of: left out with a warning, unless they have their default.
    alpha_unit, alpha_zero
        The tilt in degrees is alpha_unit (angle - alpha_zero).
    """

    beta_m: str
    beta_n: str
    alpha: str
    eta: str
    sigma_a: str
    color: str | None
    tilt: int
    axis: str
    viewer: str
    pigments: str
    versions: str
    defaults: Mapping[str, Any]
    ways: tuple[tuple[str, ...], ...]
    lacking: tuple[str, ...] = ()
    alpha_unit: float = 1.0
    alpha_zero: float = 0.0


# Each host's names, signs and defaults, from its own source.
_WHITE = (1.0, 1.0, 1.0)
_CYCLES = Host(  # scene/shader_nodes.cpp, the signs from kernel/closure/bsdf_principled_hair_chiang.h
    "roughness", "radial_roughness", "offset", "ior", "absorption_coefficient", "color", 1, "x", "wi", "blender",
    "4.2 to 5.1",
    {
        "roughness": 0.3, "radial_roughness": 0.3, "offset": math.radians(2), "ior": 1.55, "absorption_coefficient": None,
        "color": (0.017513, 0.005763, 0.002059), "melanin": 0.8, "melanin_redness": 1.0, "tint": _WHITE, "coat": 0.0,
        "random_color": 0.0, "random_roughness": 0.0,
    },
    (("color",), ("absorption_coefficient",), ("melanin", "melanin_redness", "tint")),
    ("coat", "random_color", "random_roughness"), alpha_unit=math.degrees(1),
)  # fmt: skip
HOSTS: dict[str, Host] = {
    "pbrt-v4": Host(  # HairMaterial::Create in materials.cpp, the signs from bxdfs.cpp
        "beta_m", "beta_n", "alpha", "eta", "sigma_a", "reflectance", -1, "x", "wo", "deon2011", "v4, June 2026",
        {
            "beta_m": 0.3, "beta_n": 0.3, "alpha": 2.0, "eta": 1.55, "sigma_a": None, "reflectance": None,
            "eumelanin": 1.3, "pheomelanin": 0.0,
        },
        (("eumelanin", "pheomelanin"), ("sigma_a",), ("reflectance",)),
    ),
    "mitsuba": Host(  # hair.cpp
        "longitudinal_roughness", "azimuthal_roughness", "scale_tilt", "int_ior", "sigma_a", None, -1, "y", "wi", "deon2011",
        "3.9.1",
        {
            "longitudinal_roughness": 0.3, "azimuthal_roughness": 0.3, "scale_tilt": 2.0, "int_ior": "amber",
            "ext_ior": "air", "sigma_a": None, "scale": 1.0, "eumelanin": 1.3, "pheomelanin": 0.2,
        },
        (("eumelanin", "pheomelanin"), ("sigma_a",)),
    ),
    "cycles": _CYCLES,
    "cycles-legacy": replace(_CYCLES, versions="2.83 to 4.1"),
    "materialx": Host(  # ND_chiang_hair_bsdf and its helpers in pbrlib_defs.mtlx, the signs from mx_chiang_hair_bsdf.glsl
        "longitudinal", "azimuthal", "cuticle_angle", "ior", "absorption_coefficient", "color", 1, "curve_direction", "V",
        "deon2011", "1.39.5",
        {
            "roughness_R": (0.1, 0.1), "roughness_TT": (0.05, 0.05), "roughness_TRT": (0.2, 0.2), "cuticle_angle": 0.5,
            "ior": 1.55, "absorption_coefficient": (0.0, 0.0, 0.0), "tint_R": _WHITE, "tint_TT": _WHITE, "tint_TRT": _WHITE,
            "longitudinal": 0.1, "azimuthal": 0.2, "scale_TT": 0.5, "scale_TRT": 2.0, "color": _WHITE,
            "azimuthal_roughness": 0.2, "melanin_concentration": 0.25, "melanin_redness": 0.5,
        },
        (
            ("absorption_coefficient",), ("color", "azimuthal_roughness"), ("melanin_concentration", "melanin_redness"),
        ),
        ("tint_R", "tint_TT", "tint_TRT"), alpha_unit=180.0, alpha_zero=0.5,
    ),
}  # fmt: skip


def from_host(host: str, **parameters: Any) -> dict[str, Any]:
    """Return all of `cuticle.Chiang`'s parameters for a host's own; what is not given has the host's default.

    Parameters
    ----------
    host
        A name in `HOSTS`: "pbrt-v4", "mitsuba", "cycles", "cycles-legacy" or "materialx".
    parameters
        By the host's names, those of `HOSTS[host].defaults`: for Cycles also its sliders, for MaterialX also the inputs of
        chiang_hair_roughness, chiang_hair_absorption_from_color and deon_hair_absorption_from_melanin. Mitsuba's `sigma_a`
        may be a dictionary of type `rgb`.

    Raises
    ------
    ValueError
        An unknown host or parameter; a number out of its range.

    Warns
    -----
    UserWarning
        A parameter that `cuticle.Chiang` lacks, such as a tint of one lobe, or roughness that is not the same for all lobes.

    Examples
    --------
    >>> from_host("pbrt-v4", beta_m=0.25)
    {'beta_m': 0.25, 'beta_n': 0.3, 'alpha': -2.0, 'eta': 1.55, 'eumelanin': 1.3, 'pheomelanin': 0.0}
    """
    about = HOSTS[validate.choice("host", host, HOSTS)]
    for key in parameters:
        if key not in about.defaults:
            raise ValueError(f"{host} has no hair parameter {key!r}; it has {', '.join(about.defaults)}")
    given = {key: value for key, value in parameters.items() if value is not None}
    p = {**about.defaults, **given}
    lost = [f"{k} {p[k]}" for k in about.lacking if not np.array_equal(p[k], about.defaults[k])]
    if host == "materialx":
        beta_m, beta_n, different = _materialx_roughness(given, p)
        lost += different
    else:
        beta_m, beta_n = p[about.beta_m], p[about.beta_n]
    if lost:
        warnings.warn(
            f"Chiang's model, with one roughness and no tints, leaves out of {host}: {', '.join(lost)}", stacklevel=2
        )
    alpha = validate.number(about.alpha, p[about.alpha], -1e3, 1e3)
    eta = _index(about.eta, p[about.eta]) / _index("ext_ior", p.get("ext_ior", 1.0))
    tilt = about.tilt * about.alpha_unit * (alpha - about.alpha_zero)
    return {"beta_m": beta_m, "beta_n": beta_n, "alpha": tilt, "eta": eta} | _absorption(host, given, p)


def to_host(host: str, chiang: Any) -> dict[str, Any]:
    """Return a host's parameters for a `cuticle.Chiang`, absorption as sigma_a: what `from_host` takes back.

    For Mitsuba, sigma_a is a dictionary that `mitsuba.load_dict` takes, with a `scale`, since a colour ends at 1 there.
    """
    about = HOSTS[validate.choice("host", host, HOSTS)]
    out = {
        about.beta_m: chiang.beta_m,
        about.beta_n: chiang.beta_n,
        about.alpha: about.tilt * chiang.alpha / about.alpha_unit + about.alpha_zero,
        about.eta: chiang.eta,
        about.sigma_a: chiang.absorption,
    }
    if host == "materialx":
        scale = azimuthal_scale(out.pop(about.beta_n)) / _LOGISTIC
        variance = longitudinal_variance(out.pop(about.beta_m))
        out |= {f"roughness_{lobe}": (ratio * variance, scale) for lobe, ratio in _RATIOS.items()}
    if host == "mitsuba":
        scale = max(1.0, *chiang.absorption)
        values = [s / scale for s in chiang.absorption]
        color = values * 3 if len(values) == 1 else values
        out |= {"ext_ior": 1.0, "sigma_a": {"type": "rgb", "value": color}, "scale": scale}
    return out


_LOGISTIC = math.sqrt(math.pi / 8)  # MaterialX multiplies by it when it evaluates, others when they convert
_RATIOS = {"R": 1.0, "TT": 0.25, "TRT": 4.0}  # of variances, Chiang 2016


def _materialx_roughness(given: Mapping[str, Any], p: Mapping[str, Any]) -> tuple[float, float, list[str]]:
    """Return beta_M, beta_N and what in the other lobes' roughness is not Chiang's."""
    helper = given.keys() & {"longitudinal", "azimuthal", "scale_TT", "scale_TRT"}
    own = sorted(given.keys() & {f"roughness_{lobe}" for lobe in _RATIOS})
    if helper and own:
        raise ValueError(f"give {own[0]} or {min(helper)}: chiang_hair_roughness makes the one of the other")
    if helper:
        beta_m, beta_n = p["longitudinal"], p["azimuthal"]
        scales = {"scale_TT": 0.5, "scale_TRT": 2.0}
        return beta_m, beta_n, [f"{k} {p[k]:g} (here {v:g})" for k, v in scales.items() if not math.isclose(p[k], v)]
    variance, scale = (float(x) for x in p["roughness_R"])
    expected = {f"roughness_{lobe}": (ratio * variance, scale) for lobe, ratio in _RATIOS.items()}
    different = [
        f"{name} ({p[name][0]:g}, {p[name][1]:g}) (here ({x[0]:.4g}, {x[1]:.4g}))"
        for name, x in expected.items()
        if own and not np.allclose(p[name], x, rtol=1e-3)  # its defaults alone are not: docs/conventions.md says so
    ]
    return longitudinal_roughness(variance), azimuthal_roughness(scale * _LOGISTIC), different


def _index(name: str, value: Any) -> float:
    """A refractive index, or the name of a material."""
    if isinstance(value, str):
        return INDICES[validate.choice(name, value.lower(), INDICES)]
    return validate.number(name, value, 0, 10, remedy="keratin has 1.55, air 1.000277", above=True)


def _absorption(host: str, given: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    """Chiang's parameters for the way that is given, or the host's default one."""
    ways = HOSTS[host].ways
    used = [way for way in ways if given.keys() & set(way)]
    if len(used) > 1:
        names = [name for way in used for name in way if name in given]
        raise ValueError(f"give {host}'s absorption one way: {' | '.join(map(', '.join, ways))}; got {', '.join(names)}")
    way = (used or ways)[0]
    if way[0] in ("sigma_a", "absorption_coefficient"):
        return _sigma_a(p[way[0]], p.get("scale", 1.0))
    if way[0] == "eumelanin":
        if host == "pbrt-v4" and "eumelanin" not in given and used:
            return {"eumelanin": 0.0, "pheomelanin": p["pheomelanin"]}  # 1.3 is for neither
        return {name: p[name] for name in way}
    if way[0] in ("melanin", "melanin_concentration"):
        sigma_a = sigma_a_of_pigment(*blender_pigment(p[way[0]], p[way[1]]), pigments=HOSTS[host].pigments)
        if "tint" in p:
            sigma_a = sigma_a + sigma_a_of_color(p["tint"], p[HOSTS[host].beta_n])
    elif host == "materialx":
        sigma_a = sigma_a_of_color(np.maximum(p["color"], 1e-3), p["azimuthal_roughness"])  # its node's own roughness
    else:
        return {"color": p[way[0]]}
    return {"sigma_a": tuple(sigma_a.tolist())}


def _sigma_a(value: Any, scale: float) -> dict[str, Any]:
    """Numbers, or a dictionary of type `rgb`, times Mitsuba's scale; a texture is left to the BSDF, as is its scale."""
    scale = validate.number("scale", scale, 0, 1e6)
    if isinstance(value, Mapping) and value.get("type") == "rgb":
        value = value["value"].replace(",", " ").split() if isinstance(value["value"], str) else value["value"]
    if isinstance(value, (int, float, list, tuple, np.ndarray)):
        return {"sigma_a": tuple(scale * float(s) for s in np.atleast_1d(value))}
    return {"sigma_a": value} | ({} if scale == 1 else {"scale": scale})


def _color_divisor(beta_n: ArrayLike) -> NDArray[np.float64]:
    b = validate.array("beta_n", beta_n, 0, 1, np.float64, remedy="roughness runs from 0.01 to 1")
    out = np.empty_like(b)
    _core.color_divisor(b, out)
    return out


def _inverse(name: str, value: float, function: Any) -> float:
    x = validate.number(name, value, function(LEAST_ROUGHNESS), function(1.0), remedy="roughness runs from 0.01 to 1")
    from scipy.optimize import brentq  # takes longer to import than all of this package

    return float(brentq(lambda b: function(b) - x, LEAST_ROUGHNESS, 1.0, xtol=1e-14))
