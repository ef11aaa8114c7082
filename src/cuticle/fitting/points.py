"""Where a fit of a table of lobes looks: viewers on and between nodes, numbers of strands on and between rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cuticle.fitting.mixture import Array
from cuticle.fitting.targets import Targets, make_targets
from cuticle.scattering.bcsdf import Bcsdf

if TYPE_CHECKING:
    from scipy.sparse import csr_array  # takes longer to import than all of this package: a fit does, its reader does not

THETA_NODES = 25  # every 7.5 degrees
END = np.radians(89.5)  # stands for the pole, where f·cos degenerates
_BETWEEN = (0.5, 0.25, 0.75)  # rows: lobes that follow the light halfway can lose it, or its tails, beside it


@dataclass(frozen=True)
class Points:
    """Where the fit looks: viewers on and between nodes, for rows on and between strand counts.

    `row` and `node` are places, counted in the table's rows and nodes; `share` (points, rows * nodes) holds the part that
    each entry of the table has in a point's parameters; `on_nodes` (rows, nodes) holds the points that lie on entries.
    """

    row: Array
    node: Array
    share: csr_array
    on_nodes: NDArray[np.intp]
    theta_r: Array
    strands: Array
    targets: Targets

    def natural(self, x: Array) -> Array:
        """Return the table's parameters at each point: x (rows, nodes, 5, K) -> (points, 5, K)."""
        return (self.share @ x.reshape(self.on_nodes.size, -1)).reshape(-1, *x.shape[2:])

    def by_entry(self, values: Array) -> Array:
        """Return each entry's share of the points' values: (points, ...) -> (rows * nodes, ...)."""
        return (self.share.T @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])

    def octaves(self) -> tuple[Points, csr_array]:
        """Return the same points for a table of rows an octave apart, and what interpolates its entries to all rows."""
        from scipy.sparse import csr_array, kron

        rows = self.strands[self.on_nodes[:, 0]]
        kept = [0]
        for i, n in enumerate(rows):
            if n >= 2 * rows[kept[-1]] > 0 or i == len(rows) - 1 > 0:
                kept.append(i)
        few = np.arange(len(kept))
        insert = kron(_shares(np.interp(rows, rows[kept], few), len(kept)), np.eye(THETA_NODES), "csr")
        row = np.interp(self.strands, rows[kept], few)
        return replace(self, row=row, share=csr_array(self.share @ insert), on_nodes=self.on_nodes[kept]), insert


def make_points(
    with_strands: Callable[[float], Bcsdf], strands: Sequence[float], objective: str, family: str, *, dense: bool
) -> Points:
    """Tabulate the targets that a fit of these strand counts looks at; `dense`: all viewers at every count between rows."""
    from scipy.sparse import csr_array

    halves = [i + 0.5 for i in range(THETA_NODES - 1)]
    places = np.sort([*range(THETA_NODES), *halves, 0.25, 0.75, THETA_NODES - 1.75, THETA_NODES - 1.25])  # in nodes
    seen: list[tuple[float, float]] = []  # rows and nodes
    for row, n in enumerate(strands):
        seen += [(row, x) for x in places]
        if row + 1 < len(strands) and n > 0:  # between 0 and the next count the sampler mixes; nothing to interpolate
            seen += [(row + s, x) for i, x in enumerate(places) for s in (_BETWEEN if dense else (_BETWEEN[i % 3],))]
    row, node = np.array(seen).T
    by_row, by_node = (_shares(x, count) for x, count in ((row, len(strands)), (node, THETA_NODES)))
    share = np.einsum("pr,pn->prn", by_row, by_node)
    on = np.flatnonzero(share.max(axis=(1, 2)) == 1)
    theta_r = np.clip(node * np.pi / (THETA_NODES - 1) - np.pi / 2, -END, END)
    counts = by_row @ np.array(strands)
    models = {n: with_strands(n) for n in counts}
    return Points(
        row, node, csr_array(share.reshape(len(share), -1)), on.reshape(len(strands), THETA_NODES), theta_r, counts,
        make_targets([models[n] for n in counts], list(theta_r), objective, family),
    )  # fmt: skip


def _shares(x: Array, entries: int) -> Array:
    """Return the linear interpolation to places x, counted in entries, as a matrix (places, entries)."""
    return np.maximum(1 - np.abs(x[:, None] - np.arange(entries)), 0)
