"""The audit's integrals find peaks and jumps, or say how far off they may be."""

from __future__ import annotations

import numpy as np
import pytest

from cuticle import audit
from cuticle.checking.sphere_integrals import integrate
from test_audit import failed, slow


class Narrow:
    """A lobe of von Mises and Fisher, of width 1/√κ, about the mirror image of the viewer, and 30 % everywhere."""

    def __init__(self, kappa: float) -> None:
        self.kappa = kappa

    def sample(self, theta_r: float, u: np.ndarray) -> tuple[np.ndarray, ...]:
        some = u[:, 2] < 0.3
        cos = np.where(some, 2 * u[:, 0] - 1, 1 + np.log1p(-u[:, 0]) / self.kappa)
        sin, turn = np.sqrt((1 - cos) * (1 + cos)), 2 * np.pi * u[:, 1]
        axis, up = np.array([np.cos(theta_r), -np.sin(theta_r), 0]), np.array([np.sin(theta_r), np.cos(theta_r), 0])
        x, y, z = (cos[:, None] * axis + sin[:, None] * (np.cos(turn)[:, None] * up + np.sin(turn)[:, None] * [0, 0, 1])).T
        return np.arcsin(np.clip(y, -1, 1)), np.arctan2(z, x)

    def pdf(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        # 1 - cos of the angle to the axis, without cancellation
        off = 2 * (np.sin((theta_i + theta_r) / 2) ** 2 + np.cos(theta_i) * np.cos(theta_r) * np.sin(phi / 2) ** 2)
        return 0.7 * self.kappa / (2 * np.pi) * np.exp(-self.kappa * off) + 0.3 / (4 * np.pi)


@pytest.mark.parametrize("kappa", [pytest.param(1e5, marks=slow), 1e6, 1e7, pytest.param(3e7, marks=slow)])
def test_right_lobes_narrower_than_the_cells_pass(kappa: float) -> None:
    for seed in (1, 2, 3):
        report = audit(Narrow(kappa), theta_r=np.radians([-75, 0, 60]), seed=seed)
        assert report.ok, report
    wrong, right = Narrow(kappa), Narrow(1.05 * kappa)
    assert "samples follow the pdf" in failed(audit(right.sample, wrong.pdf, theta_r=np.radians([0, 60])))


class Needle:
    """Even over the sphere, but for half a percent within a spot that no quadrature would meet."""

    share, centre, width = 0.005, (0.37, 1.23), 0.002

    def sample(self, theta_r: float, u: np.ndarray) -> tuple[np.ndarray, ...]:
        theta, phi = np.arcsin(2 * u[:, 1] - 1), 2 * np.pi * u[:, 2] - np.pi
        spot = u[:, 0] < self.share
        sines = np.sin(self.centre[0]) + self.width * (2 * u[:, 1] - 1)
        theta, phi = (
            np.where(spot, np.arcsin(sines), theta),
            np.where(spot, self.centre[1] + self.width * (2 * u[:, 2] - 1), phi),
        )
        return theta, phi, self.pdf(theta, theta_r, phi)

    def pdf(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        inside = (np.abs(np.sin(theta_i) - np.sin(self.centre[0])) < self.width) & (
            np.abs(phi - self.centre[1]) < self.width
        )
        return (1 - self.share) / (4 * np.pi) + inside * self.share / (4 * self.width**2)


def test_a_needle_that_is_in_the_density_is_no_fault() -> None:
    report = audit(Needle(), theta_r=[0.0])
    assert report.ok, report
    assert report.cases[0].integral == pytest.approx(1, abs=report.cases[0].integral_error + 1e-4)


def test_integrals_of_what_jumps_and_what_peaks() -> None:
    theta, phi = np.linspace(-np.pi / 2, np.pi / 2, 21), np.linspace(-np.pi, np.pi, 31)

    def function(t: np.ndarray, p: np.ndarray) -> np.ndarray:
        peak = np.exp(-(t**2 + (p - 1) ** 2) / (2 * 0.01**2)) / (2 * np.pi * 0.01**2) / np.cos(t)
        return np.column_stack([(p > 0.123) + peak, peak])

    result = integrate(function, theta, phi, 1e-3)
    exact = 2 * (np.pi - 0.123) + 1
    assert result.value[..., 0].sum() == pytest.approx(exact, abs=result.error[..., 0].sum() + 1e-6)
    assert result.error[..., 0].sum() < 0.02
    assert result.value[..., 1].sum() == pytest.approx(1, abs=1e-3)
