"""What rendering costs, as ratios within one run: `cuticle` beside `hair`, dual scattering beside `direct`, loading.

Real grooms are read from $CUTICLE_DATA/hair where it is there; else the ball alone is measured.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from cuticle.cli.tables import table
from cuticle.grooms.density_grid import DensityGrid
from cuticle.grooms.groom import Groom, join_grooms, read_groom
from cuticle.grooms.procedural import hair_ball
from cuticle.render.scene import View, bsdf, integrator, load_scene, mitsuba

SPP, SIZE = 8, 512


def seconds(mi: Any, scenes: dict[str, Any], rounds: int) -> dict[str, float]:
    """Median rendering time of each, rounds interleaved."""
    times: dict[str, list[float]] = {name: [] for name in scenes}
    for k in range(rounds + 1):
        for name, scene in scenes.items():
            begin = time.perf_counter()
            np.array(mi.render(scene, spp=SPP, seed=k))
            if k:
                times[name].append(time.perf_counter() - begin)
    return {name: statistics.median(values) for name, values in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    console = Console(width=110)
    data = Path(os.environ.get("CUTICLE_DATA", Path(__file__).parents[1] / "../shared/data")) / "hair" / "tressfx"
    grooms: dict[str, Groom] = {"ball": hair_ball()}
    mi = mitsuba("scalar_rgb")
    if data.exists():
        begin = time.perf_counter()
        bear = read_groom(data / "bear.tfx")
        read = time.perf_counter() - begin
        with tempfile.TemporaryDirectory() as folder:
            bear.save(Path(folder) / "bear.txt")
        spline = time.perf_counter() - begin - read
        DensityGrid.build(bear)
        grid = time.perf_counter() - begin - read - spline
        load_scene(mi, bear, {"type": "diffuse"})
        whole = time.perf_counter() - begin - read - spline - grid
        console.print(
            f"bear: read {read:.2f} s, splines and file {spline:.2f} s, grid {grid:.2f} s; a scene of it in Mitsuba, its own"
            f" splines and file among it, {whole:.2f} s"
        )
        tail = [read_groom(data / f"ponytail_{p}.tfx") for p in ("back", "front_top", "side", "tail")]
        grooms |= {"ponytail": join_grooms(tail), "bear": bear}
    listing = table(f"{SIZE} x {SIZE}, {SPP} samples, light from everywhere; times over those of `direct` with `cuticle`")
    for name in ("groom", "direct, Mitsuba's hair", "dual, grid", "dual, grid of 128", "dual, trace", "path, 64 segments"):
        listing.add_column(name, justify="left" if name == "groom" else "right")
    view = View(width=SIZE, height=SIZE)
    for name, groom in grooms.items():
        scenes = {
            "direct": (bsdf("brown"), integrator("direct")),
            "hair": ({"type": "hair"}, integrator("direct")),
            "grid": (bsdf("brown"), integrator("dual")),
            "grid 128": (bsdf("brown"), integrator("dual", cells=128)),
            "trace": (bsdf("brown"), integrator("dual", counter="trace")),
            "path": (bsdf("brown"), integrator("path", depth=64)),
        }
        loaded = {k: load_scene(mi, groom, m, view=view, technique=t) for k, (m, t) in scenes.items()}
        times = seconds(mi, loaded, arguments.rounds)
        listing.add_row(name, *(f"{times[k] / times['direct']:.2f}" for k in ("hair", "grid", "grid 128", "trace", "path")))
    console.print(listing)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    console.print(f"peak memory of all this, six scenes of each groom at once: {peak:.2f} GB")


if __name__ == "__main__":
    main()
