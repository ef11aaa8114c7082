"""Where a fit of a table of lobes looks: viewers on and between nodes, numbers of strands on and between rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cuticle.fitting.mixture import Array
from cuticle.fitting.targets import Targets, make_targets
from cuticle.scattering.bcsdf import Bcsdf

THETA_NODES = 25  # every 7.5 degrees
END = np.radians(89.5)  # stands for the pole, where f·cos degenerates
_BETWEEN = (0.5, 0.25, 0.75)  # rows: lobes that follow the light halfway can lose it, or its tails, beside it


@dataclass(frozen=True)
class Points:
    """Where the fit looks: viewers on and between nodes, for rows on and between strand counts.

    Points are those `seen` of a grid of places along rows and along nodes, (row places, node places); `by_row` (row places,
    rows) and `by_node` (node places, nodes) interpolate the table's parameters to them. `row` and `node` are each point's
    places, counted in the table's rows and nodes; `on_nodes` (rows, nodes) holds the points that lie on entries.
    """

    seen: NDArray[np.bool_]
    by_row: Array
    by_node: Array
    row: Array
    node: Array
    on_nodes: NDArray[np.intp]
    theta_r: Array
    strands: Array
    targets: Targets

    @property
    def rows(self) -> Array:
        """The table's strand counts."""
        return self.strands[self.on_nodes[:, 0]]

    def natural(self, x: Array) -> Array:
        """Return the table's parameters at each point: x (rows, nodes, 5, K) -> (points, 5, K)."""
        there = np.tensordot(self.by_row, self.by_node @ x.reshape(*self.on_nodes.shape, -1), 1)
        return there[self.seen].reshape(-1, *x.shape[2:])

    def by_entry(self, values: Array) -> Array:
        """Return each entry's share of the points' values: (points, ...) -> (rows * nodes, ...)."""
        there = np.zeros((*self.seen.shape, values[0].size))
        there[self.seen] = values.reshape(len(values), -1)
        return (self.by_node.T @ np.tensordot(self.by_row.T, there, 1)).reshape(-1, *values.shape[1:])

    def octaves(self) -> tuple[Points, Array]:
        """Return the same points for a table of rows an octave apart, and what interpolates those to all: (rows, few)."""
        rows = self.rows
        kept = [0]
        for i, n in enumerate(rows):
            if n >= 2 * rows[kept[-1]] > 0 or i == len(rows) - 1 > 0:
                kept.append(i)
        few = np.arange(len(kept))
        insert = shares(np.interp(rows, rows[kept], few), len(kept))
        row = np.interp(self.strands, rows[kept], few)
        return replace(self, row=row, by_row=self.by_row @ insert, on_nodes=self.on_nodes[kept]), insert


def make_points(
    with_strands: Callable[[float], Bcsdf],
    strands: Sequence[float],
    objective: str,
    family: str,
    *,
    dense: bool,
    known: Points | None = None,
) -> Points:
    """Tabulate the targets that a fit of these strand counts looks at; `dense`: all viewers at every count between rows.

    Between 0 and the next count the sampler mixes: there is nothing to interpolate, and 0 comes alone. Targets of `known`
    points are not made again.
    """
    halves = [i + 0.5 for i in range(THETA_NODES - 1)]
    at_node = np.sort([*range(THETA_NODES), *halves, 0.25, 0.75, THETA_NODES - 1.75, THETA_NODES - 1.25])
    at_row = np.arange(4 * len(strands) - 3) / 4
    seen = dense | (at_row[:, None] % 1 == np.resize(_BETWEEN, len(at_node))) | (at_row[:, None] % 1 == 0)
    by_row, by_node = shares(at_row, len(strands)), shares(at_node, THETA_NODES)
    row, node = (at[i] for at, i in zip((at_row, at_node), np.nonzero(seen), strict=True))
    on = np.flatnonzero((row % 1 == 0) & (node % 1 == 0))
    theta_r = np.clip(node * np.pi / (THETA_NODES - 1) - np.pi / 2, -END, END)
    counts = np.interp(row, np.arange(len(strands)), strands)
    old = {} if known is None else {place: i for i, place in enumerate(zip(known.strands, known.theta_r, strict=True))}
    new = [place for place in zip(counts, theta_r, strict=True) if place not in old]
    models = {n: with_strands(n) for n in dict.fromkeys(n for n, _ in new)}
    targets = make_targets([models[n] for n, _ in new], [t for _, t in new], objective, family)
    if known is not None:
        at = old | {place: len(old) + i for i, place in enumerate(new)}
        targets = known.targets.and_of(targets).take([at[place] for place in zip(counts, theta_r, strict=True)])
    on_nodes = on.reshape(len(strands), THETA_NODES)
    return Points(seen, by_row, by_node, row, node, on_nodes, theta_r, counts, targets)


def shares(x: Array, entries: int) -> Array:
    """Return the linear interpolation to places x, counted in entries, as a matrix (places, entries)."""
    return np.maximum(1 - np.abs(x[:, None] - np.arange(entries)), 0)
