"""The BSDF `cuticle` in Mitsuba, beside what Python computes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from conftest import COUNTS
from mitsuba_answers import (
    FIBRES,
    HALF_SPACE,
    NEAR,
    VARIANTS,
    UseVariant,
    alone,
    ask,
    random_questions,
    relative,
)

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'", allow_module_level=True)


@pytest.mark.parametrize("fibre", FIBRES)
@pytest.mark.parametrize("variant", VARIANTS)
def test_says_what_python_says(variant: str, fibre: str, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    from cuticle import mitsuba as plugin

    r, i, u = random_questions(1, VARIANTS[variant])
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

    count = VARIANTS[variant] // 4
    r, i, u = random_questions(2, count)
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
@pytest.mark.parametrize("sampling", ["lobes", "document", "uniform"])
def test_every_sampling_tells_its_own_density(sampling: str, use_variant: UseVariant) -> None:
    mi = use_variant("llvm_ad_rgb")
    from cuticle import mitsuba as plugin

    r, i, u = random_questions(6, 5000)
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
    r, i, u = random_questions(7, 5000)
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
