"""Hair that varies from strand to strand and along a strand: pigments, roughness and tilt as attributes of a groom.

A strand's value is the quantile of a distribution at a standard normal variable z, which is part smooth noise over the
roots, part the strand's own: z = √c g(root) + √(1 - c) e. g sums plane waves of random direction, length and phase, whose
covariance over a distance d is exp(-d²/2l²) (Rahimi and Recht 2007, random Fourier features).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle.grooms.groom import Groom, checked_groom
from cuticle.scattering import conventions

__all__ = ["vary"]

Array = NDArray[np.float64]
_WAVES, _AT_ONCE = 256, 4096  # plane waves, and strands whose waves are in memory together
_MOST, _STEEPEST = 100.0, 20.0  # of a pigment and of a tilt in degrees, as the scattering functions allow
_CLUMPS = 0.05  # their size, of the diagonal of the box around the roots
_RANGES: validate.Ranges = {
    "melanin": (0, _MOST, "", "blond hair has 0.3, brown 1.3, black 8", False),
    "melanin_spread": (0, 2, "", "it is relative to melanin", False),
    "redness": (0, 1, "", "it is the share of pheomelanin", False),
    "redness_spread": (0, 0.9, "", "it is relative to the largest that redness allows", False),
    "roughness": (conventions.LEAST_ROUGHNESS, 1, "", "hair has 0.2 to 0.4", False),
    "azimuthal_roughness": (conventions.LEAST_ROUGHNESS, 1, "", "hair has 0.2 to 0.4", False),
    "roughness_spread": (0, 2, "", "it is relative to roughness", False),
    "tilt": (-_STEEPEST, _STEEPEST, "degrees", "hair has 2 to 3", False),
    "tilt_spread": (0, _STEEPEST, "degrees", "0.5 is usual", False),
    "strays": (0, 1, "", "it is a share of the strands", False),
    "root_darkening": (-1, 10, "", "-1 takes all pigment, 1 doubles it", False),
    "root_length": (0, 1, "", "it is a share of a strand's length", True),
    "tip_lightening": (0, 1, "", "it is the share that the tip loses", False),
    "dyed": (0, 1, "", "it is a share of the strands", False),
    "clumping": (0, 1, "", "it is a share of the variance", False),
    "clump_size": (0, 1e9, "", "it is in the unit of the points", True),
}
_OPTIONAL = ("azimuthal_roughness", "tilt", "clump_size")


def vary(
    groom: Groom,
    *,
    melanin: float = 1.3,
    melanin_spread: float = 0.25,
    redness: float = 0.05,
    redness_spread: float = 0.1,
    roughness: float = 0.3,
    azimuthal_roughness: float | None = None,
    roughness_spread: float = 0.1,
    tilt: float | None = None,
    tilt_spread: float = 0.5,
    strays: float = 0.0,
    root_darkening: float = 0.0,
    root_length: float = 0.15,
    tip_lightening: float = 0.0,
    dye: Sequence[float] | None = None,
    dyed: float = 1.0,
    clumping: float = 0.3,
    clump_size: float | None = None,
    seed: int = 1,
) -> Groom:
    """Return the groom with attributes named as the parameters of `cuticle.Chiang`: `eumelanin`, `pheomelanin`, `beta_m`,
    `beta_n`, with a `tilt` also `alpha`, with a `dye` `sigma_a` in place of pigments.

    With one seed, and `clump_size` given, a strand's values depend on its number and its root alone: strands may be added
    after it. Roots that move take clumps elsewhere; in an animation, give the attributes of one frame to all.

    Parameters
    ----------
    groom
        Its other attributes stay.
    melanin, melanin_spread
        Mean concentration of both pigments together, 0 to 100 (blond 0.3, brown 1.3, black 8), and its standard deviation
        over the mean, 0 to 2: log-normal, cut at 100. It is that of strands with pigment, before roots darken and tips
        lighten.
    redness, redness_spread
        Mean share of pheomelanin in it, 0 to 1, and its standard deviation over the largest that such a mean allows,
        √(redness (1 - redness)), 0 to 0.9: a beta distribution.
    roughness, azimuthal_roughness, roughness_spread
        Means of `beta_m` and `beta_n` (default: `roughness`), 0.01 to 1, and their standard deviation over the mean, 0 to 2:
        log-normal, one factor for both, cut at 0.01 and 1.
    tilt, tilt_spread
        Mean of `alpha` and its standard deviation, degrees: normal, cut at ±20.
    strays
        Share of strands without pigment, 0 to 1: white hairs that make hair grey.
    root_darkening, root_length
        A root has 1 + `root_darkening` times the pigment, -1 to 10; this fades over the share `root_length` of the length.
    tip_lightening
        Share of the pigment that the sun takes up to the tip, 0 to 1. It takes the same share of what is left from each
        piece of the length, since hair is as long in the sun as its piece is old.
    dye, dyed
        Colour that dyed white hair shows, linear RGB of 1e-4 to 1, and the share of strands that are dyed.
    clumping, clump_size
        Share of the variance of pigments, roughness and tilt that neighbours have in common, 0 to 1, and the distance, in
        the points' unit, at which its correlation is down to 0.61. Default: a twentieth of the diagonal of the roots' box.
    seed
        Seed of everything random.

    Examples
    --------
    >>> from cuticle.grooms.procedural import wavy_lock
    >>> grey = vary(wavy_lock(1000), melanin=4, strays=0.4, root_darkening=0.5)
    >>> grey.attributes["eumelanin"].shape  # along a strand, too
    (32000,)
    """
    given = locals()
    checked_groom("groom", groom)
    p = {
        name: validate.number(name, given[name], low, high, unit=unit, remedy=remedy, above=above)
        for name, (low, high, unit, remedy, above) in _RANGES.items()
        if given[name] is not None or name not in _OPTIONAL
    }
    validate.random_numbers(seed)
    normal = _normals(groom, p["clumping"], p.get("clump_size"), seed)
    rough = _log_normal(normal(0), p["roughness_spread"])
    beta_m, beta_n = (
        np.clip(mean * rough, conventions.LEAST_ROUGHNESS, 1)
        for mean in (p["roughness"], p.get("azimuthal_roughness", p["roughness"]))
    )
    pigment = np.minimum(p["melanin"] * _log_normal(normal(1), p["melanin_spread"]), _MOST)
    pigment[_uniform(seed, 0, groom.strands) < p["strays"]] = 0
    share = _beta(normal(2), p["redness"], p["redness_spread"])
    colour = None if dye is None else _dye(dye, beta_n, _uniform(seed, 1, groom.strands) < p["dyed"])
    if p["root_darkening"] or p["tip_lightening"]:
        pigment = np.minimum(np.repeat(pigment, groom.counts) * _along(groom, p), _MOST)
        share = np.repeat(share, groom.counts)
        colour = None if colour is None else np.repeat(colour, groom.counts, axis=0)
    values: dict[str, NDArray | None] = {"beta_m": beta_m, "beta_n": beta_n, "color": None, "sigma_a": None}
    values |= {"eumelanin": pigment * (1 - share), "pheomelanin": pigment * share}
    if colour is not None:
        sigma_a = conventions.sigma_a_of_pigment(pigment * (1 - share), pigment * share) + colour
        values |= {"eumelanin": None, "pheomelanin": None, "sigma_a": sigma_a}
    if "tilt" in p:
        values["alpha"] = np.clip(p["tilt"] + p["tilt_spread"] * normal(3), -_STEEPEST, _STEEPEST)
    return groom.with_attributes(**values)


def _normals(groom: Groom, clumping: float, size: float | None, seed: int) -> Callable[[int], Array]:
    """Return what makes standard normal variables of all strands, a set of its own for each number."""
    roots = groom.points[groom.offsets[:-1]].astype(np.float64)
    size = size or _CLUMPS * float(np.linalg.norm(np.ptp(roots, axis=0))) or 1.0

    def normal(number: int) -> Array:
        own = _random(seed, number, 0).standard_normal(len(roots))
        if not clumping:
            return own
        rng = _random(seed, number, 1)
        waves, phase = rng.standard_normal((_WAVES, 3)).T / (2 * np.pi * size), rng.random(_WAVES)
        field = np.empty(len(roots))
        for start in range(0, len(roots), _AT_ONCE):
            turns = roots[start : start + _AT_ONCE] @ waves + phase
            turns -= np.rint(turns)  # so that single precision is enough: its cosines take a tenth of the time
            cosines = np.cos(np.float32(2 * np.pi) * turns.astype(np.float32))
            field[start : start + _AT_ONCE] = cosines.sum(axis=1, dtype=np.float64)
        return math.sqrt(2 * clumping / _WAVES) * field + math.sqrt(1 - clumping) * own

    return normal


def _uniform(seed: int, number: int, strands: int) -> Array:
    return _random(seed, number, 2).random(strands)


def _random(seed: int, number: int, kind: int) -> np.random.Generator:
    return np.random.default_rng([seed, number, kind])


def _log_normal(z: Array, spread: float) -> Array:
    """Values of mean 1 and standard deviation `spread`."""
    variance = math.log1p(spread**2)
    return np.exp(math.sqrt(variance) * z - variance / 2)


def _beta(z: Array, mean: float, spread: float) -> Array:
    """Shares of this mean, their standard deviation `spread` √(mean (1 - mean))."""
    from scipy.special import betaincinv, ndtr

    if not spread or mean in (0, 1):
        return np.full(len(z), mean)
    total = 1 / spread**2 - 1
    return betaincinv(mean * total, (1 - mean) * total, ndtr(z))


def _dye(color: Any, beta_n: Array, dyed: NDArray[np.bool_]) -> Array:
    """Absorption per radius of the dye on each strand, (strands, 3)."""
    dye = validate.array("dye", color, 1e-4, 1, np.float64, remedy="it is linear RGB")
    if dye.shape != (3,):
        raise ValueError(f"dye must be a colour of 3 channels, linear RGB, got shape {dye.shape}")
    return dyed[:, None] * conventions.sigma_a_of_color(dye, beta_n[:, None])


def _along(groom: Groom, p: dict[str, float]) -> Array:
    """Return how much of a strand's pigment is at each point, (N,)."""
    steps = np.linalg.norm(np.diff(groom.points.astype(np.float64), axis=0, prepend=groom.points[:1]), axis=1)
    steps[groom.offsets[:-1]] = 0
    length = np.cumsum(steps)
    s = (length - np.repeat(length[groom.offsets[:-1]], groom.counts)) / np.repeat(groom.lengths, groom.counts)
    t = np.minimum(s / p["root_length"], 1)
    return (1 + p["root_darkening"] * (1 - t * t * (3 - 2 * t))) * (1 - p["tip_lightening"]) ** np.clip(s, 0, 1)
