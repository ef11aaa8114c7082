"""The integrator `dual_scattering`: light through hair, beside paths and between its own techniques."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cuticle import Chiang, Tabulated
from cuticle.grooms.groom import Groom
from cuticle.grooms.procedural import hair_ball
from cuticle.render.picture import rel_mse, render
from cuticle.render.scene import Light, View, bsdf, integrator, load_scene
from rendered import SMALL, UseVariant, floor, mat, mean

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'", allow_module_level=True)


@pytest.mark.parametrize(
    "kind", ["env", "area", "point", *(pytest.param(k, marks=pytest.mark.slow) for k in ("studio", "sun"))]
)
def test_every_light_reaches_hair_through_hair(kind: str, ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    spp = 512 if kind == "studio" else 64  # of small lights against a dim room
    direct = mean(mi, ball, bsdf("brown"), integrator("direct"), spp, light=Light(kind))
    path = mean(mi, ball, bsdf("brown"), integrator("path", depth=64), light=Light(kind))
    for counter in ("grid", "trace"):
        how = integrator("dual", counter=counter, correction_paths=0)
        dual = mean(mi, ball, bsdf("brown"), how, spp, light=Light(kind))
        assert dual[0] > 1.1 * direct[0], counter  # red; blue hardly comes through
        assert np.abs(dual / path - 1).max() <= 0.12, counter  # light off the straight line to it is left out


@pytest.mark.slow
@pytest.mark.parametrize("fibre", ["blond", "brown", "black"])
def test_dual_scattering_in_diffuse_light_is_as_bright_as_paths(fibre: str, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    ball = hair_ball(10_000)
    path = mean(mi, ball, bsdf(fibre), integrator("path", depth=64))
    for counter in ("grid", "trace"):
        dual = mean(mi, ball, bsdf(fibre), integrator("dual", counter=counter))
        assert np.abs(dual / path - 1).max() <= 0.05


def test_what_is_seen_is_as_bright_as_paths_are(use_variant: UseVariant) -> None:
    # Light on crooked ways makes a quarter of a thick ball's.
    mi, thick = use_variant("scalar_rgb"), hair_ball(20_000).with_thickness(0.003, 0.001)

    def brightness(how: dict[str, Any], spp: int) -> np.ndarray:
        scene = load_scene(mi, thick, bsdf("blond"), view=SMALL, technique=how, light=Light("area"))
        image = np.array(mi.render(scene, spp=spp), np.float64)
        return image[..., :3].sum(axis=(0, 1)) / image[..., 3].sum()

    path = brightness(integrator("path", depth=64), 64)
    none = brightness(integrator("dual", correction_paths=0), 16)
    dual = brightness(integrator("dual", correction_paths=1 << 16), 16)
    assert (none / path).max() <= 0.9
    assert np.abs(dual / path - 1).max() <= 0.05  # 2 % of it noise of the paths


def test_the_correction_is_held_where_hardly_any_light_comes_straight(use_variant: UseVariant) -> None:
    # A path there may be a thousand times as bright: parts of the hair were corrected by up to 32.
    mi, thick = use_variant("scalar_rgb"), hair_ball(20_000).with_thickness(0.003, 0.001)

    def blocks(paths: int, spp: int, seed: int) -> np.ndarray:
        view, technique = View(width=48, height=48), integrator("dual", correction_paths=paths)
        scene = load_scene(mi, thick, bsdf("brown"), view=view, light=Light("area"), technique=technique)
        image = np.array(mi.render(scene, spp=spp, seed=seed), np.float64)[..., :3]
        return image.reshape(12, 4, 12, 4, 3).sum(axis=(1, 3))

    none = blocks(0, 64, 0)
    seen = none.sum(axis=-1) > 0.03 * none.sum(axis=-1).max()
    for seed in (0, 1):
        assert (blocks(1 << 14, 32, seed)[seen] / none[seen]).max() <= 1.7  # 1.4; it was 2.0 and 3.4


def test_few_paths_correct_nothing(ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")

    def image(paths: int) -> np.ndarray:
        how = integrator("dual", correction_paths=paths)
        return np.array(mi.render(load_scene(mi, ball, bsdf("blond"), view=SMALL, technique=how), spp=4))

    np.testing.assert_array_equal(image(32), image(0))
    assert not np.array_equal(image(4096), image(0))


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
def test_bounces_lead_to_paths(variant: str, ball: Groom, use_variant: UseVariant) -> None:
    mi, light = use_variant(variant), Light("area")
    path = mean(mi, ball, bsdf("blond"), integrator("path", depth=64), spp=256, light=light)
    off = [
        mean(mi, ball, bsdf("blond"), integrator("dual", bounces=m, correction_paths=0), spp=256, light=light) / path - 1
        for m in (0, 2, 8)
    ]
    assert np.abs(off[0]).max() >= 0.06
    assert np.abs(off[1:]).max() <= 0.05  # the noise of a difference: 1.4 %


@pytest.mark.parametrize("bounces", [1, 64])
def test_no_light_counts_twice_between_mirrors(bounces: int, strand: Groom, use_variant: UseVariant) -> None:
    # White hair, mirrors and light from everywhere: all that is seen is 1, whatever the way.
    mi = use_variant("scalar_rgb")
    side = mi.ScalarTransform4f().rotate([0, 1, 0], 90).scale(3)
    mirrors = {
        f"mirror{k}": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([x, 0, 0]) @ side,
            "bsdf": {"type": "twosided", "bsdf": {"type": "conductor", "material": "none"}},
        }
        for k, x in enumerate((-0.8, 0.8))
    }
    white = {"type": "cuticle", "sigma_a": 0.0}
    one = mean(mi, strand, white, integrator("dual", bounces=bounces), spp=256, others=mirrors)
    path = mean(mi, strand, white, integrator("path", depth=2 + bounces), spp=256, others=mirrors)
    assert np.abs(one / path - 1).max() <= 0.02
    assert bounces == 1 or np.abs(one - 1).max() <= 0.02


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["env", "area"])
@pytest.mark.parametrize("counter", ["grid", "trace"])
def test_emitter_and_bsdf_sampling_agree(kind: str, counter: str, ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    runs = []
    for samples in ((1, 0), (0, 1), (1, 1), (3, 2), None):  # None: by the scene's light
        given = {} if samples is None else {"emitter_samples": samples[0], "bsdf_samples": samples[1]}
        how = integrator("dual", counter=counter, correction_paths=0, **given)
        scene = load_scene(mi, ball, bsdf("brown"), view=SMALL, technique=how, light=Light(kind))
        images = [render(scene, 32, seed=s).image[..., 1] for s in range(8)]
        runs.append(np.mean(images, axis=(1, 2)))
    for other in runs[1:]:
        z = (other.mean() - runs[0].mean()) / np.sqrt((other.var(ddof=1) + runs[0].var(ddof=1)) / 8)
        assert abs(z) <= 5  # Student's with 7 to 14 degrees of freedom, 16 of them in all: 1.3 % at most
        assert abs(other.mean() / runs[0].mean() - 1) <= 0.1


@pytest.mark.parametrize(
    ("kind", "chosen"),
    [
        ("area", "emitter_samples = 1, by the scene's light,\n  bsdf_samples = 0.1"),
        ("env", "bsdf_samples = 1, by the scene's light"),
    ],
)
def test_the_light_decides_on_the_technique(kind: str, chosen: str, ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    scene = load_scene(mi, ball, bsdf("brown"), view=SMALL, technique=integrator("dual"), light=Light(kind))
    assert "emitter_samples = by the scene's light" in str(scene.integrator())
    mi.render(scene, spp=1)
    assert chosen in str(scene.integrator())
    assert ("emitter_samples = 1," in str(scene.integrator())) == (kind == "area")


@pytest.mark.parametrize("counter", ["grid", pytest.param("trace", marks=pytest.mark.slow)])
def test_strands_behind_are_counted(counter: str, use_variant: UseVariant) -> None:
    """Sparse blond hair, lit from one side: a half space of strands would send back far more."""
    mi = use_variant("scalar_rgb")
    sparse, panel = hair_ball(3_000), Light("area")
    path = mean(mi, sparse, bsdf("blond"), integrator("path", depth=64), 256, light=panel)

    def off(**how: Any) -> float:
        dual = mean(mi, sparse, bsdf("blond"), integrator("dual", correction_paths=0, **how), 256, light=panel)
        return float(np.abs(dual / path - 1).max())

    assert off(counter=counter) <= 0.15
    assert off(counter=counter, behind="half_space") > 0.3


def test_a_strand_alone_is_lit_as_by_direct(strand: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    alone = bsdf("brown", d_b=0.0)  # no strands behind it either
    dual = mean(mi, strand, alone, integrator("dual", counter="trace", correction_paths=0), 256)
    assert np.abs(dual / mean(mi, strand, alone, integrator("direct"), 256) - 1).max() <= 0.01


@pytest.mark.parametrize("counter", ["grid", pytest.param("trace", marks=pytest.mark.slow)])
def test_other_things_cast_shadows_and_are_lit(counter: str, ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    sun = Light("sun")
    toward = View().axes().T @ np.array([-0.55, 0.6, 0.6]) / np.linalg.norm([-0.55, 0.6, 0.6])
    look = mi.ScalarTransform4f().look_at(origin=(6 * toward).tolist(), target=[0, 0, 0], up=[0, 1, 0])
    blocker = {"type": "rectangle", "to_world": look @ mi.ScalarTransform4f().scale(8.0)}
    how = integrator("dual", counter=counter)
    free = mean(mi, ball, bsdf("brown"), how, light=sun)
    assert (free > 0.02).all()
    narrow = View(width=48, height=48, zoom=4)  # hair only
    assert (mean(mi, ball, bsdf("brown"), how, light=sun, view=narrow, others={"blocker": blocker}) < 1e-6).all()
    # What is not hair is lit as by direct, shadowed by hair.
    plain = {"type": "sphere", "radius": 0.98}
    seen = [
        render(load_scene(mi, ball, bsdf("black"), view=SMALL, technique=t, others={"head": plain}), 128).image
        for t in (how, integrator("direct"))
    ]
    assert rel_mse(*seen) <= 0.01


@pytest.mark.parametrize("counter", ["grid", "trace"])
@pytest.mark.parametrize(
    "light", [{"type": "directional", "direction": [0.6, 0, -0.8], "irradiance": 1.0}, {"type": "constant"}]
)
def test_shadows_of_hair_are_as_bright_as_paths(
    counter: str, light: dict[str, Any], tmp_path: Path, use_variant: UseVariant
) -> None:
    mi = use_variant("scalar_rgb")
    hair = mat(tmp_path / "mat.txt")

    def lit(how: dict[str, Any], **function: Any) -> np.ndarray:
        material = {"type": "cuticle", "fibre": "blond", **function}
        return floor(mi, {"hair": {**hair, "bsdf": material}}, how, light)

    path = lit(integrator("path", depth=64))
    assert (lit(integrator("direct")) < 0.65 * path).all()  # opaque
    for function in ({}, {"scale": 1.0}):  # its own absorption, and that of a texture
        dual = lit(integrator("dual", counter=counter, correction_paths=0), **function)
        # Light goes straight through, and the mat ends: what leaves at its sides is counted.
        assert np.abs(dual / path - 1).max() <= 0.3


@pytest.mark.parametrize(
    "function",
    [
        {"fibre": "brown"},
        pytest.param({"beta_m": 0.3, "eumelanin": 0.3, "strands": True, "sampling": "uniform"}, marks=pytest.mark.slow),
    ],
)
def test_both_samplings_see_shadows_of_hair(function: dict[str, Any], tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    hair = {"hair": {**mat(tmp_path / "mat.txt"), "bsdf": {"type": "cuticle", **function}}}
    seen = [
        floor(mi, hair, integrator("dual", correction_paths=0, **{other: 0}), {"type": "constant"}, 1024)
        for other in ("emitter_samples", "bsdf_samples")
    ]
    assert np.abs(seen[0] / seen[1] - 1).max() <= 0.04  # blue scatters by 1.3 %
    path = floor(mi, hair, integrator("path", depth=64), {"type": "constant"})
    assert np.abs(seen[0] / path - 1).max() <= 0.15


@pytest.mark.slow
@pytest.mark.parametrize("counter", ["grid", "trace"])
def test_light_through_hair_of_another_colour(counter: str, ball: Groom, tmp_path: Path, use_variant: UseVariant) -> None:
    """Every second strand is black: what is blond, and what is black, is as bright as with paths."""
    mi = use_variant("scalar_rgb")
    shapes: dict[str, Any] = {}
    for k, fibre in enumerate(("blond", "black")):
        strands = np.split(ball.points, ball.offsets[1:-1])[k::2]
        points, offsets = np.concatenate(strands), np.cumsum([0, *map(len, strands)])
        Groom(points, offsets, ball.radius.flat[0]).save(tmp_path / f"{fibre}.txt")
        curves = {"type": "bsplinecurve", "filename": str(tmp_path / f"{fibre}.txt")}
        shapes[f"{k}_{fibre}"] = {**curves, "bsdf": {"type": "cuticle", "fibre": fibre}}

    def seen(how: dict[str, Any], shapes: dict[str, Any]) -> np.ndarray:
        """Mean light of pixels where one sample met the first shape, and the second."""
        film = {"type": "hdrfilm", "width": 48, "height": 48, "pixel_format": "rgb", "rfilter": {"type": "box"}}
        look = mi.ScalarTransform4f().look_at(origin=[0, 0, 4], target=[0, 0, 0], up=[0, 1, 0])
        scene = mi.load_dict(
            {
                "type": "scene", **shapes, "integrator": {"type": "aov", "aovs": "sh:shape_index", "of": how},
                "light": {"type": "directional", "direction": [0.3, -1, -0.5]},
                "sensor": {"type": "perspective", "fov": 35, "to_world": look, "film": film},
            }
        )  # fmt: skip
        pixels = np.concatenate([np.array(mi.render(scene, spp=1, seed=k)).reshape(-1, 4) for k in range(48)])
        return np.array([pixels[pixels[:, 3] == shape, :3].mean(axis=0) for shape in (1, 2)])

    path = seen(integrator("path", depth=64), shapes)
    how = integrator("dual", counter=counter, correction_paths=0)
    dual = seen(how, shapes)
    assert np.abs(dual / path - 1).max() <= 0.17  # straight light only, as everywhere without a correction
    among_its_own = seen(how, {name: {**s, "bsdf": {"type": "cuticle", "fibre": "blond"}} for name, s in shapes.items()})
    assert among_its_own[0, 0] > 1.2 * path[0, 0]  # what blond strands had when all others were blond to them


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "cuda_ad_rgb", "scalar_spectral"])
def test_variants_agree(variant: str, ball: Groom, use_variant: UseVariant) -> None:
    use_variant(variant)  # skipped here rather than after the picture in scalar_rgb
    want = mean(use_variant("scalar_rgb"), ball, bsdf("brown"), integrator("dual"), 256)
    spectral = "spectral" in variant
    for counter in ("grid",) if spectral else ("grid", "trace"):
        got = mean(use_variant(variant), ball, bsdf("brown"), integrator("dual", counter=counter), 256)
        assert np.abs(got / want - 1).max() <= (0.08 if spectral else 0.03)  # three values stand for a spectrum


@pytest.mark.parametrize("wrapped", [
    {"type": "blendbsdf", "weight": 0.5, "a": {"type": "cuticle", "fibre": "brown"}, "b": {"type": "diffuse"}},
    {"type": "mask", "opacity": 0.5, "a": {"type": "cuticle", "fibre": "brown"}},
])  # fmt: skip
def test_hair_inside_another_bsdf_is_refused(wrapped: dict[str, Any], ball: Groom, use_variant: UseVariant) -> None:
    """It has no tables of the strands around, which its own BSDF would be asked to make."""
    mi = use_variant("scalar_rgb")
    scene = load_scene(mi, ball, wrapped, view=SMALL, technique=integrator("dual"))
    with pytest.raises(RuntimeError, match="hair must have a BSDF `cuticle` by itself, got one inside a (Blend|Mask)BSDF"):
        mi.render(scene, spp=1)


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
def test_hair_of_another_scene_does_not_matter(variant: str, ball: Groom, use_variant: UseVariant, tmp_path: Path) -> None:
    """Traced code asks each BSDF of the process, those without tables of other strands, too; rounding aside."""
    mi = use_variant(variant)

    def picture() -> np.ndarray:
        scene = load_scene(mi, ball, bsdf("brown"), view=SMALL, technique=integrator("dual"))
        return np.array(mi.render(scene, spp=4, seed=0))

    alone = picture()
    theta, phi = np.radians(np.linspace(-89, 89, 31)), np.radians(np.linspace(0, 180, 19))
    f = Chiang(eumelanin=1.3).eval(theta[:, None], theta[::2, None, None], phi)
    Tabulated(theta[::2], theta, phi, f).save(tmp_path / "mine.npz")
    others = [
        mi.load_dict({"type": "cuticle", **given})
        for given in (
            {"beta_m": 0.3, "sigma_a": 0.0}, {"beta_m": 0.3, "eumelanin": 1.0}, {"fibre": "document"},
            {"beta_m": 0.3, "eumelanin": 1.0, "near": True}, {"fibre": "black", "sampling": "lobes"},
            {"fibre": str(tmp_path / "mine.npz")},
        )
    ]  # fmt: skip
    np.testing.assert_allclose(picture(), alone, rtol=1e-3, atol=1e-5)  # one seed; what is left is single precision
    del others


def test_no_hair_in_the_scene_is_direct_light(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    scenes = [
        mi.load_dict(
            {
                "type": "scene",
                "integrator": how,
                "ball": {"type": "sphere"},
                "light": {"type": "constant"},
                "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 16, "height": 16}},
            }
        )
        for how in (integrator("dual"), integrator("direct"))
    ]
    assert rel_mse(*(np.array(mi.render(s, spp=64)) for s in scenes)) <= 1e-3


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"counter": "magic"}, "counter must be grid or trace, got magic"),
        ({"behind": "some"}, "behind must be counted or half_space, got some"),
        ({"cells": 0}, "cells must be in [1, 512], got 0"),
        ({"max_strands": 0}, "max_strands must be in [1, 10000], got 0"),
        ({"emitter_samples": 0, "bsdf_samples": 0}, "must not both be 0"),
        ({"bounces": -1}, "bounces must be in [0, 1000], got -1"),
        ({"bounces": 1, "correction_paths": 9}, "correction_paths must be 0 with bounces"),
    ],
)
def test_bad_integrator_parameters(given: dict[str, Any], message: str, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": "dual_scattering", **given})
    assert message in str(caught.value)


def test_a_fibre_without_absorption_cannot_stand_among_others(ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    white = {"type": "cuticle", "sigma_a": 0.0}
    assert "among strands" not in str(mi.load_dict(white))
    dual = mean(mi, ball, white, integrator("dual"))  # lit as by direct, with a warning
    assert np.abs(dual / mean(mi, ball, white, integrator("direct")) - 1).max() <= 0.02
