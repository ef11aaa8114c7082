"""Render the pictures of README and docs/mitsuba.md: heads of hair, samplings at equal time, dual scattering beside paths.

The ponytail is one of TressFX's grooms (Advanced Micro Devices, MIT), read from $CUTICLE_DATA/hair.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from cuticle._support.files import write_bytes
from cuticle.cli.terminal import progress_bar
from cuticle.grooms.groom import Groom, join_grooms, read_groom
from cuticle.grooms.procedural import hair_ball, hair_head, wavy_lock
from cuticle.render.compare import compare_samplings
from cuticle.render.picture import over_backdrop, render, srgb
from cuticle.render.scene import Light, View, bsdf, integrator, load_scene, mitsuba
from cuticle.sampling.quality import UniformSphere, measure
from cuticle.scattering.marschner import Marschner

IMAGES = Path(__file__).parent / "images"
PONYTAIL = ("back", "front_top", "side", "tail")


def ponytail(data: Path) -> Groom:
    return join_grooms([read_groom(data / "hair" / "tressfx" / f"ponytail_{part}.tfx") for part in PONYTAIL])


def skull(mi: Any, groom: Groom, folder: Path) -> dict[str, Any]:
    """An ellipsoid through the roots of the strands, a little smaller."""
    roots = groom.points[groom.offsets[:-1]].astype(np.float64)
    k, *_ = np.linalg.lstsq(np.hstack([roots**2, roots]), np.ones(len(roots)), rcond=None)
    centre = -k[3:] / (2 * k[:3])
    radii = 0.9 * np.sqrt((1 + (k[:3] * centre**2).sum()) / k[:3])
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 65), np.linspace(0, 2 * np.pi, 129), indexing="ij")
    unit = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1).reshape(-1, 3)
    lines = ["v {:.6g} {:.6g} {:.6g}".format(*p) for p in centre + radii * unit]
    lines += ["vn {:.6g} {:.6g} {:.6g}".format(*n) for n in unit / radii]
    corner = (np.arange(64)[:, None] * 129 + np.arange(128) + 1).ravel()
    for a in corner:
        lines.append("f {0}//{0} {1}//{1} {2}//{2} {3}//{3}".format(a, a + 1, a + 130, a + 129))
    (folder / "skull.obj").write_text("\n".join(lines) + "\n")
    skin = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.06, 0.04, 0.033]}}
    return {"type": "obj", "filename": str(folder / "skull.obj"), "bsdf": skin}


def png(pixels: np.ndarray) -> bytes:
    from matplotlib import image

    buffer = io.BytesIO()
    image.imsave(buffer, pixels, format="png", metadata={"Software": "cuticle"})
    return buffer.getvalue()


def heads(mi: Any, data: Path) -> None:
    groom = ponytail(data).with_followers(14, 0.35, tip_spread=1.0).with_thickness(0.045, 0.018)
    hair: list[tuple[dict[str, Any], float]] = [
        (bsdf("blond"), 60),
        ({"type": "cuticle", "alpha_R": -2.0, "beta_R": 8.3, "beta_N": 12.2, "eumelanin": 0.25, "pheomelanin": 0.8}, 110),
        (bsdf("brown"), 35),
    ]
    rows = []
    with tempfile.TemporaryDirectory() as folder, progress_bar() as progress:
        others = {"skull": skull(mi, groom, Path(folder))}
        for material, azimuth in hair:
            view = View(azimuth=azimuth, elevation=6, width=440, height=600, fov=24)
            scene = load_scene(
                mi, groom, material, view=view, light=Light("studio"), technique=integrator("dual"), others=others
            )
            rows.append(over_backdrop(render(scene, 256, progress=progress).image * np.array([1.35] * 3 + [1])))
    write_bytes(IMAGES / "heads.png", png(srgb(np.concatenate(rows, axis=1))))


def ess_of_brown() -> None:
    """What a single hit gains: the ESS of f·cos under uniform sampling and under the lobes that the plugin fits."""
    from cuticle.mitsuba import read_material

    material = read_material({"fibre": "brown"})
    model = Marschner(material.fibre, "energy_conserving")
    assert material.single is not None
    for name, density in (("uniform", UniformSphere()), ("lobes", material.single)):
        values = [measure(density, model, float(np.radians(t)), 0.0).ess for t in (0, 30, 60)]
        print(f"brown, {name}: ESS {', '.join(f'{v:.3f}' for v in values)} at theta_r 0, 30, 60")


def equal_time(data: Path) -> None:
    ess_of_brown()
    tail = ponytail(data).with_followers(8, 0.3, tip_spread=0.8).with_thickness(0.05, 0.02)
    for name, groom, view in (
        ("ball", hair_ball(), View(width=256, height=256)),
        ("ponytail", tail, View(azimuth=60, width=256, height=256)),
    ):
        with progress_bar() as progress, tempfile.TemporaryDirectory() as folder:
            result = compare_samplings(groom, "brown", view=view, seconds=4, reference_spp=1536, progress=progress)
            result.save(folder)
            shutil.copy(Path(folder) / "sheet.png", IMAGES / f"equal_time_{name}.png")
            if name == "ponytail":
                shutil.copy(Path(folder) / "curves.png", IMAGES / "equal_time_curves.png")
        for c in result.contenders:
            print(f"{name}, {c.technique}, {c.sampling}: {c.spp} samples, relMSE {c.error:.3g}, gain {result.gain(c):.2f}")


def beside_paths(mi: Any, data: Path) -> None:
    """Direct light, dual scattering and paths of 64 segments, blond, at equal samples."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    groom = ponytail(data).with_followers(8, 0.3, tip_spread=0.8).with_thickness(0.05, 0.02)
    figure = Figure(figsize=(12, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 4)
    view = View(azimuth=60, elevation=6, width=360, height=460, fov=24)
    for ax, (title, technique) in zip(
        axes,
        (
            ("Mitsuba's direct", integrator("direct")),
            ("dual_scattering, grid", integrator("dual")),
            ("dual_scattering, trace", integrator("dual", counter="trace")),
            ("path, 64 segments", integrator("path", depth=64)),
        ),
        strict=True,
    ):
        scene = load_scene(mi, groom, bsdf("blond"), view=view, light=Light("studio"), technique=technique)
        with progress_bar() as progress:
            done = render(scene, 64, progress=progress)
        ax.imshow(srgb(over_backdrop(done.image)), interpolation="lanczos")
        ax.set_title(f"{title}\n{done.seconds:.0f} s", fontsize=11)
        ax.set_axis_off()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, bbox_inches="tight", pad_inches=0.05, metadata={"Software": None})
    write_bytes(IMAGES / "dual_scattering.png", buffer.getvalue())


def textured(mi: Any) -> None:
    """Absorption strand by strand: Mitsuba's v runs once through the file's segments, so a row a segment colours them."""
    lock = wavy_lock(1500, width=0.2)
    scale = np.exp(np.random.default_rng(3).normal(0, 0.9, lock.strands))
    rows = np.append(np.repeat(scale, lock.counts - 1), 1)[:, None, None].astype(np.float32)  # the last is the guard's
    texture = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(rows),
        "raw": True,
        "filter_type": "nearest",
    }
    view = View(azimuth=20, elevation=4, width=300, height=500, zoom=1.5)
    images = []
    for material in (bsdf("brown"), bsdf("brown", scale=texture)):
        scene = load_scene(mi, lock, material, view=view, light=Light("studio"), technique=integrator("dual"))
        with progress_bar() as progress:
            images.append(over_backdrop(render(scene, 64, progress=progress).image * np.array([1.5] * 3 + [1])))
    write_bytes(IMAGES / "strand_by_strand.png", png(srgb(np.concatenate(images, axis=1))))


def built_in(mi: Any) -> None:
    """The head of hair that needs no file, in three colours."""
    head = hair_head()
    red = {"type": "cuticle", "eumelanin": 0.1, "pheomelanin": 1.6, "beta_R": 7.0, "beta_N": 12.0, "alpha_R": -2.5}
    images = []
    for material, azimuth, elevation in ((bsdf("blond"), 25, 10), (bsdf("brown"), -30, 22), (red, 60, 8)):
        view = View(azimuth=azimuth, elevation=elevation, width=380, height=460)
        scene = load_scene(mi, head, material, view=view, light=Light("studio"), technique=integrator("dual"))
        with progress_bar() as progress:
            images.append(over_backdrop(render(scene, 192, progress=progress).image * np.array([1.3] * 3 + [1])))
    write_bytes(IMAGES / "built_in.png", png(srgb(np.concatenate(images, axis=1))))


def main() -> None:
    data = Path(os.environ.get("CUTICLE_DATA", Path(__file__).parents[1] / "../shared/data"))
    mi = mitsuba("scalar_rgb")
    wanted = sys.argv[1:] or ["heads", "equal_time", "beside_paths", "textured", "built_in"]
    if "heads" in wanted:
        heads(mi, data)
    if "equal_time" in wanted:
        equal_time(data)
    if "beside_paths" in wanted:
        beside_paths(mi, data)
    if "textured" in wanted:
        textured(mi)
    if "built_in" in wanted:
        built_in(mi)


if __name__ == "__main__":
    main()
