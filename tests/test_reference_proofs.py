"""The reference's double integrals hold the truth: beside closed forms, beside NumPy's sums, beside the C++ core."""

from __future__ import annotations

import numpy as np
import pytest

from cuticle.reference.cases import ANGLES, Inputs, draw
from cuticle.reference.models import evaluate, formulas_of
from cuticle.scattering.bcsdf import luminance
from planted import directional_albedo, function

flint = pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")

from cuticle.reference.albedo import albedo  # noqa: E402
from cuticle.reference.balls import working_precision  # noqa: E402
from cuticle.reference.making import values_of  # noqa: E402
from cuticle.reference.rectangles import integrate_over_rectangle  # noqa: E402
from cuticle.reference.triangle_wave import TriangleWave  # noqa: E402

GAUSSIAN = draw("marschner", 16, 11, near=False, longitudinal="gaussian")
DUAL = draw("dual_scattering", 16, 5, near=False, longitudinal="gaussian")


def test_an_integral_over_a_rectangle_holds_its_closed_form() -> None:
    """∫∫ dx dy/(s + x + y) over the unit square, with its pole at a distance s; the sum of two logarithms is the truth."""
    arb = flint.arb
    with working_precision():
        s = arb("0.001")
        (found,) = integrate_over_rectangle(lambda x: lambda y: [1 / (s + x + y)], (arb(0), arb(1)), (arb(0), arb(1)), [1.0])
        truth = (s + 2) * (s + 2).log() - 2 * (s + 1) * (s + 1).log() + s * s.log()
        assert found.contains(truth)
        assert float(found.rad()) <= 1e-11  # the goal is 2^-40 of the size


@pytest.mark.parametrize("beta", [0.004, 0.1, 0.5, 1.5])
def test_the_smoothed_triangle_wave_holds_a_convolution(beta: float) -> None:
    t, step = np.linspace(-9 * beta, 9 * beta, 400_001, retstep=True)  # the trapezoidal rule: off by step² there
    normal = np.exp(-((t / beta) ** 2) / 2) / (beta * np.sqrt(2 * np.pi))
    with working_precision():
        wave = TriangleWave(flint.arb(beta))
        for x in (0.0, 0.01, 1.0, np.pi - 0.05, 3.3, -7.0):
            triangle = np.abs((x - t + np.pi) % (2 * np.pi) - np.pi) / np.pi
            assert abs(float(wave(flint.arb(x)).mid()) - (normal * triangle).sum() * step) <= 1e-8
            assert float(wave(flint.arb(x)).rad()) <= 1e-16


@pytest.mark.parametrize("case", [2, 9])
def test_the_gaussian_density_is_that_of_f_summed_over_directions(case: int) -> None:
    one = GAUSSIAN.take([case])
    with working_precision():
        proven = values_of(one, 0, evaluate(formulas_of(one), one).around[0].tolist(), density=True).pdf()
        assert float(proven.rad()) <= 1e-12 * float(proven.mid())
    row = one.row(0)
    f = function(one, row).eval(*(row[k] for k in ANGLES))
    core = float(luminance(f)) * np.cos(row["theta_i"]) / directional_albedo(one, row)
    assert abs(core / float(proven.mid()) - 1) <= 0.02  # N_p of the core's tables is within 2 % of its peak


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [GAUSSIAN, DUAL], ids=["gaussian", "dual scattering"])
def test_the_albedo_is_the_cores_sum_over_directions(inputs: Inputs) -> None:
    own = albedo(formulas_of(inputs), inputs)
    core = np.array([directional_albedo(inputs, inputs.row(i)) for i in range(len(inputs))])
    np.testing.assert_allclose(core, own, rtol=0.02)  # the core's tables, of averages, too


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [GAUSSIAN, DUAL], ids=["gaussian", "dual scattering"])
def test_double_precision_agrees_with_what_is_proven(inputs: Inputs) -> None:
    double = evaluate(formulas_of(inputs), inputs, density=True)
    with working_precision():
        for i in range(len(inputs)):
            proven = values_of(inputs, i, double.around[i].tolist(), density=True)
            np.testing.assert_allclose(double.f[i], [float(proven.f(c).mid()) for c in range(3)], rtol=1e-6)
            np.testing.assert_allclose(double.pdf[i], float(proven.pdf().mid()), rtol=2e-5)  # 96 nodes for averages
            assert all(float(proven.f(c).rad()) <= 1e-10 * float(proven.f(c).mid()) for c in range(3))
