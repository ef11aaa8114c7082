"""How well the fit does on fibres from needle-sharp to matt: ESS on the table's nodes and between them.

Prints, for each fibre and number of lobes, the mean and the worst ESS over viewers between nodes (|theta_r| up to 87°), for
strand counts on rows and between them, and the seconds of the fit.
"""

from __future__ import annotations

import argparse

import numpy as np

import cuticle

FIBRES = {
    "document": cuticle.Fibre.preset("document"),
    "marschner": cuticle.Fibre.preset("marschner"),
    "blond": cuticle.Fibre.preset("blond"),
    "glossy": cuticle.Fibre(alpha_R=-7.5, beta_R=7.5, sigma_a=0.6, beta_N=3),
    "sharp": cuticle.Fibre(alpha_R=-3, beta_R=2, sigma_a=0.3, beta_N=1),
    "sharpest": cuticle.Fibre(alpha_R=0, beta_R=0.5, sigma_a=0.2, beta_N=0.5),
    "needle": cuticle.Fibre(alpha_R=0, beta_R=0.1, sigma_a=0.01, beta_N=0.2),
    "rough": cuticle.Fibre(alpha_R=-10, beta_R=30, sigma_a=1, beta_N=60),
    "ink": cuticle.Fibre(alpha_R=-5, beta_R=5, sigma_a=100, beta_N=5),
    "tilted": cuticle.Fibre(alpha_R=-20, beta_R=6, sigma_a=0.5, beta_N=8),
}
VIEWERS = np.radians([-72, -50, -33.75, 3.75, 41, 63.7, 78.75, 87])
COUNTS = (0, 0.25, 0.5, 0.8, 1, 1.5, 3, 6, 8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fibres", nargs="*", default=list(FIBRES), help=", ".join(FIBRES))
    parser.add_argument("--lobes", type=int, nargs="*", default=[4, 8])
    arguments = parser.parse_args()
    print("mean/worst ESS between nodes for strands", ", ".join(f"{n:g}" for n in COUNTS))
    for name in arguments.fibres:
        model = cuticle.DualScattering(FIBRES[name])
        for lobes in arguments.lobes:
            fit = cuticle.fit(model, lobes, strands=[0, 1, 2, 4, 8])
            cells = []
            for n in COUNTS:
                own = model.with_strands(n)
                ess = [cuticle.measure(fit.sampler, own, float(t), n).ess for t in VIEWERS]
                cells.append(f"{np.mean(ess):.3f}/{min(ess):.3f}")
            print(f"{name:10} K={lobes:<2} {fit.seconds:4.1f} s ", "  ".join(cells), flush=True)


if __name__ == "__main__":
    main()
