"""Grids over (theta_i, phi) whose cells follow a density."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_UNIFORM = 0.35  # share of the cells spread evenly, the rest by where the density is


class Grid(NamedTuple):
    """Points and their weights along theta (..., A) and phi (..., B), radians: a product rule, or several."""

    theta: Array
    theta_weight: Array
    phi: Array
    phi_weight: Array

    @property
    def weights(self) -> Array:
        """Weights in d theta d phi, shape (..., A, B)."""
        return self.theta_weight[..., :, None] * self.phi_weight[..., None, :]


def grid(theta_edges: Array, phi_edges: Array, order: int = 1) -> Grid:
    """Return the Gauss-Legendre rule of `order` points in each cell between edges; order 1 is the midpoint rule."""
    return Grid(*gauss_legendre(theta_edges, order), *gauss_legendre(phi_edges, order))


def adapted_edges(
    density: Callable[[Grid], Array], *, even: bool, coarse: tuple[int, int], fine: tuple[int, int]
) -> tuple[Array, Array]:
    """Return edges along theta and phi of cells that lie where `density` (per d theta d phi) has its mass.

    `coarse` and `fine` are numbers of cells over theta and over half the azimuth; an even density is covered on
    phi in [0, pi] only, another on [-pi, pi]. Densities (..., A, B) of several functions have edges (..., cells + 1) each.
    """
    low, factor = (0.0, 1) if even else (-np.pi, 2)
    theta = np.linspace(-np.pi / 2, np.pi / 2, coarse[0] + 1)
    phi = np.linspace(low, np.pi, coarse[1] * factor + 1)
    mass = density(grid(theta, phi))
    return _share(theta, mass.sum(axis=-1), fine[0]), _share(phi, mass.sum(axis=-2), fine[1] * factor)


def gauss_legendre(edges: Array, order: int) -> tuple[Array, Array]:
    """Return nodes and weights, (..., cells * order), of the Gauss-Legendre rule between edges (..., cells + 1)."""
    x, w = _leggauss(order)
    half = 0.5 * np.diff(edges)[..., None]
    shape = (*edges.shape[:-1], -1)
    return (edges[..., :-1, None] + half * (1 + x)).reshape(shape), (half * w).reshape(shape)


def trapezoid(x: Array) -> Array:
    """Return the weights of the trapezoidal rule at increasing positions."""
    return np.convolve(np.diff(x), [0.5, 0.5])


_leggauss = lru_cache(np.polynomial.legendre.leggauss)


def _share(edges: Array, mass: Array, count: int) -> Array:
    """Return edges of `count` cells, each with a like share of mass (..., cells) and of length."""
    if mass.ndim > 1:
        return np.array([_share(edges, m, count) for m in mass])
    total = mass.sum()
    spread = np.diff(edges) / (edges[-1] - edges[0])
    share = (1 - _UNIFORM) * mass / total + _UNIFORM * spread if total > 0 else spread
    cumulative = np.concatenate([[0.0], np.cumsum(share)])
    return np.interp(np.linspace(0, cumulative[-1], count + 1), cumulative, edges)
