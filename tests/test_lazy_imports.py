"""What a user waits for at first: no step imports more than it needs, and our own interpolation is SciPy's."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import trapezoid as scipys_trapezoid
from scipy.interpolate import PchipInterpolator
from scipy.stats import poisson

from cuticle._support.interpolation import Monotone
from cuticle._support.quadrature import trapezoid

SLOW = (
    "scipy.interpolate",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.sparse",
    "scipy.spatial",
    "scipy.special",
    "scipy.stats",
)


@pytest.mark.parametrize(
    ("code", "allowed"),
    [
        ("import cuticle.cli.export", ()),
        ("import cuticle.cli.fit", ()),
        ("import cuticle; cuticle.family('chiang'); cuticle.Sampler; cuticle.Fibre; cuticle.DualScattering", ()),
        ("import cuticle; cuticle.fit(cuticle.Marschner(cuticle.Fibre.preset('black')), 1)", ("scipy.sparse",)),
        ("import mitsuba as mi; mi.set_variant('scalar_rgb'); import cuticle.mitsuba\n"
         "mi.load_dict({'type': 'cuticle', 'fibre': 'brown'})", ()),
    ],
)  # fmt: skip
def test_a_first_step_imports_no_more_of_scipy_than_it_needs(code: str, allowed: tuple[str, ...]) -> None:
    if "mitsuba" in code and importlib.util.find_spec("mitsuba") is None:
        pytest.skip("Mitsuba is not installed")
    asked = f"{code}\nimport sys; print(*(m for m in {SLOW} if m in sys.modules))"
    ran = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert set(ran.stdout.split()) <= set(allowed)


@pytest.mark.parametrize("n", [2, 3, 5, 30])
@pytest.mark.parametrize("axis", [0, 1, -1])
def test_the_monotone_cubic_is_scipys(n: int, axis: int) -> None:
    rng = np.random.default_rng(n)
    x, shape = np.sort(rng.random(n)), [3, 4, 2]
    shape[axis] = n
    rise, fall = rng.normal(size=shape), rng.normal(size=shape).cumsum(axis=axis)
    for y in (rise, fall, np.round(fall), np.zeros(shape)):
        for at in (np.linspace(-0.3, 1.3, 200), 0.3, rng.random((4, 5)), x):
            expected = PchipInterpolator(x, y, axis=axis)(at)
            found = Monotone(x, y, axis)(at)
            assert found.shape == expected.shape
            # The ends' cubics grow beyond the points: rounding is relative to the largest.
            np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12 * max(np.abs(expected).max(), 1))


def test_weights_of_the_trapezoidal_rule() -> None:
    x = np.sort(np.random.default_rng(2).random(9))
    np.testing.assert_allclose(trapezoid(x) @ np.exp(x), scipys_trapezoid(np.exp(x), x), rtol=1e-14)


def test_poissons_shares() -> None:
    """As through_strands.py writes them."""
    numbers = np.arange(1, 33)
    ours = np.exp(numbers * np.log(4.0) - 4.0 - np.cumsum(np.log(numbers)))
    np.testing.assert_allclose(ours, poisson.pmf(numbers, 4.0), rtol=1e-12)
