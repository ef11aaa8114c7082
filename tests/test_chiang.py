"""Chiang's near and far field: energy, density, samples, the offset integrated, and Mitsuba's own `hair`."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import special

import cuticle
from cuticle import Chiang, _core, conventions
from cuticle._support.quadrature import gauss_legendre

REC709 = np.array([0.2126, 0.7152, 0.0722])
THETA, THETA_WEIGHT = gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, 121), 4)
PHI, PHI_WEIGHT = gauss_legendre(np.linspace(-np.pi, np.pi, 181), 4)
HAIRS = [
    {"beta_m": 0.3, "beta_n": 0.3, "alpha": 2.0},
    {"beta_m": 0.1, "beta_n": 0.1, "alpha": 2.0},
    {"beta_m": 0.8, "beta_n": 0.8, "alpha": -3.0},
    {"beta_m": 1.0, "beta_n": 1.0, "alpha": 0.0},
    {"beta_m": 0.25, "beta_n": 0.3, "alpha": 20.0},
]


def over_sphere(f: np.ndarray) -> np.ndarray:
    """∫ f d omega of values at THETA x PHI."""
    return np.einsum("a,b,ab...->...", THETA_WEIGHT * np.cos(THETA), PHI_WEIGHT, f)


@pytest.mark.parametrize("hair", [HAIRS[0], *(pytest.param(h, marks=pytest.mark.slow) for h in HAIRS[1:])], ids=str)
def test_nothing_is_lost_where_nothing_is_absorbed(hair: dict[str, float]) -> None:
    model = Chiang(sigma_a=0.0, **hair)
    for theta_r in np.radians([0, 60, -85, 89.9]):
        far = model.eval(THETA[:, None], theta_r, PHI[None, :])[..., 0] * np.cos(THETA)[:, None]
        assert over_sphere(far) == pytest.approx(1, abs=1e-3)
        for h in (0.0, 0.7, -0.99):
            near = model.near(h)
            f = near.eval(THETA[:, None], theta_r, PHI[None, :])[..., 0] * np.cos(THETA)[:, None]
            p = near.pdf(THETA[:, None], theta_r, PHI[None, :])
            assert over_sphere(f) == pytest.approx(1, abs=1e-3)
            assert over_sphere(p) == pytest.approx(1, abs=1e-5)


def test_the_far_field_is_the_mean_over_h() -> None:
    rng = np.random.default_rng(1)
    gamma, weight = gauss_legendre(np.array([-np.pi / 2, np.pi / 2]), 600)
    for hair, melanin, tolerance in (((0.3, 0.3), 1.3, 0.01), ((0.1, 0.15), 8.0, 0.01), ((0.25, 0.2), 0.3, 0.01)):
        model = Chiang(beta_m=hair[0], beta_n=hair[1], eumelanin=melanin)
        for theta_r in (-1.3, 0.0, 0.5):
            ti, phi = rng.uniform(-1.5, 1.5, 100), rng.uniform(-np.pi, np.pi, 100)
            each = model.near(np.sin(gamma)).eval(ti[:, None], theta_r, phi[:, None])
            mean = np.einsum("h,phc->pc", weight * np.cos(gamma) / 2, each)
            far = model.eval(ti, theta_r, phi)
            np.testing.assert_allclose(far, mean, rtol=tolerance, atol=1e-4 * mean.max())
            parts = sum(model.eval(ti, theta_r, phi, lobes=p) for p in ("R", "TT", "TRT", "rest"))
            np.testing.assert_allclose(parts, far, rtol=1e-12)


def test_near_samples_are_of_f_itself() -> None:
    rng = np.random.default_rng(2)
    for hair in HAIRS[:3]:
        near = Chiang(eumelanin=1.3, **hair).near(0.4)
        s = near.sample(0.7, rng.random((50_000, 3)))
        weight = near.eval(s.theta_i, 0.7, s.phi) @ REC709 * np.cos(s.theta_i) / s.pdf
        np.testing.assert_allclose(weight, weight.mean(), rtol=1e-9)  # ESS 1 in luminance
        np.testing.assert_array_equal(near.pdf(s.theta_i, 0.7, s.phi), s.pdf)
        assert cuticle.measure(near, near, 0.7).ess == pytest.approx(1, abs=2e-5)


def test_lobes_drawn_for_all_channels_trade_luminance_for_blue() -> None:
    model = Chiang(eumelanin=1.3)
    bright, every = (cuticle.measure(model.near(0.4, objective=o), model.near(0.4), 0.7) for o in ("luminance", "rgb"))
    assert min(bright.ess_channels) < 0.5
    assert min(every.ess_channels) > 0.7
    assert 0.8 < every.ess < bright.ess
    assert np.mean([1 / e for e in every.ess_channels]) < np.mean([1 / e for e in bright.ess_channels])
    limits = cuticle.channel_bounds(model.near(0.4), 0.7)
    assert min(every.ess_channels) == pytest.approx(min(limits.rgb), abs=0.02)
    with pytest.raises(ValueError, match="objective must be one of"):
        model.near(0.4, objective="red")


def test_edges_of_the_random_numbers_give_directions() -> None:
    last = 1 - 2.0**-53
    u = np.array(np.meshgrid(*[[0.0, 1e-300, 0.5, last]] * 3)).reshape(3, -1).T
    for hair in HAIRS:
        for theta_r in (-np.pi / 2, 0.0, np.pi / 2):
            for h in (-1.0, 0.0, 1.0):
                s = Chiang(eumelanin=0.3, **hair).near(h).sample(theta_r, u)
                assert np.isfinite(np.array(s)).all()
                assert (np.abs(s.theta_i) <= np.pi / 2).all()
                assert (np.abs(s.phi) <= np.pi).all()


def test_the_bessel_function_is_scipys() -> None:
    """5e-7 is Abramowitz and Stegun's 1.9e-7 over 0.4. They change polynomials at 3.75; peers are 2 % off just below 12."""
    x = np.concatenate([[0, 3.74, 3.75, 3.76, 11.9, 12, 12.1], np.geomspace(1e-3, 1e4, 400)])
    ours = np.array([_core.i0_scaled(float(v)) for v in x])
    np.testing.assert_allclose(ours, special.i0e(x), rtol=5e-7)


def mitsubas_bessel(x: np.ndarray) -> np.ndarray:
    """exp(-x) I0(x) as Mitsuba 3.9.1 has it: ten terms of the series up to 12, beyond an expansion with a halved term."""
    series = sum((x * x / 4) ** i / math.factorial(i) ** 2 for i in range(11)) * np.exp(-x)
    return np.where(x > 12, np.exp(0.5 * (np.log(1 / (2 * np.pi * np.maximum(x, 1))) + 1 / (8 * np.maximum(x, 1)))), series)


MITSUBA = pytest.mark.skipif(importlib.util.find_spec("mitsuba") is None, reason="Mitsuba 3 is not installed")
# Its hair as a scene has it: with nothing, with each parameter alone, with several.
MITSUBAS: list[tuple[dict[str, Any], float, float]] = [  # parameters, h, theta_r
    ({}, 0.0, 0.4),
    ({"longitudinal_roughness": 0.1}, 0.5, 1.3),
    ({"azimuthal_roughness": 0.7}, -0.9, -1.2),
    ({"scale_tilt": -5.0}, 0.3, 0.0),
    ({"int_ior": "bk7", "ext_ior": "water"}, 0.2, 0.4),
    ({"ext_ior": 1.2}, 0.2, 0.4),
    ({"eumelanin": 0.3}, 0.0, 0.4),
    ({"pheomelanin": 1.0, "scale": 3.0}, -0.5, 0.8),
    ({"sigma_a": {"type": "rgb", "value": [0.2, 0.25, 0.7]}, "scale": 3.0}, 0.0, 0.4),
    ({"longitudinal_roughness": 0.8, "eumelanin": 8.0, "pheomelanin": 0.0, "int_ior": 1.4}, 0.5, 1.3),
]


@MITSUBA
@pytest.mark.parametrize(("given", "h", "theta_r"), MITSUBAS, ids=str)
def test_mitsubas_hair_is_this_but_for_its_bessel_function(given: dict[str, Any], h: float, theta_r: float) -> None:
    rng = np.random.default_rng(3)
    ti, phi = rng.uniform(-1.5, 1.5, 1000), rng.uniform(-np.pi, np.pi, 1000)
    ours = Chiang(**conventions.from_host("mitsuba", **given)).near(h)
    f, g = cuticle.from_mitsuba("hair", h=h, **given).eval(ti, theta_r, phi), ours.eval(ti, theta_r, phi)
    seen = g.max(axis=1) > 1e-6
    assert np.abs(f[seen] / g[seen] - 1).max() < 0.03
    # Each lobe with the Bessel function exchanged: nothing is left but single precision.
    exchanged = np.zeros_like(g)
    for k, part in enumerate(("R", "TT", "TRT", "rest")):
        x = np.abs(np.cos(ti) * np.cos(ours.model.tilt[k] - theta_r)) / ours.model.variance[k]
        ratio = mitsubas_bessel(x) / special.i0e(x)
        exchanged += ours.eval(ti, theta_r, phi, lobes=part) * ratio[:, None]
    # The factor 2 within Mitsuba's exponent is .6931 as a logarithm, for variances below .1.
    assert np.abs(f[seen] / exchanged[seen] - 1).max() < 3e-4


@MITSUBA
def test_mitsuba_takes_what_to_host_gives() -> None:
    model = Chiang(beta_m=0.4, beta_n=0.5, alpha=3.0, eta=1.5, sigma_a=(0.3, 1.0, 2.0))
    theirs = cuticle.from_mitsuba("hair", h=0.3, **conventions.to_host("mitsuba", model))
    ti, phi = np.meshgrid([-0.5, 0.1, 0.7], [0.3, 1.5, 3.0])
    # Mitsuba's Bessel function, see above.
    np.testing.assert_allclose(theirs.eval(ti, 0.2, phi), model.near(0.3).eval(ti, 0.2, phi), rtol=0.03)


@MITSUBA
def test_refractive_indices_are_mitsubas() -> None:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    for name, index in conventions.INDICES.items():
        props = mi.Properties("hair")
        props["int_ior"] = name
        assert mi.lookup_ior(props, "int_ior", "air") == pytest.approx(index, rel=1e-7), name


def test_a_file_reads_back(tmp_path: Path) -> None:
    for given in (
        {"eumelanin": 1.3},
        {"sigma_a": (0.1, 0.2, 0.3), "alpha": -2.5},
        {"color": (0.5, 0.3, 0.1), "beta_n": 0.7},
    ):
        model = Chiang(**given)
        assert np.isfinite(model.eval(0.1, 0.2, 3.0)).all()  # what it has made on the way is no part of it
        loaded = Chiang.load(model.save(tmp_path / "hair.toml"))
        assert loaded == model
        assert hash(loaded) == hash(model)
    (tmp_path / "bad.toml").write_text("[chiang]\nbeta_m = 2\neumelanin = 1\n")
    with pytest.raises(ValueError, match=r"bad.toml: beta_m must be in \[0.01, 1\], got 2"):
        Chiang.load(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "needs its absorption"),
        ({"eumelanin": 1, "sigma_a": 0.1}, "give one of"),
        ({"beta_m": 0.0, "eumelanin": 1}, r"beta_m must be in \[0.01, 1\], got 0"),
        ({"beta": 0.3, "eumelanin": 1}, "no parameter 'beta'"),
        ({"color": (1.5, 0.2, 0.1)}, r"color\[0\] must be in"),
        ({"alpha": 30, "eumelanin": 1}, "alpha must be in"),
    ],
)
def test_bad_parameters_are_one_line(given: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        Chiang(**given)
    assert "\n" not in str(caught.value)


def test_bad_arguments_are_one_line() -> None:
    model = Chiang(eumelanin=1.3)
    with pytest.raises(ValueError, match=r"h must lie in \[-1, 1"):
        model.near(1.5)
    with pytest.raises(ValueError, match=r"u must have shape"):
        model.near(0).sample(0.1, [0.1, 0.2])
    with pytest.raises(ValueError, match="theta_i must lie"):
        model.near(0).eval(3.0, 0, 0)
    with pytest.raises(ValueError, match="lobes must be one of"):
        model.eval(0, 0, 0, lobes="TTT")


def test_offsets_broadcast() -> None:
    model = Chiang(eumelanin=1.3)
    f = model.near([-0.5, 0.0, 0.5]).eval(0.1, 0.2, 3.0)
    assert f.shape == (3, 3)
    np.testing.assert_array_equal(f[2], model.near(0.5).eval(0.1, 0.2, 3.0))
    # The other side of the fibre is the mirror image.
    np.testing.assert_allclose(f[0], model.near(0.5).eval(0.1, 0.2, -3.0), rtol=1e-12)


@pytest.mark.parametrize(("melanin", "least"), [(0.3, 0.985), (1.3, 0.98), (8.0, 0.97)])
def test_fitted_lobes_beat_an_offset_drawn_at_random(melanin: float, least: float) -> None:
    model = Chiang(beta_m=0.3, beta_n=0.3, eumelanin=melanin)
    result = cuticle.fit(model, 4)
    inner = np.abs(result.theta_r) <= np.radians(70)
    assert result.ess[0][inner].mean() >= least
    assert result.sampler.about["chiang"]["eumelanin"] == melanin


def test_as_a_fibre_it_looks_much_the_same() -> None:
    model = Chiang(eumelanin=1.3)
    fibre = model.fibre()
    assert fibre.beta_R == pytest.approx(8.3, abs=0.1)
    assert fibre.beta_N == pytest.approx(12.2, abs=0.1)
    assert fibre.alpha_R == -2
    near = cuticle.Marschner(fibre, "energy_conserving")
    a, b = (cuticle.tabulate(m, 0.3).luminance for m in (model, near))
    assert np.abs(a - b).sum() / b.sum() < 0.1


# ---- conventions


def test_the_maps_have_inverses() -> None:
    for b in np.linspace(0.02, 1, 15):
        assert conventions.longitudinal_roughness(conventions.longitudinal_variance(b)) == pytest.approx(b, abs=1e-9)
        assert conventions.azimuthal_roughness(conventions.azimuthal_scale(b)) == pytest.approx(b, abs=1e-9)
        color = np.array([0.9, 0.4, 0.05])
        back = conventions.color_of_sigma_a(conventions.sigma_a_of_color(color, b), b)
        np.testing.assert_allclose(back, color, rtol=1e-12)
    with pytest.raises(ValueError, match="variance must be in"):
        conventions.longitudinal_roughness(1e3)
    with pytest.raises(ValueError, match="color must lie in"):
        conventions.sigma_a_of_color([0, 0.5, 2], 0.3)


def test_a_color_has_a_roughness_of_its_own() -> None:
    """Roughness broadcasts with colours; against pbrt's formula (SigmaAFromReflectance), written again."""
    b, color = np.linspace(0.05, 1, 20)[:, None], np.array([0.9, 0.5, 0.02])
    divisor = 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5
    np.testing.assert_allclose(conventions.sigma_a_of_color(color, b), (np.log(color) / divisor) ** 2, rtol=1e-13)


@pytest.mark.parametrize("host", conventions.HOSTS)
def test_a_hair_goes_to_a_host_and_back(host: str) -> None:
    model = Chiang(beta_m=0.22, beta_n=0.41, alpha=2.5, eta=1.5, sigma_a=(0.2, 0.4, 0.9))
    there = conventions.to_host(host, model)
    back = Chiang(**conventions.from_host(host, **there))
    for name, value in model.values().items():
        assert getattr(back, name) == pytest.approx(value), name
    with pytest.raises(ValueError, match=f"{host} has no hair parameter 'gloss'"):
        conventions.from_host(host, gloss=1)


# Defaults and signs as each host's source has them. In Cycles both before and after 4.2, which moved the rotation from the
# light's angle to the viewer's and negated it: R lies at -theta_r - 2 alpha.
@pytest.mark.parametrize(
    ("host", "given", "expected"),
    [
        ("pbrt-v4", {}, {"alpha": -2.0, "eta": 1.55, "beta_m": 0.3, "beta_n": 0.3, "eumelanin": 1.3, "pheomelanin": 0.0}),
        ("pbrt-v4", {"pheomelanin": 0.7}, {"eumelanin": 0.0, "pheomelanin": 0.7}),
        ("pbrt-v4", {"eumelanin": 0.3}, {"eumelanin": 0.3, "pheomelanin": 0.0}),
        ("cycles", {}, {"alpha": 2.0, "eta": 1.55, "beta_m": 0.3, "color": (0.017513, 0.005763, 0.002059)}),
        ("cycles", {"offset": math.radians(3)}, {"alpha": 3.0}),
        ("cycles-legacy", {"offset": math.radians(3)}, {"alpha": 3.0}),
        ("cycles", {"melanin_redness": 0.0}, {"sigma_a": -math.log(0.2) * np.array([0.506, 0.841, 1.653])}),
        ("materialx", {}, {"alpha": 0.0, "eta": 1.55, "sigma_a": np.zeros(3)}),
        ("materialx", {"longitudinal": 0.25}, {"beta_m": 0.25, "beta_n": 0.2, "alpha": 0.0, "sigma_a": np.zeros(3)}),
        ("materialx", {"longitudinal": 0.25, "cuticle_angle": 0.49}, {"alpha": -1.8}),
        (
            "materialx",
            {"azimuthal": 0.2, "melanin_redness": 0.0},
            {"sigma_a": -math.log(0.75) * np.array([0.419, 0.697, 1.37])},
        ),
    ],
    ids=str,
)
def test_what_is_not_given_has_the_hosts_default(host: str, given: dict[str, Any], expected: dict[str, Any]) -> None:
    found = conventions.from_host(host, **given)  # and without a warning, which is an error here
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, atol=1e-12, err_msg=name)


@pytest.mark.parametrize(
    ("host", "given", "message"),
    [
        (
            "materialx",
            {"roughness_R": (0.1, 0.1)},
            r"roughness_TT \(0.05, 0.05\) \(here \(0.025, 0.1\)\), roughness_TRT \(0.2, 0.2\)",
        ),
        ("materialx", {"longitudinal": 0.2, "tint_R": (1.0, 0.5, 0.5)}, r"tint_R \(1.0, 0.5, 0.5\)"),
        ("materialx", {"longitudinal": 0.2, "scale_TT": 1.0}, "scale_TT 1 "),
        ("cycles", {"coat": 0.5}, "leaves out of cycles: coat 0.5"),
    ],
    ids=str,
)
def test_what_the_model_lacks_is_said(host: str, given: dict[str, Any], message: str) -> None:
    with pytest.warns(UserWarning, match=message):
        conventions.from_host(host, **given)


@pytest.mark.parametrize(
    ("host", "given", "message"),
    [
        ("mitsuba", {"sigma_a": 0.2, "eumelanin": 1.0}, "absorption one way: .*; got eumelanin, sigma_a"),
        ("cycles", {"color": (0.1, 0.1, 0.1), "tint": (0.5, 0.5, 0.5)}, "absorption one way: .*; got color, tint"),
        ("mitsuba", {"int_ior": "glue"}, "int_ior must be one of vacuum, .*; got 'glue'"),
        ("mitsuba", {"ext_ior": 0.0}, r"ext_ior must be in \(0, 10\], got 0"),
        ("materialx", {"longitudinal": 0.2, "roughness_R": (0.1, 0.1)}, "give roughness_R or longitudinal"),
    ],
    ids=str,
)
def test_a_host_that_contradicts_itself(host: str, given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        conventions.from_host(host, **given)


def test_pigments_of_both_sets() -> None:
    np.testing.assert_allclose(conventions.sigma_a_of_pigment(1.3), 1.3 * np.array([0.419, 0.697, 1.37]))
    eumelanin, pheomelanin = conventions.blender_pigment(0.8, 0.25)
    assert eumelanin + pheomelanin == pytest.approx(-math.log(0.2))
    expected = eumelanin * np.array([0.506, 0.841, 1.653]) + pheomelanin * np.array([0.343, 0.733, 1.924])
    given = conventions.from_host("cycles", melanin=0.8, melanin_redness=0.25)
    np.testing.assert_allclose(given["sigma_a"], expected)
    with pytest.raises(ValueError, match="melanin must be in"):
        conventions.blender_pigment(1.2, 0)


def test_positive_tilt_moves_r_toward_the_root() -> None:
    theta = np.linspace(-1.2, 1.2, 2401)
    f = Chiang(beta_m=0.1, eumelanin=1.3, alpha=3).near(0.0).eval(theta, 0.3, 0.0, lobes="R")[:, 0] * np.cos(theta)
    assert theta[np.argmax(f)] == pytest.approx(-0.3 - math.radians(6), abs=0.01)
