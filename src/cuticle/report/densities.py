"""The picture of a fit: the scattering distribution beside the fitted density, viewer by viewer."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from cuticle._support.plots import INK, MAP, PALE, PAPER, figure_bytes
from cuticle.sampling.distribution import Distribution, tabulate
from cuticle.sampling.quality import measure
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import Bcsdf, with_strands

VIEWERS = (-85, -60, -30, 0, 30, 60, 85)  # theta_r in degrees, a column each
_HALO = [withStroke(linewidth=2.5, foreground="#00000099")]


def densities_figure(sampler: Sampler, model: Any) -> bytes:
    """Return a PNG: for each viewer f·cos(theta_i) above the fitted pdf, on one scale, with the ESS below.

    Both are shown for direct light and for the middle strand count of a sampler, or for each of its counts if it has two.
    """
    counts = sampler.strands
    strands = counts if len(counts) < 3 else (counts[0], counts[len(counts) // 2])
    columns, rows = len(VIEWERS), 2 * len(strands)
    figure = Figure(figsize=(1.72 * columns + 1.1, 1.62 * rows + 1.25), facecolor=PAPER, dpi=150)
    grid = figure.add_gridspec(
        rows, columns, left=0.085, right=0.985, bottom=0.095, top=0.86, wspace=0.08,
        hspace=0.12, height_ratios=[1] * rows,
    )  # fmt: skip
    for pair, n in enumerate(strands):
        own = with_strands(model, n)
        for column, degrees in enumerate(VIEWERS):
            theta_r = float(np.radians(degrees))
            d = tabulate(own, theta_r, n_theta=180, n_phi=240)
            quality = measure(sampler, own, theta_r, n)
            for row, image in enumerate(_images(d, sampler, own, n)):
                axes = figure.add_subplot(grid[2 * pair + row, column])
                _panel(axes, image, left=column == 0, bottom=2 * pair + row == rows - 1)
                if 2 * pair + row == 0:
                    axes.set_title(f"$\\theta_r$ = {degrees:g}°", color=INK, fontsize=10, pad=6)
                if column == 0:
                    light = "direct" if n == 0 else f"{n:g} strand{'s' if n != 1 else ''}"
                    axes.set_ylabel(f"{light}\n{('f·cos θᵢ', 'fitted pdf')[row]}", color=INK, fontsize=9)
                if row == 1:
                    axes.text(
                        0.97,
                        0.05,
                        f"ESS {quality.ess:.3f}",
                        transform=axes.transAxes,
                        ha="right",
                        color="white",
                        fontsize=8,
                        path_effects=_HALO,
                    )
    name = f"{sampler.lobes} product lobes" if sampler.lobes > 1 else "one product lobe"
    figure.text(0.085, 0.955, f"A scattering distribution and the density fitted to it: {name}", color=INK, fontsize=14)
    figure.text(
        0.085, 0.918, "Where light toward the viewer comes from, per steradian; each pair on one scale, as its square root.",
        color=PALE, fontsize=9.5,
    )  # fmt: skip
    figure.text(
        0.535,
        0.025,
        "azimuth φ = φᵢ − φᵣ (0° to 360°; 180° is straight through)   ·   vertical: θᵢ, −90° to 90°",
        color=PALE,
        fontsize=9,
        ha="center",
    )
    return figure_bytes(figure)


def _images(d: Distribution, sampler: Sampler, model: Bcsdf, strands: float) -> tuple[np.ndarray, np.ndarray]:
    """Return both densities per steradian with phi from 0 to 360°, on one scale from 0 to 1."""
    truth = d.luminance / float(
        np.sum(d.luminance * np.cos(d.theta_i)[:, None]) * np.pi / len(d.theta_i) * 2 * np.pi / len(d.phi)
    )
    fitted = sampler.pdf(d.theta_i[:, None], d.theta_r, d.phi[None, :], strands)
    # A sampler's lobes do not vanish at the poles, where a steradian is nothing: the scale is the distribution's own.
    top = np.quantile(truth, 0.9995)
    turned = [np.roll(image, len(d.phi) // 2, axis=1) / top for image in (truth, fitted)]
    return turned[0], turned[1]


def _panel(axes: Any, image: np.ndarray, *, left: bool, bottom: bool) -> None:
    axes.imshow(np.sqrt(image), origin="lower", extent=(0, 360, -90, 90), aspect="auto", cmap=MAP, vmin=0, vmax=1)
    axes.set_xticks([90, 180, 270] if bottom else [], labels=["90", "180", "270"] if bottom else None)
    axes.set_yticks([-90, 0, 90] if left else [])
    axes.tick_params(colors=PALE, labelsize=8, length=2)
    for spine in axes.spines.values():
        spine.set_color("#3a3d44")
