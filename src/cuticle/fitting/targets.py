"""The density to match, f·cos for one viewer, on a grid whose cells follow it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support.quadrature import Grid, adapted_edges, grid
from cuticle.sampling.families import NORMAL
from cuticle.scattering.bcsdf import Bcsdf, checked_even, evaluate, luminance

OBJECTIVES = ("luminance", "rgb")
_COARSE = (150, 36)
_FINE = (56, 36)
_AT_ONCE = 16  # viewers of one model that are tabulated together: their values fit a cache


class Targets(NamedTuple):
    """Densities of E viewers, per radian of theta and of phi, each on its own product grid; q integrates to 1.

    With an even model phi runs over [0, pi] and q holds both signs.
    """

    q: NDArray[np.float64]  # (E, A, B)
    theta: NDArray[np.float64]  # (E, A)
    theta_weight: NDArray[np.float64]
    phi: NDArray[np.float64]  # (E, B)
    phi_weight: NDArray[np.float64]
    energy: NDArray[np.float64]  # (E,) ∫ f cos, luminance
    even: bool
    family: str = NORMAL  # of the lobes that are fitted to it

    def take(self, index: Sequence[int] | NDArray[np.intp]) -> Targets:
        """Return the targets at `index`."""
        i = np.asarray(index, np.intp)
        arrays = [np.ascontiguousarray(a[i]) for a in self[:6]]
        return Targets(arrays[0], arrays[1], arrays[2], arrays[3], arrays[4], arrays[5], self.even, self.family)

    def and_of(self, other: Targets) -> Targets:
        """Return these targets, then the others."""
        c = [np.concatenate(pair) for pair in zip(self[:6], other[:6], strict=True)]
        return Targets(c[0], c[1], c[2], c[3], c[4], c[5], self.even, self.family)

    def coarser(self) -> Targets:
        """Return the targets on a grid of half as many points along each angle: each stands for two."""

        def pairs(a: NDArray[np.float64]) -> NDArray[np.float64]:
            return a.reshape(len(a), -1, 2)

        weights = [pairs(w).sum(axis=2) for w in (self.theta_weight, self.phi_weight)]
        theta, phi = (
            pairs(x * w).sum(axis=2) / total
            for x, w, total in zip((self.theta, self.phi), (self.theta_weight, self.phi_weight), weights, strict=True)
        )
        mass = self.q * self.theta_weight[:, :, None] * self.phi_weight[:, None, :]
        mass = mass.reshape(len(mass), theta.shape[1], 2, phi.shape[1], 2).sum(axis=(2, 4))
        q = mass / (weights[0][:, :, None] * weights[1][:, None, :])
        return Targets(q, theta, weights[0], phi, weights[1], self.energy, self.even, self.family)


def objective_density(values: NDArray[np.float64], weights: NDArray[np.float64], objective: str) -> NDArray[np.float64]:
    """Return q ≥ 0, (..., A, B), whose ∫ q²/p is what the objective minimises.

    "luminance": the luminance of `values` (..., A, B, channels). "rgb": 1/ESS averaged over channels is ∫ q²/p for q² the
    mean over channels of (f_c/∫f_c)²; `weights` (..., A, B) are the cells' measures.
    """
    if objective == "luminance":
        return luminance(values)
    total = (weights[..., None] * values).sum(axis=(-3, -2), keepdims=True)
    return np.sqrt(np.mean((values / np.maximum(total, 1e-300)) ** 2, axis=-1))


def make_targets(models: Sequence[Bcsdf], theta_r: Sequence[float], objective: str, family: str = NORMAL) -> Targets:
    """Tabulate each (model, theta_r) pair as a target; neighbours of one model together."""
    even = checked_even(models[0])
    built = []
    for _, of_one in groupby(zip(models, theta_r, strict=True), lambda pair: id(pair[0])):
        of_model, at = zip(*of_one, strict=True)
        for i in range(0, len(at), _AT_ONCE):
            built.append(_targets(of_model[0], np.array(at[i : i + _AT_ONCE]), even, objective))
    c = [np.concatenate(column) for column in zip(*built, strict=True)]
    return Targets(c[0], c[1], c[2], c[3], c[4], c[5], even, family)


def _targets(model: Bcsdf, theta_r: NDArray[np.float64], even: bool, objective: str) -> tuple[NDArray[np.float64], ...]:
    def values(g: Grid) -> NDArray[np.float64]:
        return evaluate(model, g.theta, theta_r, g.phi) * np.cos(g.theta)[..., :, None, None]  # per d theta d phi

    edges = adapted_edges(
        lambda c: objective_density(values(c), c.weights, objective), even=even, coarse=_COARSE, fine=_FINE
    )
    g = grid(*edges)
    f = values(g)
    q = objective_density(f, g.weights, objective)
    total = (g.weights * q).sum(axis=(1, 2))
    if not (total > 0).all():
        nowhere = np.degrees(theta_r[np.argmin(total > 0)])
        raise ValueError(f"the model scatters nothing toward theta_r {nowhere:.4g}°: there is nothing to sample")
    energy = (g.weights * luminance(f)).sum(axis=(1, 2)) * (2 if even else 1)
    return q / total[:, None, None], g.theta, g.theta_weight, g.phi, g.phi_weight, energy
