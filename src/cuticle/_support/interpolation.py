"""Interpolation along one axis; SciPy's takes longer to import than all of this package, and is used for splines only."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Monotone:
    """The cubic through points that rises and falls only where they do (Fritsch and Butland 1984), as SciPy's PCHIP.

    Called with positions, an array or a number, it returns values with that array's axes in the place of `axis`. Beyond the
    ends the last cubic goes on.

    Parameters
    ----------
    x
        Increasing positions, at least two, shape (n,).
    y
        Values; the axis `axis` has length n.
    """

    def __init__(self, x: ArrayLike, y: ArrayLike, axis: int = 0) -> None:
        self._x, values = np.asarray(x, np.float64), np.asarray(y, np.float64)
        self._axis = axis % values.ndim
        self._y = np.moveaxis(values, self._axis, 0)
        self._step = np.diff(self._x).reshape(-1, *[1] * (self._y.ndim - 1))
        self._slope = self._slopes(np.diff(self._y, axis=0) / self._step)

    def _slopes(self, chord: Array) -> Array:
        """Slopes at the points: weighted harmonic means of the chords on either side, 0 where those turn."""
        if len(chord) == 1:
            return np.concatenate([chord, chord])
        h, out = self._step, np.zeros_like(self._y)
        left, right = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
        same = np.sign(chord[1:]) * np.sign(chord[:-1]) > 0
        a, b = np.where(same, chord[:-1], 1.0), np.where(same, chord[1:], 1.0)
        out[1:-1] = np.where(same, (left + right) / (left / a + right / b), 0.0)
        out[0] = _end(h[0], h[1], chord[0], chord[1])
        out[-1] = _end(h[-1], h[-2], chord[-1], chord[-2])
        return out

    def __call__(self, at: ArrayLike) -> Array:
        """Return the values at positions."""
        positions = np.asarray(at, np.float64)
        flat = positions.ravel()
        k = (np.searchsorted(self._x, flat, side="right") - 1).clip(0, len(self._x) - 2)
        h = self._step[k]
        t = (flat - self._x[k]).reshape(h.shape) / h
        y, slope, s = self._y, self._slope, 1 - t
        out = y[k] * (1 + 2 * t) * s**2 + y[k + 1] * (1 + 2 * s) * t**2 + h * t * s * (slope[k] * s - slope[k + 1] * t)
        whole = np.moveaxis(out, 0, self._axis)
        shape = whole.shape
        return whole.reshape(*shape[: self._axis], *positions.shape, *shape[self._axis + 1 :])


def _end(near: Array, far: Array, chord: Array, next_chord: Array) -> Array:
    """The slope at an end, of the parabola through three points, kept from turning."""
    slope = ((2 * near + far) * chord - near * next_chord) / (near + far)
    slope = np.where(np.sign(slope) != np.sign(chord), 0.0, slope)
    steep = (np.sign(chord) != np.sign(next_chord)) & (np.abs(slope) > 3 * np.abs(chord))
    return np.where(steep, 3 * chord, slope)


def smooth_spline(x: ArrayLike, y: ArrayLike, degree: int = 3, axis: int = 0) -> Any:
    """Return SciPy's spline through points."""
    from scipy.interpolate import make_interp_spline

    return make_interp_spline(x, y, k=degree, axis=axis)
