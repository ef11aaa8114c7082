"""What pictures share: the dark palette, and figures as files."""

from __future__ import annotations

import io
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

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
