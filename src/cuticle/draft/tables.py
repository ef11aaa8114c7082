"""The draft's three tables, for any scattering function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle.draft.gaussians import HOLDS, Curve, Gaussian, fit_gaussian
from cuticle.sampling.distribution import tabulate, wrap_angle
from cuticle.scattering.bcsdf import Bcsdf, is_even, luminance

PHI_R = (-180, -90, 0, 90, 180)  # degrees, as are those below
THETA_R_1 = (-90, -60, -30, 0, 30, 60, 90)
THETA_R_2 = tuple(range(-80, 81, 10))
THETA_R_3 = (-90, -60, -30, 0, 30, 60, 90)
STRANDS = (1.0, 2.0, 4.0, 8.0, 16.0)
VIEWERS = np.radians([-60.0, -30.0, 0.0, 30.0, 60.0])  # of what is told as a mean
USED = 70  # degrees: past it the draft leaves its Gaussians, and so do the functions
POLE = math.radians(89.75)  # stands for ±90°, where f·cos has no limit
_AROUND = 90  # azimuths of a mean over phi


def near_pole(degrees: float) -> float:
    """Return an inclination in radians, ±90° as ±89.75°."""
    return float(np.clip(math.radians(degrees), -POLE, POLE))


@dataclass(frozen=True)
class PeakRow:
    """Table 1: where f·cos is largest for one viewer. Radians; phi_i in (-pi, pi]."""

    phi_r: float
    theta_r: float
    theta_i: float
    phi_i: float
    mirror: float  # the azimuth of the same height across the fibre, where f is even in phi


@dataclass(frozen=True)
class SliceRow:
    """Table 2: Gaussians along phi (V) and along theta_i (H) through the highlight. Radians."""

    theta_r: float
    vertical: Gaussian | None
    horizontal: Gaussian | None
    shift: float | None  # of the mean along theta_i from -theta_r
    peak_offset: float  # azimuth of the true maximum, from the highlight's axis

    @property
    def holds(self) -> bool:
        """Whether both Gaussians describe their slice: rms residual at most 6 % of the peak."""
        return all(g is not None and g.residual <= HOLDS for g in (self.vertical, self.horizontal))


@dataclass(frozen=True)
class StrandRow:
    """Table 3: the one Gaussian in theta_i through n strands. Radians."""

    strands: float
    theta_r: float
    gaussian: Gaussian | None
    shift: float | None  # of the mean from -theta_r

    @property
    def holds(self) -> bool:
        """Whether the Gaussian describes the curve."""
        return self.gaussian is not None and self.gaussian.residual <= HOLDS


def highlight_axis(model: Bcsdf) -> float:
    """Return the azimuth that the highlight is centred on, pi or 0: the higher one at normal view."""
    theta = np.linspace(-1.5, 1.5, 601)
    return math.pi if _slice(model, theta, 0.0, math.pi).max() >= _slice(model, theta, 0.0, 0.0).max() else 0.0


def _slice(model: Bcsdf, theta_i: NDArray, theta_r: float, phi: float | NDArray) -> NDArray[np.float64]:
    """f·cos(theta_i) of the luminance, 1/sr."""
    f = luminance(np.asarray(model.eval(theta_i, theta_r, phi), np.float64))
    return f * np.cos(theta_i)


def along_theta(model: Bcsdf, theta_r: float, axis: float, per: str) -> Curve:
    """Return the slice along theta_i at the highlight's azimuth: f·cos, or f·cos² where it is told per radian."""
    if per == "radian":
        return lambda x: _slice(model, x, theta_r, axis) * np.cos(x)
    return lambda x: _slice(model, x, theta_r, axis)


def around(model: Bcsdf, theta_r: float, cosines: int = 2) -> Curve:
    """Return the mean over all azimuths of f·cos² theta_i: up to a factor the density of theta_i per radian.

    The one Gaussian for n strands has no azimuthal part, so it is a density of theta_i alone, and d omega brings a cosine
    beside that of f·cos. The draft's own table is met better so than with one (docs/document.md); `cosines` is for that
    comparison.
    """
    even = is_even(model)
    phi = (np.arange(_AROUND if even else 2 * _AROUND) + 0.5) * math.pi / _AROUND

    def curve(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return _slice(model, x[:, None], theta_r, phi).mean(axis=1) * np.cos(x) ** (cosines - 1)

    return curve


def table_1(model: Bcsdf) -> tuple[PeakRow, ...]:
    """Return the position of the maximum for each viewer.

    Every viewer is searched over all directions, as the draft did.
    """
    rows = []
    for p in np.radians(PHI_R):
        for t in THETA_R_1:
            peak = tabulate(_Turned(model, float(p)), near_pole(t), n_theta=360, n_phi=720).peak
            mirror = wrap_angle(2 * float(p) - peak.phi)
            rows.append(PeakRow(float(p), math.radians(t), peak.theta_i, peak.phi, mirror))
    return tuple(rows)


class _Turned:
    """A model seen by a viewer at azimuth phi_r: phi is then the light's own azimuth."""

    def __init__(self, model: Bcsdf, phi_r: float) -> None:
        self._model, self._phi_r = model, phi_r

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        return self._model.eval(theta_i, theta_r, np.asarray(phi) - self._phi_r)


def table_2(
    model: Bcsdf, theta_r: Sequence[float] = THETA_R_2, axis: float | None = None, per: str = "steradian"
) -> tuple[SliceRow, ...]:
    """Return the Gaussians through the highlight of direct light.

    Parameters
    ----------
    model
        Any scattering function.
    theta_r
        Viewers, degrees.
    axis
        Azimuth of the highlight, radians; found at normal view if left out.
    per
        The measure of the slice along theta_i. "steradian": f·cos, as the draft's table has it. "radian": f·cos², the
        density of theta_i, which is what a Gaussian that is drawn from has to follow.
    """
    validate.choice("per", per, ("steradian", "radian"))
    axis = highlight_axis(model) if axis is None else axis
    rows = []
    for degrees in theta_r:
        t = near_pole(degrees)
        horizontal = fit_gaussian(along_theta(model, t, axis, per), -math.pi / 2, math.pi / 2)
        vertical = None
        if horizontal is not None:
            x = np.linspace(-math.pi / 2, math.pi / 2, 1441)
            top = float(x[np.argmax(_slice(model, x, t, axis))])
            vertical = fit_gaussian(
                lambda p, top=top, t=t: _slice(model, np.array(top), t, p + axis),  # type: ignore[misc]
                -math.pi,
                math.pi,
                centre=0.0,
            )
        shift = None if horizontal is None else horizontal.mean + t
        peak = tabulate(model, t, n_theta=360, n_phi=360).peak
        rows.append(SliceRow(math.radians(degrees), vertical, horizontal, shift, abs(wrap_angle(peak.phi - axis))))
    return tuple(rows)


def table_3(model: Bcsdf, strands: Sequence[float] = STRANDS, theta_r: Sequence[float] = THETA_R_3) -> tuple[StrandRow, ...]:
    """Return the one Gaussian in theta_i for each number of strands; theta_r in degrees."""
    rows = []
    for n in strands:
        own = model.with_strands(n)  # type: ignore[attr-defined]
        for degrees in theta_r:
            t = near_pole(degrees)
            gaussian = fit_gaussian(around(own, t), -math.pi / 2, math.pi / 2, window=0.0)
            rows.append(StrandRow(n, math.radians(degrees), gaussian, None if gaussian is None else gaussian.mean + t))
    return tuple(rows)
