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


class Scaled:
    """f = c cos theta_i: light in any unit."""

    def __init__(self, c: float) -> None:
        self.c = c

    def eval(self, theta_i: Any, theta_r: Any, phi: Any) -> np.ndarray:
        return self.c * Cosine().eval(theta_i, theta_r, phi)


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_quality_does_not_depend_on_the_unit_of_light(scale: float) -> None:
    """Squares of such numbers are 0 or infinite."""
    one, other = (cuticle.measure(Uniform(), Scaled(c), 0.3) for c in (1.0, scale))
    for name in ("ess", "ess_channels", "largest_weight", "total_variation"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-9)


def test_a_function_without_light_has_no_quality() -> None:
    with pytest.raises(ValueError, match="scatters nothing toward theta_r 17.19°: there is nothing to measure"):
        cuticle.measure(Uniform(), Scaled(0), 0.3)


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
