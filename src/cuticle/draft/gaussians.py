"""A scaled Gaussian through a curve: what the draft's tables 2 and 3 hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Curve = Callable[[NDArray[np.float64]], NDArray[np.float64]]
WINDOW = 1 / 3  # of the peak: a Gaussian is matched to the highlight, not to the floor around it
HOLDS = 0.06  # rms residual over the peak, past which a Gaussian is no description
_FLAT = 2 * np.pi  # radians: a wider Gaussian is none that a curve could tell from a constant
_COARSE, _FINE = 721, 241


@dataclass(frozen=True)
class Gaussian:
    """s/(sigma sqrt(2 pi)) exp(-(x - mean)²/(2 sigma²)), and how well it goes through its curve.

    Attributes
    ----------
    scale
        s, in units of the curve times radians.
    mean, sigma
        Radians.
    residual
        Root-mean-square difference from the curve where it was fitted, over the curve's peak.
    """

    scale: float
    mean: float
    sigma: float
    residual: float

    def __call__(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return its values at x."""
        return _gaussian(x, self.scale / (self.sigma * np.sqrt(2 * np.pi)), self.mean, self.sigma)


def _gaussian(x: NDArray[np.float64], height: float, mean: float, sigma: float) -> NDArray[np.float64]:
    return height * np.exp(-0.5 * ((x - mean) / sigma) ** 2)


def fit_gaussian(
    curve: Curve, low: float, high: float, *, window: float = WINDOW, centre: float | None = None
) -> Gaussian | None:
    """Fit a Gaussian to a curve on [low, high] by least squares around its peak.

    Parameters
    ----------
    curve
        Values at an array of points; non-negative.
    low, high
        The curve's domain, radians.
    window
        Only the connected piece around the peak where the curve exceeds this share of it counts; 0 takes all.
    centre
        Hold the mean there, and take the piece around it.

    Returns
    -------
    Gaussian or None
        None where the peak lies on the edge of the domain, the curve is flat, or nothing fits.
    """
    x = np.linspace(low, high, _COARSE)
    y = curve(x)
    top = int(np.argmax(y)) if centre is None else int(np.argmin(np.abs(x - centre)))
    if not y[top] > 0 or (centre is None and top in (0, len(x) - 1)):
        return None
    above = y > window * y[top] if window > 0 else np.ones_like(y, bool)
    first = top - int(np.argmin(above[top::-1])) if not above[: top + 1].all() else 0
    last = top + int(np.argmin(above[top:])) if not above[top:].all() else len(x) - 1
    x = np.linspace(x[first], x[last], _FINE)  # a peak narrower than the coarse grid is seen whole
    y = curve(x)
    peak = float(y.max())
    near = y > window * peak if window > 0 else np.ones_like(y, bool)
    x, y = x[near], y[near] / peak
    start = float(x[np.argmax(y)]) if centre is None else centre
    width = max(0.3 * float(x[-1] - x[0]), 1e-5)
    from scipy.optimize import curve_fit

    try:
        if centre is None:
            lower, upper = [0, low, 1e-6], [20, high, 20.0]
            found = curve_fit(_gaussian, x, y, p0=(1, start, width), bounds=(lower, upper))[0]
            height, mean, sigma = map(float, found)
        else:
            held = centre
            found = curve_fit(lambda x, h, s: _gaussian(x, h, held, s), x, y, p0=(1, width), bounds=(0, [20, 20]))[0]
            height, mean, sigma = float(found[0]), held, float(found[1])
    except (RuntimeError, ValueError):
        return None
    if sigma > _FLAT:
        return None
    residual = float(np.sqrt(np.mean((y - _gaussian(x, height, mean, sigma)) ** 2)))
    return Gaussian(peak * height * sigma * float(np.sqrt(2 * np.pi)), mean, sigma, residual)
