"""Integrals over cells of the sphere, to within a stated error, of functions that nobody promised to be smooth."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_legendre

Array = NDArray[np.float64]
_ORDER = 4
_DEPTH = 7  # halvings of a cell along each axis
_BUDGET = 600_000  # points beyond the first pass
_BLOCK = 400_000
_MISSED = 3.0  # times what the rules met in a cell: they missed something


class Integrals(NamedTuple):
    """Integrals over cells (A, B, Q) and how far they may be off, and the largest value of each found (Q,)."""

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
        Of the first quantity's integral over all cells: a cell is halved where two rules differ by more than its share.
    seen
        theta, phi and the first quantity at points where it may be large: a cell is halved, too, where one of them says far
        more than the rules met, since a peak may lie between their points.
    """
    a, b = (x.ravel() for x in np.meshgrid(np.arange(len(theta) - 1), np.arange(len(phi) - 1), indexing="ij"))
    boxes = np.column_stack([theta[a], theta[a + 1], phi[b], phi[b + 1]])
    cell = a * (len(phi) - 1) + b
    limit = tolerance / len(cell)
    total, error = None, None
    largest = None
    points, depth = 0, 0
    seen_theta, seen_phi, seen_value = seen if seen is not None else (np.zeros(0), np.zeros(0), np.zeros(0))
    where = place(seen_theta, theta) * (len(phi) - 1) + place(seen_phi, phi)  # the box that each of them is in
    while len(boxes):
        fine, coarse, tops = _rules(function, boxes)
        top = tops.max(axis=0)
        if total is None or error is None or largest is None:
            total, error = np.zeros((len(cell), fine.shape[1])), np.zeros((len(cell), fine.shape[1]))
            largest = top
        largest = np.maximum(largest, top)
        difference = np.abs(fine - coarse)
        wrong = difference[:, 0] > limit / 2**depth
        known = np.zeros(len(boxes))
        np.maximum.at(known, where, seen_value)
        wrong |= (known > _MISSED * tops[:, 0]) & (known * _area(boxes) > limit)
        cost = int(wrong.sum()) * 4 * (_ORDER**2 + (_ORDER - 1) ** 2)
        if depth == _DEPTH or points + cost > _BUDGET:
            wrong[:] = False
        done = ~wrong
        np.add.at(total, cell[done], fine[done])
        np.add.at(error, cell[done], difference[done] * 0.1)  # the finer rule is far nearer than the two are to each other
        rough = done & (difference[:, 0] > limit / 2**depth)
        np.add.at(error, cell[rough], difference[rough] * 0.9)
        points += cost if wrong.any() else 0
        inside = wrong[where]
        parents = (np.cumsum(wrong) - 1)[where[inside]]
        seen_theta, seen_phi, seen_value = seen_theta[inside], seen_phi[inside], seen_value[inside]
        box = boxes[wrong][parents].T
        upper = (
            (seen_theta >= 0.5 * (box[0] + box[1])).astype(np.intp),
            (seen_phi >= 0.5 * (box[2] + box[3])).astype(np.intp),
        )
        where = 4 * parents + 2 * upper[0] + upper[1]
        boxes, cell = _halved(boxes[wrong]), np.repeat(cell[wrong], 4)
        depth += 1
    if total is None or error is None or largest is None:
        raise ValueError("there must be at least one cell")
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


def place(x: Array, edges: Array) -> NDArray[np.intp]:
    """The cell between edges that each x lies in."""
    return np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)


def _halved(boxes: Array) -> Array:
    t0, t1, p0, p1 = boxes.T
    tm, pm = 0.5 * (t0 + t1), 0.5 * (p0 + p1)
    quarters = [(t0, tm, p0, pm), (t0, tm, pm, p1), (tm, t1, p0, pm), (tm, t1, pm, p1)]
    return np.stack([np.column_stack(q) for q in quarters], axis=1).reshape(-1, 4)
