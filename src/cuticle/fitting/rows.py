"""Which numbers of strands a sampler's table needs rows for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle.scattering.bcsdf import evaluate, is_even, luminance

_ALWAYS = (1.0, 2.0, 4.0, 8.0, 16.0)
_FURTHER = (32.0, 64.0)
_SETTLED = 0.995  # ESS of the last row's shape for that through 64 strands: what leaving out the rows beyond may cost
# ESS between two rows of both shapes mixed, as lobes that do not move would mix them. With .92, and halfway only, four lobes
# fell to .90 over 31 fibres (benchmarks/random_fits.py); with .95 at all quarters to .98, but at one place of black hair.
_FOLLOWED = 0.95
_HALVINGS = 2  # of a gap between two counts of the above
_BETWEEN = (0.25, 0.5, 0.75)  # shares fall by powers from part to part: what is right halfway can be wrong beside it
_VIEWERS = np.radians([-85, -60, -20, 33, 70])
_GRID = (120, 24)


def settled_rows(model: Any) -> tuple[float, ...]:
    """Return strand counts from 0 to where the shape of the light no longer changes with their number, at most 64.

    Through 16 strands and more the tables of light hold one shape for each part; what still changes is the parts' and the
    channels' shares, which fall by powers. Rows follow where that matters to the luminance, and are halved where the shape
    between two is far from a mixture of both.
    """
    shapes: dict[float, NDArray] = {}

    def ess(wanted: float, *rows: tuple[float, float]) -> float:
        """Return the least ESS for one count of a mixture of others, pairs of share and count."""
        for n in (wanted, *(n for _, n in rows)):
            if n not in shapes:
                shapes[n] = _shapes(model, n)
        mixed = sum(share * shapes[n] for share, n in rows)
        return float(1 / (shapes[wanted] ** 2 / np.maximum(mixed, 1e-30)).sum(axis=(1, 2)).max())

    def after(low: float, high: float, halvings: int) -> list[float]:
        """Return the rows above `low` up to `high`."""
        if not halvings or all(ess((1 - s) * low + s * high, (1 - s, low), (s, high)) >= _FOLLOWED for s in _BETWEEN):
            return [high]
        middle = 0.5 * (low + high)
        return after(low, middle, halvings - 1) + after(middle, high, halvings - 1)

    rows = [0.0, _ALWAYS[0]]
    for n in (*_ALWAYS[1:], *_FURTHER):
        if n in _FURTHER and ess(_FURTHER[-1], (1.0, rows[-1])) >= _SETTLED:
            break
        rows += after(rows[-1], n, _HALVINGS)
    return tuple(rows)


def _shapes(model: Any, strands: float) -> NDArray:
    """Shares of f cos by cell, for each viewer."""
    theta = (np.arange(_GRID[0]) + 0.5) / _GRID[0] * np.pi - np.pi / 2
    phi = (np.arange(_GRID[1]) + 0.5) / _GRID[1] * np.pi
    phi = phi if is_even(model) else np.concatenate([-phi, phi])
    through = model.with_strands(strands)
    values = np.array([luminance(evaluate(through, theta, float(t), phi)) for t in _VIEWERS])
    return values / np.maximum(values.sum(axis=(1, 2), keepdims=True), 1e-300)
