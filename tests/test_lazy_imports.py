"""What a user waits for at first: no step imports SciPy, and what is written out for that is SciPy's."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import trapezoid as scipys_trapezoid
from scipy.stats import poisson

from cuticle._support.quadrature import trapezoid
from cuticle.scattering.through_strands import poisson_shares


@pytest.mark.parametrize(
    "code",
    [
        "import cuticle.cli.export",
        "import cuticle.cli.fit",
        "import cuticle; cuticle.family('chiang'); cuticle.Sampler; cuticle.Fibre; cuticle.DualScattering",
        "import cuticle; cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset('black')), 1, strands=[0, 1, 2])",
        "import mitsuba as mi; mi.set_variant('scalar_rgb'); import cuticle.mitsuba\n"
        "mi.load_dict({'type': 'cuticle', 'fibre': 'brown'})",
    ],
)
def test_a_first_step_imports_nothing_of_scipy(code: str) -> None:
    if "mitsuba" in code and importlib.util.find_spec("mitsuba") is None:
        pytest.skip("Mitsuba is not installed")
    asked = f"{code}\nimport sys; print(*(m for m in sys.modules if m.split('.')[0] == 'scipy'))"
    ran = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert not ran.stdout.split()


def test_weights_of_the_trapezoidal_rule() -> None:
    x = np.sort(np.random.default_rng(2).random(9))
    np.testing.assert_allclose(trapezoid(x) @ np.exp(x), scipys_trapezoid(np.exp(x), x), rtol=1e-14)


def test_poissons_shares() -> None:
    numbers = np.arange(1, 33)
    for mean in (1e-6, 1.0, 4.0, 16.0):
        np.testing.assert_allclose(poisson_shares(numbers, mean), poisson.pmf(numbers, mean), rtol=1e-12)
