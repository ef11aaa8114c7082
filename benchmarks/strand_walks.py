"""Walks among strands at true angles beside `exact`: the table of docs/models.md.

Energy over the walk's, then how far off mean and deviation of theta_i are. Light that met no other strand is left out.

python benchmarks/strand_walks.py [--paths N]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cuticle import DualScattering, Fibre

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from strand_walk import quadrature, walk

FIBRES = {
    "blond, red": ("blond", 0), "blond, green": ("blond", 1), "brown, red": ("brown", 0),
    "marschner, σ_a .2": ("marschner", 0),
}  # fmt: skip
ARRANGEMENTS = [("sheets", n) for n in (1, 2, 4, 8, 16)] + [("medium", t) for t in (0.5, 2, 8)]


def scattered(model: DualScattering, c: int, arrangement: str, n: float) -> Callable[..., np.ndarray]:
    """Return f of the light that other strands met, in one channel."""
    if arrangement == "sheets":
        return lambda i, r, phi: model.with_strands(n).eval(i, r, phi)[..., c]
    return lambda i, r, phi: (model.expected(i, r, phi, n) - np.exp(-n) * model.single.eval(i, r, phi))[..., c]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--paths", type=int, default=400_000)
    paths = parser.parse_args().paths
    heads = [f"τ {n:g}" if how == "medium" else f"{n:g} sheets" for how, n in ARRANGEMENTS]
    print(f"| | θ_r | {' | '.join(heads)} |\n|{' --- |' * (len(heads) + 2)}")
    for label, (name, c) in FIBRES.items():
        fibre = Fibre.preset(name).replace(d_f=1, d_b=1)
        if name == "marschner":
            fibre = fibre.replace(sigma_a=0.2)
        model, sigma_a = DualScattering(fibre), fibre.absorption[c]
        for degrees in (0, 50, -70, 75):
            theta_r, cells = np.radians(degrees), []
            for how, n in ARRANGEMENTS:
                count = paths * (10 if n > 8 else 1)  # little of the light gets there
                energy, *angles = walk(fibre, sigma_a, theta_r, n, arrangement=how, count=count).moments()
                ours = quadrature(scattered(model, c, how, n), theta_r)
                off = np.degrees(np.subtract(ours[1:], angles))
                dark = energy < (5e-4 if n > 8 else 1e-4)  # too few paths get there to be averaged
                cells.append("" if dark else f"{ours[0] / energy:.2f}, {off[0]:+.1f}°, {off[1]:+.1f}°")
            print(f"| {label} | {degrees}° | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
