"""The scattering functions against evaluations that share no code with them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.stats import poisson

import cuticle
from conftest import sphere
from cuticle import DualScattering, Fibre, Marschner, _core
from cuticle.scattering.presets import PRESETS

SMOOTH = Fibre(alpha_R=-7.5, beta_R=7.5, sigma_a=0.6, beta_N=3)
VIEWERS = np.radians([-80, -45, 0, 30, 80])


def fresnel(cos_i: np.ndarray, eta: float) -> np.ndarray:
    sin_t = np.sqrt(1 - cos_i**2) / eta
    cos_t = np.sqrt(1 - sin_t**2)
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    return 0.5 * (((cos_i - eta * cos_t) / (cos_i + eta * cos_t)) ** 2 + parallel**2)


def histogram_n(theta_d: float, fibre: Fibre, bins: int = 1440) -> np.ndarray:
    """N_p(phi) in bins of phi from 0 to 2 pi: a histogram of phi_p(h) over 40,000 h, smoothed by beta_N."""
    h = (np.arange(40_000) + 0.5) / 20_000 - 1
    eta_p = math.sqrt(fibre.eta**2 - math.sin(theta_d) ** 2) / math.cos(theta_d)
    gamma_i, gamma_t = np.arcsin(h), np.arcsin(h / eta_p)
    f = fresnel(math.cos(theta_d) * np.cos(gamma_i), fibre.eta)
    cos_theta_t = math.sqrt(1 - (math.sin(theta_d) / fibre.eta) ** 2)
    transmitted = np.exp(-2 * fibre.absorption[0] * np.cos(gamma_t) / cos_theta_t)
    frequency = np.fft.fftfreq(bins, 1 / bins)
    smoothing = np.exp(-0.5 * (frequency * math.radians(fibre.beta_N)) ** 2)
    out = []
    for p in range(3):
        a = f if p == 0 else (1 - f) ** 2 * f ** (p - 1) * transmitted**p
        phi = 2 * p * gamma_t - 2 * gamma_i + p * math.pi
        counts, _ = np.histogram(phi % (2 * math.pi), bins, (0, 2 * math.pi), weights=0.5 * a * 2 / 40_000)
        out.append(np.fft.ifft(np.fft.fft(counts) * smoothing).real * bins / (2 * math.pi))
    return np.array(out)


@pytest.mark.parametrize("fibre", [SMOOTH, Fibre(alpha_R=0, beta_R=10, sigma_a=0.2, beta_N=1), Fibre.preset("document")])
@pytest.mark.parametrize("degrees", [0, 20, 45, 60, 70, 75.25, 80])
def test_azimuthal_functions_agree_with_a_histogram(fibre: Fibre, degrees: float) -> None:
    theta_d = math.radians(degrees)
    reference = histogram_n(theta_d, fibre)
    phi = (np.arange(1440) + 0.5) / 1440 * 2 * np.pi
    model = Marschner(fibre)
    for p, lobe in enumerate(("R", "TT", "TRT")):
        # theta_i = -theta_d, theta_r = theta_d: theta_h = 0, so M is known by hand.
        g = math.exp(-0.5 * (fibre.alpha[p] / fibre.beta[p]) ** 2) / (fibre.beta[p] * math.sqrt(2 * math.pi))
        found = model.eval(-theta_d, theta_d, phi, lobes=lobe)[:, 0] * math.cos(theta_d) ** 2 / g
        assert np.max(np.abs(found - reference[p])) <= 0.02 * reference[p].max()


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("theta_r", VIEWERS)
def test_white_furnace(name: str, theta_r: float) -> None:
    fibre = Fibre.preset(name).replace(sigma_a=0.0)
    theta, phi, cell = sphere(720, 360)
    f = Marschner(fibre, "energy_conserving").eval(theta, theta_r, phi)[..., 0]
    energy = float((f * np.cos(theta) ** 2).sum() * cell)
    assert abs(energy - 1) <= 1e-3  # the issue asks for 1 %; quadrature and table leave less than 1e-3


def test_even_in_phi_and_reciprocal_where_it_says_so() -> None:
    rng = np.random.default_rng(3)
    ti, tr, phi = rng.uniform(-1.5, 1.5, 500), rng.uniform(-1.5, 1.5, 500), rng.uniform(-np.pi, np.pi, 500)
    for model in (Marschner(SMOOTH), Marschner(SMOOTH, "energy_conserving"), DualScattering(SMOOTH, 2)):
        np.testing.assert_allclose(model.eval(ti, tr, phi), model.eval(ti, tr, -phi), rtol=1e-9)
        assert model.even
    gaussian = Marschner(SMOOTH)
    np.testing.assert_allclose(gaussian.eval(ti, tr, phi), gaussian.eval(tr, ti, phi), rtol=1e-9)


@pytest.mark.parametrize("strands", [0, 0.4, 1, 2.5, 8])
@pytest.mark.parametrize("formulation", ["exact", "zinke2008"])
def test_parts_add_up(strands: float, formulation: str) -> None:
    model = DualScattering(Fibre.preset("brown"), strands, formulation)
    theta, phi, _ = sphere(40, 20)
    parts = sum(model.eval(theta, 0.3, phi, lobes=part) for part in ("R", "TT", "TRT", "back"))
    np.testing.assert_allclose(parts, model.eval(theta, 0.3, phi), rtol=1e-12)
    assert (parts >= 0).all()


@pytest.mark.parametrize("a_f", [0.5, 0.8, pytest.param(0.9, marks=pytest.mark.slow)])
def test_exact_backscatter_agrees_with_a_walk_over_strands(a_f: float) -> None:
    a_b, alpha_f, alpha_b, beta_f, beta_b = 0.09, 0.03, -0.1, 0.12, 0.2
    energy, shift, deviation = _core.backscatter(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b, True, 0.7)
    rng = np.random.default_rng(11)
    count = 2_000_000
    depth, heading, angle = np.zeros(count, int), np.ones(count, int), np.zeros(count)
    events, back_angles, alive = 0, [], np.arange(count)
    while len(alive):
        events += 1
        u = rng.random(len(alive))
        forward, back = u < a_f, (u >= a_f) & (u < a_f + a_b)
        angle[alive] += np.where(forward, alpha_f, alpha_b) + np.where(forward, beta_f, beta_b) * rng.normal(size=len(alive))
        heading[alive[back]] *= -1
        depth[alive] += heading[alive]
        out = (forward | back) & (depth[alive] < 0)
        if events > 1:  # the first strand's own single backscatter is not counted
            back_angles.append(angle[alive[out]])
        alive = alive[(forward | back) & ~out]
    returned = np.concatenate(back_angles)
    # 1 %: at 2e6 walks the rarest of the three energies has a standard error of 0.3 %.
    assert len(returned) / count == pytest.approx(energy, rel=0.01)
    assert returned.std() == pytest.approx(deviation, rel=0.01)
    assert abs(returned.mean() - shift) <= 0.01 * deviation


@pytest.mark.parametrize("expected", [0.0, 0.05, 0.8, 3.0, 12.0])
def test_an_expected_number_of_strands_as_printed_is_the_mean_over_poissons(expected: float) -> None:
    model = DualScattering(Fibre.preset("brown"), formulation="zinke2008")
    theta, phi, cell = sphere(180, 60)
    mean = model.expected(theta, 0.3, phi, expected)
    sum_over_n = sum(
        poisson.pmf(n, expected) * model.with_strands(n).eval(theta, 0.3, phi) for n in range(int(4 * expected) + 12)
    )
    weight = (np.cos(theta) ** 2 * cell * np.ones_like(phi))[..., None]
    energy = (mean * weight).sum(axis=(0, 1))
    # Energies are those of the sum, but for the Gaussian's cut at the poles; one M of the mean width stands for a sum of Ms
    # of all widths, which is a little more peaked and longer in its tails.
    np.testing.assert_allclose(energy, (sum_over_n * weight).sum(axis=(0, 1)), rtol=0.02)
    assert (0.5 * (np.abs(mean - sum_over_n) * weight).sum(axis=(0, 1)) <= 0.03 * energy).all()


def test_strands_behind_send_back_what_a_half_space_of_them_does() -> None:
    model = DualScattering(Fibre.preset("blond"))
    at = (0.1, 0.2, 0.5)
    half_space = model.expected(*at, 2.0, behind=1e4)
    np.testing.assert_allclose(model.expected(*at, 2.0, behind=1e3), half_space, rtol=1e-9)
    # Endless to the sides as well, a medium scatters more of the light on slanted ways.
    assert (model.expected(*at, 2.0) > half_space).all()
    none = model.expected(*at, 0.0, behind=0.0)
    np.testing.assert_allclose(none, model.eval(*at, lobes=("R", "TT", "TRT")), rtol=1e-12)
    back = model.expected(*at, 0.0, behind=[0.5, 1, 2, 4, 8, 16], lobes="back")
    assert (np.diff(back, axis=0) > 0).all()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: m.expected(0, 0, 0, -1.0), "strands must be in [0, 10,000], got -1"),
        (lambda m: m.expected(0, 0, 0, [1.0, np.nan]), "strands must be in [0, 10,000], got nan"),
        (lambda m: m.expected(0, 0, 0, 1.0, behind=2e4), "behind must be in [0, 10,000], got 20000"),
        (lambda m: DualScattering(m.fibre, 0, "zinke2008").expected(0, 0, 0, 1.0, behind=2.0), "leave behind out"),
        (lambda m: m.expected([0, 0], 0, [0, 0, 0], 1.0), "shapes do not broadcast together"),
    ],
)
def test_bad_expectations_are_told(call: Callable[[DualScattering], object], words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        call(DualScattering(Fibre.preset("brown")))


def test_printed_backscatter_is_as_printed() -> None:
    # ā_f .8, ā_b .1, ᾱ_f 2°, ᾱ_b -6°: the printed mean is 7.13°. ā_f .95, ā_b .05, widths of marschner: see below.
    _, shift, _ = _core.backscatter(0.8, 0.1, math.radians(2), math.radians(-6), 0.1, 0.1, False, 0.7)
    assert math.degrees(shift) == pytest.approx(7.13, abs=0.005)
    f, b, bf, bb = 0.7, 0.2, 0.15, 0.25
    energy, _, deviation = _core.backscatter(f, b, 0, 0, bf, bb, False, 0.7)
    a1, a3 = b * f**2 / (1 - f**2), b**3 * f**2 / (1 - f**2) ** 3
    assert energy == pytest.approx(a1 + a3, rel=1e-12)
    top = b * math.sqrt(2 * bf**2 + bb**2) + b**3 * math.sqrt(2 * bf**2 + 3 * bb**2)
    assert deviation == pytest.approx((1 + 0.7 * f**2) * top / (b + b**3 * (2 * bf + 3 * bb)), rel=1e-12)


def test_zinke2008_is_as_printed() -> None:
    """Rebuild f for two strands from the printed formulas and the fibre's own lobes."""
    fibre, n = Fibre.preset("document"), 2
    model, single = DualScattering(fibre, n), Marschner(fibre)
    theta_i, theta_r, phi = 0.3, -0.5, 2.1
    theta_h, theta_d = (theta_i + theta_r) / 2, (theta_r - theta_i) / 2
    a = DualScattering(fibre).averages(theta_d)

    def g(x: float, variance: float) -> float:
        return math.exp(-0.5 * x * x / variance) / math.sqrt(2 * math.pi * variance)

    spread = n * float(a.beta_f[0]) ** 2
    turn = np.linspace(-np.pi / 2, np.pi / 2, 4001)
    scatter = 0.0
    for p, lobe in enumerate(("R", "TT", "TRT")):
        own = g(theta_h - fibre.alpha[p], fibre.beta[p] ** 2)
        mean = trapezoid(single.eval(theta_i, theta_r, phi - turn, lobes=lobe)[:, 0], turn) / np.pi
        scatter += mean * g(theta_h - fibre.alpha[p], fibre.beta[p] ** 2 + spread) / own
    width = float(a.back_deviation[0]) ** 2 + spread
    back = 2 * float(a.back_energy[0]) * g(theta_h - float(a.back_shift[0]), width) / (np.pi * math.cos(theta_d) ** 2)
    transmittance = fibre.d_f * float(a.a_f[0]) ** n
    expected = transmittance * fibre.d_f * (scatter + np.pi * fibre.d_b * back)
    # 2e-3: tables of half-degree rows against the rows' own interpolation here.
    assert float(model.eval(theta_i, theta_r, phi)[0]) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("model", [
    DualScattering(SMOOTH), DualScattering(SMOOTH, formulation="zinke2008"), Marschner(SMOOTH),
    Marschner(SMOOTH, "energy_conserving"), cuticle.Chiang(beta_m=0.3, beta_n=0.4, sigma_a=(0.2, 0.5, 1)),
], ids=["exact", "zinke2008", "gaussian", "conserving", "chiang"])  # fmt: skip
def test_rows_of_azimuths_are_what_each_direction_alone_is(model: cuticle.Bcsdf) -> None:
    """Azimuths that come in rows are looked up once, in vectors: rows that stay, change, shrink, and break off."""
    rng = np.random.default_rng(3)
    phi = rng.uniform(-np.pi, np.pi, (2, 61))
    columns: list[list[float]] = [[], [], [], [], []]  # theta_i, theta_r, phi, and how many strands are before and behind
    for _ in range(400):
        row = phi[rng.integers(2), : rng.choice([1, 2, 3, 4, 9, 30, 61])]
        values = (rng.choice([0.3, -0.9]), rng.choice([0.2, 0.7]), row, *rng.choice([1, 4], 2))
        for column, value in zip(columns, values, strict=True):
            column.extend(np.broadcast_to(value, row.shape))
    ti, tr, ph, n, behind = map(np.array, columns)
    calls = [lambda of: model.eval(ti[of], tr[of], ph[of])]
    if isinstance(model, DualScattering):
        calls += [lambda of, k=k: model.with_strands(k).eval(ti[of], tr[of], ph[of]) for k in (0.5, 3)]
        end = (lambda of: behind[of]) if model.formulation == "exact" else (lambda of: None)
        calls.append(lambda of: model.expected(ti[of], tr[of], ph[of], n[of], behind=end(of)))
    order = rng.permutation(ti.size)
    for f in calls:
        alone = f(order)
        np.testing.assert_allclose(f(slice(None))[order], alone, rtol=1e-13)


def test_between_none_and_one_strand_it_is_a_blend() -> None:
    theta, phi, _ = sphere(30, 20)
    for formulation in ("exact", "zinke2008"):
        f = [DualScattering(Fibre.preset("brown"), n, formulation).eval(theta, 0.4, phi) for n in (0, 0.25, 1)]
        np.testing.assert_allclose(f[1], 0.75 * f[0] + 0.25 * f[2], rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: DualScattering(Fibre(sigma_a=0.0)), "a_f + a_b, must stay below 1, got 1 "),
        (lambda: DualScattering(Fibre(beta_R=15, sigma_a=0.2), 1, "zinke2008"), 'raise sigma_a, or use formulation="exact"'),
        (lambda: DualScattering(SMOOTH, -1), "strands must be in [0, 10000], got -1"),
        (lambda: DualScattering(SMOOTH, float("nan")), "strands must be in [0, 10000], got nan"),
        (lambda: DualScattering(SMOOTH, 1, "zinke"), "formulation must be one of exact, zinke2008; got 'zinke'"),
        (lambda: Marschner(SMOOTH, "box"), "longitudinal must be one of gaussian, energy_conserving; got 'box'"),
        (lambda: Marschner("brown"), "fibre must be a cuticle.Fibre, got str"),
        (lambda: Marschner(SMOOTH).eval(90.0, 0, 0), "theta_i must lie in [-1.5708, 1.5708], got 90"),
        (lambda: Marschner(SMOOTH).eval(0, [0, np.nan], 0), "got nan at theta_r[1]"),
        (lambda: Marschner(SMOOTH).eval(np.zeros(3), np.zeros(2), 0), "theta_i (3,), theta_r (2,)"),
        (lambda: Marschner(SMOOTH).eval(0, 0, 0, lobes="back"), "lobes must be one of R, TT, TRT; got 'back'"),
    ],
)
def test_bad_input(make, words: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        make()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_finite_everywhere() -> None:
    edges = np.array([-np.pi / 2, -1.57, -1e-9, 0, 0.5, 1.5707963, np.pi / 2])
    phi = np.array([-np.pi, -1e-12, 0, 1.5, np.pi])
    for name in PRESETS:
        for strands in (0, 0.5, 1, 100):
            f = DualScattering(Fibre.preset(name), strands).eval(edges[:, None, None], edges[:, None], phi)
            assert np.isfinite(f).all()
            assert (f >= 0).all()


def test_tabulate() -> None:
    model = DualScattering(Fibre.preset("document"))
    d = cuticle.tabulate(model, np.radians(30))
    # The draft's table 1: the highlight lies opposite in phi and at 27° - 3°... of -theta_r.
    assert abs(abs(np.degrees(d.peak.phi)) - 180) <= 10
    assert abs(np.degrees(d.peak.theta_i) + 31) <= 2
    weight = np.cos(d.theta_i)[:, None] * np.pi / 360 * 2 * np.pi / 720
    assert float(d.energy[0]) == pytest.approx(float((d.luminance * weight).sum()), rel=1e-9)
    assert float((d.marginal_phi[:, 0] * 2 * np.pi / 720).sum()) == pytest.approx(float(d.energy[0]), rel=1e-9)
    colour = cuticle.tabulate(Marschner(Fibre.preset("brown")), 0.0, n_theta=50, n_phi=40)
    np.testing.assert_allclose(colour.luminance, colour.values @ [0.2126, 0.7152, 0.0722])
    with pytest.raises(ValueError, match="theta_r must be in"):
        cuticle.tabulate(model, 30.0)
