"""Functions that are no `Fibre`'s in the BSDF `cuticle`: Chiang's closed forms, tables, dual scattering of both."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import run_program
from cuticle.grooms.groom import Groom
from cuticle.grooms.procedural import hair_ball
from mitsuba_answers import VARIANTS, UseVariant, ask, random_directions, random_questions, relative
from test_export_functions import CHIANG, make_table

TILTED = cuticle.Chiang(**CHIANG.values() | {"alpha": 4.0, "eumelanin": 0.8})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table, Chiang's parameters, and samplers of both among strands."""
    made = tmp_path_factory.mktemp("functions")
    make_table(made / "mine.npz", TILTED.eval)
    TILTED.save(made / "mine.toml")
    for name, single in (("chiang", TILTED), ("table", cuticle.Tabulated.load(made / "mine.npz"))):
        cuticle.fit(cuticle.Strands(single), 2, strands=(0, 2)).sampler.save(made / f"{name}.json")
    return made


@pytest.mark.parametrize("variant", VARIANTS)
def test_chiang_says_what_python_says(variant: str, folder: Path, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    from cuticle import mitsuba as plugin

    r, i, u = random_questions(3, VARIANTS[variant] // 4)
    given: dict[str, Any] = {"fibre": str(folder / "mine.toml"), "sampling": "lobes"}
    said = ask(mi, mi.load_dict({"type": "cuticle"} | given), r, i, u)
    f = TILTED.eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
    assert relative(said.f, f) <= 2e-4
    material = plugin.read_material(given)
    assert material.fibre == TILTED
    assert relative(said.pdf, material.single.pdf(i.theta, r.theta, i.phi - r.phi)) <= 1e-4
    # Parameters in the scene, over those of the file; another absorption falls between two of the tables.
    inline = {"beta_m": 0.6, "beta_n": 0.6, "alpha": 4.0, "eumelanin": 0.8}
    assert plugin.read_material(inline).fibre == TILTED
    assert plugin.read_material(given | {"alpha": 1.0}).fibre == cuticle.Chiang(**TILTED.values() | {"alpha": 1.0})
    darker = ask(mi, mi.load_dict({"type": "cuticle", "scale": 2.0} | given), r, i, u)
    f = TILTED.with_absorption(tuple(2 * x for x in TILTED.absorption)).eval(i.theta, r.theta, i.phi - r.phi)
    f *= np.cos(i.theta)[:, None]
    assert np.abs(darker.f - f).max() <= 0.01 * f.max()


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_near_field_says_what_python_says(variant: str, folder: Path, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    r, i, u = random_questions(6, VARIANTS[variant] // 4)
    near = TILTED.near(-np.cos(r.phi))
    said = ask(mi, mi.load_dict({"type": "cuticle", "fibre": str(folder / "mine.toml"), "near": True}), r, i, u)
    f = near.eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
    pdf = near.pdf(i.theta, r.theta, i.phi - r.phi)
    # Where the ray grazes the strand, |h| near 1, single precision knows asin(h) to 2e-4.
    inner = np.abs(near.h) < 0.999
    assert relative(said.f[inner], f[inner]) <= 2e-3
    assert relative(said.pdf[inner], pdf[inner]) <= 2e-3
    drawn = near.sample(r.theta, u.astype(float))
    off = np.abs(np.stack([said.wo.theta - drawn.theta_i, np.sin(said.wo.phi - r.phi - drawn.phi) * np.cos(drawn.theta_i)]))
    assert np.quantile(off[:, inner], 0.995) <= 1e-3
    value = near.eval(said.wo.theta, r.theta, said.wo.phi - r.phi) * np.cos(said.wo.theta)[:, None]
    apart = np.abs(said.weight * said.sample_pdf[:, None] - value)[inner] / value.max()
    assert apart.max() <= 2e-3


def test_in_place_of_hair_as_the_docs_say(use_variant: UseVariant) -> None:
    """The scene file of docs/mitsuba.md is `hair` with nothing set; so is what `from_host` returns."""
    mi = use_variant("scalar_rgb")
    page = (Path(__file__).parent.parent / "docs" / "mitsuba.md").read_text()
    written = page[page.index('This is `<bsdf type="hair"/>`') :].split("```xml\n")[1].split("```")[0]
    scene = written.replace('"cuticle">', '"cuticle" version="3.0.0">')
    bsdfs = ({"type": "hair"}, {"type": "cuticle", "near": True} | cuticle.conventions.from_host("mitsuba"))
    rng = np.random.default_rng(8)
    theta_i, phi = rng.uniform(-1.4, 1.4, 300), rng.uniform(-np.pi, np.pi, 300)
    theirs, *ours = (
        cuticle.from_mitsuba(x, h=0.3).eval(theta_i, 0.4, phi) for x in (*map(mi.load_dict, bsdfs), mi.load_string(scene))
    )
    for f in ours:
        np.testing.assert_allclose(f, theirs, rtol=0.03, atol=1e-6)  # Mitsuba's Bessel function, see tests/test_chiang.py


SPECTRUM = {"type": "irregular", "wavelengths": "400, 500, 600, 700", "values": "0.8, 0.5, 0.2, 0.1"}


@pytest.mark.parametrize(
    ("variant", "sigma_a", "expected"),
    [
        ("scalar_rgb", {"type": "bitmap", "raw": True}, (0.2, 0.4, 0.8)),
        ("scalar_rgb", {"type": "rgb", "value": [0.2, 0.4, 0.8]}, (0.2, 0.4, 0.8)),
        ("scalar_spectral", SPECTRUM, (0.68, 0.35, 0.29, 0.18)),  # at the wavelengths of ask(): 440, 550, 570 and 620 nm
        (
            "scalar_spectral",
            {"type": "spectrum", "value": [(400, 0.8), (500, 0.5), (600, 0.2), (700, 0.1)]},
            (0.68, 0.35, 0.29, 0.18),
        ),
    ],
    ids=str,
)
def test_absorption_is_a_texture_or_a_spectrum(
    variant: str, sigma_a: dict[str, Any], expected: tuple[float, ...], use_variant: UseVariant
) -> None:
    """Each wavelength has a value of its own, and `scale` multiplies it."""
    mi = use_variant(variant)
    if sigma_a["type"] == "bitmap":
        sigma_a = {**sigma_a, "bitmap": mi.Bitmap(np.broadcast_to(np.float32(expected), (2, 2, 3)).copy())}
    given = cuticle.conventions.from_host("mitsuba", sigma_a=sigma_a, scale=1.5)
    r, i, u = random_questions(9, 60)
    bsdf = mi.load_dict({"type": "cuticle", "near": True} | given)
    model = cuticle.Chiang(**cuticle.conventions.from_host("mitsuba", sigma_a=tuple(1.5 * np.array(expected))))
    f = model.near(-np.cos(r.phi)).eval(i.theta, r.theta, i.phi - r.phi) * np.cos(i.theta)[:, None]
    inner = np.abs(np.cos(r.phi)) < 0.999
    assert relative(ask(mi, bsdf, r, i, u).f[inner], f[inner]) <= 2e-3


@pytest.mark.slow
def test_the_near_field_is_mitsubas_hair_with_a_right_pdf(use_variant: UseVariant, tmp_path: Path) -> None:
    """The same picture as `hair`, and an audit that `hair` fails at this roughness."""
    mi = use_variant("llvm_ad_rgb")
    Groom(np.array([[0, -4, 0], [0, 0, 0], [0, 4, 0]]), np.array([0, 3]), np.full(1, 0.5)).save(tmp_path / "strand.txt")
    strand = {"type": "bsplinecurve", "filename": str(tmp_path / "strand.txt")}
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3},
        "light": {"type": "directional", "direction": [-0.5, -0.2, -1.0]},
        "sensor": {
            "type": "orthographic",
            "to_world": mi.ScalarTransform4f().look_at([0, 1, 4], [0, 0, 0], [0, 1, 0]) @ mi.ScalarTransform4f().scale(0.45),
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
        },
    }
    given = {"longitudinal_roughness": 0.4, "azimuthal_roughness": 0.5, "eumelanin": 0.3, "pheomelanin": 0.0}
    ours = cuticle.conventions.from_host("mitsuba", **given)
    pictures = []
    for bsdf in ({"type": "hair"} | given, {"type": "cuticle", "near": True} | ours):
        loaded = mi.load_dict(scene | {"hair": strand | {"bsdf": bsdf}})
        pictures.append(np.array(mi.render(loaded, spp=1024, seed=1))[..., :3].mean(axis=0))
    assert pictures[0].max() > 0.02
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=0.02, atol=1e-3 * pictures[0].max())
    sharp = cuticle.from_mitsuba("cuticle", h=0.3, near=True, beta_m=0.25, beta_n=0.3, eumelanin=0.3)
    assert cuticle.audit(sharp, theta_r=np.radians([0, 60]), samples=100_000).ok


@pytest.mark.parametrize(("variant", "name"), [("scalar_rgb", "chiang"), ("llvm_ad_rgb", "table"), ("cuda_ad_rgb", "table")])
def test_tables_say_what_python_says(variant: str, name: str, folder: Path, use_variant: UseVariant) -> None:
    mi = use_variant(variant)
    from cuticle import mitsuba as plugin
    from cuticle.mitsuba.build import COUNTS, function_table

    rng = np.random.default_rng(4)
    count = VARIANTS[variant] // 8
    r, i, u = random_directions(rng, count), random_directions(rng, count), rng.random((count, 3), np.float32)
    given: dict[str, Any] = {"filename": str(folder / f"{name}.json")}
    if variant == "scalar_rgb":  # or made at loading
        given = {"fibre": str(folder / {"chiang": "mine.toml", "table": "mine.npz"}[name]), "strands": True, "lobes": 2}
    material = plugin.read_material(given)
    assert material.among is not None
    assert material.among.d_f == 1
    bsdf = mi.load_dict({"type": "cuticle"} | given)
    phi = i.phi - r.phi
    n = rng.choice([0, 0.5, 1, 2, 3, 7, 20], count)
    for strands, function, counts in ((None, material.fibre, (0.0,)), (n, material.among, COUNTS)):
        said = ask(mi, bsdf, r, i, u, strands)
        table = function_table(function, counts)
        out = np.empty((count, 3))
        table.core.eval(i.theta, r.theta, phi, np.zeros(count) if strands is None else strands, out)
        f = out * np.cos(i.theta)[:, None]
        assert np.abs(said.f / f - 1).max() <= 1e-3
        sampler = material.single if strands is None else material.combined
        assert sampler is not None
        assert relative(said.pdf, sampler.pdf(i.theta, r.theta, phi)) <= 1e-4
        exact = function.eval(i.theta, r.theta, phi) * np.cos(i.theta)[:, None]
        if strands is None:
            assert np.abs(f - exact).mean() <= 0.02 * exact.mean()


def test_a_spectrum_of_a_table_has_its_channels(folder: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_spectral")
    r, i, u = random_questions(5, 50)
    said = ask(mi, mi.load_dict({"type": "cuticle", "fibre": str(folder / "mine.npz")}), r, i, u)
    mi = use_variant("scalar_rgb")
    rgb = ask(mi, mi.load_dict({"type": "cuticle", "fibre": str(folder / "mine.npz")}), r, i, u)
    # ask() gives 440, 550, 570 and 620 nm.
    np.testing.assert_allclose(said.f[:, [0, 1, 3]], rgb.f[:, ::-1], rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["path", "dual_scattering"])
def test_a_measured_fibre_is_rendered(integrator: str, folder: Path, use_variant: UseVariant) -> None:
    """A table of Chiang's function and the function itself make the same picture, and light passes through strands."""
    mi = use_variant("scalar_rgb")
    path = folder / "ball.txt"
    hair_ball(200).with_thickness(0.03).save(path)

    def render(bsdf: dict[str, Any]) -> np.ndarray:
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": integrator} | ({"counter": "trace"} if integrator == "dual_scattering" else {}),
                "hair": {"type": "bsplinecurve", "filename": str(path), "bsdf": {"type": "cuticle"} | bsdf},
                "light": {"type": "constant"},
                "sensor": {
                    "type": "perspective",
                    "to_world": mi.ScalarTransform4f().look_at([0, 0, 6], [0, 0, 0], [0, 1, 0]),
                    "film": {"type": "hdrfilm", "width": 24, "height": 24, "rfilter": {"type": "box"}},
                },
            }
        )
        return np.array(mi.render(scene, spp=32, seed=1))[..., :3]

    of_function, of_table = (render({"filename": str(folder / f"{name}.json")}) for name in ("chiang", "table"))
    assert np.isfinite(of_table).all()
    np.testing.assert_allclose(of_table.mean(), of_function.mean(), rtol=0.01)
    if integrator == "dual_scattering":
        alone = render({"fibre": str(folder / "mine.npz")})  # of a single strand: its shadows are opaque
        assert of_table.mean() > 1.02 * alone.mean()


def test_what_a_function_has_not_is_one_line(folder: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    table = str(folder / "mine.npz")
    for given, words in (
        ({"fibre": table, "sigma_a": 1.0}, "sigma_a is not a parameter of this scattering function (Tabulated)"),
        ({"fibre": table, "scale": 2.0}, "scale multiplies a fibre's absorption"),
        ({"fibre": table, "sampling": "document"}, "sampling document needs a fibre of R, TT and TRT"),
        ({"fibre": "brown", "beta_m": 0.3}, "beta_m is not a parameter of this scattering function (Fibre)"),
        ({"beta_m": 0.3}, "a fibre needs its absorption"),
        ({"fibre": "brown", "near": True}, "near needs Chiang's function"),
        ({"beta_m": 0.3, "eumelanin": 1.0, "near": True, "sampling": "uniform"}, "near draws from its own function"),
        ({"fibre": str(folder / "nowhere.npz")}, "nowhere.npz"),
    ):
        with pytest.raises(Exception, match="cuticle") as caught:
            mi.load_dict({"type": "cuticle"} | given)
        assert words in str(caught.value)


@pytest.mark.slow
def test_the_command_renders_a_table(folder: Path, use_variant: UseVariant) -> None:
    use_variant("scalar_rgb")
    make_table(folder / "grey.npz", cuticle.Chiang(sigma_a=(0.5,)).eval)
    # The default integrator wants it among strands: the command sees to that.
    options = ["--sampling", "uniform", "--spp", "2", "--width", "32", "-o", "ball.png"]
    done = run_program("render", "ball", "--fibre", "grey.npz", *options, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "ball.png").exists()
    assert "can stand among others" not in done.stdout + done.stderr
