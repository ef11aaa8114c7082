"""Mean and deviation of theta_i through n strands, exact beside printed, for the document's fibre: docs/models.md.

python benchmarks/strand_widths.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from cuticle import DualScattering, Fibre

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from strand_walk import quadrature


def main() -> None:
    fibre = Fibre.preset("document")
    print("| θ_r | formulation | 1 | 2 | 4 | 8 strands |\n| --- | --- | --- | --- | --- | --- |")
    for degrees in (0, 40, 60):
        for formulation in ("exact", "zinke2008"):
            cells = []
            for n in (1, 2, 4, 8):
                model = DualScattering(fibre, n, formulation)
                _, mean, deviation = quadrature(lambda i, r, phi, m=model: m.eval(i, r, phi)[..., 0], np.radians(degrees))
                cells.append(f"{np.degrees(mean):.0f}°, {deviation:.2f}")
            print(f"| {degrees}° | {formulation} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
