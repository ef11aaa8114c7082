"""Integrals over the sphere: of any function over cells, with an error; of a mixture's pdf, whose lobes are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_legendre

from cuticle._support.quadrature import gauss_legendre
from cuticle.sampling.quality import Density
from cuticle.sampling.sampler import Sampler

Array = NDArray[np.float64]
_ORDER = 4
_DEPTH = 7  # halvings of a cell along each axis
_BUDGET = 600_000  # points beyond the first pass
_BLOCK = 400_000  # points per call
_PANELS = np.array([-8, -5.5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5.5, 8.0])[:, None]  # edges about a lobe's mean, in sigmas
_MISSED = 3.0  # a known value this many times larger than the rules' largest means that they missed a peak


class Integrals(NamedTuple):
    """Integrals over cells (A, B, Q), bounds on their errors, and the largest value of each function (Q,)."""

    value: Array
    error: Array
    largest: Array


def integrate(
    function: Callable[[Array, Array], Array],
    theta: Array,
    phi: Array,
    tolerance: float,
    seen: tuple[Array, Array, Array] | None = None,
) -> Integrals:
    """Integrate over the cells between edges in theta and phi, d omega = cos(theta) d theta d phi.

    Parameters
    ----------
    function
        function(theta, phi) -> (n, Q), per steradian.
    theta, phi
        Edges, radians.
    tolerance
        Error allowed in the first function's integral over all cells. A cell is halved along both axes where two rules
        differ by more than its share.
    seen
        theta, phi and the first function's value at points where it may be large. A cell is also halved where such a value
        is far larger than any at the rules' nodes, because a peak may lie between them.
    """
    a, b = (x.ravel() for x in np.meshgrid(np.arange(len(theta) - 1), np.arange(len(phi) - 1), indexing="ij"))
    boxes = np.column_stack([theta[a], theta[a + 1], phi[b], phi[b + 1]])
    cell = a * (len(phi) - 1) + b
    limit = tolerance / len(cell)
    total: Array = np.zeros((0, 0))
    error, largest = total, total
    points, depth = 0, 0
    seen_theta, seen_phi, seen_value = seen if seen is not None else (np.zeros(0), np.zeros(0), np.zeros(0))
    box_of = cell_index(seen_theta, theta) * (len(phi) - 1) + cell_index(seen_phi, phi)  # the box that each point lies in
    while len(boxes):
        fine, coarse, tops = _rules(function, boxes)
        if depth == 0:
            total, error, largest = np.zeros_like(fine), np.zeros_like(fine), tops.max(axis=0)
        largest = np.maximum(largest, tops.max(axis=0))
        difference = np.abs(fine - coarse)
        wrong = difference[:, 0] > limit / 2**depth
        known = np.zeros(len(boxes))
        np.maximum.at(known, box_of, seen_value)
        wrong |= (known > _MISSED * tops[:, 0]) & (known * _area(boxes) > limit)
        cost = int(wrong.sum()) * 4 * (_ORDER**2 + (_ORDER - 1) ** 2)
        if depth == _DEPTH or points + cost > _BUDGET:
            wrong[:] = False
        done = ~wrong
        np.add.at(total, cell[done], fine[done])
        np.add.at(error, cell[done], difference[done] * 0.1)  # the finer rule is far closer to the integral than the coarser
        rough = done & (difference[:, 0] > limit / 2**depth)
        np.add.at(error, cell[rough], difference[rough] * 0.9)
        points += cost if wrong.any() else 0
        inside = wrong[box_of]
        parents = (np.cumsum(wrong) - 1)[box_of[inside]]
        seen_theta, seen_phi, seen_value = seen_theta[inside], seen_phi[inside], seen_value[inside]
        box = boxes[wrong][parents].T
        box_of = 4 * parents + 2 * (seen_theta >= 0.5 * (box[0] + box[1])) + (seen_phi >= 0.5 * (box[2] + box[3]))
        boxes, cell = _halved(boxes[wrong]), np.repeat(cell[wrong], 4)
        depth += 1
    shape = (len(theta) - 1, len(phi) - 1, total.shape[1])
    return Integrals(total.reshape(shape), error.reshape(shape), largest)


def _rules(function: Callable[[Array, Array], Array], boxes: Array) -> tuple[Array, Array, Array]:
    results = []
    for order in (_ORDER, _ORDER - 1):
        x, w = roots_legendre(order)
        weight = 0.25 * np.outer(w, w).ravel()
        parts, tops = [], []
        step = max(_BLOCK // order**2, 1)
        for start in range(0, len(boxes), step):
            t0, t1, p0, p1 = boxes[start : start + step].T
            t = (0.5 * (t0 + t1))[:, None] + 0.5 * (t1 - t0)[:, None] * np.repeat(x, order)
            p = (0.5 * (p0 + p1))[:, None] + 0.5 * (p1 - p0)[:, None] * np.tile(x, order)
            f = function(t.ravel(), p.ravel()).reshape(*t.shape, -1)
            measure = weight * ((t1 - t0) * (p1 - p0))[:, None] * np.cos(t)
            parts.append(np.einsum("np,npq->nq", measure, f))
            tops.append(f.max(axis=1))
        results.append((np.concatenate(parts), np.concatenate(tops)))
    return results[0][0], results[1][0], np.maximum(results[0][1], results[1][1])


def _area(boxes: Array) -> Array:
    return (np.sin(boxes[:, 1]) - np.sin(boxes[:, 0])) * (boxes[:, 3] - boxes[:, 2])


def cell_index(x: Array, edges: Array) -> NDArray[np.intp]:
    """Return the index of the cell between edges that each x lies in."""
    return np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)


def _halved(boxes: Array) -> Array:
    t0, t1, p0, p1 = boxes.T
    tm, pm = 0.5 * (t0 + t1), 0.5 * (p0 + p1)
    quarters = [(t0, tm, p0, pm), (t0, tm, pm, p1), (tm, t1, p0, pm), (tm, t1, pm, p1)]
    return np.stack([np.column_stack(q) for q in quarters], axis=1).reshape(-1, 4)


def integrate_pdf(density: Density, sampler: Sampler, theta_r: float, strands: float, dtype: Any = np.float64) -> float:
    """Return ∫ pdf d omega over the sphere, by Gauss-Legendre panels as wide as `sampler`'s lobes are."""
    lobes = sampler.mixture(theta_r, strands)
    theta = lobes.mean_theta + _PANELS * lobes.sigma_theta
    phi = lobes.mean_phi + _PANELS * np.minimum(lobes.sigma_phi, np.pi)
    if sampler.even:
        phi = np.concatenate([phi, -phi])
    else:  # with the kink where a lobe's period ends; then all within one turn
        phi = np.concatenate([phi, lobes.mean_phi[None] + np.pi])
        phi = np.mod(phi + np.pi, 2 * np.pi) - np.pi
    order = 10 if len(lobes.weight) <= 4 else 6
    x, wx = gauss_legendre(_edges(theta, np.pi / 2), order)
    y, wy = gauss_legendre(_edges(phi, np.pi), order)
    xs, ys = x.astype(dtype), y.astype(dtype)
    p = density.pdf(xs[:, None], np.asarray(theta_r, dtype), ys[None, :], strands).astype(np.float64)
    return float((wx * np.cos(xs.astype(np.float64))) @ p @ wy)


def _edges(inner: NDArray[np.float64], end: float) -> NDArray[np.float64]:
    return np.unique(np.concatenate([inner.ravel(), np.linspace(-end, end, 9)]).clip(-end, end))
