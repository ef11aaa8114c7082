"""Which numbers of strands a sampler's table needs rows for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle.scattering.bcsdf import evaluate, is_even, luminance

_ALWAYS = (1.0, 2.0, 4.0, 8.0, 16.0)
_FURTHER = (32.0, 64.0)
_SETTLED = 0.995  # ESS of the last row's shape for that through 64 strands: what leaving out the rows beyond may cost
_VIEWERS = np.radians([-85, -60, -20, 33, 70])
_GRID = (120, 24)


def settled_rows(model: Any) -> tuple[float, ...]:
    """Return strand counts from 0 to where the shape of the light no longer changes with their number, at most 64.

    Through 16 strands and more the tables of light hold one shape for each part; what still changes is the parts' and the
    channels' shares, which fall by powers. Rows follow where that matters to the luminance. Between two rows the fit adds
    more, where its lobes need them.
    """
    far = _shapes(model, _FURTHER[-1])
    rows = [0.0, *_ALWAYS]
    for n in _FURTHER:
        last = _shapes(model, rows[-1])
        if (1 / (far**2 / np.maximum(last, 1e-30)).sum(axis=(1, 2))).min() >= _SETTLED:
            break
        rows.append(n)
    return tuple(rows)


def _shapes(model: Any, strands: float) -> NDArray:
    """Shares of f cos by cell, for each viewer."""
    theta = (np.arange(_GRID[0]) + 0.5) / _GRID[0] * np.pi - np.pi / 2
    phi = (np.arange(_GRID[1]) + 0.5) / _GRID[1] * np.pi
    phi = phi if is_even(model) else np.concatenate([-phi, phi])
    through = model.with_strands(strands)
    values = np.array([luminance(evaluate(through, theta, float(t), phi)) for t in _VIEWERS])
    return values / np.maximum(values.sum(axis=(1, 2), keepdims=True), 1e-300)
