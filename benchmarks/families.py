"""Families of lobes beside each other: ESS of the fits, and what a sample costs.

ESS is the mean over |theta_r| <= 75° and the worst there, direct light. Costs are of a sample with its pdf: medians of
interleaved rounds on one thread in single precision, in calibration kernels (16 expf of varying inputs).
"""

from __future__ import annotations

import argparse
import sys

from rich.console import Console

import bench
import cuticle
from cuticle.cli.tables import table
from cuticle.sampling.families import FAMILIES

LOBES = (1, 2, 4, 8)
ROUNDS = 41
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


def costs(fits: dict[tuple[str, int, str], cuticle.Fit]) -> dict[tuple[str, int, str], float]:
    found = {}
    for family in FAMILIES:
        own = {key: f for key, f in fits.items() if key[2] == family}
        cases = [(f"{name} {lobes}", f.sampler, 0.0) for (name, lobes, _), f in own.items()]
        model = cuticle.DualScattering(cuticle.Fibre.preset("document"), formulation="exact")
        took = bench.costs(cases, model, ROUNDS, f"{family.capitalize()}Lobes")
        found |= {key: took[f"{key[0]} {key[1]} sample"] / took["calibration"] for key in own}
    return found


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
    functions = models()
    fits = {(n, k, f): cuticle.fit(functions[n], k, family=f) for n in functions for k in LOBES for f in FAMILIES}
    prices = costs(fits)
    for name in functions:
        for lobes in LOBES:
            rows = {family: fits[name, lobes, family].summary[0][1:3] for family in FAMILIES}
            cost = {family: prices[name, lobes, family] for family in FAMILIES}
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
