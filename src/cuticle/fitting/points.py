"""Where a fit of a table of lobes looks: viewers on and between nodes, numbers of strands on and between rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cuticle.fitting.mixture import Array
from cuticle.fitting.targets import Targets, make_targets
from cuticle.scattering.bcsdf import Bcsdf

THETA_NODES = 25  # every 7.5 degrees
END = np.radians(89.5)  # stands for the pole, where f·cos degenerates
_BETWEEN_AT_ENDS = (0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Points:
    """Where the fit looks: viewers on and between nodes, for rows on and between strand counts."""

    node: NDArray[np.intp]
    t: Array
    row: NDArray[np.intp]
    s: Array
    theta_r: Array
    strands: Array
    targets: Targets

    def natural(self, x: Array) -> Array:
        """Return the table's parameters at each point: x (rows, nodes, 5, K) -> (points, 5, K)."""
        t, s = self.t[:, None, None], self.s[:, None, None]
        upper_row = np.minimum(self.row + 1, x.shape[0] - 1)
        lower = (1 - t) * x[self.row, self.node] + t * x[self.row, self.node + 1]
        upper = (1 - t) * x[upper_row, self.node] + t * x[upper_row, self.node + 1]
        return (1 - s) * lower + s * upper

    def on_nodes(self) -> dict[tuple[int, int], int]:
        """Return the points that lie on entries of the table, by row and node."""
        on = np.flatnonzero((self.s == 0) & np.isin(self.t, (0.0, 1.0)))
        return {(int(self.row[k]), int(self.node[k] + self.t[k])): int(k) for k in on}

    @property
    def rows(self) -> int:
        """Number of the table's rows."""
        return int(self.row.max()) + 1


def make_points(with_strands: Callable[[float], Bcsdf], strands: Sequence[float], objective: str, family: str) -> Points:
    """Tabulate the targets that a fit of these strand counts looks at."""
    theta: list[tuple[int, float]] = [(i, 0.0) for i in range(THETA_NODES - 1)] + [(THETA_NODES - 2, 1.0)]
    for i in range(THETA_NODES - 1):
        theta += [(i, t) for t in (_BETWEEN_AT_ENDS if i in (0, THETA_NODES - 2) else (0.5,))]
    places: list[tuple[int, float, int, float, float, float]] = []
    models = []
    step = np.pi / (THETA_NODES - 1)

    def add(i: int, t: float, j: int, s: float, model: Bcsdf) -> None:
        count = strands[j] if s == 0 else (1 - s) * strands[j] + s * strands[j + 1]
        places.append((i, t, j, s, float(np.clip(-np.pi / 2 + (i + t) * step, -END, END)), count))
        models.append(model)

    for j, n in enumerate(strands):
        model = with_strands(n)
        for i, fraction in theta:
            add(i, fraction, j, 0.0, model)
        if j + 1 < len(strands) and n > 0:  # between 0 and the next count the sampler mixes; nothing to interpolate
            middle = with_strands(0.5 * (n + strands[j + 1]))
            for i, fraction in theta:
                add(i, fraction, j, 0.5, middle)
    node, t, row, s, theta_r, counts = (np.array(column) for column in zip(*places, strict=True))
    return Points(node, t, row, s, theta_r, counts, make_targets(models, list(theta_r), objective, family))
