"""What `measure` and `tabulate` say, against integrals done by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import cuticle


class Cosine:
    """f = cos theta_i."""

    channels = 1

    def eval(self, theta_i: Any, theta_r: Any, phi: Any) -> np.ndarray:
        return np.cos(theta_i + 0 * theta_r + 0 * phi)[..., None]


class Uniform:
    """Directions over the sphere."""

    def pdf(self, theta_i: Any, theta_r: Any, phi: Any, strands: Any = None) -> np.ndarray:
        return np.full(np.broadcast_shapes(np.shape(theta_i), np.shape(phi)), 0.25 / np.pi)


def test_quality_is_what_its_docstring_says() -> None:
    """f cos = cos² over dω = cos dθ dφ: ∫ is 8π/3, and ∫ of its square 32π/15."""
    q = cuticle.measure(Uniform(), Cosine(), 0.3)
    assert q.energy[0] == pytest.approx(8 * np.pi / 3, rel=1e-4)
    assert q.ess == pytest.approx(5 / 6, rel=1e-4)
    assert q.ess_channels == pytest.approx((5 / 6,), rel=1e-4)
    assert q.largest_weight == pytest.approx(1.5, rel=1e-3)
    assert q.total_variation == pytest.approx(1 / (3 * np.sqrt(3)), rel=1e-3)
    assert q.energy_error is not None
    assert abs(q.energy_error) < 1e-3


class Bump:
    """A peak between the points of a grid."""

    channels = 1
    theta, phi = 0.3123, 1.0371

    def eval(self, theta_i: Any, theta_r: Any, phi: Any) -> np.ndarray:
        off = (np.asarray(theta_i) - self.theta) ** 2 + (np.asarray(phi) - self.phi) ** 2 + 0 * theta_r
        return (np.exp(-off / 0.02) / np.cos(theta_i))[..., None]


def test_a_peak_is_found_between_the_points_of_the_grid() -> None:
    peak = cuticle.tabulate(Bump(), 0.2).peak
    assert peak.theta_i == pytest.approx(Bump.theta, abs=1e-4)
    assert peak.phi == pytest.approx(Bump.phi, abs=1e-4)
