"""Which numbers of strands a sampler's table needs rows for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle.scattering.bcsdf import evaluate, luminance

_ALWAYS = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0)
_FURTHER = (32.0, 64.0)
_SETTLED = 0.995  # ESS of the last row's shape for that through 64 strands
_FOLLOWED = 0.97  # ESS halfway between two rows of the mean of both shapes
_VIEWERS = np.radians([-85, -60, -20, 33, 70])
_GRID = (180, 60)


def settled_rows(model: Any) -> tuple[float, ...]:
    """Return strand counts from 0 to where the shape of the light no longer changes with their number, at most 64.

    Through 16 strands and more the tables of light hold one shape for each part; what still changes is the parts' and the
    channels' shares, which fall by powers. Rows follow where that matters to the luminance.
    """
    rows = list(_ALWAYS)
    shapes = {n: _shapes(model, n) for n in (rows[-1], *_FURTHER)}
    for n in _FURTHER:
        low = rows[-1]
        if _least_ess(shapes[low], shapes[_FURTHER[-1]]) >= _SETTLED:
            break
        middle = 0.5 * (low + n)
        if (
            _least_ess([0.5 * (a + b) for a, b in zip(shapes[low], shapes[n], strict=True)], _shapes(model, middle))
            < _FOLLOWED
        ):
            rows.append(middle)
        rows.append(n)
    return tuple(rows)


def _shapes(model: Any, strands: float) -> list[NDArray]:
    """Shares of f cos by cell, for each viewer."""
    theta = (np.arange(_GRID[0]) + 0.5) / _GRID[0] * np.pi - np.pi / 2
    phi = (np.arange(2 * _GRID[1]) + 0.5) / _GRID[1] * np.pi - np.pi
    values = [luminance(evaluate(model.with_strands(strands), theta, float(t), phi)) for t in _VIEWERS]
    return [v / max(float(v.sum()), 1e-300) for v in values]


def _least_ess(drawn: Sequence[NDArray], wanted: Sequence[NDArray]) -> float:
    return min(1 / max(float((w**2 / np.maximum(d, 1e-30)).sum()), 1e-30) for d, w in zip(drawn, wanted, strict=True))
