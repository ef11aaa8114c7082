"""Cells of like probability: samples counted in them against what closed-form cdfs expect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle.checking.chi_square import chi_square
from cuticle.sampling.lobe_table import SIGMA_PHI, SIGMA_THETA
from cuticle.sampling.sampler import Sampler

CELLS = 40  # along each axis, of like probability


class Cells:
    """Cells of like probability and what a sampler's closed-form cdfs expect in them."""

    def __init__(self, sampler: Sampler, theta_r: float, strands: float) -> None:
        self._sampler, self._theta_r, self._strands = sampler, theta_r, strands
        self._weights = sampler.mixture(theta_r, strands).weight
        axes = []
        for cdf, end in ((sampler.cdf_theta, np.pi / 2), (sampler.cdf_phi, np.pi)):
            x = np.linspace(-end, end, 4001)
            total = sum(w * cdf(x, *self._at(k)) for k, w in enumerate(self._weights))
            inner = np.interp(np.linspace(0, 1, CELLS + 1)[1:-1], total, x)
            axes.append(np.unique(np.concatenate([[-end - 1e-6], inner, [end + 1e-6]])))
        self.theta, self.phi = axes
        theta, phi = self.theta.clip(-np.pi / 2, np.pi / 2), self.phi.clip(-np.pi, np.pi)
        self.probability = sampler.cell_probabilities(theta, phi, theta_r, strands)

    def _at(self, lobe: int) -> tuple[float, int, float]:
        return self._theta_r, lobe, self._strands

    def test(self, theta: NDArray, phi: NDArray) -> tuple[float, int, float]:
        """Return chi-square and degrees of freedom over the cells, and a p-value of three tests.

        Over the cells, over theta alone and over phi alone: the least of the three p-values times three. The last two
        see with few degrees of freedom what runs along one axis.
        """
        counts = np.zeros(self.probability.shape, np.int64)
        if _core.histogram(theta, phi, self.theta, self.phi, counts):
            return np.inf, 1, 0.0
        tests = [chi_square(counts.sum(axis=a), self.probability.sum(axis=a) * len(theta)) for a in ((), 0, 1)]
        return tests[0][0], tests[0][1], min(1.0, 3 * min(p for *_, p in tests))

    def turned(self, shift: float) -> NDArray[np.float64]:
        """Return the probabilities of the cells for the same sampler with phi turned by `shift`."""
        at = (self.phi.clip(-np.pi, np.pi) - shift + np.pi) % (2 * np.pi) - np.pi
        theta = self.theta.clip(-np.pi / 2, np.pi / 2)
        total = np.zeros_like(self.probability)
        for k, weight in enumerate(self._weights):
            along_phi = np.diff(self._sampler.cdf_phi(at, *self._at(k))) % 1.0
            total += weight * np.outer(np.diff(self._sampler.cdf_theta(theta, *self._at(k))), along_phi)
        return total

    def widened(self, lobe: int) -> NDArray[np.float64]:
        """Return the probabilities of the cells with one lobe 5 % too wide."""
        theta, phi = self.theta.clip(-np.pi / 2, np.pi / 2), self.phi.clip(-np.pi, np.pi)
        return widened(self._sampler, lobe, 1.05).cell_probabilities(theta, phi, self._theta_r, self._strands)

    def distance(self, probability: NDArray[np.float64]) -> float:
        """Return the total variation distance of these cells from other probabilities of them."""
        return 0.5 * float(np.abs(probability - self.probability).sum())


def widened(sampler: Sampler, lobe: int, factor: float) -> Sampler:
    """Return a sampler with one lobe's widths scaled: a negative control."""
    nodes = sampler.nodes.copy()
    nodes[:, :, [SIGMA_THETA, SIGMA_PHI], lobe] *= factor
    return replace(sampler, nodes=nodes)
