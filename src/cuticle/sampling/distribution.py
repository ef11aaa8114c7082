"""The target of a sampler: f·cos(theta_i) for one viewer, on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.values import Value
from cuticle.scattering.bcsdf import Bcsdf, check_model, evaluate, luminance


class Peak(NamedTuple):
    """The maximum of the luminance of f·cos: its theta_i and phi in radians, and its value in 1/sr."""

    theta_i: float
    phi: float
    value: float


@dataclass(frozen=True, eq=False)
class Distribution(Value):
    """f·cos(theta_i) for one viewer, at the centres of a grid of cells.

    Attributes
    ----------
    theta_r
        The viewer's inclination, radians.
    theta_i, phi
        Cell centres, radians, evenly spaced, shapes (A,) and (B,).
    values
        f·cos(theta_i), 1/sr, shape (A, B, channels).
    """

    theta_r: float
    theta_i: NDArray[np.float64]
    phi: NDArray[np.float64]
    values: NDArray[np.float64]

    def __repr__(self) -> str:
        p = self.peak
        return (
            f"Distribution(theta_r {np.degrees(self.theta_r):.4g}°, peak at theta_i {np.degrees(p.theta_i):.4g}°,"
            f" phi {np.degrees(p.phi):.4g}°, energy {luminance(self.energy):.4g})"
        )

    @property
    def luminance(self) -> NDArray[np.float64]:
        """Luminance of `values`, shape (A, B)."""
        return luminance(self.values)

    @property
    def _steps(self) -> tuple[float, float]:
        return np.pi / len(self.theta_i), 2 * np.pi / len(self.phi)

    @property
    def energy(self) -> NDArray[np.float64]:
        """∫ f cos theta_i d omega_i for each channel."""
        return self.marginal_theta.sum(axis=0) * self._steps[0]

    @property
    def marginal_theta(self) -> NDArray[np.float64]:
        """∫ f cos theta_i · cos theta_i d phi, per radian of theta_i, shape (A, channels)."""
        return self.values.sum(axis=1) * np.cos(self.theta_i)[:, None] * self._steps[1]

    @property
    def marginal_phi(self) -> NDArray[np.float64]:
        """∫ f cos theta_i · cos theta_i d theta_i, per radian of phi, shape (B, channels)."""
        return np.einsum("abc,a->bc", self.values, np.cos(self.theta_i)) * self._steps[0]

    @property
    def peak(self) -> Peak:
        """The maximum of the luminance, refined between cells by a parabola along each axis."""
        grid = self.luminance
        a, b = np.unravel_index(np.argmax(grid), grid.shape)
        step_t, step_p = self._steps
        theta = self.theta_i[a]
        if 0 < a < len(self.theta_i) - 1:
            theta = theta + step_t * _vertex(grid[a - 1 : a + 2, b])
        count = len(self.phi)
        phi = self.phi[b] + step_p * _vertex(grid[a, [(b - 1) % count, b, (b + 1) % count]])
        return Peak(float(theta), wrap_angle(phi), float(grid[a, b]))


def wrap_angle(phi: float) -> float:
    """Return an angle in (-pi, pi], radians."""
    return float(np.pi - (np.pi - phi) % (2 * np.pi))


def _vertex(y: NDArray[np.float64]) -> float:
    bend = y[0] - 2 * y[1] + y[2]
    return float(np.clip(0.5 * (y[0] - y[2]) / bend, -0.5, 0.5)) if bend < 0 else 0.0


def tabulate(model: Bcsdf, theta_r: float, *, n_theta: int = 360, n_phi: int = 720) -> Distribution:
    """Tabulate f·cos(theta_i) of a model for one viewer.

    Parameters
    ----------
    model
        Any object with `eval(theta_i, theta_r, phi)`.
    theta_r
        The viewer's inclination, radians in [-pi/2, pi/2].
    n_theta, n_phi
        Cells over [-pi/2, pi/2] and over (-pi, pi].

    Examples
    --------
    >>> import cuticle
    >>> d = cuticle.tabulate(cuticle.Marschner(cuticle.Fibre.preset("marschner")), 0.0)
    >>> bool(abs(d.peak.phi) > 3)
    True
    """
    check_model(model)
    tr = validate.number("theta_r", theta_r, -validate.HALF_PI, validate.HALF_PI, unit="rad", remedy=validate.RADIANS)
    validate.integer("n_theta", n_theta, 2, 20000)
    validate.integer("n_phi", n_phi, 2, 20000)
    theta_i = (np.arange(n_theta) + 0.5) / n_theta * np.pi - np.pi / 2
    phi = (np.arange(n_phi) + 0.5) / n_phi * 2 * np.pi - np.pi
    return Distribution(tr, theta_i, phi, evaluate(model, theta_i, tr, phi))
