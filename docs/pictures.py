"""Render the pictures of README and docs: heads of hair, samplings at equal time, dual scattering beside paths.

Without arguments all of them, else those that are named: `docs/pictures.py heads built_in`. The grooms are read from
$CUTICLE_DATA/hair: TressFX's ponytail (Advanced Micro Devices, MIT), and Sintel's hair (the README names its authors).
"""

from __future__ import annotations

import io
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cuticle._support.files import write_bytes
from cuticle.cli.terminal import progress_bar
from cuticle.grooms.bust import Bust
from cuticle.grooms.groom import Groom, join_grooms, read_groom
from cuticle.grooms.procedural import hair_ball, hair_head, head_bust, wavy_lock
from cuticle.grooms.variation import vary
from cuticle.render.compare import compare_samplings
from cuticle.render.picture import over_backdrop, render, srgb
from cuticle.render.scene import Light, View, bsdf, bust_shape, integrator, load_scene, mitsuba
from cuticle.sampling.quality import UniformSphere, measure
from cuticle.scattering.conventions import sigma_a_of_pigment
from cuticle.scattering.marschner import Marschner

IMAGES = Path(__file__).parent / "images"
PONYTAIL = ("back", "front_top", "side", "tail")


def ponytail(data: Path) -> Groom:
    return join_grooms([read_groom(data / "hair" / "tressfx" / f"ponytail_{part}.tfx") for part in PONYTAIL])


def sintel(data: Path) -> tuple[Groom, Bust]:
    """Sintel's hair, full, and a bust through its roots."""
    guides = read_groom(data / "hair" / "sintel" / "sintel.tfx")
    bust = Bust.fitted(guides)
    guides = replace(guides, points=bust.kept_out(guides.points, 5e-4).astype(np.float32))
    full = guides.interpolated(100_000, points=20, clumping=0.35, frizz=0.008, length_variation=0.1)
    return full.with_thickness(5e-5, 2.5e-5), bust  # metres


def png(pixels: np.ndarray) -> bytes:
    from matplotlib import image

    buffer = io.BytesIO()
    image.imsave(buffer, pixels, format="png", metadata={"Software": "cuticle"})
    return buffer.getvalue()


def split(groom: Groom, share: float) -> tuple[Groom, Groom]:
    """A random share of the strands, and the others."""
    chosen = np.random.default_rng(5).random(groom.strands) < share
    own = np.repeat(chosen, groom.counts)
    first, second = (
        Groom(groom.points[of], np.append(0, np.cumsum(groom.counts[which])), groom.radius[of])
        for which, of in ((chosen, own), (~chosen, ~own))
    )
    return first, second


def heads(mi: Any, data: Path) -> None:
    """Blond, red, brown, black and grey: one head of hair, one light, and the melanin of each."""
    groom, bust = sintel(data)
    shape = {"type": "cuticle", "alpha_R": -2.0, "beta_R": 8.3, "beta_N": 12.2}
    red = {**shape, "eumelanin": 0.04, "pheomelanin": 1.2}
    grey = {**shape, "eumelanin": 1.6, "pheomelanin": 0.0}
    white = {**shape, "sigma_a": {"type": "rgb", "value": [0.02, 0.02, 0.022]}}
    view = View(azimuth=-40, elevation=4, width=420, height=500, fov=20, zoom=0.78)
    layers = []
    with tempfile.TemporaryDirectory() as folder, progress_bar() as progress:
        for material in (bsdf("blond"), red, bsdf("brown"), bsdf("black"), grey):
            hair, others = groom, {"bust": bust_shape(mi, bust, 0.06)}
            if material is grey:  # strays are another shape, of another fibre
                strays, hair = split(groom, 0.22)
                strays.save(Path(folder) / "strays.txt")
                others["strays"] = {"type": "bsplinecurve", "filename": str(Path(folder) / "strays.txt"), "bsdf": white}
            scene = load_scene(
                mi,
                hair,
                material,
                view=view,
                light=Light("studio"),
                technique=integrator("dual"),
                others=others,
                framed=groom,
            )
            layers.append(render(scene, 144, progress=progress).image)
    pitch = 330
    row = np.zeros((view.height, 4 * pitch + view.width, 4))
    for k in (0, 4, 1, 3, 2):  # the middle one in front
        place = row[:, k * pitch : k * pitch + view.width]
        place[:] = layers[k] + (1 - layers[k][..., 3:]) * place
    write_bytes(IMAGES / "heads.png", png(srgb(over_backdrop(row[50:] * np.array([1.15] * 3 + [1])))))


def ess_of_brown() -> None:
    """What a single hit gains: the ESS of f·cos under uniform sampling and under the lobes that the plugin fits."""
    from cuticle.mitsuba import read_material

    material = read_material({"fibre": "brown", "sampling": "lobes"})
    model = Marschner(material.fibre, "energy_conserving")
    assert material.single is not None
    for name, density in (("uniform", UniformSphere()), ("lobes", material.single)):
        values = [measure(density, model, float(np.radians(t)), 0.0).ess for t in (0, 30, 60)]
        print(f"brown, {name}: ESS {', '.join(f'{v:.3f}' for v in values)} at theta_r 0, 30, 60")


def varied(mi: Any, data: Path) -> None:
    """One head of hair three times, in the same time each: one fibre, melanin that varies, and everything that varies."""
    groom, bust = sintel(data)
    view = View(azimuth=-40, elevation=4, width=440, height=520, fov=20, zoom=0.85)
    others, images = {"bust": bust_shape(mi, bust, 0.06)}, []
    for values in (
        {"melanin_spread": 0, "redness_spread": 0, "roughness_spread": 0},
        {"melanin_spread": 0.8, "redness_spread": 0.3, "roughness_spread": 0},
        {"melanin_spread": 0.8, "redness_spread": 0.3, "roughness_spread": 0.4, "strays": 0.08, "root_darkening": 1.5,
         "tip_lightening": 0.6, "tilt": 2.5},
    ):  # fmt: skip
        hair = vary(groom, melanin=0.7, redness=0.15, roughness=0.25, clumping=0.5, **values)
        scene = load_scene(
            mi, hair, {"type": "cuticle"}, view=view, light=Light("studio"), technique=integrator("dual"), others=others
        )
        with progress_bar() as progress:
            images.append(over_backdrop(render(scene, 72, progress=progress).image * np.array([1.15] * 3 + [1])))
    write_bytes(IMAGES / "varied.png", png(srgb(np.concatenate(images, axis=1))))


def one_fit(mi: Any, data: Path) -> None:
    """Hair that varies in melanin and roughness, beside one fit of its mean fibre, of which melanin alone can vary."""
    from cuticle.mitsuba import strand_texture

    groom, bust = sintel(data)
    hair = vary(groom, melanin=0.7, redness=0.15, roughness=0.25, clumping=0.5, melanin_spread=0.8, roughness_spread=0.6)
    mean = {name: float(values.mean()) for name, values in hair.attributes.items()}
    green = sigma_a_of_pigment(hair.attributes["eumelanin"], hair.attributes["pheomelanin"])[..., 1]
    scale = green / sigma_a_of_pigment(mean["eumelanin"], mean["pheomelanin"])[1]
    darker = strand_texture(groom.with_attributes(scale=scale), "scale")
    view = View(azimuth=-40, elevation=4, width=440, height=520, fov=20, zoom=0.85)
    images, seconds = [], 0.0
    for curves, material in ((groom, {"type": "cuticle", "sampling": "lobes", "scale": darker, **mean}),
                             (hair, {"type": "cuticle"})):  # fmt: skip
        scene = load_scene(
            mi, curves, material, view=view, light=Light("studio"), technique=integrator("path", depth=32),
            others={"bust": bust_shape(mi, bust, 0.06)},
        )  # fmt: skip
        a_sample = render(scene, 4, seed=1).seconds / 4
        seconds = seconds or 64 * a_sample
        with progress_bar() as progress:
            done = render(scene, max(1, round(seconds / a_sample)), progress=progress)
        print(f"{'one fit' if curves is groom else 'any fibre'}: {done.seconds:.0f} s")
        images.append(over_backdrop(done.image * np.array([1.15] * 3 + [1])))
    write_bytes(IMAGES / "one_fit.png", png(srgb(np.concatenate(images, axis=1))))


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
    from matplotlib.figure import Figure

    groom = ponytail(data).with_followers(8, 0.3, tip_spread=0.8).with_thickness(0.05, 0.02)
    figure = Figure(figsize=(12, 4.6), layout="constrained")
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
    """Absorption strand by strand."""
    from cuticle.mitsuba import strand_texture

    lock = wavy_lock(1500, width=0.2)
    scale = lock.with_attributes(scale=np.exp(np.random.default_rng(3).normal(0, 0.9, lock.strands)))
    view = View(azimuth=20, elevation=4, width=300, height=500, zoom=1.5)
    images = []
    for material in (bsdf("brown"), bsdf("brown", scale=strand_texture(scale, "scale"))):
        scene = load_scene(mi, lock, material, view=view, light=Light("studio"), technique=integrator("dual"))
        with progress_bar() as progress:
            images.append(over_backdrop(render(scene, 64, progress=progress).image * np.array([1.5] * 3 + [1])))
    write_bytes(IMAGES / "strand_by_strand.png", png(srgb(np.concatenate(images, axis=1))))


def built_in(mi: Any) -> None:
    """The head of hair that needs no file, in three colours, from behind and from its front."""
    head, others = hair_head(60_000).with_thickness(0.0011, 0.0005), {"bust": bust_shape(mi, head_bust(), 0.06)}
    red = {"type": "cuticle", "eumelanin": 0.1, "pheomelanin": 1.6, "beta_R": 7.0, "beta_N": 12.0, "alpha_R": -2.5}
    images = []
    for material, azimuth, elevation in ((bsdf("blond"), 30, 10), (bsdf("brown"), -35, 14), (red, 150, 6)):
        view = View(azimuth=azimuth, elevation=elevation, width=400, height=460, zoom=0.95)
        scene = load_scene(mi, head, material, view=view, light=Light("studio"), technique=integrator("dual"), others=others)
        with progress_bar() as progress:
            images.append(over_backdrop(render(scene, 64, progress=progress).image * np.array([1.15] * 3 + [1])))
    write_bytes(IMAGES / "built_in.png", png(srgb(np.concatenate(images, axis=1))))


def main() -> None:
    data = Path(os.environ.get("CUTICLE_DATA", Path(__file__).parents[1] / "../shared/data"))
    mi = mitsuba("scalar_rgb")
    pictures: dict[str, Callable[[], None]] = {
        "heads": lambda: heads(mi, data),
        "varied": lambda: varied(mi, data),
        "one_fit": lambda: one_fit(mi, data),
        "equal_time": lambda: equal_time(data),
        "beside_paths": lambda: beside_paths(mi, data),
        "textured": lambda: textured(mi),
        "built_in": lambda: built_in(mi),
    }
    for name in sys.argv[1:] or pictures:
        if name not in pictures:
            sys.exit(f"a picture is one of {', '.join(pictures)}; got {name!r}")
        pictures[name]()


if __name__ == "__main__":
    main()
