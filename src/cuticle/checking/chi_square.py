"""Pearson's chi-square over cells of a grid, small ones pooled with their neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

LEAST_EXPECTED = 10.0  # samples in a cell; smaller cells are pooled


class ChiSquare(NamedTuple):
    """The statistic, its degrees of freedom, and the chance of one as large where the expectation is right."""

    statistic: float
    dof: int
    p_value: float


def chi_square(counts: NDArray, expected: NDArray, error: NDArray | None = None) -> ChiSquare:
    """Test counts of independent samples against what is expected in each cell.

    Parameters
    ----------
    counts, expected
        One dimension, or (rows, columns). Cells that expect fewer than 10 are pooled within their row, and rows' pools with
        the next until 10 are expected.
    error
        How far `expected` itself may be off (of a quadrature), if at all: it adds to the variance.
    """
    shape = (1, -1) if counts.ndim == 1 else counts.shape
    o, e = counts.reshape(shape).astype(np.float64), expected.reshape(shape).astype(np.float64)
    d = np.zeros_like(e) if error is None else error.reshape(shape).astype(np.float64)
    small = e < LEAST_EXPECTED
    kept = [x[~small] for x in (o, e, d)]
    pools = _pool(*(np.where(small, x, 0).sum(axis=1) for x in (o, e, d)))
    o, e, d = (np.concatenate(pair) for pair in zip(kept, pools, strict=True))
    if len(e) > 1 and e[-1] < LEAST_EXPECTED:  # too few even together: into the smallest cell that counts
        at = int(np.argmin(e[:-1]))
        for x in (o, e, d):
            x[at] += x[-1]
        o, e, d = o[:-1], e[:-1], d[:-1]
    used = e > 0
    if (o[~used] > 0).any():
        return ChiSquare(np.inf, 1, 0.0)
    o, e, d = o[used], e[used], d[used]
    statistic, dof = float(((o - e) ** 2 / (e + d**2)).sum()), len(e) - 1
    if dof < 1:
        return ChiSquare(statistic, max(dof, 0), 1.0)
    # A Poisson count's (o - e)²/e varies by 2 + 1/e, not 2: match both moments.
    scale = 1 + float((1 / e).sum()) / (2 * len(e))
    return ChiSquare(statistic, dof, float(chdtrc(dof / scale, dof / scale + (statistic - dof) / scale)))


def _pool(o: NDArray, e: NDArray, d: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    pools: list[list[float]] = []
    current = [0.0, 0.0, 0.0]
    for row in zip(o, e, d, strict=True):
        current = [a + b for a, b in zip(current, row, strict=True)]
        if current[1] >= LEAST_EXPECTED:
            pools.append(current)
            current = [0.0, 0.0, 0.0]
    if any(current):
        if pools:
            pools[-1] = [a + b for a, b in zip(pools[-1], current, strict=True)]
        else:
            pools.append(current)
    columns = np.array(pools).reshape(-1, 3)
    return columns[:, 0], columns[:, 1], columns[:, 2]
