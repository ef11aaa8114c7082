"""Samples counted in cells of the sphere, against the probability that a density has in each.

The probabilities of a `Sampler` are exact, from its closed-form cdfs (`from_cdfs`); those of any other density come from
`sphere_integrals`, with an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtr, pdtrc

from cuticle import _core
from cuticle.checking.chi_square import ChiSquare, chi_square
from cuticle.sampling.sampler import Sampler

Array = NDArray[np.float64]
CELLS = 40  # of like probability, along each axis
_BEYOND = 1e-6  # radians past the ends of an axis: angles in single precision are rounded outward


class Groups(NamedTuple):
    """Cells taken together: the first row (theta) and column (phi) of each group; None: the whole axis is one group."""

    rows: NDArray[np.intp] | None
    columns: NDArray[np.intp] | None

    def sums(self, x: NDArray) -> NDArray:
        """Return the sum over each group: shape (row groups, column groups), one dimension where an axis is one group."""
        x = x.sum(axis=0) if self.rows is None else np.add.reduceat(x, self.rows, axis=0)
        return x.sum(axis=-1) if self.columns is None else np.add.reduceat(x, self.columns, axis=-1)


@dataclass(frozen=True)
class CellProbabilities:
    """Edges along theta (A + 1,) and phi (B + 1,), radians; the cells' probabilities (A, B) and how far those may be off."""

    theta: Array
    phi: Array
    value: Array
    error: Array | None = None

    def count(self, theta: NDArray, phi: NDArray) -> NDArray[np.int64] | None:
        """Return how many directions lie in each cell; None where one is not a number or not on the sphere."""
        rows, columns = (np.concatenate([[e[0] - _BEYOND], e[1:-1], [e[-1] + _BEYOND]]) for e in (self.theta, self.phi))
        counts = np.zeros(self.value.shape, np.int64)
        return None if _core.histogram(theta, phi, rows, columns, counts) else counts

    def test(self, counts: NDArray, asked: int, groups: Sequence[Groups], bands: Sequence[Groups] = ()) -> ChiSquare:
        """Test counts out of `asked` samples against the probabilities.

        Returns chi-square over the first groups with its degrees of freedom, and the p-value of all tests together: the
        smallest of their p-values times their number. There is a chi-square test over each of `groups`, and one test of
        the least likely single count among `bands`.
        """
        error = np.zeros_like(self.value) if self.error is None else self.error
        of_each = counts, self.value * asked, error * asked
        tests = [chi_square(*map(g.sums, of_each)) for g in groups]
        p_values = [t.p_value for t in tests]
        if bands:
            p_values.append(_least_likely_count(*(np.concatenate([g.sums(x) for g in bands]) for x in of_each)))
        return tests[0]._replace(p_value=min(1.0, len(p_values) * min(p_values)))

    def distance(self, probability: Array) -> float:
        """Return the total variation distance from other probabilities of the same cells."""
        return 0.5 * float(np.abs(probability - self.value).sum())


def from_cdfs(sampler: Sampler, theta_r: float, strands: float) -> CellProbabilities:
    """Return the exact probabilities of 40 x 40 cells; rows are of like probability, and so are columns."""
    weights = sampler.mixture(theta_r, strands).weight
    axes = []
    for cdf, end in ((sampler.cdf_theta, np.pi / 2), (sampler.cdf_phi, np.pi)):
        x = np.linspace(-end, end, 4001)
        total = sum(w * cdf(x, theta_r, k, strands) for k, w in enumerate(weights))
        inner = np.interp(np.linspace(0, 1, CELLS + 1)[1:-1], total, x)
        axes.append(np.unique(np.concatenate([[-end], inner, [end]])))
    theta, phi = axes
    return CellProbabilities(theta, phi, sampler.cell_probabilities(theta, phi, theta_r, strands))


def compare_samples(cells: CellProbabilities, theta: NDArray, phi: NDArray) -> ChiSquare:
    """Test samples over all cells, over theta alone and over phi alone.

    The last two tests have few degrees of freedom, and so see small errors that run along one axis.
    """
    counts = cells.count(theta, phi)
    if counts is None:
        return ChiSquare(np.inf, 1, 0.0)
    rows, columns = (np.arange(n) for n in cells.value.shape)
    return cells.test(counts, len(theta), (Groups(rows, columns), Groups(None, columns), Groups(rows, None)))


def _least_likely_count(counts: Array, expected: Array, error: Array) -> float:
    """Return the p-value of the least likely Poisson count among bands: it sees samples where there should be none."""
    many = np.where(counts > 0, pdtrc(np.maximum(counts - 1, 0), expected + error), 1.0)
    few = pdtr(counts, np.maximum(expected - error, 0))
    return float(min(1.0, 2 * len(counts) * min(many.min(), few.min())))
