"""Which numbers of strands a sampler's table needs rows for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle.scattering.bcsdf import evaluate, is_even, luminance

_ALWAYS = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0)
_FURTHER = (32.0, 64.0)
_SETTLED = 0.995  # ESS of the last row's shape for that through 64 strands
_FOLLOWED = 0.92  # ESS halfway between two rows of the mean of both shapes
_HALVED = 8.0  # the first count below which a row may come in between
_VIEWERS = np.radians([-85, -60, -20, 33, 70])
_GRID = (120, 40)


def settled_rows(model: Any) -> tuple[float, ...]:
    """Return strand counts from 0 to where the shape of the light no longer changes with their number, at most 64.

    Through 16 strands and more the tables of light hold one shape for each part; what still changes is the parts' and the
    channels' shares, which fall by powers. Rows follow where that matters to the luminance, and are halved where the shape
    between two is far from both.
    """
    shapes = {n: _shapes(model, n) for n in (*(n for n in _ALWAYS if n >= _HALVED / 2), *_FURTHER)}
    rows = [n for n in _ALWAYS if n < _HALVED]
    for n in (n for n in (*_ALWAYS, *_FURTHER) if n >= _HALVED):
        low = rows[-1]
        if n in _FURTHER and _least_ess(shapes[low], shapes[_FURTHER[-1]]) >= _SETTLED:
            break
        middle, mean = 0.5 * (low + n), [0.5 * (a + b) for a, b in zip(shapes[low], shapes[n], strict=True)]
        if _least_ess(mean, _shapes(model, middle)) < _FOLLOWED:
            rows.append(middle)
        rows.append(n)
    return tuple(rows)


def _shapes(model: Any, strands: float) -> list[NDArray]:
    """Shares of f cos by cell, for each viewer."""
    theta = (np.arange(_GRID[0]) + 0.5) / _GRID[0] * np.pi - np.pi / 2
    phi = (np.arange(_GRID[1]) + 0.5) / _GRID[1] * np.pi
    phi = phi if is_even(model) else np.concatenate([-phi, phi])
    values = [luminance(evaluate(model.with_strands(strands), theta, float(t), phi)) for t in _VIEWERS]
    return [v / max(float(v.sum()), 1e-300) for v in values]


def _least_ess(drawn: Sequence[NDArray], wanted: Sequence[NDArray]) -> float:
    return min(1 / max(float((w**2 / np.maximum(d, 1e-30)).sum()), 1e-30) for d, w in zip(drawn, wanted, strict=True))
