"""The far field with a fibre's parameters as arguments: against tables, the near field averaged, and its own samples."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import cuticle
from cuticle import Chiang, Fibre, Marschner
from cuticle._support.quadrature import gauss_legendre
from cuticle.checking.verdicts import sidak
from drawn import are_directions, ends_of_random_numbers, follows

CHIANG, MARSCHNER = cuticle.family("chiang"), cuticle.family("marschner")
REC709 = np.array([0.2126, 0.7152, 0.0722])


def random_fibre(form: str, rng: np.random.Generator) -> tuple[Any, Any]:
    """A fibre anywhere in the box that renderers allow, and its function from tables."""
    sigma_a = tuple(10 ** rng.uniform(-2, np.log10(20), 3))
    eta = rng.uniform(1.3, 1.8)
    if form == "chiang":
        model = Chiang(
            beta_m=rng.uniform(0.05, 1), beta_n=rng.uniform(0.05, 1), alpha=rng.uniform(-15, 15), eta=eta, sigma_a=sigma_a
        )
        return model, model
    fibre = Fibre(
        alpha_R=rng.uniform(-15, 15), beta_R=rng.uniform(2, 40), beta_N=rng.uniform(2, 40), eta=eta, sigma_a=sigma_a
    )
    return fibre, Marschner(fibre, "energy_conserving")


@pytest.mark.parametrize("form", ["chiang", "marschner"])
@pytest.mark.parametrize("count", [4, pytest.param(60, marks=pytest.mark.slow)])
def test_it_is_what_tables_say_and_what_it_draws(form: str, count: int) -> None:
    """In luminance f/pdf is constant; beside the tables, which are another quadrature, nearly so."""
    rng, family = np.random.default_rng(count), cuticle.family(form)
    theta, phi = np.linspace(-1.56, 1.56, 181)[:, None], np.linspace(0, np.pi, 181)
    for _ in range(count):
        fibre, model = random_fibre(form, rng)
        theta_r = rng.uniform(-1.48, 1.48)
        ours, table = (m.eval(theta, theta_r, phi) * np.cos(theta)[..., None] for m in (family.sampler_at(fibre), model))
        assert np.all(np.abs(ours - table).max((0, 1)) <= 0.025 * table.max((0, 1))), fibre
        np.testing.assert_allclose(ours.sum((0, 1)), table.sum((0, 1)), rtol=2e-3)
        assert cuticle.measure(family.sampler_at(fibre), model, theta_r).ess >= 0.995
        assert cuticle.measure(family.sampler_at(fibre), family.sampler_at(fibre), theta_r).ess >= 0.9999


@pytest.mark.parametrize("beta_n", [0.1, 0.3])
def test_it_is_the_near_field_averaged_over_the_width(beta_n: float) -> None:
    """Of the near field, which other tests compare with Mitsuba's own hair: no cells, no tables."""
    model = Chiang(beta_m=0.2, beta_n=beta_n, alpha=3, eumelanin=0.8)
    gamma, weight = gauss_legendre(np.array([-np.pi / 2, np.pi / 2]), 600)
    rng = np.random.default_rng(5)
    for theta_r in (-1.4, 0.3, 1.0):
        ti, phi = rng.uniform(-1.5, 1.5, 200), rng.uniform(-np.pi, np.pi, 200)
        each = model.near(np.sin(gamma)).eval(ti[:, None], theta_r, phi[:, None])
        mean = np.einsum("h,phc->pc", weight * np.cos(gamma) / 2, each)
        assert np.all(np.abs(CHIANG.eval(ti, theta_r, phi, model) - mean) <= 0.01 * mean.max(0))


@pytest.mark.parametrize(
    ("beta_n", "eta", "off"),
    [
        (0.06, 1.29, 0.225),
        (0.06, 1.55, 0.125),
        (0.11, 1.29, 0.12),
        (0.11, 1.55, 0.065),
        (0.3, 1.29, 0.042),
        (0.3, 1.55, 0.01),
    ],
)
def test_glints_are_as_far_off_as_the_docs_say(beta_n: float, eta: float, off: float) -> None:
    """TRT seen alone: scales so steep that no other lobe reaches its axis."""
    model = Chiang(beta_m=0.05, beta_n=beta_n, alpha=20, eta=eta, sigma_a=0.01)
    gamma, weight = gauss_legendre(np.array([-np.pi / 2, np.pi / 2]), 600)
    phi = np.linspace(0, np.pi, 361)
    for theta_r in (0.0, 0.4, 0.7, 1.0, 1.3):
        theta_i = np.radians(4 * model.alpha) - theta_r
        each = model.near(np.sin(gamma)).eval(theta_i, theta_r, phi[:, None])[..., 0]
        trt = each @ (weight * np.cos(gamma) / 2)
        assert np.abs(CHIANG.eval(theta_i, theta_r, phi, model)[:, 0] - trt).max() <= off * trt.max()


@pytest.mark.parametrize("dtype", [np.float32, pytest.param(np.float64, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "case",
    [
        (CHIANG, {"beta_m": 0.3, "beta_n": 0.3, "eumelanin": 1.3}),
        (MARSCHNER, {"beta_R": 2.0, "beta_N": 2.0, "alpha_R": -15.0, "sigma_a": (0.1, 0.2, 0.4)}),
    ],
    ids=["chiang", "marschner"],
)
def test_samples_follow_the_density(case: tuple[cuticle.Family, dict[str, Any]], dtype: Any) -> None:
    family, values = case
    sampler = family.sampler_at(**values)

    def sample(theta_r: float, u: np.ndarray) -> Any:
        return sampler.sample(dtype(theta_r), np.minimum(u, 1 - 2.0**-24).astype(dtype))

    def pdf(theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return sampler.pdf(theta_i.astype(dtype), dtype(theta_r), phi.astype(dtype))

    viewers = np.radians([0, -60, 85])
    assert cuticle.audit(sample, pdf, theta_r=viewers, samples=100_000).ok
    wrong = cuticle.audit(
        lambda t, u: sample(t, u), lambda ti, tr, phi: sampler.pdf(ti, tr, np.clip(phi * 1.02, -np.pi, np.pi)),
        theta_r=viewers[:1], samples=100_000,
    )  # fmt: skip
    assert not wrong.ok


@pytest.mark.slow
@pytest.mark.parametrize("form", ["chiang", "marschner"])
@pytest.mark.parametrize(
    ("dtype", "fibres", "samples"), [(np.float32, 100, 300_000), (np.float32, 10, 1_000_000), (np.float64, 10, 100_000)]
)
def test_samples_of_fibres_all_over_the_box_follow_their_densities(form: str, dtype: Any, fibres: int, samples: int) -> None:
    """One family of tests at 1e-3."""
    rng, family = np.random.default_rng(fibres), cuticle.family(form)
    level = sidak(1e-3, 240)
    for k in range(fibres):
        sampler, theta_r = family.sampler_at(random_fibre(form, rng)[0]), rng.uniform(-1, 1) * np.radians(85)

        follows(sampler, theta_r, dtype, samples=samples, level=level, seed=k)


@pytest.mark.parametrize(
    ("family", "ranges"),
    [
        (CHIANG, {"beta_m": (0.05, 1.0), "beta_n": (0.05, 1.0), "alpha": (-20.0, 20.0)}),
        (MARSCHNER, {"beta_R": (0.5, 45.0), "beta_N": (1.0, 45.0), "alpha_R": (-30.0, 30.0)}),
    ],
)
def test_no_parameter_and_no_random_number_gives_what_is_no_direction(
    family: cuticle.Family, ranges: dict[str, tuple[float, float]]
) -> None:
    """All corners of the box, viewers along the strand, random numbers at their ends, both precisions."""
    corners = ranges | {"eta": (1.05, 3.0), "sigma_a": (0.0, 1000.0)}
    values = dict(zip(corners, (x.reshape(-1, 1, 1) for x in np.meshgrid(*corners.values())), strict=True))
    values["sigma_a"] = values["sigma_a"][..., None]
    theta_r = np.array([-np.pi / 2, -1.5, 0, np.pi / 2])[:, None]
    for dtype, u in ends_of_random_numbers():
        s = family.sample(theta_r.astype(dtype), u, **values)
        are_directions(s, dtype)
        f, p = family.eval_pdf(s.theta_i, theta_r.astype(dtype), s.phi, **values)
        assert np.isfinite(f).all()
        np.testing.assert_array_equal(p, s.pdf)


def test_arrays_of_fibres_broadcast_with_directions() -> None:
    rng = np.random.default_rng(3)
    roughness, melanin = np.array([0.1, 0.3, 0.6]), np.array([[0.2], [2.0]])
    ti, phi = rng.uniform(-1, 1, (2, 3)), rng.uniform(-3, 3, (2, 3))
    whole = CHIANG.eval(ti, 0.3, phi, beta_m=roughness, eumelanin=melanin)
    assert whole.shape == (2, 3, 3)
    for i, j in np.ndindex(2, 3):
        one = CHIANG.eval(ti[i, j], 0.3, phi[i, j], Chiang(beta_m=roughness[j], eumelanin=float(melanin[i, 0])))
        np.testing.assert_array_equal(whole[i, j], one)
    fibres = CHIANG.fibres(beta_m=roughness, color=[[0.8, 0.5, 0.3]] * 3)
    assert (fibres.shape, fibres.channels) == ((3,), 3)
    own = [Chiang(beta_m=b, color=(0.8, 0.5, 0.3)).absorption for b in roughness]
    np.testing.assert_allclose(fibres.sigma_a, own, rtol=1e-14)
    np.testing.assert_array_equal(
        CHIANG.pdf(ti, 0.3, phi, fibres), CHIANG.pdf(ti, 0.3, phi, pickle.loads(pickle.dumps(fibres)))
    )
    of_r = MARSCHNER.fibres(alpha_R=[-5.0, 5.0], sigma_a=0.3)
    for row, alpha in zip(of_r.parameters, (-5.0, 5.0), strict=True):
        np.testing.assert_allclose(row[:6], np.concatenate([(f := Fibre(alpha_R=alpha, sigma_a=0.3)).alpha, f.beta]))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"beta_m": 0.3}, "needs one absorption.*got none"),
        ({"sigma_a": 1.0, "eumelanin": 1.0}, "needs one absorption.*got sigma_a and eumelanin"),
        ({"sigma_a": [1.0, 2.0]}, r"last axis of 1 or 3 channels, got shape \(2,\)"),
        ({"sigma_a": 1.0, "beta_n": [0.3, 0.01]}, r"beta_n must lie in \[0.05, 1\], got 0.01 at beta_n\[1\]"),
        ({"sigma_a": 1.0, "eta": 1.0}, r"eta must lie in \[1.05, 3\], got 1"),
        ({"sigma_a": 1.0, "beta_R": 3.0}, "fibres of 'chiang' have no parameter 'beta_R'; they have beta_m"),
        ({"sigma_a": 1.0, "beta_m": [0.1, 0.2], "alpha": [1.0, 2.0, 3.0]}, "shapes do not broadcast"),
    ],
)
def test_what_is_refused_says_why(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        CHIANG.pdf(0.1, 0.2, 0.3, **values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"color": (0.7, 0.1)}, r"color must have a last axis of 1 or 3 channels, got shape \(2,\)"),
        ({"color": np.full((5, 4), 0.5)}, r"color must have a last axis of 1 or 3 channels, got shape \(5, 4\)"),
        ({"color": np.full((4, 3), 0.5), "beta_n": np.full(5, 0.3)}, r"do not broadcast.*color.*beta_n"),
        ({"eumelanin": np.ones(2), "pheomelanin": np.ones(3)}, r"do not broadcast.*eumelanin.*pheomelanin"),
    ],
)
def test_shapes_that_do_not_fit_are_told(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cuticle.family("chiang").eval_pdf(np.zeros(5), 0.2, 0.3, **values)


def test_fibres_hold_what_was_checked() -> None:
    made = cuticle.family("chiang").fibres(beta_m=[0.2, 0.4], sigma_a=0.3)
    with pytest.raises(ValueError, match="read-only"):
        made.parameters[0, 0] = 99
    for parameters, sigma_a in (
        (np.ones((2, 3)), np.ones((2, 3))), (np.ones((2, 4)), np.ones((2, 2))), (np.full(4, np.nan), np.ones(3)),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="must"):
            cuticle.Fibres("chiang", parameters, sigma_a)


def test_a_fibre_of_another_family_is_refused() -> None:
    with pytest.raises(TypeError, match=r"fibre must be a cuticle\.Chiang.*got Fibre"):
        CHIANG.pdf(0.1, 0.2, 0.3, Fibre.preset("brown"))
    with pytest.raises(ValueError, match="family must be one of chiang, marschner, dual_scattering; got 'kajiya'"):
        cuticle.family("kajiya")
    with pytest.raises(ValueError, match=r"u must have shape \(\.\.\., 3\): lobe, theta, phi; got \(2,\)"):
        CHIANG.sample(0.1, [0.1, 0.2], sigma_a=0.1)
    with pytest.raises(ValueError, match=r"sampler_at takes one fibre, got an array of shape \(2,\)"):
        CHIANG.sampler_at(beta_m=[0.1, 0.2], sigma_a=0.1)


def test_a_fibres_defaults_follow_its_r_whether_it_is_a_fibre_or_keywords() -> None:
    """Beyond 30° of alpha_R and 45° of beta_R its TRT leaves the range of one that is set; the fibre is the same one."""
    for values in ({"alpha_R": -40.0}, {"beta_R": 60.0}):
        one = MARSCHNER.fibres(**values, sigma_a=0.3)
        other = MARSCHNER.sampler_at(Fibre(**values, sigma_a=0.3)).fibre
        np.testing.assert_array_equal(one.parameters, other.parameters)
    with pytest.raises(ValueError, match=r"alpha_TRT must lie in \[-45, 45\], got 60"):
        MARSCHNER.fibres(alpha_R=-40.0, alpha_TRT=60.0, sigma_a=0.3)


def test_what_a_family_alone_does_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match="d_b is for the family 'dual_scattering'; 'chiang' is of a strand on its own"):
        cuticle.family("chiang", d_b=0.5)
