"""The axes and the shape of a table: increasing angles that cover the sphere, or one line that says what does not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate

LARGEST_GAP = np.radians(30)  # between neighbours of one axis
LARGEST_MARGIN = np.radians(10)  # between the last theta_i and the pole
_DEGREES = "angles are in radians: give degrees=True, or name the columns theta_r_deg, theta_i_deg, phi_deg"


def increasing(name: str, x: NDArray, least: int) -> NDArray[np.float64]:
    """Return an axis of at least `least` increasing angles, radians; raise ValueError for any other."""
    x = validate.real(name, x).astype(np.float64)
    if x.ndim != 1 or len(x) < least:
        raise ValueError(f"{name} must be a list of at least {least} angles, got shape {x.shape}")
    limit = 4 * np.pi if name == "phi" else np.pi / 2
    if not np.isfinite(x).all() or np.abs(x).max() > limit * (1 + 1e-6):
        raise ValueError(f"{name} must lie in ±{limit:.5g} rad, got up to {np.abs(x).max():.5g}; {_DEGREES}")
    if (np.diff(x) <= 0).any():
        at = int(np.argmax(np.diff(x) <= 0))
        raise ValueError(f"{name} must be increasing, got {x[at]:.5g} and then {x[at + 1]:.5g} (item {at + 1})")
    return x.clip(-limit, limit)


def grid_axes(sizes: Sequence[int], even: bool = False) -> tuple[NDArray, NDArray, NDArray]:
    """Return theta_r, theta_i and phi, radians, for a table of so many of each over the sphere.

    Inclinations stop short of the poles, where f·cos degenerates; phi runs over half a turn of an even function.
    """
    theta_r = np.linspace(-np.pi / 2, np.pi / 2, sizes[0]) * 0.995
    theta_i = np.linspace(-np.pi / 2, np.pi / 2, sizes[1]) * 0.999
    phi = np.linspace(0, np.pi, sizes[2] // 2 + 1) if even else np.linspace(-np.pi, np.pi, sizes[2])[:-1]
    return theta_r, theta_i, phi


def shaped(values: ArrayLike, r: int, a: int, b: int) -> NDArray:
    """Return values in shape (r, a, b, channels), or raise ValueError."""
    f = validate.real("values", values)
    f = f if f.dtype == np.float32 else f.astype(np.float64, copy=False)
    if f.shape[:2] == (a, b) and f.ndim in (2, 3) and r == 1:
        f = f[None]
    if f.ndim == 3:
        f = f[..., None]
    if f.ndim != 4 or f.shape[:3] != (r, a, b) or not 1 <= f.shape[3] <= 32:
        raise ValueError(
            f"values must have shape (theta_r, theta_i, phi, channels) = ({r}, {a}, {b}, 1 to 32), got {np.shape(values)}"
        )
    return f


def check_theta(theta: NDArray) -> None:
    """Raise ValueError where theta_i leaves a pole or a wide gap uncovered."""
    margin = max(theta[0] + np.pi / 2, np.pi / 2 - theta[-1])
    if margin > LARGEST_MARGIN + 1e-9:
        raise ValueError(
            f"theta_i must reach within {np.degrees(LARGEST_MARGIN):g}° of both poles, got"
            f" {np.degrees(theta[0]):.4g}° to {np.degrees(theta[-1]):.4g}°; the grid does not cover the sphere. {_DEGREES}"
        )
    _check_gap("theta_i", float(np.diff(theta).max()))


def _check_gap(name: str, gap: float) -> None:
    if gap > LARGEST_GAP + 1e-9:
        raise ValueError(
            f"neighbours in {name} may be {np.degrees(LARGEST_GAP):g}° apart at most, got {np.degrees(gap):.4g}°;"
            " the grid does not cover the sphere"
        )


def azimuth(phi: NDArray) -> tuple[NDArray, Any, bool]:
    """Return the azimuths to keep, where they lie in the given ones, and whether they are half a turn."""
    phi = increasing("phi", phi, 3)
    step, reach = float(np.diff(phi).max()), float(phi[-1] - phi[0])
    _check_gap("phi", step)
    if reach > 2 * np.pi + 1e-6:
        raise ValueError(f"phi must cover one turn, got {np.degrees(reach):.5g}°; leave out what comes twice")
    if reach >= 2 * np.pi - 1e-6:  # the last is the first again
        return phi[:-1], slice(0, -1), False
    if 2 * np.pi - reach <= step * 1.001 + 1e-9:
        return phi, slice(None), False
    if phi[0] >= -1e-6 and phi[-1] <= np.pi + 1e-6 and phi[0] <= step and np.pi - phi[-1] <= step:
        return phi.clip(0, np.pi), slice(None), True
    raise ValueError(
        f"phi must run over a whole turn, or from 0 to pi for an even function, got {np.degrees(phi[0]):.4g}° to"
        f" {np.degrees(phi[-1]):.4g}°; the grid does not cover the sphere"
    )
