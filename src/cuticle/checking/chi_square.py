"""Pearson's chi-square over cells of a grid; cells with small expected counts are pooled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

LEAST_EXPECTED = 10.0  # samples in a cell; smaller cells are pooled


class ChiSquare(NamedTuple):
    """The statistic, its degrees of freedom and its p-value."""

    statistic: float
    dof: int
    p_value: float


def chi_square(counts: NDArray, expected: NDArray, error: NDArray | None = None) -> ChiSquare:
    """Test counts of independent samples against the expected count of each cell.

    Parameters
    ----------
    counts, expected
        One dimension, or (rows, columns). Cells that expect fewer than 10 are pooled within their row; the rows' pools are
        merged, in order, until each expects 10.
    error
        Bound on the error of `expected`, of a quadrature say; its square adds to the variance.
    """
    shape = (1, -1) if counts.ndim == 1 else counts.shape
    o, e = counts.reshape(shape).astype(np.float64), expected.reshape(shape).astype(np.float64)
    d = np.zeros_like(e) if error is None else error.reshape(shape).astype(np.float64)
    small = e < LEAST_EXPECTED
    kept = [x[~small] for x in (o, e, d)]
    pools = _pool(*(np.where(small, x, 0).sum(axis=1) for x in (o, e, d)))
    o, e, d = (np.concatenate(pair) for pair in zip(kept, pools, strict=True))
    if len(e) > 1 and e[-1] < LEAST_EXPECTED:  # the last pool is too small: merge it with the smallest cell
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
    # For a Poisson count (o - e)²/e has variance 2 + 1/e, not 2: scale the distribution to match mean and variance.
    scale = 1 + float((1 / e).sum()) / (2 * len(e))
    return ChiSquare(statistic, dof, float(chdtrc(dof / scale, dof / scale + (statistic - dof) / scale)))


def _pool(*of_rows: NDArray) -> NDArray:
    """Merge rows (counts, expected, error) in order until each expects enough; return the same for the pools."""
    pools = [np.zeros(3)]
    for row in np.column_stack(of_rows):
        if pools[-1][1] >= LEAST_EXPECTED:
            pools.append(np.zeros(3))
        pools[-1] += row
    if len(pools) > 1 and pools[-1][1] < LEAST_EXPECTED:
        pools[-2:] = [pools[-2] + pools[-1]]
    return np.array(pools).T
