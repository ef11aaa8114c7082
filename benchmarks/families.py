"""Families of lobes beside each other: ESS of the fits, and what a sample costs.

ESS is the mean over |theta_r| <= 75° and the worst there, direct light. Costs are of a sample with its pdf: medians of
interleaved rounds on one thread in single precision, in calibration kernels (16 expf of varying inputs).
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from rich.console import Console

import cuticle
from cuticle import _core
from cuticle.cli.tables import table
from cuticle.sampling.families import FAMILIES

LOBES = (1, 2, 4, 8)
INPUTS, ROUNDS = 2048, 41
PATH = 30.0  # kernels to trace and shade a ray, as in fitting/costs.py
out = Console() if sys.stdout.isatty() else Console(width=118)


def models() -> dict[str, cuticle.Bcsdf]:
    found: dict[str, cuticle.Bcsdf] = {
        f"preset {name}": cuticle.DualScattering(cuticle.Fibre.preset(name))
        for name in ("document", "blond", "brown", "black")
    }
    for roughness in (0.1, 0.3, 0.6):
        found[f"Chiang, roughness {roughness:g}"] = cuticle.Chiang(beta_m=roughness, beta_n=roughness, eumelanin=1.3)
    return found


def costs(samplers: dict[str, cuticle.Sampler]) -> dict[str, float]:
    rng = np.random.default_rng(1)
    x = rng.random(INPUTS + 16, np.float32)
    theta_r = rng.uniform(-1.5, 1.5, INPUTS).astype(np.float32)
    u = rng.random(3 * INPUTS, np.float32)
    tables = [s._table(np.float32) for s in samplers.values()]
    rounds = [[_core.kernel_cost(x), *(t.sample_cost(theta_r, u, 0.0) for t in tables)] for _ in range(ROUNDS)]
    kernel, *others = np.median(rounds, axis=0)
    return dict(zip(samplers, (float(c / kernel) for c in others), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.parse_args()
    listing = table("ESS mean and worst within 75°; cost of a sample with its pdf, kernels")
    for column in (
        "function",
        "K",
        *(f"{f}: ESS" for f in FAMILIES),
        *(f"{f}: cost" for f in FAMILIES),
        "most ESS, and with a path of 30 kernels",
    ):
        listing.add_column(column, justify="left" if column == "function" else "right")
    for name, model in models().items():
        for lobes in LOBES:
            fits = {family: cuticle.fit(model, lobes, family=family) for family in FAMILIES}
            rows = {family: f.summary[0][1:3] for family, f in fits.items()}
            cost = costs({family: f.sampler for family, f in fits.items()})
            ess = {family: row[0] for family, row in rows.items()}
            efficiency = {family: ess[family] / (cost[family] + PATH) for family in FAMILIES}
            best, quick = max(ess, key=ess.__getitem__), max(efficiency, key=efficiency.__getitem__)
            listing.add_row(
                name, str(lobes), *(f"{rows[f][0]:.4f} {rows[f][1]:.3f}" for f in FAMILIES),
                *(f"{cost[f]:.2f}" for f in FAMILIES), f"{best}, {quick}",
            )  # fmt: skip
    out.print(listing)


if __name__ == "__main__":
    main()
