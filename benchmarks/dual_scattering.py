"""Dual scattering beside path tracing to depth 64: how bright, how near, how long. `--data DIR` adds real grooms.

For each groom, hair and light: brightness over the path tracer's (mean of the covered part, each channel), relMSE against it
(less the noise of both: what is left is bias), time over Mitsuba's `direct` at equal samples, and how many times longer the
path tracer takes to the same noise: the product of time and variance between runs, path over dual. "corrected"
is the integrator's default; "m bounces" trace m segments before dual scattering; the other rows neither correct nor bounce.
In light from everywhere the grid runs a second time with directions from the BSDF alone. `--groom NAME` and `--way NAME`,
repeated, pick some; rows come one by one.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.live import Live

from cuticle.cli.tables import table
from cuticle.grooms.groom import Groom, join_grooms, read_groom
from cuticle.grooms.procedural import hair_ball
from cuticle.render.picture import rel_mse
from cuticle.render.scene import Light, View, bsdf, integrator, load_scene, mitsuba

RUNS, SPP = 4, 64
LIGHTS = ("env", "area")
DATA = Path(os.environ.get("CUTICLE_DATA", Path(__file__).parents[1] / "../shared/data"))


def grooms(data: Path | None) -> dict[str, Groom]:
    found = {"ball": hair_ball(), "thick ball": hair_ball(20_000).with_thickness(0.003, 0.001)}
    if data is not None:
        folder = data / "hair" / "tressfx"
        tail = join_grooms([read_groom(folder / f"ponytail_{p}.tfx") for p in ("back", "front_top", "side", "tail")])
        found["ponytail"] = tail
        found["ponytail x 9"] = tail.with_followers(8, 0.3, tip_spread=0.8).with_thickness(0.05, 0.02)
        found["bear"] = read_groom(folder / "bear.tfx")
        found["bear, thick"] = found["bear"].with_thickness(0.2, 0.05)
        guides = read_groom(data / "hair" / "sintel" / "sintel.tfx")
        full = guides.interpolated(100_000, points=20, clumping=0.35, frizz=0.008, length_variation=0.1)
        found["sintel"] = full.with_thickness(5e-5, 2.5e-5)
    return found


def noise(stack: NDArray[np.float64], mean: NDArray[np.float64]) -> float:
    """Variance of pictures, (runs, height, width, 3), over the squared mean, as relMSE weighs it."""
    return float((stack.var(axis=0, ddof=1) / (mean**2 + 0.01)).mean())


def runs(mi: Any, groom: Groom, fibre: str, light: str, view: View, how: dict[str, Any], scale: int = 1) -> dict[str, Any]:
    """Mean picture, variance of one run's luminance over the pixels' means, and seconds a run."""
    scene = load_scene(mi, groom, bsdf(fibre), view=view, light=Light(light), technique=how)
    np.array(mi.render(scene, spp=1))
    images, seconds = [], 0.0
    for k in range(RUNS):
        begin = time.perf_counter()
        images.append(np.array(mi.render(scene, spp=SPP * scale, seed=k + 1), np.float64))
        seconds += time.perf_counter() - begin
    stack = np.array(images)
    mean = stack.mean(axis=0)
    variance = noise(stack[..., :3], mean[..., :3])
    bright = mean[..., :3].sum(axis=(0, 1)) / mean[..., 3].sum()
    return {"image": mean, "noise": variance, "seconds": seconds / RUNS, "bright": bright}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=DATA if DATA.exists() else None)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--groom", action="append", help="one of these alone; may be repeated")
    parser.add_argument("--hair", action="append", choices=("blond", "black"), help="one of these alone")
    parser.add_argument("--light", action="append", choices=LIGHTS, help="one of these alone")
    parser.add_argument("--way", action="append", help='one of these alone, such as "grid, corrected"; may be repeated')
    arguments = parser.parse_args()
    try:
        found = grooms(arguments.data)
    except ValueError as error:
        parser.error(f"--data must hold hair/tressfx and hair/sintel with their grooms: {error}")
    chosen = arguments.groom or list(found)
    if unknown := [name for name in chosen if name not in found]:
        parser.error(f"--groom must be one of {', '.join(found)}; got {', '.join(unknown)}")
    mi = mitsuba("scalar_rgb")
    view = View(width=arguments.size, height=arguments.size)
    grid = table(f"dual scattering beside path tracing to depth 64, {arguments.size} x {arguments.size}")
    names = (
        "groom",
        "hair",
        "light",
        "counter",
        "brightness R, G, B",
        "relMSE",
        "time / direct",
        "path: time to equal noise",
    )
    for name in names:
        grid.add_column(name, justify="left" if name in names[:4] else "right")
    console = Console(width=140)
    with Live(grid, console=console, auto_refresh=False) as live:
        for name in chosen:
            for light in arguments.light or LIGHTS:
                for fibre in arguments.hair or ("blond", "black"):
                    path = runs(mi, found[name], fibre, light, view, integrator("path", depth=64))
                    direct = runs(mi, found[name], fibre, light, view, integrator("direct"))
                    plain = {"correction_paths": 0}
                    ways = {
                        "grid, corrected": integrator("dual"),
                        "grid": integrator("dual", **plain),
                        "trace": integrator("dual", counter="trace", **plain),
                        **{f"{m} bounces": integrator("dual", bounces=m) for m in (1, 2, 4)},
                    }
                    if light == "env":
                        ways["grid, BSDF alone"] = integrator("dual", emitter_samples=0, **plain)
                    for counter, how in ways.items():
                        if arguments.way and counter not in arguments.way:
                            continue
                        dual = runs(mi, found[name], fibre, light, view, how)
                        bias = rel_mse(dual["image"], path["image"]) - (dual["noise"] + path["noise"]) / RUNS
                        grid.add_row(
                            name,
                            fibre,
                            light,
                            counter,
                            ", ".join(f"{x:.2f}" for x in dual["bright"] / path["bright"]),
                            f"{max(bias, 0):.4f}",
                            f"{dual['seconds'] / direct['seconds']:.2f}",
                            f"{path['noise'] * path['seconds'] / (dual['noise'] * dual['seconds']):.1f}",
                        )
                        live.refresh()


if __name__ == "__main__":
    main()
