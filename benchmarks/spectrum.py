"""The spectrum that stands for an absorption given as linear RGB: its edges, and the colours it gives back.

Light that has crossed a fibre is exp(-k sigma_a) of white. The edges are those for which its colour, under D65, is nearest
to exp(-k sigma_a) of each channel, for the pigments of hair and depths k from 0.5 to 3.
"""

from __future__ import annotations

import numpy as np
from rich.console import Console
from scipy.optimize import minimize

from cuticle.cli.tables import table
from cuticle.render.scene import mitsuba
from cuticle.scattering.conventions import sigma_a_of_pigment

WAVELENGTHS = np.arange(360, 831, 2.0)
DEPTHS = (0.5, 1.0, 1.7, 3.0)
TO_RGB = np.array([[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]])


def main() -> None:
    mi = mitsuba("scalar_spectral")
    xyz = np.array([np.array(mi.cie1931_xyz(float(x))) for x in WAVELENGTHS])
    white = np.array([float(np.ravel(mi.cie_d65(float(x)))[0]) for x in WAVELENGTHS])

    def colour(transmittance: np.ndarray) -> np.ndarray:
        return TO_RGB @ ((xyz * (white * transmittance)[:, None]).sum(axis=0) / (xyz[:, 1] * white).sum())

    def spectrum(edges: np.ndarray, rgb: np.ndarray) -> np.ndarray:
        r, g, b = rgb
        return np.interp(WAVELENGTHS, [360, *edges, 830], [b, b, g, g, r, r])

    hair = {
        "blond": sigma_a_of_pigment(0.3),
        "brown": sigma_a_of_pigment(1.3),
        "red": sigma_a_of_pigment(0, 1),
    }

    def error(edges: np.ndarray) -> float:
        if not (np.diff([360, *edges, 830]) > 0).all():
            return 1e3
        pairs = [(colour(np.exp(-k * spectrum(edges, s))), np.exp(-k * s)) for s in hair.values() for k in DEPTHS]
        return float(sum(((a - b) ** 2).sum() for a, b in pairs))

    starts = ((480, 510, 575, 605), (470, 520, 560, 620), (490, 500, 580, 590))
    best = min((minimize(error, s, method="Nelder-Mead", options={"maxiter": 4000}) for s in starts), key=lambda r: r.fun)
    grid = table(f"edges {', '.join(f'{x:.1f}' for x in best.x)} nm", "linear RGB of light through the fibre")
    for column in ("hair", "k", "exp(-k sigma_a)", "the spectrum's colour"):
        grid.add_column(column)
    for name, s in hair.items():
        for k in DEPTHS:
            wanted, got = np.exp(-k * s), colour(np.exp(-k * spectrum(best.x, s)))
            grid.add_row(name, f"{k:g}", *(", ".join(f"{x:.3f}" for x in v) for v in (wanted, got)))
    Console(width=100).print(grid)


if __name__ == "__main__":
    main()
