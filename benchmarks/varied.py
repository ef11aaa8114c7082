"""Hair that varies from strand to strand: noise and time of its samplings, each against its own mean over many samples.

On a built-in head, strand by strand: melanin (a log-normal spread of .8), roughness (.4), tilt, strays, darker roots. At
equal time, the product of variance and time: `function`, which draws from each strand's own far field; `near`, from its near
field; `lobes`, one fit for the mean fibre, whose absorption alone can vary; and Mitsuba's `hair` with the same absorption,
its roughness the mean one. Pictures differ (near and far field; roughness), so each has a mean of its own. The last table is
of f alone: the ESS of one fit for the mean fibre, over the fibres of the head.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from rich.console import Console

import cuticle
from cuticle.cli.tables import table
from cuticle.grooms.procedural import hair_head
from cuticle.grooms.variation import vary
from cuticle.render.scene import Light, View, integrator, load_scene, mitsuba
from cuticle.sampling.quality import measure

VARIED = {
    "melanin": 0.7, "melanin_spread": 0.8, "redness": 0.1, "roughness": 0.25, "roughness_spread": 0.4, "tilt": 2.0,
    "strays": 0.1, "root_darkening": 1.0,
}  # fmt: skip
TECHNIQUES = {
    "BSDF alone": integrator("direct", emitter_samples=0, bsdf_samples=1),
    "with emitter sampling": integrator("direct"),
    "path, 16 segments": integrator("path", depth=16),
}


def measured(mi: Any, scene: Any, spp: int, runs: int) -> tuple[float, float]:
    """Mean relative variance of a pixel of `spp` samples, and CPU seconds of a picture."""
    mi.render(scene, spp=1)
    begin = time.process_time()
    images = np.array([np.array(mi.render(scene, spp=spp, seed=1 + k), np.float64)[..., :3] for k in range(runs)])
    seconds = (time.process_time() - begin) / runs
    mean = images.mean(axis=0)
    return float((images.var(axis=0, ddof=1) / (mean**2 + 0.01)).mean()), seconds


def fibres_of(groom: Any, count: int) -> list[cuticle.Chiang]:
    """Fibres at the middles of so many segments."""
    values = {name: groom.on_segments(name).mean(axis=(1, 2)).astype(float) for name in groom.attributes}
    values |= {name: np.maximum(values[name], 0.05) for name in ("beta_m", "beta_n")}  # as the BSDF holds them
    chosen = np.random.default_rng(1).integers(0, len(values["beta_m"]), count)
    return [cuticle.Chiang(**{name: float(x[k]) for name, x in values.items()}) for k in chosen]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--strands", type=int, default=10_000)
    parser.add_argument("--fibres", type=int, default=40)
    arguments = parser.parse_args()
    mi = mitsuba("scalar_rgb")
    from cuticle.mitsuba import strand_texture

    groom = vary(hair_head(arguments.strands), **VARIED)  # type: ignore[arg-type]
    texture = {name: strand_texture(groom, name) for name in groom.attributes}
    mean = {name: float(groom.attributes[name].mean()) for name in groom.attributes}
    pigment = cuticle.conventions.sigma_a_of_pigment(groom.attributes["eumelanin"], groom.attributes["pheomelanin"])
    one = cuticle.conventions.sigma_a_of_pigment(mean["eumelanin"], mean["pheomelanin"])
    darker = strand_texture(groom.with_attributes(scale=pigment[:, 1] / one[1]), "scale")
    sigma_a = strand_texture(groom.with_attributes(sigma_a=pigment), "sigma_a")
    rough = {name: mean[name] for name in ("beta_m", "beta_n")}
    materials = {
        "function": {"type": "cuticle", **texture},
        "near": {"type": "cuticle", "near": True, **texture},
        "lobes": {"type": "cuticle", "sampling": "lobes", "scale": darker, **mean},
        "Mitsuba's hair": {
            "type": "hair", "sigma_a": sigma_a, "longitudinal_roughness": rough["beta_m"],
            "azimuthal_roughness": rough["beta_n"], "scale_tilt": -mean["alpha"],
        },
    }  # fmt: skip
    console = Console(width=120)
    view = View(width=arguments.size, height=arguments.size)
    for name, how in TECHNIQUES.items():
        listing = table(f"{name}, light from everywhere: variance of a pixel, time of a picture, both against function's")
        for column in ("directions", "variance", "time", "variance x time"):
            listing.add_column(column, justify="left" if column == "directions" else "right")
        first = None
        for kind, material in materials.items():
            bare = groom if kind == "function" else groom.with_attributes(**dict.fromkeys(groom.attributes))
            scene = load_scene(mi, bare, dict(material), view=view, light=Light("env"), technique=how)
            found = measured(mi, scene, arguments.spp, arguments.runs)
            first = first or found
            ratio = [a / b for a, b in zip(found, first, strict=True)]
            listing.add_row(kind, *(f"{x:.2f}" for x in (*ratio, ratio[0] * ratio[1])))
        console.print(listing)
    family, lobes = cuticle.family("chiang"), cuticle.fit(cuticle.Chiang(**mean), 4).sampler
    ess: dict[str, list[float]] = {"function": [], "one fit for the mean fibre": []}
    for fibre in fibres_of(groom, arguments.fibres):
        for viewer in np.radians([0, 40]).tolist():
            for samples, density in zip(ess.values(), (family.sampler_at(fibre), lobes), strict=True):
                samples.append(measure(density, fibre, viewer, 0.0).ess)
    listing = table("ESS over the head's fibres, one strand alone")
    for column in ("directions", "mean", "worst", "samples for equal noise"):
        listing.add_column(column, justify="left" if column == "directions" else "right")
    for kind, values in ess.items():
        listing.add_row(kind, f"{np.mean(values):.3f}", f"{np.min(values):.3f}", f"{np.mean(1 / np.array(values)):.2f} x")
    console.print(listing)


if __name__ == "__main__":
    main()
