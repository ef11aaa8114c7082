"""The reference's double integrals hold the truth: beside closed forms, beside NumPy's sums, beside the C++ core."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cuticle.reference.cases import ANGLES, Inputs, draw
from cuticle.reference.models import evaluate, formulas_of
from cuticle.scattering.bcsdf import luminance
from planted import directional_albedo, function

flint = pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")

from cuticle.reference import albedo_in_balls, among_strands_in_balls, inclinations, pieces  # noqa: E402
from cuticle.reference.albedo import albedo  # noqa: E402
from cuticle.reference.albedo_in_balls import albedo as albedo_among_strands  # noqa: E402
from cuticle.reference.balls import series_terms, working_precision  # noqa: E402
from cuticle.reference.making import values_of  # noqa: E402
from cuticle.reference.pieces import BEYOND, Interpolated, expanded, integrated  # noqa: E402
from cuticle.reference.triangle_wave import TriangleWave  # noqa: E402

GAUSSIAN = draw("marschner", 16, 11, near=False, longitudinal="gaussian")
DUAL = draw("dual_scattering", 16, 5, near=False, longitudinal="gaussian")
DUAL_24 = draw("dual_scattering", 24, 5, near=False, longitudinal="gaussian")


def test_an_interpolation_holds_its_function() -> None:
    """1/(s + x) and exp x, between points and a little past the ends; the pole at -s makes for narrow panels."""
    arb = flint.arb
    with working_precision(), series_terms(1):
        s = arb("0.05")

        def functions(x: Any) -> list[Any]:
            return [1 / (s + x), x.exp()]

        found = Interpolated(functions, functions, arb(0), arb(1), 1e-14)
        assert len(found.ends) > 3
        for x in (*np.random.default_rng(1).random(50), *map(float, found.ends)):
            piece = found.at(arb(x))
            for beyond in (0.0, BEYOND, -BEYOND):
                for p, off, truth in zip(
                    piece.at(flint.arb_series([arb(x + beyond)])), piece.off, functions(arb(x + beyond)), strict=True
                ):
                    assert (p[0] + off * arb(0, 1)).overlaps(truth)
                    assert float(off) <= 1e-13


def test_a_taylor_polynomial_holds_its_function() -> None:
    arb = flint.arb
    with working_precision():
        s = arb("0.05")
        pieces = list(expanded(lambda x, _: [1 / (s + x), x.exp()], [arb(0), arb(1)], 1e-14))
        assert len(pieces) > 3
        for x in np.random.default_rng(1).random(50):
            piece = next(p for p in pieces if x <= p.middle + p.half)
            with series_terms(1):
                values = piece.at(flint.arb_series([arb(x)]))
            for value, off, truth in zip(values, piece.off, (1 / (s + x), arb(x).exp()), strict=True):
                assert (value[0] + off * arb(0, 1)).overlaps(truth)
                assert float(off) <= 1e-14


def test_an_integral_by_taylor_series_holds_its_closed_form() -> None:
    arb = flint.arb
    with working_precision():
        s = arb("0.001")
        found = integrated(lambda x: 1 / (s + x), [arb(0), arb(1)], 1e-12)
        assert found.contains(((s + 1) / s).log())
        assert float(found.rad()) <= 1e-11
        with pytest.raises(ArithmeticError, match="not smooth"):
            integrated(lambda x: x.sqrt(), [arb(0), arb(1)], 1e-12)


def test_a_constant_known_up_to_a_radius_may_be_another_one_at_each_point() -> None:
    """With e = off sign(x) the integral of x (1 + e) over [-1, 1] is off, though that of x alone is 0 for any one e."""
    arb, off = flint.arb, 1e-3
    with working_precision():
        found = integrated(lambda x: x * arb(1, off), [arb(-1), arb(1)], 1e-12)
        assert found.contains(arb(off))
        assert found.contains(arb(-off))


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


@pytest.mark.parametrize("case", [2, pytest.param(9, marks=pytest.mark.slow), pytest.param(14, marks=pytest.mark.slow)])
def test_the_proven_albedo_among_strands_is_that_of_double_precision(case: int) -> None:
    """The other code interpolates averages in 160 nodes, and sums over theta_i and h in panels of its own."""
    one = DUAL_24.take([case])
    proven = albedo_among_strands(one.row(0))
    assert float(proven.rad()) <= 1e-9 * float(proven.mid())
    assert abs(albedo(formulas_of(one), one, 2)[0] / float(proven.mid()) - 1) <= 1e-8


@pytest.mark.slow
def test_other_panels_prove_the_same_albedo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Radii are about 1e-13: whatever a bound leaves out would show there."""
    row = DUAL_24.row(20)
    found = albedo_among_strands(row)
    for known in (among_strands_in_balls.energies_of, albedo_in_balls._averages_on, albedo_in_balls._ends):
        known.cache_clear()
    monkeypatch.setattr(inclinations, "_WIDEST", 1.1)
    monkeypatch.setattr(inclinations, "_REACH", 10)
    monkeypatch.setattr(pieces, "_SUMMED", 20)
    monkeypatch.setattr(pieces, "_TERMS", 34)
    monkeypatch.setattr(pieces, "_ORDERS", (30, 44))
    other = albedo_among_strands(row)
    assert found.mid() != other.mid()
    assert found.overlaps(other)
    assert max(float(found.rad()), float(other.rad())) <= 1e-11


@pytest.mark.slow
def test_there_is_no_albedo_where_light_behind_has_no_sum() -> None:
    row = DUAL.row(2) | {f"sigma_a_{c}": 1e-3 for c in "rgb"}
    assert albedo_among_strands(row) is None
    assert albedo_among_strands(row | {"d_b": 0.0}) is not None


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
