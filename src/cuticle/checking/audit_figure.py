"""The picture of an audit: the density drawn, the density claimed, and where they differ."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from cuticle._support.plots import INK, MAP, PALE, PAPER, figure_bytes
from cuticle.checking.measurements import AuditMeasurement

_LARGEST = 8.0  # standard deviations at the ends of the colour scale
_CELLS = (90, 120)


def audit_figure(m: AuditMeasurement, *, name: str, ok: bool, samples: int) -> bytes:
    """Return a PNG: claimed and drawn density at one viewer, and their difference in standard deviations."""
    assert m.maps is not None
    maps = m.maps
    theta, phi = np.linspace(-np.pi / 2, np.pi / 2, _CELLS[0] + 1), np.linspace(-np.pi, np.pi, _CELLS[1] + 1)
    claimed, drawn = (maps.spread(x, theta, phi) for x in (maps.claimed, maps.drawn))
    area = np.outer(np.diff(np.sin(theta)), np.diff(phi))
    top = max(float(np.quantile(claimed / area, 0.999)), 1e-12)
    score = (drawn - claimed) * samples / np.sqrt(np.maximum(claimed * samples, 1.0))
    figure = Figure(figsize=(12.4, 4.9), facecolor=PAPER, dpi=150)
    grid = figure.add_gridspec(1, 3, left=0.055, right=0.93, bottom=0.13, top=0.74, wspace=0.1)
    images = ("claimed by the pdf", claimed / area), ("drawn by the sampler", drawn / area)
    for column, (title, image) in enumerate(images):
        axes = _axes(figure, grid[0, column], title, left=column == 0)
        axes.pcolormesh(np.degrees(phi), np.degrees(theta), np.sqrt(image / top), cmap=MAP, vmin=0, vmax=1, rasterized=True)
    axes = _axes(figure, grid[0, 2], "drawn − claimed, in standard deviations of a cell", left=False)
    norm = TwoSlopeNorm(0, -_LARGEST, _LARGEST)
    mesh = axes.pcolormesh(np.degrees(phi), np.degrees(theta), score, cmap="RdBu_r", norm=norm, rasterized=True)
    bar = figure.colorbar(mesh, cax=figure.add_axes((0.94, 0.13, 0.012, 0.61)), extend="both")
    bar.ax.tick_params(colors=PALE, labelsize=8)
    bar.outline.set_edgecolor("#3a3d44")
    if m.region is not None:
        (t0, t1), (p0, p1) = np.degrees(m.region.theta), np.degrees(m.region.phi)
        axes.add_patch(Rectangle((p0, t0), p1 - p0, t1 - t0, fill=False, edgecolor="#111", linewidth=1.4))
    short = name if len(name) <= 90 else f"{name[:87]}…"
    figure.text(0.055, 0.925, f"{short}: {'passes' if ok else 'FAILED'}", color=INK, fontsize=14)
    difference = m.region.text() if m.region is not None else "samples and density agree here"
    about = (
        f"viewer at θr = {np.degrees(m.theta_r):.3g}°, {samples:,} samples; p = {m.p_value:.2g}, TV distance"
        f" {m.total_variation:.3g} (a correct sampler: {m.noise_floor:.3g}); {difference}"
    )
    figure.text(0.055, 0.862, about, color=PALE, fontsize=9.5)
    return figure_bytes(figure)


def _axes(figure: Figure, place: Any, title: str, *, left: bool) -> Any:
    axes = figure.add_subplot(place)
    axes.set_title(title, color=INK, fontsize=10, pad=7)
    axes.set_xticks([-180, -90, 0, 90, 180])
    axes.set_yticks([-90, -45, 0, 45, 90] if left else [])
    axes.set_xlabel("φ, degrees", color=PALE, fontsize=9)
    if left:
        axes.set_ylabel("θi, degrees", color=PALE, fontsize=9)
    axes.tick_params(colors=PALE, labelsize=8, length=2)
    for spine in axes.spines.values():
        spine.set_color("#3a3d44")
    return axes
