"""pbrt-v4's `hair` beside the same hair exported, in the same CPU time: relMSE, each against a long render of its own.

    cuticle fit hair.toml -o hair && cuticle export hair --to pbrt --name chiang -o pbrt-v4/src/pbrt
    python benchmarks/pbrt.py PBRT --material chiang

PBRT is a built pbrt-v4 with that material in it (examples/pbrt.md). hair.toml is what `--toml` prints: `hair` without
parameters, in Chiang's. The scene is a ball of curves under two area lights. The two images differ, since `hair` is a near
field and the export is far-field; each is compared with itself. Times are user CPU time on one thread, less that of one
sample a pixel, in runs that alternate.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import cuticle
from cuticle.grooms.procedural import hair_ball
from cuticle.scattering.bcsdf import luminance
from cuticle.scattering.conventions import from_host
from far_field import random_offset_ess

SCENE = """LookAt 0 0 9  0 0 0  0 1 0
Camera "perspective" "float fov" 27
Sampler "independent" "integer pixelsamples" {samples} "integer seed" {seed}
Integrator "path" "integer maxdepth" {depth}
Film "rgb" "integer xresolution" {size} "integer yresolution" {size} "string filename" "{image}"
WorldBegin
AttributeBegin
AreaLightSource "diffuse" "rgb L" [4 4 4] "bool twosided" true
Translate -4 5 6
Rotate 45 1 1 0
Shape "disk" "float radius" 2.5
AttributeEnd
AttributeBegin
AreaLightSource "diffuse" "rgb L" [4 4 4] "bool twosided" true
Translate 3 4 -7
Rotate 30 -1 1 0
Shape "disk" "float radius" 2.5
AttributeEnd
Material "{material}"
{curves}
"""
FLOOR = 1e-3  # added to the squared reference: the lights have radiance 4
VIEWERS = np.radians(np.arange(-60, 61, 20.0))


class Renders:
    """pbrt's renders of one scene."""

    def __init__(self, given: argparse.Namespace, folder: Path) -> None:
        self.given, self.folder = given, folder
        points, offsets = hair_ball(given.strands).control_points()
        ends = zip(offsets, np.append(offsets[1:], len(points)), strict=False)
        self.curves = "\n".join(
            f'Shape "curve" "string basis" "bspline" "float width" {given.width} "point3 P" ['
            + " ".join(f"{x:.6g}" for x in points[a:b, :3].ravel())
            + "]"
            for a, b in ends
            if b > a
        )

    def __call__(self, material: str, samples: int, seed: int) -> tuple[NDArray[np.float64], float]:
        """Return the image (size, size, 3), and the user CPU time in seconds."""
        image, scene = self.folder / "image.exr", self.folder / "scene.pbrt"
        values = {k: getattr(self.given, k) for k in ("depth", "size")}
        scene.write_text(
            SCENE.format(samples=samples, seed=seed, image=image, material=material, curves=self.curves, **values)
        )
        begun = os.times().children_user
        subprocess.run([self.given.pbrt, "--quiet", "--nthreads", "1", str(scene)], check=True)
        return np.array(mi.Bitmap(str(image)))[..., :3].astype(np.float64), os.times().children_user - begun


def relative_error(image: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """Return the mean of (x - r)²/(r² + FLOOR) over the pixels that show hair."""
    shown = reference.sum(axis=2) > 0
    return float(((image - reference) ** 2 / (reference**2 + FLOOR))[shown].mean())


def vertex_ess(model: cuticle.Chiang) -> NDArray[np.float64]:
    """Return the ESS of one scattering event, means over viewers and over h, where a ray hits across the strand.

    Under light from everywhere: of pbrt's way, which draws from the lobes at h; of the best sampler at each h; of the
    export.
    Then of f itself over h for one direction to a light, drawn as the far field has it: no sampler takes part in that.
    """
    rng = np.random.default_rng(1)
    fitted = cuticle.fit(model).sampler
    rows = []
    for theta_r in map(float, VIEWERS):
        near = model.near(rng.uniform(-1, 1, 100_000))
        drawn = near.sample(theta_r, rng.random((100_000, 3)))
        f = luminance(near.eval(drawn.theta_i, theta_r, drawn.phi))
        weight = np.divide(f * np.cos(drawn.theta_i), drawn.pdf, out=np.zeros_like(f), where=drawn.pdf > 0)
        to_light = fitted.sample(theta_r, rng.random((400, 1, 3)))
        f = luminance(model.near(np.linspace(-1, 1, 257)[:-1] + 1 / 256).eval(to_light.theta_i, theta_r, to_light.phi))
        rows.append((ess(weight), random_offset_ess(model, theta_r), cuticle.measure(fitted, model, theta_r).ess, ess(f)))
    return np.mean(rows, axis=0)


def ess(weight: NDArray[np.float64]) -> float:
    """Return (E w)²/E w² over the last axis, a mean over the others."""
    return float((weight.mean(axis=-1) ** 2 / (weight**2).mean(axis=-1)).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pbrt", nargs="?", help="the program")
    parser.add_argument("--toml", action="store_true", help="print pbrt's `hair` in Chiang's parameters, and end")
    parser.add_argument("--material", default="chiang", help="the exported material's name")
    parser.add_argument("--samples", type=int, default=64, help="of the export; `hair` gets what the same time allows")
    parser.add_argument("--reference", type=int, default=2048, help="samples of a reference")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--strands", type=int, default=600)
    parser.add_argument("--width", type=float, default=0.04, help="of a curve; the ball has radius 1, the hair length 1")
    parser.add_argument("--depth", type=int, default=8)
    parser.add_argument("--size", type=int, default=64, help="pixels a side")
    given = parser.parse_args()
    model = cuticle.Chiang(**from_host("pbrt-v4"))
    if given.toml:
        print(model.to_toml(), end="")
        return
    if given.pbrt is None:
        parser.error("give the path of pbrt, or --toml")
    mi.set_variant("scalar_rgb")
    with tempfile.TemporaryDirectory() as folder:
        render = Renders(given, Path(folder))
        names = ("hair", given.material)
        reference = {name: render(name, given.reference, 999)[0] for name in names}
        for name in names:
            print(f"{name}: mean radiance {reference[name].mean():.4f}")
        runs = [{n: (render(n, 1, k), render(n, given.samples + 1, k)) for n in names} for k in range(1, given.rounds + 1)]
        times = {n: np.median([many[1] - one[1] for one, many in (run[n] for run in runs)]) / given.samples for n in names}
        fewer = max(1, round(given.samples * times[given.material] / times["hair"]))
        for name, samples in (("hair", given.samples), ("hair", fewer), (given.material, given.samples)):
            errors = [relative_error(render(name, samples, 100 + k)[0], reference[name]) for k in range(given.rounds)]
            print(
                f"{name}: {samples} samples a pixel, {1e3 * times[name]:.1f} ms a sample of the whole image,"
                f" {samples * times[name]:.2f} s, relMSE {np.mean(errors):.4f} ± {np.std(errors) / len(errors) ** 0.5:.4f}"
            )
    pbrts, best, ours, over_h = vertex_ess(model)
    print(f"ESS of one event: pbrt's way {pbrts:.3f}; the best at each h {best:.3f}; the export {ours:.3f}")
    print(f"ESS over h of f toward one direction: {over_h:.3f}; the export has no h")


if __name__ == "__main__":
    main()
