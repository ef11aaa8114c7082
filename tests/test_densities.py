"""One family of tests over every one-dimensional density: pdf, cdf and icdf tell one story."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.integrate import trapezoid

from cuticle import _core
from cuticle.sampling.densities import DENSITIES, Density, even_normal, longitudinal_normal, periodic_normal
from cuticle.sampling.families import core_table

MEANS = [-30.0, -math.pi, -math.pi / 2, -1.0, 0.0, 0.7, math.pi / 2, 1.9, math.pi, 5.0, 400.0]
SIGMAS = [np.radians(0.2), 0.05, 0.3, 1.0, 3.0, 50.0, 1e6]


def points(density: Density, mean: float, sigma: float) -> np.ndarray:
    """Where the density has its mass: dense about the mean and about both ends."""
    scales = np.concatenate([[0], np.geomspace(1e-9, 2 * np.pi, 4000)])
    near = np.concatenate(
        [c + s * scales for c in (mean, -mean, density.low, density.high, 0.0, math.pi, -math.pi) for s in (-1, 1)]
    )
    if density is periodic_normal:
        wrapped = np.mod(mean + np.pi, 2 * np.pi) - np.pi
        near = np.concatenate([near, wrapped + scales, wrapped - scales])
    return np.unique(np.clip(near, density.low, density.high))


@pytest.mark.parametrize("density", DENSITIES, ids=lambda d: d.name)
@pytest.mark.parametrize("mean", MEANS)
@pytest.mark.parametrize("sigma", SIGMAS)
def test_pdf_is_the_slope_of_a_cdf_from_0_to_1(density: Density, mean: float, sigma: float) -> None:
    x = points(density, mean, sigma)
    pdf, cdf = density.pdf(x, mean, sigma), density.cdf(x, mean, sigma)
    assert np.isfinite(pdf).all()
    assert (pdf >= 0).all()
    total = trapezoid(pdf, x)
    assert abs(total - 1) <= 2e-3  # the trapezoid's own error on this grid
    assert cdf[0] <= 1e-15
    assert cdf[-1] == 1
    assert (np.diff(cdf) >= -1e-15).all()
    slope = np.cumsum(np.diff(x) * 0.5 * (pdf[1:] + pdf[:-1]))
    assert np.max(np.abs(cdf[1:] - slope)) <= 2e-3


@pytest.mark.parametrize("density", DENSITIES, ids=lambda d: d.name)
@pytest.mark.parametrize("mean", MEANS)
@pytest.mark.parametrize("sigma", SIGMAS)
def test_icdf_inverts_cdf(density: Density, mean: float, sigma: float) -> None:
    u = np.concatenate([[0.0], np.linspace(1e-4, 1 - 1e-4, 501), [1.0]])
    x = density.icdf(u, mean, sigma)
    assert ((x >= density.low) & (x <= density.high)).all()
    back = density.cdf(x, mean, sigma)
    inner = slice(1, -1)
    # cdf moves by pdf dx: an x rounded to 1e-15 of a turn is all that can be asked of narrow lobes.
    tolerance = 1e-9 + 4e-15 * density.pdf(x, mean, sigma)[inner]
    assert (np.abs(back - u)[inner] <= tolerance).all()


@settings(max_examples=300, deadline=None)
@given(mean=st.floats(-6, 6), sigma=st.floats(0.004, 20), u=st.floats(0, 1))
def test_longitudinal_agrees_with_scipy(mean: float, sigma: float, u: float) -> None:
    low, high = (-math.pi / 2 - mean) / sigma, (math.pi / 2 - mean) / sigma
    if min(abs(low), abs(high)) > 30 and low * high > 0:
        return  # SciPy's own truncnorm loses digits that far out; the family above covers it
    reference = stats.truncnorm(low, high, mean, sigma)
    x = float(longitudinal_normal.icdf(u, mean, sigma))
    expected = float(reference.ppf(u))
    width = float(reference.std()) + 1e-12
    if 1e-15 < u < 1 - 1e-6:  # from the upper end SciPy's own ppf loses digits
        assert abs(x - expected) <= 1e-6 * width + 1e-12
    assert float(longitudinal_normal.pdf(x, mean, sigma)) == pytest.approx(float(reference.pdf(x)), rel=1e-8, abs=1e-300)
    assert float(longitudinal_normal.cdf(x, mean, sigma)) == pytest.approx(float(reference.cdf(x)), rel=1e-8, abs=1e-12)


@pytest.mark.parametrize("sigma", [0.29, 0.3, 0.4, 1.0])
def test_an_interval_ends_where_u_does(sigma: float) -> None:
    # erf is 1 - 1e-15 at the far end, and its last digit is a tenth of what lies beyond.
    for mean in (0.83, -0.83):
        ends = longitudinal_normal.icdf(np.array([0.0, 1.0]), mean, sigma)
        np.testing.assert_allclose(ends, [-math.pi / 2, math.pi / 2], rtol=0, atol=1e-14)


def test_far_mean_is_an_exponential_at_the_near_end() -> None:
    # Far outside, exp(-(x - mean)²/2 sigma²) is exp(-d x) at the near end with d = distance/sigma².
    mean, sigma = -400.0, 2.0
    rate = (400 - math.pi / 2) / sigma**2
    x = longitudinal_normal.icdf(0.5, mean, sigma) + math.pi / 2
    assert float(x) == pytest.approx(math.log(2) / rate, rel=1e-3)


def test_even_normal_about_pi_is_the_periodic_normal() -> None:
    phi = np.linspace(-np.pi, np.pi, 101)
    np.testing.assert_allclose(even_normal.pdf(phi, np.pi, 0.7), periodic_normal.pdf(phi, np.pi, 0.7), rtol=1e-12)


@pytest.mark.parametrize("density", DENSITIES, ids=lambda d: d.name)
def test_single_precision_follows_double(density: Density) -> None:
    rng = np.random.default_rng(5)
    x = rng.uniform(density.low, density.high, 20000).astype(np.float32)
    mean = rng.uniform(-2, 4, 20000).astype(np.float32)
    sigma = np.exp(rng.uniform(np.log(0.02), np.log(5), 20000)).astype(np.float32)
    single = density.pdf(x, mean, sigma)
    double = density.pdf(x.astype(np.float64), mean.astype(np.float64), sigma.astype(np.float64))
    assert single.dtype == np.float32
    # z² carries the rounding of x - mean: up to z² · 2^-22 of the value where it matters at all.
    seen = double > 1e-6
    assert np.max(np.abs(single[seen] / double[seen] - 1)) <= 2e-3
    assert np.median(np.abs(single[seen] / double[seen] - 1)) <= 2e-6
    u = rng.random(20000, np.float32)
    drawn = density.icdf(u, mean, sigma)
    assert np.isfinite(drawn).all()
    assert (np.abs(drawn) <= np.float32(density.high)).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((5.0, 0.0, np.nan), "sigma must lie in"),
        ((5.0, 0.0, 0.0), "sigma must lie in [1e-05, 1e+09], got 0;"),
        ((np.nan, 0.0, 1.0), "x must lie in"),
        ((0.0, np.inf, 1.0), "mean must lie in"),
        (("a", 0.0, 1.0), "x must be an array of numbers"),
        ((np.zeros(3), np.zeros(2), 1.0), "shapes do not broadcast together: x (3,), mean (2,)"),
    ],
)
def test_bad_arguments(arguments: tuple, words: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        longitudinal_normal.pdf(*arguments)
    assert words in str(error.value)


@pytest.mark.parametrize("family", _core.lobe_families)
@pytest.mark.parametrize("even", [True, False])
def test_tables_of_every_family(family: str, even: bool) -> None:
    """The core's tables: ∫ pdf, cdf and inverse, samples' pdf, single precision beside double."""
    lobes = [[0.6, 0.4], [-1.2, 0.5], [3.3 if even else -4.0, 0.9], [0.1, 0.8], [0.5, 40.0]]
    nodes = np.broadcast_to(np.array(lobes), (1, 2, 5, 2)).copy()
    table = {dtype: core_table(nodes, np.ones((1, 2)), (0.0,), even, family, dtype) for dtype in (np.float64, np.float32)}

    def pdf(theta: np.ndarray, phi: np.ndarray, dtype: type) -> np.ndarray:
        out = np.empty(theta.size, dtype)
        own = [np.ascontiguousarray(np.broadcast_to(x, theta.shape), dtype) for x in (theta, 0.3, phi, 0)]
        table[dtype].pdf(*own, out)
        return out

    n = 800
    middle = (np.arange(n) + 0.5) / n
    theta, phi = (x.ravel() for x in np.meshgrid(np.pi * (middle - 0.5), 2 * np.pi * (middle - 0.5)))
    density = pdf(theta, phi, np.float64)
    assert abs(np.sum(density * np.cos(theta)) * 2 * (np.pi / n) ** 2 - 1) <= 1e-5  # the midpoint rule's own error
    np.testing.assert_allclose(pdf(theta, phi, np.float32), density, rtol=1e-4, atol=1e-12)

    u, viewer, alone = np.linspace(0.001, 0.999, 99), np.full(1, 0.3), np.zeros(1)
    for coordinate in (0, 1):
        for lobe in (0, 1):
            x, back = np.empty(99), np.empty(99)
            table[np.float64].lobe(coordinate, True, lobe, False, u, viewer, alone, x)
            table[np.float64].lobe(coordinate, False, lobe, False, x, viewer, alone, back)
            np.testing.assert_allclose(back, u, atol=1e-9)

    numbers = np.random.default_rng(3).random((5000, 3)).astype(np.float32)
    drawn = [np.empty(5000, np.float32) for _ in range(3)]
    table[np.float32].sample(np.full(5000, 0.3, np.float32), numbers.ravel(), np.zeros(5000, np.float32), *drawn)
    np.testing.assert_allclose(drawn[2], pdf(drawn[0], drawn[1], np.float64), rtol=1e-3)


@pytest.mark.parametrize("family", _core.lobe_families)
@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("price", [0.0, 1.0])
def test_a_fits_derivatives_of_every_family(family: str, even: bool, price: float) -> None:
    """The gradient of the loss beside its differences, without and with a price of ratios above 1/2."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    theta, d_theta = nodes[None] * np.pi / 2, weights[None] * np.pi / 2
    phi, d_phi = (nodes[None] + 1) * np.pi / 2, weights[None] * np.pi / 2
    target = np.exp(-((theta[:, :, None] - 0.2) ** 2)) * (1 + np.cos(phi[:, None]) ** 2)
    target /= np.sum(target * d_theta[:, :, None] * d_phi[:, None])
    start = np.array([[0.6, 0.4], [-1.6, 0.5], [3.3, 0.9], [0.4, 0.8], [0.5, 3.0]])

    def loss(parameters: np.ndarray, gradient: np.ndarray, hessian: np.ndarray) -> float:
        out = np.empty(1)
        _core.normal_equations(
            target, theta, d_theta, phi, d_phi, parameters[None], even, 0.5, price, out, gradient, hessian, family
        )
        return float(out[0])

    gradient, hessian = np.empty((1, 10)), np.empty((1, 10, 10))
    loss(start, gradient, hessian)
    for i in range(10):
        step = np.zeros(10)
        step[i] = 1e-6
        low, high = (loss(start + s * step.reshape(5, 2), np.empty(0), np.empty(0)) for s in (-1, 1))
        assert gradient[0, i] == pytest.approx((high - low) / 2e-6, rel=1e-5, abs=1e-7)


def test_a_family_that_is_none_is_refused() -> None:
    x = np.ones((1, 1, 1))
    with pytest.raises(ValueError, match='no family of lobes is called "square"'):
        _core.normal_equations(
            x, x, x, x, x, np.ones((1, 5, 1)), True, 1.0, 0.0, np.empty(1), np.empty(0), np.empty(0), "square"
        )
