"""Where a fit of a table of lobes looks: viewers on and between nodes, numbers of strands on and between rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cuticle.fitting.mixture import Array
from cuticle.fitting.targets import Targets, make_targets
from cuticle.scattering.bcsdf import Bcsdf

THETA_NODES = 25  # every 7.5 degrees: of a table at first
END = np.radians(89.5)  # stands for the pole, where f·cos degenerates
_BETWEEN = (0.5, 0.25, 0.75)  # rows: lobes that follow the light halfway can lose it, or its tails, beside it
_BESIDE = (1 / 2, 1 / 3, 2 / 3)  # of the way between two nodes


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
    def nodes(self) -> int:
        """How many viewers the table has, evenly from pole to pole."""
        return self.by_node.shape[1]

    @property
    def rows(self) -> Array:
        """The table's strand counts."""
        return self.strands[self.on_nodes[:, 0]]

    @cached_property
    def coarse(self) -> Points:
        """The same points, with targets on coarser grids."""
        return replace(self, targets=self.targets.coarser())

    def natural(self, x: Array) -> Array:
        """Return the table's parameters at each point: x (rows, nodes, 5, K) -> (points, 5, K)."""
        there = np.tensordot(self.by_row, self.by_node @ x.reshape(*self.on_nodes.shape, -1), 1)
        return there[self.seen].reshape(-1, *x.shape[2:])

    def by_entry(self, values: Array) -> Array:
        """Return each entry's share of the points' values: (points, ...) -> (rows * nodes, ...)."""
        of_places = np.split(values.reshape(len(values), -1), np.cumsum(self.seen.sum(axis=1))[:-1])  # along rows
        there = np.array([self.by_node[seen].T @ v for seen, v in zip(self.seen, of_places, strict=True)])
        return np.tensordot(self.by_row.T, there, 1).reshape(-1, *values.shape[1:])

    @property
    def whole(self) -> NDArray[np.intp]:
        """Places along rows, on and between them, where all nodes are seen."""
        on_node = self.by_node.max(axis=1) == 1
        return np.flatnonzero(self.seen[:, on_node].all(axis=1))

    def of_row(self, place: int) -> Points:
        """Return the points at one of the places along rows, for a table of that row alone."""
        at = np.flatnonzero(np.nonzero(self.seen)[0] == place)
        node = self.node[at]
        return Points(
            self.seen[place : place + 1], np.ones((1, 1)), self.by_node, np.zeros(len(at)), node,
            np.flatnonzero(node % 1 == 0)[None], self.theta_r[at], self.strands[at], self.targets.take(at),
        )  # fmt: skip

    def energy_at_nodes(self, nodes: int) -> Array:
        """Return ∫ f cos for each row of a table with so many nodes, of whose viewers all are seen: (rows, nodes)."""
        at = np.linspace(0, self.nodes - 1, nodes)
        found = []
        for r in range(len(self.on_nodes)):
            seen = np.flatnonzero(self.row == r)
            seen = seen[np.argsort(self.node[seen])]
            found.append(np.interp(at, self.node[seen], self.targets.energy[seen]))
        return np.array(found)


def with_nodes(table: Array, nodes: int) -> Array:
    """Return the same table, (rows, few nodes, ...), with more nodes between them."""
    few = table.shape[1]
    return np.moveaxis(np.tensordot(shares(np.linspace(0, few - 1, nodes), few), table, (1, 1)), 0, 1)


def make_points(
    with_strands: Callable[[float], Bcsdf],
    strands: Sequence[float],
    objective: str,
    family: str,
    *,
    dense: bool,
    nodes: int,
    known: Points | None,
) -> Points:
    """Tabulate the targets that a fit of these strand counts looks at; `dense`: all viewers at every count between rows.

    Between 0 and the next count the sampler mixes: there is nothing to interpolate, and 0 comes alone. Targets of `known`
    points are not made again; some have to be new.
    """
    middle = np.arange(nodes - 1)
    near_poles = middle[[0, 0, -1, -1]] + [0.25, 0.75, 0.25, 0.75]
    at_node = np.concatenate([np.arange(nodes), near_poles, *(middle + x for x in _BESIDE)])
    kind = np.repeat(range(len(_BESIDE) + 1), [nodes + 4, *[nodes - 1] * len(_BESIDE)])
    at_row = np.arange(4 * len(strands) - 3) / 4
    beside = np.resize([1, 2, 1, 3], len(at_row))  # the kind seen at each: halfway, at a third, halfway, at two thirds
    seen = (kind == 0) | (kind == beside[:, None])
    if not dense:
        seen &= (at_row[:, None] % 1 == np.resize(_BETWEEN, len(at_node))) | (at_row[:, None] % 1 == 0)
    by_row, by_node = shares(at_row, len(strands)), shares(at_node, nodes)
    row, node = (at[i] for at, i in zip((at_row, at_node), np.nonzero(seen), strict=True))
    on = np.flatnonzero((row % 1 == 0) & (node % 1 == 0))
    theta_r = np.clip(node / (nodes - 1) * np.pi - np.pi / 2, -END, END)  # the same for twice as many
    counts = np.interp(row, np.arange(len(strands)), strands)
    old = {} if known is None else {place: i for i, place in enumerate(zip(known.strands, known.theta_r, strict=True))}
    new = [place for place in zip(counts, theta_r, strict=True) if place not in old]
    models = {n: with_strands(n) for n in dict.fromkeys(n for n, _ in new)}
    targets = make_targets([models[n] for n, _ in new], [t for _, t in new], objective, family)
    if known is not None:
        at = old | {place: len(old) + i for i, place in enumerate(new)}
        targets = known.targets.and_of(targets).take([at[place] for place in zip(counts, theta_r, strict=True)])
    on_nodes = on.reshape(len(strands), nodes)
    return Points(seen, by_row, by_node, row, node, on_nodes, theta_r, counts, targets)


def shares(x: Array, entries: int) -> Array:
    """Return the linear interpolation to places x, counted in entries, as a matrix (places, entries)."""
    return np.maximum(1 - np.abs(x[:, None] - np.arange(entries)), 0)
