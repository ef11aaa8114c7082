"""What pictures share: the dark palette, and figures as files."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

INK, PALE, PAPER = "#e8e6e3", "#a9a59e", "#14161a"  # text, quiet text, ground
MAP = "magma"  # of densities on the dark ground
_SVG: Any = {"svg.fonttype": "path", "svg.hashsalt": "cuticle"}


def figure_bytes(figure: Figure, kind: str = "png", dpi: int = 150) -> bytes:
    """Return a figure as "png" or "svg", the same bytes every time."""
    buffer = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    with mpl.rc_context(_SVG):
        figure.savefig(buffer, format=kind, dpi=dpi, facecolor=figure.get_facecolor(), metadata=metadata)
    return buffer.getvalue()


def new_axes() -> Any:
    """Return the axes to draw on where the caller has none: those of a new figure of pyplot, which notebooks show."""
    from matplotlib import pyplot  # chooses a backend: only where a figure is shown

    return pyplot.subplots()[1]


def plot_density(density: Callable[[NDArray, NDArray], NDArray], theta_r: float, title: str, axes: Any = None) -> Any:
    """Draw a function of theta_i (A, 1) and phi (1, B), radians, per steradian, as a map in degrees; return the axes."""
    axes = new_axes() if axes is None else axes
    theta, phi = (np.arange(180) + 0.5 - 90)[:, None], (np.arange(240) + 0.5)[None, :] * 1.5
    values = density(np.radians(theta), np.radians(phi))
    image = axes.imshow(values, origin="lower", extent=(0, 360, -90, 90), aspect="auto", cmap=MAP, vmin=0)
    axes.figure.colorbar(image, ax=axes, label="1/sr")
    axes.set(xlabel="φ, degrees", ylabel="θ_i, degrees", title=f"{title}, θ_r = {np.degrees(theta_r):.4g}°")
    return axes
