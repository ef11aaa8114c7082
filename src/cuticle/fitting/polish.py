"""All nodes and rows of a table of lobes, fitted together."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cuticle.fitting.mixture import Array, confine, equations, in_coordinates, loss, to_natural
from cuticle.fitting.points import Points

_BAD = 0.005  # ½ (1/ESS - 1) that weighs twice as much as a small one
_PATIENCE = 3  # steps over which that is judged: two halves of a lobe part slowly at first
_SMOOTH = 1e-5
_LEAST_GAIN = 5e-6  # of ½ (1/ESS - 1) a point: a change of 1e-5 in ESS is not worth a step


class _Objective:
    """What `polish` lowers: a convex function of the loss at all points, and a small penalty on bends along theta_r.

    The penalty settles parameters of lobes that hardly count. Both are told apart by the table's entries.
    """

    def __init__(self, points: Points) -> None:
        self.points = points

    def __call__(self, u: Array, losses: Array | None = None) -> Array:
        """Return the share of each entry, (rows, nodes)."""
        if losses is None:
            losses = loss(self.points.targets, self.points.natural(to_natural(u)))
        value = self.points.by_entry(losses * (1 + losses / (2 * _BAD)))
        bends = (np.diff(u, 2, axis=1) ** 2).sum(axis=(2, 3))
        return value.reshape(u.shape[:2]) + _SMOOTH / 6 * _to_nodes(bends, (1, 1, 1))

    def equations(self, u: Array) -> tuple[Array, Array, Array]:
        """Return the value by entry, and for each entry by itself its gradient and the matrix of its step.

        The matrix bounds that of all entries together from above: the square of a mean is at most the mean of the squares.
        """
        rows, nodes, _, lobes = u.shape
        n, size = rows * nodes, 5 * lobes
        x = to_natural(u)
        losses, gradient, hessian = equations(self.points.targets, self.points.natural(x))
        steeper = 1 + losses / _BAD
        g, h = self.points.by_entry(steeper[:, None] * gradient), self.points.by_entry(steeper[:, None, None] * hessian)
        g, h = in_coordinates(x.reshape(n, 5, lobes), g, h)
        g += _SMOOTH * _to_nodes(np.diff(u, 2, axis=1), (1, -2, 1)).reshape(n, size)
        i = np.arange(size)
        h[:, i, i] += 16 * _SMOOTH  # the largest eigenvalue of the bends' matrix
        return self(u, losses), g, h


def _to_nodes(bends: Array, factors: tuple[int, int, int]) -> Array:
    """Return the sum over the three nodes of each bend (rows, nodes - 2, …), by node."""
    out = np.zeros((len(bends), bends.shape[1] + 2, *bends.shape[2:]))
    for i, factor in enumerate(factors):
        out[:, i : i + bends.shape[1]] += factor * bends
    return out


def polish(points: Points, u: Array, steps: int, progress: Callable[[float], None] = lambda fraction: None) -> Array:
    """Fit all nodes and rows together, by Levenberg-Marquardt steps of each entry of the table, with a damping of its own.

    The objective counts viewers between nodes and numbers of strands between rows as it does those on them. Losses weigh the
    more the larger they are, so that no viewer pays for the others.
    """
    u = confine(u, points.targets.even)
    shape = u.shape
    objective = _Objective(points)
    damping, reached = np.full(shape[:2], 1e-3), [np.inf]
    i = np.arange(shape[2] * shape[3])
    for taken in range(steps):
        value, g, h = objective.equations(u)
        own = h[:, i, i]
        for _ in range(6):
            damped = h.copy()
            damped[:, i, i] += damping.reshape(-1, 1) * own + 1e-7 * own.max(axis=1, keepdims=True) + 1e-9
            step = np.linalg.solve(damped, g[..., None]).reshape(shape)
            trial = confine(u - np.clip(step, -0.5, 0.5), points.targets.even)
            new = objective(trial)
            better = new < value
            if not better.all():  # entries that got worse stay where they were
                damping[~better] *= 8
                trial = np.where(better[:, :, None, None], trial, u)
                new = objective(trial)
            if new.sum() < value.sum():
                break
            damping[better] *= 20
        else:
            break
        damping[better] = np.maximum(damping[better] * 0.3, 1e-7)
        u = trial
        progress((taken + 1) / steps)
        reached.append(float(new.sum()))
        least = max(1e-3 * reached[-1], _LEAST_GAIN * len(points.strands))
        if taken >= _PATIENCE and reached[-1 - _PATIENCE] - reached[-1] < _PATIENCE * least:
            break
    return u
