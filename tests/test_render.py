"""Hair in Mitsuba: energy, agreement of samplings, pictures, the command line."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import cuticle
from command import refused, run, run_program
from cuticle.grooms.groom import Groom
from cuticle.grooms.procedural import hair_ball, hair_head, wavy_lock
from cuticle.render import picture
from cuticle.render.picture import expected_seconds, over_backdrop, passes, render, save_picture
from cuticle.render.scene import Light, View, bsdf, integrator, load_scene
from rendered import UseVariant, mean

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'", allow_module_level=True)


@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral", "llvm_ad_rgb", "cuda_ad_rgb"])
@pytest.mark.parametrize(
    "roughness",
    [
        {},
        {"alpha_R": -8.0, "beta_R": 12.0, "beta_N": 25.0},
        pytest.param({"beta_R": 4.0, "beta_N": 5.0}, marks=pytest.mark.slow),
    ],
)
def test_white_furnace(variant: str, roughness: dict[str, float], strand: Groom, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    white = {"type": "cuticle", "sigma_a": 0.0, **roughness}
    for groom in (strand, wavy_lock(400)):
        one = mean(mi, groom, white, integrator("path", depth=2000), spp=64 if groom is strand else 128)
        assert np.abs(one - 1).max() <= 0.02


@pytest.mark.slow
def test_uniform_and_lobes_converge_to_one_picture(ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    view = View(width=16, height=16)  # large pixels: their means are all but normal

    def runs(sampling: str, seeds: range, strength: float = 1.0, **changes: Any) -> np.ndarray:
        how = integrator("direct", emitter_samples=0, bsdf_samples=1)
        material, light = bsdf("brown", sampling, **changes), Light("env", strength)
        scene = load_scene(mi, ball, material, view=view, technique=how, light=light)
        return np.array([render(scene, 400, seed=s).image[..., :3] for s in seeds])

    def worst(a: np.ndarray, b: np.ndarray) -> float:
        seen = (a.mean(axis=0) > 0.02).all(axis=-1)
        a, b = a[:, seen, 1], b[:, seen, 1]
        z = (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt(a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b))
        # Student's with about 30 degrees of freedom: its square has mean 30/28 and variance about 2.6.
        return float(((z**2).mean() - 30 / 28) / np.sqrt(2.6 / z.size))

    uniform, lobes = runs("uniform", range(16)), runs("lobes", range(100, 116))
    assert abs(worst(uniform, lobes)) <= 4
    # Controls at the same sample size: more absorption, and weights that are 5 % off.
    assert worst(uniform, runs("lobes", range(200, 216), eumelanin=1.3 * 1.15)) > 4
    assert worst(uniform, runs("lobes", range(300, 316), strength=1.05)) > 4


def test_the_camera_sees_every_point(ball: Groom) -> None:
    for view in (View(), View(azimuth=-120, elevation=60, width=300, height=100), View(fov=90, width=100, height=300)):
        origin, _ = view.place(ball)
        seen = (ball.points - origin) @ view.axes().T
        tangents = np.abs(seen[:, :2] / -seen[:, 2:])
        half = np.tan(np.radians(view.fov) / 2)
        limit = half * np.array([1, view.height / view.width])
        assert (seen[:, 2] < 0).all()
        assert (tangents <= limit).all()
        assert (tangents / limit).max() >= 0.85  # and fills the picture


@pytest.mark.parametrize("scale", [1e-3, 1e8])
def test_the_unit_does_not_matter(scale: float, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    ball = hair_ball(200).with_thickness(0.02)
    there = Groom(ball.points * np.float32(scale), ball.offsets, ball.radius * np.float32(scale))
    a, b = (
        render(load_scene(mi, g, bsdf("brown"), view=View(width=32, height=32), technique=integrator("direct")), 16).image
        for g in (ball, there)
    )
    assert b[..., 3].mean() == pytest.approx(a[..., 3].mean(), rel=0.02)  # the same rays, rounded elsewhere
    with pytest.raises(ValueError, match="at least 0.001 across to be rendered, got 3.86e-06; scale it up"):
        load_scene(mi, Groom(ball.points * 1e-6, ball.offsets, ball.radius * 1e-6), bsdf("brown"))


def test_passes_average_to_one_picture(ball: Groom, use_variant: UseVariant) -> None:
    scene = load_scene(
        use_variant("scalar_rgb"), ball, bsdf("brown"), view=View(width=16, height=16), technique=integrator("dual")
    )
    steps = list(passes(scene, 24, step=10, seed=1))
    assert [p.spp for p in steps] == [10, 20, 24]
    again = list(passes(scene, 24, step=10, seed=1))[-1]
    np.testing.assert_array_equal(steps[-1].image, again.image)
    assert not np.array_equal(again.image, list(passes(scene, 24, step=10, seed=2))[-1].image)


def test_expecting_how_long_a_picture_takes_leaves_it_as_it_was(ball: Groom, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    scene = load_scene(mi, ball, bsdf("brown"), view=View(width=130, height=50), technique=integrator("dual"))
    before = render(scene, 2).image
    expected = expected_seconds(scene, 2)
    assert expected is not None
    assert expected > 0
    np.testing.assert_array_equal(render(scene, 2).image, before)


def test_the_time_expected_of_a_machine_that_takes_as_long_for_every_pixel(
    ball: Groom, use_variant: UseVariant, monkeypatch: pytest.MonkeyPatch
) -> None:
    mi = use_variant("scalar_rgb")
    view = View(width=400, height=300)
    scene = load_scene(mi, ball, bsdf("brown"), view=view, technique=integrator("path"))
    now = [0.0]

    def rendered(scene: Any, spp: int) -> None:
        first = 0.0 if now[0] else 5.0  # what only a first picture does
        width, height = scene.sensors()[0].film().crop_size()
        now[0] += first + 0.25 + 1e-5 * spp * width * height

    monkeypatch.setattr(mi, "render", rendered)
    monkeypatch.setattr(picture, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    assert expected_seconds(scene, 7) == pytest.approx(7 * view.width * view.height * 1e-5)


@pytest.mark.alone
def test_a_picture_takes_about_as_long_as_expected(ball: Groom, use_variant: UseVariant) -> None:
    scene = load_scene(use_variant("scalar_rgb"), ball, bsdf("brown"), technique=integrator("path"))
    ratios = []
    for _ in range(3):  # the middle one: in between a machine may do something else
        expected = expected_seconds(scene, 4)
        assert expected is not None
        ratios.append(expected / render(scene, 4).seconds)
    assert 0.4 <= np.median(ratios) <= 2.5, ratios  # other views of the same pixels


def test_pictures_are_written_whole(tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    image = np.full((4, 6, 4), 0.5)
    image[:, :3] = 0
    for name in ("a.exr", "a.png"):
        save_picture(tmp_path / name, image)
    exr = np.array(mi.Bitmap(str(tmp_path / "a.exr")))
    np.testing.assert_allclose(exr, image, atol=1e-6)
    png = np.array(mi.Bitmap(str(tmp_path / "a.png")))
    assert png.shape == (4, 6, 3)
    backdrop = over_backdrop(image)[:, 0]
    assert (np.diff(backdrop[:, 0]) < 0).all()
    with pytest.raises(ValueError, match=r"must end in .exr or .png, got 'a.jpg'"):
        save_picture(tmp_path / "a.jpg", image)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.exr", "a.png"]


SMALL = ("--spp", "4", "--width", "32", "--followers", "1")


def test_command_line(tmp_path: Path) -> None:
    ran = run("render", "lock", "-o", "lock.exr", *SMALL, "--json", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["strands"] == 2000


def test_each_option_of_a_picture_does_what_it_says(tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    groom = wavy_lock(30)
    groom.save(tmp_path / "a.npz")

    def rendered(*options: str) -> np.ndarray:
        run("render", "a.npz", "-o", "a.exr", "--spp", "2", "--width", "12", *options, cwd=tmp_path)
        return np.array(mi.Bitmap(str(tmp_path / "a.exr")), np.float64)

    def shown(stops: str) -> np.ndarray:
        run("render", "a.npz", "-o", "a.png", "--spp", "2", "--width", "12", "--exposure", stops, cwd=tmp_path)
        return np.array(mi.Bitmap(str(tmp_path / "a.png")).convert(mi.Bitmap.PixelFormat.RGB), float)

    plain = rendered()
    assert plain[..., :3].max() > 0
    np.testing.assert_array_equal(rendered("--seed", "0"), plain)
    assert (rendered("--seed", "3") != plain).any()
    np.testing.assert_allclose(rendered("--strength", "2")[..., :3], 2 * plain[..., :3], rtol=1e-4)
    assert (rendered("--counter", "trace") != plain).any()
    scene = load_scene(
        mi, groom, bsdf("brown", strands=True), view=View(elevation=80, width=12, height=12), light=Light("studio"),
        technique=integrator("dual"),
    )  # fmt: skip
    np.testing.assert_array_equal(rendered("--elevation", "80")[..., 3], render(scene, 2).image[..., 3])
    assert shown("2").mean() > shown("0").mean() > shown("-8").mean()


def test_command_line_takes_or_ignores_what_a_file_says_of_its_strands(tmp_path: Path) -> None:
    lock = wavy_lock(20)
    lock.with_attributes(color=np.full((20, 3), 0.5), alpha=np.full(20, 90.0)).save(tmp_path / "a.npz")
    small = ("render", "a.npz", "-o", "a.png", "--spp", "1", "--width", "16")
    done = run(*small, "--ignore", "alpha", cwd=tmp_path)  # a colour is Chiang's
    assert "20 strands" in done.stdout
    assert "20 strands" in run(*small, "--fibre", "brown", "--ignore", "alpha", "--ignore", "color", cwd=tmp_path).stdout
    refused(*small, "--fibre", "brown", words="--ignore alpha", cwd=tmp_path)


@pytest.mark.slow
def test_command_line_reads_a_sampler(tmp_path: Path) -> None:
    fit = cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset("brown")), 2, strands=[0, 2])
    fit.sampler.save(tmp_path / "brown.json")
    ran = run_program(
        "render", "ball", "--fibre", "brown.json", "--integrator", "path", "-o", "ball.png", *SMALL, cwd=tmp_path
    )
    assert ran.returncode == 0, ran.stderr
    assert "20,000 strands" in ran.stdout
    assert (tmp_path / "ball.png").stat().st_size > 500


def test_a_bust_stands_under_the_hair(tmp_path: Path, use_variant: Callable[[str], Any]) -> None:
    """Below the hair, in the middle of the picture, is its grey, and nothing beside its neck."""
    mi = use_variant("scalar_rgb")
    hair_head(1000, length=1.2).save(tmp_path / "head.txt")
    more = (
        "--bust",
        "--interpolate",
        "500",
        "--integrator",
        "direct",
        "--sampling",
        "uniform",
        "--spp",
        "4",
        "--width",
        "24",
        "--zoom",
        ".6",
    )
    run("render", "head.txt", *more, "-o", "a.exr", cwd=tmp_path)
    picture = np.array(mi.Bitmap(str(tmp_path / "a.exr")))
    neck = picture[18, 11:14]
    assert (picture[18, [0, 1, -2, -1], 3] == 0).all()
    assert (neck[:, 3] == 1).all()
    assert (neck[:, :3] > 0).all()
    assert (np.ptp(neck[:, :3], axis=1) <= 0.25 * neck[:, :3].mean(axis=1)).all()  # the studio's lamps are tinted by so much


@pytest.mark.slow
def test_command_line_compares(tmp_path: Path) -> None:
    ran = run_program(
        "render", "compare", "ball", "-o", "out", "--seconds", "0.3", "--reference-spp", "64", "--width", "48", cwd=tmp_path
    )
    assert ran.returncode == 0, ran.stderr
    result = json.loads((tmp_path / "out" / "compare.json").read_text())
    error = {(c["sampling"], c["technique"]): c for c in result["contenders"]}
    assert len(error) == 8
    assert error["lobes", "bsdf"]["gain_over_uniform"] > 2
    assert error["function", "bsdf"]["equal_samples"]["rel_mse"] < 0.5 * error["uniform", "bsdf"]["equal_samples"]["rel_mse"]
    assert error["uniform", "bsdf"]["gain_over_uniform"] == 1
    assert error["lobes", "mis"]["equal_samples"]["rel_mse"] < error["uniform", "mis"]["equal_samples"]["rel_mse"]
    for name in ("sheet.png", "curves.png"):
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nowhere.hair", "-o", "a.png"), "cannot read groom nowhere.hair"),
        (("ball", "-o", "a.gif"), "must end in .exr or .png, got 'a.gif'"),
        (("ball", "-o", "a.png", "--fibre", "red"), "a scattering function must be a preset"),
        (("ball", "-o", "a.png", "--light", "moon"), "light must be one of env, studio, area, point, sun; got 'moon'"),
        (("ball", "-o", "a.png", "--integrator", "magic"), "integrator must be one of path, direct, dual; got 'magic'"),
        (
            ("ball", "-o", "a.png", "--sampling", "best"),
            "sampling must be one of function, lobes, document, uniform; got 'best'",
        ),
        (("ball", "-o", "a.png", "--counter", "fingers"), "--counter must be one of grid, trace; got 'fingers'"),
        (("ball", "-o", "a.png", "--spp", "0"), "--spp must be in [1, 1.04858e+06], got 0"),
        (("ball", "-o", "a.png", "--width", "0"), "width must be in [1, 8192], got 0"),
        (("ball", "-o", "a.png", "--height", "0"), "height must be in [1, 8192], got 0"),
        (("compare", "nowhere.hair", "-o", "out"), "cannot read groom nowhere.hair"),
        (("ball", "-o", "a.png", "--tip", "0.1"), "--tip needs --radius"),
        (("ball", "-o", "a.png", "--interpolate", "-1"), "--interpolate must be in [0, 1e+07], got -1"),
        (("ball", "-o", "a.png", "--interpolate", "9", "--followers", "2"), "leave out one"),
        (("lock", "-o", "a.png", "--bust"), "groom must have roots about a head"),
        (("ball", "-o", "a.png", "--variant", "gpu"), "variant must be one of scalar_rgb"),
        (("ball", "-o", "a.png", "--ignore", "color"), "--ignore color: the groom has no attributes"),
        (("ball", "-o", "a.png", "--vary", "tilt=1", "--vary", "tilt=2"), "--vary was given tilt twice; leave one out"),
        (("ball", "-o", "nowhere/a.png"), "cannot write to nowhere"),
        (("compare", "ball", "-o", "out", "--seconds", "0"), "--seconds must be in [0.1, 3600], got 0"),
    ],
)
def test_bad_command_lines_are_one_line(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    refused("render", *arguments, words=message, cwd=tmp_path)


@pytest.mark.slow
def test_the_example_runs(tmp_path: Path) -> None:
    example = Path(__file__).parents[1] / "examples" / "render_hair.py"
    ran = subprocess.run(
        [sys.executable, str(example), "a.png", "2"], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "eumelanin=0.3" in ran.stdout
    assert (tmp_path / "a.png").exists()


@pytest.mark.slow
def test_a_light_that_is_hidden_covers_nothing(ball: Groom, use_variant: UseVariant) -> None:
    """As in Mitsuba's `direct`: what is behind it is seen, and counts for alpha."""
    mi = use_variant("scalar_rgb")
    before = mi.ScalarTransform4f().look_at(origin=[0.9, 0.9, 1.5], target=[0.9, 0.9, 9], up=[0, 1, 0])
    lamp = {"type": "rectangle", "to_world": before.scale(0.6), "emitter": {"type": "area", "radiance": 1.0}}
    hidden, direct, shown = (
        render(load_scene(mi, ball, bsdf("brown"), view=View(width=48, height=48), technique=t, others={"lamp": lamp}), 16)
        .image[..., 3]
        .sum()
        for t in (integrator("dual", correction_paths=0), integrator("direct"), integrator("direct", hide=False))
    )
    assert shown > 1.02 * direct  # the lamp is in view, beside the hair
    assert abs(hidden - direct) < 0.1 * (shown - direct)
