"""The BSDF `cuticle` in Mitsuba, beside what Python computes."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import cuticle
from conftest import COUNTS
from cuticle.grooms.groom import Groom
from cuticle.scattering.marschner import LONGITUDINAL_OF

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'", allow_module_level=True)

UseVariant = Callable[[str], Any]
# One with each formulation; the others say the same of other numbers.
FIBRES = ("blond", "document", *(pytest.param(name, marks=pytest.mark.slow) for name in ("brown", "black", "marschner")))
VARIANTS = {
    "scalar_rgb": 500,
    "llvm_ad_rgb": 100_000,
    "cuda_ad_rgb": 100_000,
}  # and how many inputs: scalar ones go one by one
AMONG_STRANDS, EXPECTED = 1 << 31, 1 << 29  # plugins/mitsuba/strands.h
HALF_SPACE = float(np.finfo(np.float32).max)


def alone(fibre: cuticle.Fibre) -> cuticle.Marschner:
    return cuticle.Marschner(fibre, LONGITUDINAL_OF[fibre.formulation])


class Directions(NamedTuple):
    theta: np.ndarray
    phi: np.ndarray
    vector: np.ndarray  # in a curve's shading frame, single precision


def directions(vector: np.ndarray) -> Directions:
    w = vector.astype(np.float32)
    x, y, z = w.astype(float).T
    return Directions(np.arctan2(y, np.hypot(x, z)), np.arctan2(z, x), w)


def random_directions(rng: np.random.Generator, n: int) -> Directions:
    theta, phi = rng.uniform(-1.55, 1.55, n), rng.uniform(-np.pi, np.pi, n)
    return directions(np.stack([np.cos(theta) * np.cos(phi), np.sin(theta), np.cos(theta) * np.sin(phi)], axis=-1))


class Answers(NamedTuple):
    f: np.ndarray  # f cos theta_i
    pdf: np.ndarray
    wo: Directions
    sample_pdf: np.ndarray
    weight: np.ndarray


def ask(
    mi: Any,
    bsdf: Any,
    r: Directions,
    i: Directions,
    u: np.ndarray,
    strands: np.ndarray | None = None,
    behind: float | None = None,
) -> Answers:
    """What a BSDF says to viewers r, lights i and random numbers u.

    Among strands where their number is given: counted or, with so many `behind`, expected.
    """
    context = mi.BSDFContext()
    if strands is not None:
        bsdf.parameters_changed(["strand_tables"])
        context.type_mask |= AMONG_STRANDS | (0 if behind is None else EXPECTED)

    def once(r_: np.ndarray, i_: np.ndarray, u_: np.ndarray, n_: Any) -> tuple[Any, ...]:
        import drjit as dr

        si = dr.zeros(mi.SurfaceInteraction3f, u_.shape[1] if u_.ndim > 1 else 1)
        si.wi = mi.Vector3f(*r_)
        if mi.is_spectral:
            si.wavelengths = type(si.wavelengths)(440, 550, 570, 620)
        if strands is not None:
            # Counted (or drawn), expected, and behind.
            si.duv_dx = mi.Vector2f(n_, 0) if behind is None else mi.Vector2f(-1, n_)
            si.duv_dy = mi.Vector2f(HALF_SPACE if behind is None else behind, 0)
        wo = mi.Vector3f(*i_)
        f, pdf = bsdf.eval_pdf(context, si, wo)
        sample, weight = bsdf.sample(context, si, mi.Float(u_[0]), mi.Point2f(u_[1], u_[2]))
        alone, own = bsdf.eval(context, si, wo), bsdf.pdf(context, si, wo)
        dr.eval(f, pdf, sample, weight, alone, own)  # one kernel: compiling is most of the time
        assert np.allclose(np.array(alone), np.array(f), rtol=1e-6, atol=0)
        assert np.allclose(np.array(own), np.array(pdf), rtol=1e-6, atol=0)
        return tuple(np.array(x) for x in (f, pdf, sample.wo, sample.pdf, weight))

    n = np.zeros(len(u), np.float32) if strands is None else strands.astype(np.float32)
    if "scalar" in mi.variant():
        rows = [
            once(*(list(map(float, v)) for v in (a, b)), np.array([float(x) for x in c]), float(k))
            for a, b, c, k in zip(r.vector, i.vector, u, n, strict=True)
        ]
        f, pdf, wo, sample_pdf, weight = (np.array(x) for x in zip(*rows, strict=True))
    else:
        f, pdf, wo, sample_pdf, weight = once(r.vector.T, i.vector.T, u.T, n)
        f, wo, weight = f.T, wo.T, weight.T
    return Answers(f, np.ravel(pdf), directions(wo), np.ravel(sample_pdf), weight)


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float((np.abs(a - b) / np.maximum(np.abs(b), 1e-10)).max())


@pytest.mark.parametrize("fibre", FIBRES)
@pytest.mark.parametrize("variant", VARIANTS)
def test_says_what_python_says(variant: str, fibre: str, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    from cuticle import mitsuba as plugin

    rng = np.random.default_rng(1)
    count = VARIANTS[variant]
    r, i = random_directions(rng, count), random_directions(rng, count)
    u = rng.random((count, 3), np.float32)
    given = {"fibre": fibre, "sampling": "lobes"}
    said = ask(mi, mi.load_dict({"type": "cuticle", **given}), r, i, u)
    material = plugin.read_material(given)
    f = alone(material.fibre).eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
    assert relative(said.f, np.broadcast_to(f, said.f.shape)) <= 1e-4  # single precision and tables in it
    assert material.single is not None
    assert relative(said.pdf, material.single.pdf(i.theta, r.theta, i.phi - r.phi)) <= 1e-4
    drawn = material.single.sample(r.theta, u.astype(float))
    apart = np.abs(np.stack([said.wo.theta - drawn.theta_i, np.cos(drawn.theta_i) * _turn(said.wo.phi - r.phi - drawn.phi)]))
    assert apart.max() <= 1e-4
    # What sample() returns is what pdf() and eval() say of the direction it drew.
    assert relative(said.sample_pdf, material.single.pdf(said.wo.theta, r.theta, said.wo.phi - r.phi)) <= 1e-3
    value = alone(material.fibre).eval(said.wo.theta, r.theta, said.wo.phi - r.phi) * np.cos(said.wo.theta)[:, None]
    assert relative(said.weight * said.sample_pdf[:, None], np.broadcast_to(value, said.f.shape)) <= 1e-3


def _turn(x: np.ndarray) -> np.ndarray:
    return (x + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("fibre", ["blond", "document"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_among_strands_says_what_python_says(variant: str, fibre: str, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    from cuticle import mitsuba as plugin

    rng = np.random.default_rng(2)
    count = VARIANTS[variant] // 4
    r, i = random_directions(rng, count), random_directions(rng, count)
    u = rng.random((count, 3), np.float32)
    given = {"fibre": fibre, "sampling": "lobes"}
    bsdf, material = mi.load_dict({"type": "cuticle", **given}), plugin.read_material(given)
    model = cuticle.DualScattering(material.fibre)
    assert material.combined is not None
    for n in (0.0, 0.5, 1.0, 2.0, 7.0):
        said = ask(mi, bsdf, r, i, u, np.full(count, n))
        f = model.with_strands(n).eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
        assert relative(said.f, np.broadcast_to(f, said.f.shape)) <= 2e-4  # a_f to the n-th power
        mean = ask(mi, bsdf, r, i, u, np.full(count, n), behind=3.0 if fibre == "blond" else HALF_SPACE).f
        stack = 3.0 if fibre == "blond" else None  # zinke2008 stays as printed
        f = model.expected(i.theta, r.theta, i.phi - r.phi, n, behind=stack) * np.cos(i.theta)[:, None]
        assert relative(mean, np.broadcast_to(f, mean.shape)) <= 3e-4  # differences of exponentials
        # The direction is drawn, and its density told, without knowing n.
        assert relative(said.pdf, material.combined.pdf(i.theta, r.theta, i.phi - r.phi)) <= 1e-4


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


NEAR = {"near": True, "beta_m": 0.3, "beta_n": 0.25, "alpha": -2.0, "eumelanin": 1.3}


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


@pytest.mark.slow
@pytest.mark.parametrize("sampling", ["lobes", "document", "uniform"])
def test_every_sampling_tells_its_own_density(sampling: str, use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    from cuticle import mitsuba as plugin

    rng = np.random.default_rng(6)
    r, i, u = random_directions(rng, 5000), random_directions(rng, 5000), rng.random((5000, 3), np.float32)
    said = ask(mi, mi.load_dict({"type": "cuticle", "fibre": "brown", "sampling": sampling}), r, i, u)
    single = plugin.read_material({"fibre": "brown", "sampling": sampling}).single
    if sampling == "uniform":
        assert single is None
        assert relative(said.pdf, np.full(5000, 1 / (4 * np.pi))) <= 1e-6
    else:
        assert single is not None
        assert relative(said.pdf, single.pdf(i.theta, r.theta, i.phi - r.phi)) <= 2e-4


@pytest.mark.slow
def test_a_sampler_file_is_what_is_drawn_from(tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    model = cuticle.DualScattering(cuticle.Fibre.preset("brown"))
    path = cuticle.fit(model, 3, strands=COUNTS).sampler.save(tmp_path / "brown.json")
    bsdf = mi.load_dict({"type": "cuticle", "filename": str(path)})
    rng = np.random.default_rng(7)
    r, i, u = random_directions(rng, 5000), random_directions(rng, 5000), rng.random((5000, 3), np.float32)
    said = ask(mi, bsdf, r, i, u)
    assert relative(said.pdf, cuticle.Sampler.load(path).pdf(i.theta, r.theta, i.phi - r.phi, strands=0)) <= 1e-4
    f = alone(model.fibre).eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
    assert relative(said.f, f) <= 1e-4
    assert "3 lobes" in str(bsdf)
    text = f'<bsdf version="3.0.0" type="cuticle"><string name="filename" value="{path}"/></bsdf>'
    assert str(mi.load_string(text)) == str(bsdf)


@pytest.mark.parametrize("parameters", [{"fibre": "brown"}, {**NEAR}], ids=["far", "near"])
def test_no_direction_and_no_strand_gives_a_nan(parameters: dict[str, Any], use_variant: UseVariant, tmp_path: Path) -> None:
    """Any bits as directions and random numbers, and a strand padded by its tip, whose segments have no frame.

    Where Mitsuba's `hair` gives 0, as here, one NaN would spoil a pixel.
    """
    mi = use_variant("scalar_rgb")
    bsdf, context, rng = mi.load_dict({"type": "cuticle", **parameters}), mi.BSDFContext(), np.random.default_rng(1)
    odd = np.array([np.nan, np.inf, -np.inf, 0, -0.0, 1e38, 1e-45, 1, -1])
    for _ in range(500):
        wi, wo, u = (rng.choice(odd, 3) if rng.random() < 0.5 else rng.normal(size=3) for _ in range(3))
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*wi)
        value, pdf = bsdf.eval_pdf(context, si, mi.Vector3f(*wo))
        sample, weight = bsdf.sample(context, si, u[0], mi.Point2f(*u[1:]))
        found = np.array([*value, pdf, *sample.wo, sample.pdf, *weight])
        assert np.isfinite(found).all(), (wi, wo, u)
        if not np.isfinite([*wi, *wo]).all():
            assert found[:4].tolist() == [0, 0, 0, 0]

    np.savetxt(tmp_path / "point.txt", np.tile([0, 0, 0, 0.3], (6, 1)))
    scene = {
        "type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"},
        "hair": {"type": "bsplinecurve", "filename": str(tmp_path / "point.txt"), "bsdf": bsdf},
        "sensor": {
            "type": "perspective", "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
        },
    }  # fmt: skip
    image = np.array(mi.render(mi.load_dict(scene), spp=64))
    assert np.isfinite(image).all()


def test_says_what_it_holds(use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    text = str(mi.load_string('<bsdf version="3.0.0" type="cuticle"><string name="fibre" value="blond"/></bsdf>'))
    for part in ("eumelanin=0.3", "beta_R=8.3", "its own density", "sigma_a", "scale"):
        assert part in text
    text = str(mi.load_dict({"type": "cuticle", "fibre": "blond", "lobes": 1}))
    assert "1 lobes" in text
    assert "sampling among strands" in text


# 25 of ours, one family at 1e-3 together.
VIEWERS = (0, 60, -60, 85, -85)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", VIEWERS)
@pytest.mark.parametrize("fibre", FIBRES)
def test_passes_mitsubas_chi_square(fibre: str, degrees: float, use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    passed, p_value = chi_square(mi, "cuticle", f'<string name="fibre" value="{fibre}"/>', degrees)
    assert passed, p_value


@pytest.mark.slow
@pytest.mark.parametrize(("roughness", "eumelanin"), [(0.25, 0.3), (0.3, 1.3)])
def test_mitsubas_own_hair_fails_the_same(roughness: float, eumelanin: float, use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    values = {"longitudinal_roughness": roughness, "azimuthal_roughness": 0.3, "eumelanin": eumelanin, "pheomelanin": 0}
    xml = "".join(f'<float name="{k}" value="{v}"/>' for k, v in values.items())
    assert not chi_square(mi, "hair", xml, 60)[0]


def chi_square(mi: Any, name: str, xml: str, degrees: float) -> tuple[bool, float]:
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    t = np.radians(degrees)
    viewer = mi.ScalarVector3f(0.3 * np.cos(t), np.sin(t), np.sqrt(0.91) * np.cos(t))
    sample, pdf = BSDFAdapter(name, xml, wi=viewer)
    test = ChiSquareTest(
        domain=SphericalDomain(), sample_func=sample, pdf_func=pdf, sample_dim=3, sample_count=500_000, res=201, ires=8
    )
    return test.run(significance_level=1e-3, test_count=len(FIBRES) * len(VIEWERS), quiet=True), test.p_value
