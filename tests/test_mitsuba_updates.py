"""The BSDF `cuticle` in Mitsuba: textures, and parameters that are changed."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from cuticle.grooms.groom import Groom
from cuticle.render.scene import integrator, load_scene
from mitsuba_answers import (
    NEAR,
    Answers,
    UseVariant,
    alone,
    ask,
    random_directions,
    relative,
)
from rendered import SMALL

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'", allow_module_level=True)


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral", "llvm_ad_rgb", "llvm_ad_spectral", "cuda_ad_spectral"])
def test_scale_multiplies_the_absorption(variant: str, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    rng = np.random.default_rng(3)
    count = 500
    r, i = random_directions(rng, count), random_directions(rng, count)
    u = rng.random((count, 3), np.float32)
    for fibre in ("blond", "document"):
        own = cuticle.Fibre.preset(fibre)
        for scale in (0.3, 1.0, 2.7):
            said = ask(mi, mi.load_dict({"type": "cuticle", "fibre": fibre, "scale": scale, "sampling": "uniform"}), r, i, u)
            model = alone(own.replace(sigma_a=tuple(scale * x for x in own.absorption)))
            f = model.eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
            if "spectral" in variant and fibre != "document":
                f = f[:, [2, 1, 1, 0]]  # blue, green, green, red: the wavelengths that are asked for
            # Between two tabulated absorptions N is interpolated as exp(-sigma_a l) with one length l.
            assert relative(said.f, np.broadcast_to(f, said.f.shape)) <= 0.01


def test_a_texture_colours_strand_by_strand(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    texture = {"type": "checkerboard", "color0": 0.5, "color1": 2.0, "to_uv": mi.ScalarTransform4f().scale([1, 1, 1])}
    bsdf = mi.load_dict({"type": "cuticle", "fibre": "blond", "scale": texture})
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    values = []
    for uv in ((0.2, 0.2), (0.2, 0.8)):
        si.uv = mi.Point2f(*uv)
        values.append(np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0.1, -1))))
    plain = [
        np.array(
            mi.load_dict({"type": "cuticle", "fibre": "blond", "scale": s}).eval(
                mi.BSDFContext(), si, mi.Vector3f(0, 0.1, -1)
            )
        )
        for s in (0.5, 2.0)
    ]
    assert sorted(map(tuple, values)) == sorted(map(tuple, plain))
    assert not np.allclose(*values)


def test_a_row_of_a_bitmap_is_a_strand(tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    points = [[x, y, 0] for x in (0, 1, 2) for y in np.linspace(-1, 1, 5)]
    groom = Groom(np.array(points, np.float32), np.arange(4) * 5, np.array(0.1, np.float32))
    groom.save(tmp_path / "g.txt")
    curves = mi.load_dict({"type": "bsplinecurve", "filename": str(tmp_path / "g.txt")})
    scene = mi.load_dict({"type": "scene", "curves": curves})
    rows = np.append(np.repeat([1.0, 2.0, 3.0], groom.counts - 1), 9).astype(np.float32)  # a row a segment, and the guard's
    bitmap = {"type": "bitmap", "bitmap": mi.Bitmap(rows.reshape(-1, 1, 1)), "raw": True, "filter_type": "nearest"}
    texture = mi.load_dict(bitmap)
    for strand in range(3):
        for y in (-0.8, 0.1, 0.9):
            si = scene.ray_intersect(mi.Ray3f(mi.Point3f(strand, y, 5), mi.Vector3f(0, 0, -1)))
            assert si.is_valid()
            assert texture.eval_1(si) == strand + 1


def test_parameters_are_traversed_and_change_what_is_seen(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    bsdf = mi.load_dict({"type": "cuticle", "fibre": "blond", "sampling": "uniform"})
    parameters = mi.traverse(bsdf)
    assert {"sigma_a.value", "scale.value"} <= set(parameters.keys())
    rng = np.random.default_rng(4)
    r, i, u = random_directions(rng, 50), random_directions(rng, 50), rng.random((50, 3), np.float32)
    before = ask(mi, bsdf, r, i, u).f
    parameters["sigma_a.value"] = mi.Color3f(0.1, 0.2, 0.3)
    parameters.update()
    after = ask(mi, bsdf, r, i, u).f
    wanted = alone(cuticle.Fibre.preset("blond").replace(sigma_a=(0.1, 0.2, 0.3)))
    f = wanted.eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
    assert relative(after, f) <= 0.01
    assert relative(before, f) > 0.1


def test_tables_of_other_absorptions_are_made_when_one_is_asked_for(use_variant: UseVariant) -> None:
    """Not on loading; by a change of the scale, and by that of a number after it."""
    mi = use_variant("scalar_rgb")
    rng = np.random.default_rng(8)
    r, i, u = random_directions(rng, 20), random_directions(rng, 20), rng.random((20, 3)).astype(np.float32)

    def hair(**given: float) -> Any:
        return mi.load_dict({"type": "cuticle", "fibre": "blond", "sampling": "uniform", **given})

    bsdf = hair()
    parameters = mi.traverse(bsdf)
    for name, value, other in (("scale.value", 2.0, {"scale": 2.0}), ("beta_N", 14.0, {"scale": 2.0, "beta_N": 14.0})):
        parameters[name] = value
        parameters.update()
        for strands in (None, np.full(20, 2.0)):
            both = [ask(mi, b, r, i, u, strands).f for b in (bsdf, hair(**other))]
            np.testing.assert_allclose(*both, rtol=1e-5)


@pytest.mark.parametrize(
    ("given", "changes", "of_changed"),
    [
        (NEAR, {"beta_m": 0.4, "alpha": 3.0, "eta": 1.4, "pheomelanin": 0.5}, {}),
        # A default that follows another parameter still does.
        pytest.param(
            {"alpha_R": -3.0, "beta_R": 8.0, "eumelanin": 1.0, "lobes": 1},
            {"alpha_R": -6.0, "eumelanin": 0.25},
            {"alpha_TT": 3.0, "alpha_TRT": 9.0},
            marks=pytest.mark.slow,
        ),
        pytest.param({**NEAR, "near": False}, {"beta_n": 0.375, "eumelanin": 0.25}, {}, marks=pytest.mark.slow),
        pytest.param({**NEAR, "near": False, "strands": True, "lobes": 1}, {"beta_m": 0.5}, {}, marks=pytest.mark.slow),
        pytest.param({**NEAR, "color": (0.4, 0.2, 0.1), "eumelanin": None}, {"beta_n": 0.4}, {}, marks=pytest.mark.slow),
    ],
    ids=["near", "fibre", "far", "among strands", "a colour"],
)
@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_spectral"])
def test_an_update_makes_what_follows_from_a_number_anew(
    variant: str, given: dict[str, Any], changes: dict[str, Any], of_changed: dict[str, Any], use_variant: UseVariant
) -> None:
    mi = use_variant(variant)
    given = {k: mi.ScalarColor3f(*v) if k == "color" else v for k, v in given.items() if v is not None}
    rng = np.random.default_rng(6)
    r, i, u = random_directions(rng, 40), random_directions(rng, 40), rng.random((40, 3), np.float32)
    strands = np.full(40, 1.5) if {"alpha_R", "strands"} & given.keys() else None
    bsdf, wanted = (mi.load_dict({"type": "cuticle", **given, **c}) for c in ({}, changes))
    parameters = mi.traverse(bsdf)
    before = ask(mi, bsdf, r, i, u, strands)
    parameters.update(changes)
    assert {k: parameters[k] for k in of_changed} == pytest.approx(of_changed)
    for part, after, old in zip(Answers._fields, ask(mi, bsdf, r, i, u, strands), before, strict=True):
        expected = getattr(ask(mi, wanted, r, i, u, strands), part)
        if part == "wo":
            assert np.abs(after.vector - expected.vector).max() <= 1e-5
        else:
            assert relative(after, expected) <= 1e-4, part  # changes in single precision
            assert relative(old, expected) > 0.05, part
    parameters["eta"] = 7.0
    with pytest.raises(ValueError, match=r"^eta must be in \(1, 3\], got 7; keratin has 1.55$"):
        parameters.update()
    assert relative(ask(mi, bsdf, r, i, u, strands).f, ask(mi, wanted, r, i, u, strands).f) <= 1e-4


@pytest.mark.parametrize("value", [2.0, -0.5, float("nan")])
def test_an_update_refuses_a_density_out_of_range(value: float, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    for given in ({"fibre": "brown"}, {"beta_m": 0.3, "eumelanin": 1.3}):
        bsdf = mi.load_dict({"type": "cuticle", **given})
        parameters = mi.traverse(bsdf)
        before = parameters["d_f"]
        parameters["d_f"] = value
        with pytest.raises(ValueError, match="d_f must be in .0, 1], got"):
            parameters.update()
        assert mi.traverse(bsdf)["d_f"] == before


@pytest.mark.parametrize("sampling", ["function", "uniform"])
@pytest.mark.parametrize("value", [-1.0, float("nan")])
def test_an_absorption_that_is_none_is_held_to_0(value: float, sampling: str, use_variant: UseVariant) -> None:
    """What moves it, such as a gradient, is not stopped: it is held, as a texture's values are."""
    mi = use_variant("scalar_rgb")
    rng = np.random.default_rng(5)
    r, i = random_directions(rng, 5), random_directions(rng, 5)
    found = []
    for scale in (0.0, value):
        bsdf = mi.load_dict({"type": "cuticle", "beta_m": 0.3, "eumelanin": 1.3, "scale": 2.0, "sampling": sampling})
        parameters = mi.traverse(bsdf)
        parameters["scale.value"] = scale
        parameters.update()
        found.append(ask(mi, bsdf, r, i, rng.random((5, 3)), None).f)
    assert np.array_equal(*found)
    assert (found[0] > 0).all()


@pytest.mark.slow
def test_absorption_is_differentiable(use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    import drjit as dr

    bsdf = mi.load_dict({"type": "cuticle", "fibre": "brown", "scale": 1.3})
    parameters = mi.traverse(bsdf)
    scale = mi.Float(1.3)
    dr.enable_grad(scale)
    parameters["scale.value"] = scale
    parameters.update()
    rng = np.random.default_rng(5)
    r, i = random_directions(rng, 1000), random_directions(rng, 1000)
    si = dr.zeros(mi.SurfaceInteraction3f, 1000)
    si.wi = mi.Vector3f(*r.vector.T)
    total = dr.sum(dr.mean(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*i.vector.T))))
    dr.backward(total)

    def energy(s: float) -> float:
        fibre = cuticle.Fibre.preset("brown")
        model = alone(fibre.replace(sigma_a=tuple(s * x for x in fibre.absorption)))
        return float((model.eval(i.theta, r.theta, i.phi - r.phi).mean(axis=1) * np.cos(i.theta)).sum())

    slope = (energy(1.301) - energy(1.299)) / 0.002
    assert float(np.ravel(np.array(scale.grad))[0]) == pytest.approx(slope, rel=0.02)  # of an interpolation


@pytest.mark.parametrize("given", [
    {"sampling": "uniform", "scale": 2.0},
    pytest.param({"sampling": "lobes", "lobes": 1, "scale": 1.5}, marks=pytest.mark.slow),
])  # fmt: skip
def test_colours_far_apart_fit_into_the_tables(given: dict[str, Any], use_variant: UseVariant) -> None:
    """Thirty absorptions about those of its own: no more than a table may have."""
    mi = use_variant("scalar_rgb")
    color = mi.ScalarColor3d(0.8, 0.1, 0.05)
    bsdf = mi.load_dict({"type": "cuticle", "beta_m": 0.3, "beta_n": 0.3, "color": color, **given})
    own = cuticle.Chiang(beta_m=0.3, beta_n=0.3, color=(0.8, 0.1, 0.05)).absorption
    scaled = mi.ScalarColor3d(*(given["scale"] * x for x in own))
    plain = mi.load_dict({"type": "cuticle", "beta_m": 0.3, "beta_n": 0.3, "sigma_a": scaled, "sampling": "uniform"})
    rng = np.random.default_rng(5)
    r, i = random_directions(rng, 40), random_directions(rng, 40)
    u = rng.random((40, 3), np.float32)
    # Between two tabulated absorptions N is interpolated as exp(-sigma_a l) with one length l.
    assert relative(ask(mi, bsdf, r, i, u).f, ask(mi, plain, r, i, u).f) <= 0.01


def test_an_update_that_is_refused_leaves_everything_as_it_was(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    bsdf = mi.load_dict({"type": "cuticle", "fibre": "brown", "sampling": "uniform"})
    rng = np.random.default_rng(6)
    r, i = random_directions(rng, 20), random_directions(rng, 20)
    u = rng.random((20, 3), np.float32)
    before = ask(mi, bsdf, r, i, u).f
    parameters = mi.traverse(bsdf)
    absorption = next(key for key in parameters.keys() if key.startswith("sigma_a"))  # noqa: SIM118 - Mitsuba's
    parameters[absorption] = mi.ScalarColor3f(1, 2, 3) if "value" in absorption else parameters[absorption]
    parameters["beta_R"] = 500.0
    with pytest.raises(Exception, match="beta_R must be in"):
        parameters.update()
    np.testing.assert_array_equal(ask(mi, bsdf, r, i, u).f, before)


def test_a_channel_without_absorption_is_hair_among_hair(ball: Groom, use_variant: UseVariant) -> None:
    """White in red alone: the strands around have tables, as those of .999 have."""
    mi = use_variant("scalar_rgb")
    dual = integrator("dual", correction_paths=0)
    means = []
    for red, technique in ((1.0, dual), (0.999, dual), (0.999, integrator("direct"))):
        material = {"type": "cuticle", "beta_m": 0.3, "beta_n": 0.3, "color": mi.ScalarColor3d(red, 0.6, 0.3)}
        scene = load_scene(mi, ball, material, view=SMALL, technique=technique)
        means.append(np.array(mi.render(scene, spp=16))[..., :3].mean(axis=(0, 1)))
    np.testing.assert_allclose(means[0], means[1], rtol=0.03)
    assert means[0][0] > 1.2 * means[2][0]  # what it was without tables


def test_spectral_variants_are_refused_for_a_function_of_three_channels(use_variant: UseVariant) -> None:
    use_variant("scalar_spectral")
    with pytest.raises(ValueError, match=r'from_mitsuba needs a variant in RGB.*mi.set_variant\("scalar_rgb"\) first'):
        cuticle.from_mitsuba("hair", h=0.3, eumelanin=1.3)


@pytest.mark.parametrize("given", [{}, {"sampling": "uniform"}, {"near": True}])
def test_the_last_of_sigma_a_and_pigments_counts(given: dict[str, Any], use_variant: UseVariant) -> None:
    """A sigma_a that was set outlives a change of roughness, also a colour's; a pigment is heard with the number it had."""
    mi = use_variant("scalar_rgb")

    def sigma_a(name: str, value: Any) -> Any:
        parameters[name] = value
        parameters.update()
        return np.array(mi.traverse(hair)["sigma_a.value"], np.float64)

    for absorption in ({"color": mi.ScalarColor3d(0.3, 0.4, 0.5)}, {"eumelanin": 1.3}):
        hair = mi.load_dict({"type": "cuticle", "beta_m": 0.3, "beta_n": 0.3, **absorption, **given})
        parameters = mi.traverse(hair)
        own = np.array(parameters["sigma_a.value"], np.float64)
        sigma_a("sigma_a.value", mi.ScalarColor3d(1, 2, 3))
        np.testing.assert_array_equal(sigma_a("beta_n", 0.6), [1, 2, 3])
    np.testing.assert_allclose(sigma_a("eumelanin", 1.3), own, rtol=1e-6)
