"""The ESS over the box of Chiang's fibres: of the family, of one fit for all of them, and of h drawn at random.

Two maps for each: over beta_m and beta_n, and over absorption and the viewer's inclination. What does not vary is that of
the mean fibre (beta_m and beta_n .3, eumelanin 1.3, eta 1.55, seen from 30°), to which four lobes are fitted once. ESS is of
luminance. That of the family is against the near field averaged over the width, by samples, as `any_fibre.py --box`; that
of the fit by quadrature, the family being f.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

import cuticle
from any_fibre import drawn_offset, ess_by_samples
from cuticle._support.files import write_bytes
from cuticle._support.plots import MAP, figure_bytes
from cuticle.cli.tables import table

MEAN = cuticle.Chiang(beta_m=0.3, beta_n=0.3, eumelanin=1.3)
VIEWER = 30.0
SAMPLERS = ("any fibre, one sampler", "one fit, of the mean fibre", "near field, h drawn at random")
LEVELS = (0.1, 0.5, 0.9, 0.99)
out = Console() if sys.stdout.isatty() else Console(width=118)


def esses(beta_m: float, beta_n: float, scale: float, theta_r: float, fit: Any, rng: np.random.Generator) -> list[float]:
    """The ESS of each sampler for a fibre whose absorption is `scale` times the mean's; theta_r in degrees."""
    fibre = cuticle.Chiang(beta_m=beta_m, beta_n=beta_n, sigma_a=tuple(scale * a for a in MEAN.absorption))
    viewer = float(np.radians(theta_r))
    f = cuticle.family("chiang").sampler_at(fibre)
    return [
        ess_by_samples("chiang", fibre, viewer, rng, 640), cuticle.measure(fit, f, viewer).ess, drawn_offset(fibre, viewer)
    ]  # fmt: skip


def maps(steps: int) -> dict[str, tuple[NDArray, NDArray, NDArray]]:
    """Each map's columns, rows, and ESS, shape (rows, columns, samplers)."""
    rng, fit = np.random.default_rng(6), cuticle.fit(MEAN, 4).sampler
    beta, scale, viewers = np.linspace(0.05, 1, steps), np.geomspace(0.01, 20, steps), np.linspace(0, 85, steps)
    made = {}
    for name, columns, rows in (("roughness", beta, beta), ("absorption", scale, viewers)):
        each = [(x, y, 1.0, VIEWER) if name == "roughness" else (0.3, 0.3, x, y) for y in rows for x in columns]
        shown = track(each, name, console=Console(stderr=True), disable=not sys.stderr.isatty())
        made[name] = columns, rows, np.array([esses(*x, fit, rng) for x in shown]).reshape(steps, steps, -1)
    return made


def picture(made: dict[str, tuple[NDArray, NDArray, NDArray]], path: Path) -> None:
    """Draw the maps: samplers side by side, what varies below one another."""
    from matplotlib.figure import Figure  # takes a second to import
    from matplotlib.patheffects import withStroke

    edged = [withStroke(linewidth=2.2, foreground="#30303a")]  # seen on the bright and on the dark ground
    figure = Figure((9.6, 6.0), layout="constrained")
    axes = figure.subplots(2, 3)
    for row, (name, (x, y, ess)) in zip(axes, made.items(), strict=True):
        for k, (ax, title) in enumerate(zip(row, SAMPLERS, strict=True)):
            values = np.clip(ess[..., k], 0, 1)
            image = ax.pcolormesh(x, y, values, cmap=MAP, vmin=0, vmax=1, shading="gouraud", rasterized=True)
            crossed = [level for level in LEVELS if values.min() < level < values.max()]
            if crossed:
                lines = ax.contour(x, y, values, crossed, colors="white", linewidths=0.9)
                lines.set_path_effects(edged)
                for label in ax.clabel(lines, fmt=lambda v: f"{v:g}".lstrip("0"), fontsize=8):
                    label.set_path_effects(edged)
            numbers = f"mean {values.mean():.4f}, worst {values.min():.4f}"
            if name == "roughness":
                ax.set_title(f"{title}\n{numbers}", fontsize=9.5)
                ax.set(xlabel=r"$\beta_m$")
                ax.plot(0.3, 0.3, "+", color="white", markersize=9, path_effects=edged)
            else:
                ax.set_title(numbers, fontsize=9.5)
                ax.set(xscale="log", xlabel=r"$\sigma_a$, out of the mean fibre's")
                ax.plot(1, VIEWER, "+", color="white", markersize=9, path_effects=edged)
        row[0].set_ylabel(r"$\beta_n$" if name == "roughness" else r"$\theta_r$, degrees")
    figure.colorbar(image, ax=axes, label="ESS", shrink=0.7)
    write_bytes(path, figure_bytes(figure))


def main() -> None:
    """Print what the maps hold, and draw them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=13, help="fibres along each side of a map")
    parser.add_argument("--picture", type=Path, help="draw the maps there")
    arguments = parser.parse_args()
    made = maps(arguments.steps)
    listing = table(f"ESS over {arguments.steps} × {arguments.steps} fibres a map")
    for column in ("what varies", "sampler", "mean", "worst", "share at .9 or more"):
        listing.add_column(column, justify="left" if column in ("what varies", "sampler") else "right")
    for name, (_, _, ess) in made.items():
        for k, sampler in enumerate(SAMPLERS):
            e = ess[..., k]
            listing.add_row(name, sampler, f"{e.mean():.4f}", f"{e.min():.4f}", f"{100 * np.mean(e >= 0.9):.0f} %")
    out.print(listing)
    if arguments.picture:
        picture(made, arguments.picture)


if __name__ == "__main__":
    main()
