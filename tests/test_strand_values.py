"""A fibre that varies over strands and along them, in Mitsuba: textures of its parameters, and values of grooms."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import refused, run
from cuticle.grooms.groom import Groom
from cuticle.grooms.procedural import hair_ball
from cuticle.grooms.variation import vary
from cuticle.render.scene import View, integrator, load_scene

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'", allow_module_level=True)

from mitsuba_answers import UseVariant, ask, random_questions, relative

CHIANG = {"beta_m": 0.35, "beta_n": 0.2, "alpha": 3.0, "eta": 1.5}


@pytest.mark.parametrize(
    ("family", "given", "near"),
    [
        ("chiang", CHIANG | {"eumelanin": 0.7, "pheomelanin": 0.4}, False),
        ("chiang", CHIANG | {"color": (0.5, 0.3, 0.1)}, True),
        ("marschner", {"alpha_R": -4.0, "beta_R": 9.0, "beta_TT": 6.0, "beta_N": 14.0, "sigma_a": (0.3, 0.5, 0.9)}, False),
    ],
)
@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
def test_a_texture_says_what_its_number_says(
    variant: str, family: str, given: dict[str, Any], near: bool, use_variant: UseVariant
) -> None:
    mi = use_variant(variant)
    r, i, u = random_questions(1, 40)

    def texture(x: Any) -> Any:
        if isinstance(x, float):
            return {"type": "uniform", "value": x}
        return {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(np.broadcast_to(np.float32(x), (2, 2, 3)).copy())}

    plain = {k: mi.ScalarColor3f(*v) if isinstance(v, tuple) else v for k, v in given.items()}
    kind = {"type": "cuticle", "near": near}
    number = ask(mi, mi.load_dict(kind | plain), r, i, u)
    textured = mi.load_dict(kind | {k: texture(v) for k, v in given.items()})
    said = ask(mi, textured, r, i, u)
    for a, b in ((said.f, number.f), (said.pdf, number.pdf)):
        assert relative(a, b) <= 1e-4
    # The lower half of a number's digits turns the direction: the last bit of a parameter shows.
    assert relative(said.sample_pdf, number.sample_pdf) <= 0.02
    if not near:  # beside the core in double precision
        f = cuticle.family(family).eval(i.theta, r.theta, i.phi - r.phi, **given) * np.cos(i.theta)[:, None]
        assert relative(said.f, f) <= 2e-4
    with pytest.raises(RuntimeError, match="beta_m takes one value a strand|beta_.* must be in"):
        mi.load_dict(kind | plain | {next(n for n in given if n.startswith("beta")): texture(99.0)})


@pytest.fixture
def three(tmp_path: Path) -> Groom:
    """Strands side by side, whose melanin is one, two, or runs from none to three."""
    points = [[x, y, 0] for x in (0, 1, 2) for y in np.linspace(-1, 1, 5)]
    melanin = np.concatenate([np.full(5, 1.0), np.full(5, 2.0), np.linspace(0, 3, 5)])
    groom = Groom(np.array(points, np.float32), np.arange(4) * 5, np.array(0.1, np.float32))
    return groom.with_attributes(eumelanin=melanin, beta_m=[0.2, 0.4, 0.3])


def test_a_hit_has_the_value_of_its_strand_there(three: Groom, tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    three.save(tmp_path / "g.txt")
    three.save(tmp_path / "g.npz")

    def values(name: str) -> dict[str, Any]:
        return {"type": "cuticle_strands", "filename": str(tmp_path / "g.npz"), "attribute": name}

    bsdf = {"type": "cuticle", "eumelanin": values("eumelanin"), "beta_m": values("beta_m")}
    curves = mi.load_dict({"type": "bsplinecurve", "filename": str(tmp_path / "g.txt"), "bsdf": bsdf})
    scene = mi.load_dict({"type": "scene", "curves": curves})
    for strand, y, melanin in ((0, 0.3, 1.0), (1, -0.7, 2.0), (2, -0.5, 0.75), (2, 0.9, 2.85)):
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(strand, y, 5), mi.Vector3f(0, 0, -1)))
        one = mi.load_dict({"type": "cuticle", "eumelanin": melanin, "beta_m": [0.2, 0.4, 0.3][strand]})
        wo = mi.Vector3f(0.3, 0.2, -0.9)
        context = mi.BSDFContext()
        assert np.allclose(si.bsdf().eval(context, si, wo), one.eval(context, si, wo), rtol=1e-3)
    for given, message in (
        ({"attribute": "beta_m"}, "cuticle_strands needs filename and attribute"),
        (
            {**values("dye"), "type": None},
            "the groom has no attribute 'dye'; it has beta_m, eumelanin|it has eumelanin, beta_m",
        ),
    ):
        with pytest.raises(RuntimeError, match=message):
            mi.load_dict({**given, "type": "cuticle_strands"})
    parameters = mi.traverse(mi.load_dict(values("beta_m")))
    before = np.array(parameters["values"])
    parameters["values"] = mi.TensorXf(np.zeros((1, 1, 1), np.float32))
    with pytest.raises(RuntimeError, match="values must have shape"):
        parameters.update()
    np.testing.assert_array_equal(np.array(parameters["values"]), before)  # as it was


@pytest.mark.parametrize("technique", ["path", "dual"])
def test_values_that_do_not_vary_are_numbers(technique: str, use_variant: UseVariant) -> None:
    """The same picture, sample by sample; and where strands differ, another."""
    mi = use_variant("scalar_rgb")
    ball, numbers = hair_ball(300), {"sigma_a": 0.5, "beta_m": 0.25, "beta_n": 0.375}
    how = integrator(technique, **({"correction_paths": 0} if technique == "dual" else {"depth": 8}))

    def seen(groom: Groom, **material: float) -> np.ndarray:
        scene = load_scene(mi, groom, {"type": "cuticle", **material}, view=View(width=24, height=24), technique=how)
        return np.array(mi.render(scene, spp=16))

    wanted = seen(ball, **numbers)
    np.testing.assert_allclose(seen(ball.with_attributes(**numbers)), wanted, rtol=1e-4, atol=1e-6)
    if technique == "dual":
        return
    white = vary(ball, melanin=1.3, strays=0.5, seed=2)
    assert seen(white)[..., :3].mean() > 1.1 * wanted[..., :3].mean()
    # What the material says itself has precedence.
    np.testing.assert_allclose(seen(white, **numbers), wanted, rtol=1e-6)


def test_what_lies_outside_a_range_is_told(three: Groom, tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    rough = three.with_attributes(beta_m=[0.2, 0.01, 0.3])
    with pytest.warns(UserWarning, match=r"beta_m: on 4 of 13 segments it lies outside \[0.05, 1\]"):
        load_scene(mi, rough, {"type": "cuticle"})


def test_hair_varies_on_the_command_line(tmp_path: Path) -> None:
    picture = tmp_path / "p.png"
    small = ["render", "lock", "--spp", "1", "--width", "16", "-o", str(picture)]
    dyed = run(*small, "--vary", "melanin=2", "--vary", "dye=.8,.1,.1", "--vary", "dyed=.5", "--integrator", "path")
    assert dyed.returncode == 0, dyed.stderr
    assert picture.stat().st_size > 0
    for given, message in (
        (["--vary", "curl=1"], "--vary has no 'curl'; it has melanin, "),
        (["--vary", "melanin"], "--vary takes NAME=NUMBER, such as melanin=1.3, or dye=R,G,B; got 'melanin'"),
        (["--vary", "strays=2"], "strays must be in [0, 1], got 2"),
        (["--vary", "strays=.2", "--fibre", "brown"], "the groom's beta_m is for Chiang's fibres: leave --fibre out"),
    ):
        refused(*small, *given, words=message, cwd=tmp_path)
