"""SciPy's interpolation along one axis, imported where it is used: that takes longer than all of this package."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike


def monotone(x: ArrayLike, y: ArrayLike, axis: int = 0) -> Any:
    """Return the cubic through points that rises and falls only where they do."""
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(x, y, axis=axis)


def smooth_spline(x: ArrayLike, y: ArrayLike, degree: int = 3, axis: int = 0) -> Any:
    """Return the spline through points."""
    from scipy.interpolate import make_interp_spline

    return make_interp_spline(x, y, k=degree, axis=axis)
