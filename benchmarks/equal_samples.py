"""What a sampler can take away from a picture's noise, and what none can: brown hair in the same light from everywhere.

Directions come from the BSDF alone. For each groom: how many times less noise than with uniform sampling the picture has at
equal samples, with 4 lobes and with 16, and with 16 fitted to all three channels alike; and of the noise with 4 lobes, what
is left when every hit is lit by very many directions (hits and misses within a pixel, strands of different brightness). The
rest is light that other strands block: with all of f taken care of, a direction brings all or nothing. Noise is a picture's
variance over the square of one mean for all, that of the picture lit by very many. `--data DIR` adds real grooms.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import cuticle
from cuticle.cli.tables import table
from cuticle.grooms.groom import Groom
from cuticle.render.scene import Light, View, bsdf, integrator, load_scene, mitsuba
from cuticle.sampling.quality import UniformSphere, measure
from cuticle.scattering.marschner import Marschner
from dual_scattering import DATA, grooms, noise

RUNS, SPP, MANY = 8, 32, 32
GROOMS = ("ball", "ponytail", "ponytail x 9", "bear")


def pictures(mi: Any, groom: Groom, view: View, material: dict[str, Any], directions: int = 1) -> NDArray[np.float64]:
    """RUNS pictures of SPP samples a pixel, (runs, height, width, 3), lit by so many directions a hit."""
    how = integrator("direct", emitter_samples=0, bsdf_samples=directions)
    scene = load_scene(mi, groom, material, view=view, light=Light("env"), technique=how)
    return np.array([np.array(mi.render(scene, spp=SPP, seed=k), np.float64)[..., :3] for k in range(RUNS)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=DATA if DATA.exists() else None)
    parser.add_argument("--size", type=int, default=128)
    arguments = parser.parse_args()
    try:
        found = grooms(arguments.data)
    except ValueError as error:
        parser.error(f"--data must hold hair/tressfx with its grooms: {error}")
    mi = mitsuba("scalar_rgb")
    listing = table("brown hair, light from everywhere, BSDF sampling alone, at equal samples")
    for name in ("groom", "4 lobes", "16 lobes", "16 lobes, rgb", "4 lobes' noise: within a pixel", "blocked light"):
        listing.add_column(name, justify="left" if name == "groom" else "right")
    console = Console(width=120)
    model = Marschner(cuticle.Fibre.preset("brown"), "energy_conserving")
    samplers = {k: cuticle.fit(model, k).sampler for k in (4, 16)}
    for name, density in (("uniform", UniformSphere()), *((f"{k} lobes", s) for k, s in samplers.items())):
        ess = [measure(density, model, float(np.radians(t)), 0.0).ess for t in (0, 30, 60)]
        console.print(f"ESS of {name}, at theta_r 0, 30, 60: {', '.join(f'{x:.4f}' for x in ess)}")
    view = View(width=arguments.size, height=arguments.size)
    with tempfile.TemporaryDirectory() as folder:
        path = cuticle.fit(model, 16, objective="rgb").sampler.save(Path(folder) / "rgb.json")
        lobes = [bsdf("brown"), bsdf("brown", lobes=16), bsdf(str(path))]
        for name, groom in found.items():
            if name not in GROOMS:
                continue
            calm = pictures(mi, groom, view, lobes[0], MANY)
            mean = calm.mean(axis=0)
            materials = (bsdf("brown", "uniform"), *lobes)
            uniform, four, *others = (noise(pictures(mi, groom, view, m), mean) for m in materials)
            # noise = within + blocked / directions
            blocked = (1 - noise(calm, mean) / four) / (1 - 1 / MANY)
            gains = (f"{uniform / x:.2f} x" for x in (four, *others))
            listing.add_row(name, *gains, f"{1 - blocked:.0%}", f"{blocked:.0%}")
    console.print(listing)


if __name__ == "__main__":
    main()
