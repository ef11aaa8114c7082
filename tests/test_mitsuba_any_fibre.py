"""The BSDF `cuticle` drawn from its own density: textures, what is no number in them, spectra, strands unlike the others."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import cuticle
from mitsuba_answers import AMONG_STRANDS, HALF_SPACE, UseVariant, ask, random_directions, relative

CHIANG = {"beta_m": 0.3, "beta_n": 0.3, "alpha": 2.0, "eumelanin": 1.3}
MARSCHNER = {"alpha_R": -4.0, "beta_R": 8.0, "beta_N": 10.0, "eumelanin": 1.3}


def uniform(value: float) -> dict[str, Any]:
    return {"type": "uniform", "value": value}


def bitmap(mi: Any, values: Any) -> dict[str, Any]:
    image = mi.Bitmap(np.asarray(values, np.float32))
    return {"type": "bitmap", "bitmap": image, "raw": True, "filter_type": "nearest"}


def asked(count: int = 20) -> tuple[Any, Any, np.ndarray]:
    rng = np.random.default_rng(4)
    return random_directions(rng, count), random_directions(rng, count), rng.random((count, 3)).astype(np.float32)


@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral"])
@pytest.mark.parametrize(
    ("given", "name", "value"),
    [(CHIANG, "alpha", -3.0), (CHIANG, "beta_m", 0.5), (MARSCHNER, "alpha_R", -8.0), (MARSCHNER, "eumelanin", 0.4)],
)
def test_a_texture_of_one_value_is_that_number(
    variant: str, given: dict[str, Any], name: str, value: float, use_variant: UseVariant
) -> None:
    """Alone and among strands, where its mean stands for the others; of one channel or of three, as luminance."""
    mi = use_variant(variant)
    number = mi.load_dict({"type": "cuticle", **given, name: value})
    for texture in (uniform(value), bitmap(mi, [[[value] * 3] * 2])):
        bsdf = mi.load_dict({"type": "cuticle", **given, name: texture})
        for strands in (None, np.full(20, 2.0)):
            a, b = (ask(mi, x, *asked(), strands) for x in (bsdf, number))
            assert relative(a.f, b.f) <= 1e-5
            assert relative(a.pdf, b.pdf) <= 1e-5


def test_a_texture_may_lie_below_its_range_on_average(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    found, least = (
        mi.load_dict({"type": "cuticle", **CHIANG, "beta_m": bitmap(mi, [[[a], [b]]])})
        for a, b in ((0.0, 0.03), (0.05, 0.05))
    )
    assert relative(ask(mi, found, *asked()).f, ask(mi, least, *asked()).f) <= 1e-6


def test_a_bitmap_of_colours_is_no_absorption_in_spectral_variants(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_spectral")
    colours = {"type": "bitmap", "bitmap": mi.Bitmap(np.full((2, 2, 3), 0.5, np.float32))}
    with pytest.raises(RuntimeError, match="sigma_a must not be a bitmap of colours in a spectral variant"):
        mi.load_dict({"type": "cuticle", "beta_m": 0.3, "sigma_a": colours})


@pytest.mark.parametrize("near", [False, True])
@pytest.mark.parametrize(
    ("name", "least"), [("beta_m", 0.05), ("alpha", -20.0), ("eumelanin", 0.0), ("sigma_a", 0.0), ("scale", 0.0)]
)
def test_what_is_no_number_in_a_texture_is_the_least(name: str, least: float, near: bool, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    import drjit as dr

    base = {"type": "cuticle", **{k: v for k, v in CHIANG.items() if (name, k) != ("sigma_a", "eumelanin")}, "near": near}
    values = np.full((64, 64, 1), 0.3)
    values[0, 0] = np.nan  # not among those that its mean is taken of
    least = 0.01 if near and name == "beta_m" else least
    bsdf, wanted = (mi.load_dict(base | {name: x}) for x in (bitmap(mi, values), least))
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi, si.uv = mi.Vector3f(0.1, 0.3, 0.9), mi.Point2f(0.001, 0.001)
    for wo in (mi.Vector3f(0.2, -0.1, 0.9), mi.Vector3f(0.1, 0.3, -0.9)):
        a, b = (x.eval_pdf(mi.BSDFContext(), si, wo) for x in (bsdf, wanted))
        np.testing.assert_allclose(np.ravel(a[0]), np.ravel(b[0]), rtol=1e-5)
        assert a[1] == pytest.approx(b[1], rel=1e-5)


def test_means_keep_their_sign_and_are_numbers(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    from cuticle.mitsuba import mean_of

    assert list(mean_of("color", mi.load_dict(bitmap(mi, [[[-3.0], [9.0]]])))) == pytest.approx([0.50005] * 3)
    assert mean_of("alpha", mi.load_dict(bitmap(mi, [[[-3.0], [-5.0]]]))) == pytest.approx(-4)
    with pytest.raises(RuntimeError, match="eumelanin must be in .*got nan"):
        mi.load_dict({"type": "cuticle", **CHIANG, "eumelanin": uniform(float("nan"))})


@pytest.mark.parametrize("plain", [True, False])
def test_a_texture_that_reads_the_shape_is_refused(plain: bool, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    attribute = {"type": "mesh_attribute", "name": "vertex_color"}
    texture = attribute if plain else {"type": "checkerboard", "color0": attribute}
    with pytest.raises(RuntimeError, match="eumelanin must not be a mesh_attribute"):
        mi.load_dict({"type": "cuticle", **CHIANG, "eumelanin": texture})


def test_a_spectrum_is_a_texture_in_every_variant(use_variant: UseVariant) -> None:
    for variant in ("scalar_rgb", "scalar_spectral"):
        mi = use_variant(variant)
        wavelengths = [(300.0, 0.4), (900.0, 0.4)]
        given = {"type": "cuticle", "beta_m": 0.3, "beta_n": 0.3}
        spectrum, number = (mi.load_dict({**given, "sigma_a": x}) for x in ({"type": "spectrum", "value": wavelengths}, 0.4))
        assert relative(ask(mi, spectrum, *asked()).f, ask(mi, number, *asked()).f) <= 5e-3  # a flat spectrum's colour


@pytest.mark.parametrize("sigma_a", [(0.0, 0.0, 0.0), (2.0, 0.5, 0.2), (0.5, 2.0, 0.2)])
def test_spectra_are_what_rgb_is(sigma_a: tuple[float, ...], use_variant: UseVariant) -> None:
    """Without absorption; and dyed, where red is absorbed most, among strands, too."""
    found = []
    for variant in ("scalar_rgb", "scalar_spectral"):
        mi = use_variant(variant)
        bsdf = mi.load_dict({"type": "cuticle", "beta_m": 0.3, "beta_n": 0.3, "sigma_a": mi.ScalarColor3f(*sigma_a)})
        found.append([ask(mi, bsdf, *asked(), n).f for n in (None, np.full(20, 2.0))[: 1 + any(sigma_a)]])
    for rgb, spectral in zip(*found, strict=True):
        assert relative(spectral, rgb[:, [2, 1, 1, 0]]) <= 2e-3


CUTICLE = {"type": "cuticle"}
SEEN = {k: v for k, v in CHIANG.items() if k != "eumelanin"}
COLOUR = {"beta_m": 0.3, "beta_n": 0.3, "color": (0.8, 0.5, 0.3)}
SIGMA_A = (0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("given", "steps", "wanted"),
    [
        (
            CHIANG, [{"eumelanin": 2.0}, {"sigma_a.value": SIGMA_A}, {"beta_m": 0.4}],
            SEEN | {"beta_m": 0.4, "sigma_a": SIGMA_A},
        ),
        (CHIANG, [{"scale.value": 2.0}, {"beta_n": 0.5, "d_b": 0.0}], CHIANG | {"scale": 2.0, "beta_n": 0.5, "d_b": 0.0}),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                (CHIANG, [{"sigma_a.value": SIGMA_A}, {"eumelanin": 2.0}], CHIANG | {"eumelanin": 2.0}),
                (CHIANG | {"beta_m": uniform(0.3)}, [{"beta_m.value": 0.5}], CHIANG | {"beta_m": 0.5}),
                (
                    COLOUR, [{"beta_n": 0.5}, {"sigma_a.value": SIGMA_A}, {"beta_n": 0.4}],
                    {"beta_m": 0.3, "beta_n": 0.4, "sigma_a": SIGMA_A},
                ),
                (COLOUR | {"beta_n": uniform(0.3)}, [{"beta_n.value": 0.5}], COLOUR | {"beta_n": 0.5}),
            )
        ),
    ],
)  # fmt: skip
def test_updates_in_any_order_are_the_scene_with_those_values(
    given: dict[str, Any], steps: list[dict[str, Any]], wanted: dict[str, Any], use_variant: UseVariant
) -> None:
    """What is updated last tells the absorption; tables among strands were made before."""
    mi = use_variant("scalar_rgb")

    def hair(values: dict[str, Any]) -> Any:
        return mi.load_dict({k: mi.ScalarColor3f(*v) if isinstance(v, tuple) else v for k, v in values.items()} | CUTICLE)

    strands = np.full(20, 2.0)
    bsdf = hair(given)
    parameters = mi.traverse(bsdf)
    ask(mi, bsdf, *asked(), strands)
    for step in steps:
        parameters.update({k: mi.Color3f(v) if isinstance(v, tuple) else v for k, v in step.items()})
    for n in (None, strands):
        a, b = (ask(mi, x, *asked(), n) for x in (bsdf, hair(wanted)))
        assert relative(a.f, b.f) <= 1e-5
        assert relative(a.pdf, b.pdf) <= 1e-5


@pytest.mark.parametrize("given", [CHIANG, MARSCHNER], ids=["chiang", "marschner"])
def test_a_strand_unlike_the_others_is_the_familys(given: dict[str, Any], use_variant: UseVariant) -> None:
    """f among strands of a mean fibre, counted and expected: `cuticle.family("dual_scattering")`."""
    mi = use_variant("scalar_rgb")
    kind = cuticle.Chiang if given is CHIANG else cuticle.Fibre
    texture = bitmap(mi, [[[0.4], [2.2]]])  # seen where it is .4
    bsdf = mi.load_dict({"type": "cuticle", **given, "eumelanin": texture, "d_f": 0.8, "d_b": 0.6})
    family = cuticle.family("dual_scattering", kind(**given), d_f=0.8, d_b=0.6)
    r, i, u = asked()
    strands = np.linspace(0.3, 9, 20)
    for behind in (None, 1.5):
        answers = ask(mi, bsdf, r, i, u, strands, behind)
        around = {"strands": strands} | ({} if behind is None else {"behind": behind, "random": True})
        f = family.eval(i.theta, r.theta, i.phi - r.phi, **(given | {"eumelanin": 0.4}), **around)
        assert relative(answers.f, f * np.cos(i.theta)[:, None]) <= 2e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [MARSCHNER | {"eumelanin": "texture"}, {"beta_m": 0.05, "beta_n": 0.05, "sigma_a": 0.02}],
    ids=["a white strand among dark ones", "smooth"],
)
def test_draws_among_strands_follow_their_density(given: dict[str, Any], use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    import drjit as dr

    texture = bitmap(mi, [[[0.1], [2.5]]])
    bsdf = mi.load_dict({"type": "cuticle", **{k: texture if v == "texture" else v for k, v in given.items()}})
    bsdf.parameters_changed(["strand_tables"])
    context = mi.BSDFContext()
    context.type_mask |= AMONG_STRANDS

    def seen(theta_r: float, count: int) -> Any:
        si = dr.zeros(mi.SurfaceInteraction3f, count)
        si.uv, si.duv_dx, si.duv_dy = mi.Point2f(0.01, 0.5), mi.Vector2f(2, 0), mi.Vector2f(HALF_SPACE, 0)
        si.wi = mi.Vector3f(math.cos(theta_r), math.sin(theta_r), 0)
        return si

    def sample(theta_r: float, u: np.ndarray) -> Any:
        u = np.minimum(u, 1 - 2.0**-24).astype(np.float32)
        drawn, _ = bsdf.sample(context, seen(theta_r, len(u)), mi.Float(u[:, 0]), mi.Point2f(u[:, 1], u[:, 2]))
        x, y, z = np.array(drawn.wo, float)
        return np.arctan2(y, np.hypot(x, z)), np.arctan2(z, x), np.array(drawn.pdf, float)

    def pdf(theta_i: np.ndarray, theta_r: float, phi: np.ndarray, shift: float = 0) -> np.ndarray:
        theta_i, phi = np.broadcast_arrays(theta_i, phi)
        t, p = theta_i.ravel(), phi.ravel() + shift
        wo = mi.Vector3f(np.cos(t) * np.cos(p), np.sin(t), np.cos(t) * np.sin(p))
        return np.array(bsdf.pdf(context, seen(theta_r, t.size), wo), float).reshape(theta_i.shape)

    viewers = np.radians([0, -75])
    assert cuticle.audit(sample, pdf, theta_r=viewers, samples=100_000).ok
    wrong = cuticle.audit(sample, lambda t, r, p: pdf(t, r, p, 0.05), theta_r=viewers[:1], samples=100_000)
    assert not wrong.ok


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "name", "step"),
    [
        ({"near": True, "beta_m": 0.3, "beta_n": 0.3, "color": (0.8, 0.5, 0.3)}, "beta_n", 0.01),
        (MARSCHNER, "alpha_R", 0.1),  # TT and TRT follow
        ({"fibre": "brown"}, "alpha_TT", 0.1),  # follows, until a gradient is asked for
        (CHIANG, "eumelanin", 0.02),
    ],
)
def test_gradients_are_differences(given: dict[str, Any], name: str, step: float, use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    import drjit as dr

    r, i, _ = asked(64)
    bsdf = mi.load_dict({"type": "cuticle", **{k: mi.ScalarColor3d(*v) if k == "color" else v for k, v in given.items()}})

    def value(x: Any) -> Any:
        parameters = mi.traverse(bsdf)
        parameters[name] = x
        parameters.update()
        si = dr.zeros(mi.SurfaceInteraction3f, 64)
        si.wi = mi.Vector3f(*r.vector.T)
        return dr.mean(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*i.vector.T)), axis=None)

    at = given[name] if name in given else float(np.ravel(mi.traverse(bsdf)[name])[0])
    x = mi.Float(at)
    dr.enable_grad(x)
    dr.backward(value(x))
    slope = float(np.ravel(dr.grad(mi.traverse(bsdf)[name]))[0])
    upper, lower = (float(np.ravel(value(mi.Float(at + s)))[0]) for s in (step, -step))
    assert slope == pytest.approx((upper - lower) / (2 * step), rel=0.01)


@pytest.mark.slow
def test_a_value_that_is_optimised_follows_no_other(use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    import drjit as dr

    parameters = mi.traverse(mi.load_dict({"type": "cuticle", "fibre": "brown"}))
    x = mi.Float(parameters["alpha_TT"])
    dr.enable_grad(x)
    parameters["alpha_TT"] = x
    parameters.update()
    parameters["alpha_R"] = mi.Float(-4)
    parameters.update()
    assert dr.grad_enabled(parameters["alpha_TT"])
    assert float(np.ravel(parameters["alpha_TT"])[0]) == 1
    assert float(np.ravel(parameters["alpha_TRT"])[0]) == 4  # brown gives it
