"""How far a value may be off: what rounding makes of the published formulas, and what a quadrature or a table makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import Evaluated, Formulas, arguments, optics
from cuticle.scattering.bcsdf import luminance_weights

Array = NDArray[np.float64]
FLOORS = {"single": 1e-3, "double": 1e-5}  # of a closed form's relative error: approximations of special functions pass
AVERAGED = 1e-2  # of a far field's, which is someone's quadrature or table, of f and its mean over azimuth
_EPS = {"single": 2.0**-23, "double": 2.0**-52}
_TINY = {"single": 1e-30, "double": 1e-200}  # values below are taken for 0
SHARE = 1e-3  # of all values may lie outside the tolerance, none further than
FURTHEST = 30.0  # tolerances
AVERAGED_SHARE = 1e-2
EXPLAINED = 5e-3  # a hypothesis that leaves no more of the values outside explains them


@dataclass(frozen=True, eq=False)
class Quantity:
    """Someone's values of f or of the density, and the tolerance of each.

    Attributes
    ----------
    name
        "f" or "pdf".
    given
        The values, (n, channels), NaN where there is none.
    relative
        The tolerance as a share, (n, 1).
    mean
        What the share is taken of beside the value itself, (n, channels).
    tiny
        The tolerance where both are next to nothing.
    averaged
        Whether the values are those of a quadrature or a table.
    """

    name: str
    given: Array
    relative: Array
    mean: Array
    tiny: float
    averaged: bool

    def off(self, predicted: Array) -> Array:
        """Return how far each value is from a prediction, in tolerances, (n, channels); NaN where there is none."""
        with np.errstate(all="ignore"):
            allowed = self.relative * (np.abs(predicted) + self.mean) + self.tiny
            found = np.abs(self.given - predicted) / allowed
        return np.where(np.isfinite(found), found, np.where(np.isnan(self.given), np.nan, 1e12))

    def take(self, rows: NDArray[np.intp]) -> Quantity:
        """Return the quantity of some of the cases."""
        return Quantity(self.name, self.given[rows], self.relative[rows], self.mean[rows], self.tiny, self.averaged)

    def bias(self, predicted: Array) -> float:
        """Return by what share the values are off in the median, where they matter, over the tolerance's quarter; 0 is none.

        A constant factor within the tolerance is found by this.
        """
        if not self.averaged:
            return 0.0
        with np.errstate(all="ignore"):
            ratio = (self.given / predicted - 1) / self.relative
        ratio = ratio[np.isfinite(ratio) & (predicted > 0.3 * self.mean)]
        if len(ratio) < 20:
            return 0.0
        middle = float(np.median(ratio))
        half = (float(np.quantile(ratio, 0.84)) - float(np.quantile(ratio, 0.16))) / 2
        return abs(middle) * 4 if abs(middle) > 5 * half / np.sqrt(len(ratio)) else 0.0

    def right(self, predicted: Array) -> bool:
        """Whether the values are those predicted."""
        off = self.off(predicted)
        off = off[~np.isnan(off)]
        share = AVERAGED_SHARE if self.averaged else SHARE
        return bool((off > 1).mean() <= share and self.furthest(predicted) <= FURTHEST and self.bias(predicted) <= 1)

    def furthest(self, predicted: Array) -> float:
        """Return how far the worst value is off, in tolerances."""
        return float(np.nanmax(self.off(predicted)))

    def outside(self, predicted: Array) -> float:
        """Return the share of the values outside the tolerance."""
        off = self.off(predicted)
        return float((off[~np.isnan(off)] > 1).mean())

    def score(self, predicted: Array) -> float:
        """Return a misfit that is less for each value that is explained, whatever the others do."""
        off = self.off(predicted)
        off = off[~np.isnan(off)]
        return float(np.mean(2 * np.log(np.hypot(1, off))) + 0.02 * self.bias(predicted) ** 2)


def quantity(
    name: str, given: Array, F: Formulas, inputs: Inputs, right: Evaluated, precision: str, tolerance: float | None,
    written: float,
) -> Quantity:  # fmt: skip
    """Return the quantity with its tolerances; `written`: by how much a value may be off as it was printed."""
    averaged = not inputs.near
    floor = tolerance if tolerance is not None else AVERAGED if averaged else FLOORS[precision]
    relative = floor + _EPS[precision] * _conditioning(F, inputs, right)
    mean = right.mean if averaged else np.zeros_like(right.mean)
    if name == "pdf":
        whole = right.f @ luminance_weights(inputs.channels)
        with np.errstate(all="ignore"):
            mean = np.nan_to_num((mean @ luminance_weights(inputs.channels)) * right.pdf / whole)[:, None]
    return Quantity(name, given, relative, mean, max(_TINY[precision], written), averaged)


def _conditioning(F: Formulas, inputs: Inputs, right: Evaluated) -> Array:
    """Return by how much the formulas as printed may enlarge a rounding error, (n, 1): a sum over what they subtract.

    exp(… 1/v) loses the digits of 1/v, D((φ - φ_p)/s) those of 2π/s, exp(-σ_a …) those of the depth, 1 - F those of F near
    1, √(1 - sin²θ) near a pole those of 1. Lobes count by their share of f.
    """
    q = arguments(inputs)
    if not q.near:
        q.h = np.zeros((1, 1))
    with np.errstate(all="ignore"):
        energies, ray = optics(F, q)
        del energies
        parts = right.parts @ luminance_weights(inputs.channels)
        share = np.nan_to_num(parts / parts.sum(axis=1, keepdims=True), nan=1.0)
        i, r = (np.tan(x) ** 2 for x in (q.theta_i, q.theta_r))
        total = 20 + i + r + 20 * np.pi / F.scale(q)
        cosines = np.cos(q.theta_i) * np.cos(q.theta_r) * (i + r)
        depth = (F.path(ray)[..., None] * q.sigma_a).max(axis=-1)
        for p, v in enumerate(F.variances(q)):
            inner = 2 / np.maximum(1 - ray.fresnel, 1e-7) + 4 * p * depth if p else 0.0
            total = total + share[:, p : p + 1] * ((4 + cosines) / v + inner)
    return np.asarray(np.minimum(total, 1e7))
