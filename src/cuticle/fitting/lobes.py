"""K lobes over all viewers and strand counts: grown at one viewer, carried to the others, then polished together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cuticle.fitting.mixture import Array, confine, equations, from_natural, jacobian, loss, solve_each, to_natural
from cuticle.fitting.targets import Targets, make_targets
from cuticle.sampling.families import mixture_density
from cuticle.sampling.lobe_table import MEAN_THETA, SIGMA_PHI, SIGMA_THETA, WEIGHT
from cuticle.scattering.bcsdf import Bcsdf

THETA_NODES = 25  # every 7.5 degrees
END = np.radians(89.5)  # stands for the pole, where f·cos degenerates
_BETWEEN_AT_ENDS = (0.25, 0.5, 0.75)
_START = THETA_NODES // 2
_LOST = 0.05  # ½ (1/ESS - 1): ESS below .91 at one viewer, where its neighbour was well fitted
_LEAST_GAIN = 5e-6  # of ½ (1/ESS - 1) a point: a change of 1e-5 in ESS is not worth a step


@dataclass(frozen=True)
class Points:
    """Where the fit looks: viewers on and between nodes, for rows on and between strand counts."""

    node: NDArray[np.intp]
    t: Array
    row: NDArray[np.intp]
    s: Array
    targets: Targets

    def natural(self, x: Array) -> Array:
        """Return the table's parameters at each point: x (rows, nodes, 5, K) -> (points, 5, K)."""
        t, s = self.t[:, None, None], self.s[:, None, None]
        upper_row = np.minimum(self.row + 1, x.shape[0] - 1)
        lower = (1 - t) * x[self.row, self.node] + t * x[self.row, self.node + 1]
        upper = (1 - t) * x[upper_row, self.node] + t * x[upper_row, self.node + 1]
        return (1 - s) * lower + s * upper


def node_angles() -> Array:
    """Inclinations of the table's nodes, from pole to pole."""
    return np.linspace(-np.pi / 2, np.pi / 2, THETA_NODES)


def make_points(with_strands: Callable[[float], Bcsdf], strands: Sequence[float], objective: str, family: str) -> Points:
    """Tabulate the targets that a fit of these strand counts looks at."""
    theta: list[tuple[int, float]] = [(i, 0.0) for i in range(THETA_NODES - 1)] + [(THETA_NODES - 2, 1.0)]
    for i in range(THETA_NODES - 1):
        theta += [(i, t) for t in (_BETWEEN_AT_ENDS if i in (0, THETA_NODES - 2) else (0.5,))]
    node, t, row, s, models, angles = [], [], [], [], [], []
    step = np.pi / (THETA_NODES - 1)

    def add(i: int, fraction: float, j: int, between: float, model: Bcsdf) -> None:
        node.append(i)
        t.append(fraction)
        row.append(j)
        s.append(between)
        models.append(model)
        angles.append(float(np.clip(-np.pi / 2 + (i + fraction) * step, -END, END)))

    for j, n in enumerate(strands):
        model = with_strands(n)
        for i, fraction in theta:
            add(i, fraction, j, 0.0, model)
        if j + 1 < len(strands) and n > 0:  # between 0 and the next count the sampler mixes; nothing to interpolate
            middle = with_strands(0.5 * (n + strands[j + 1]))
            for i, fraction in theta:
                add(i, fraction, j, 0.5, middle)
    targets = make_targets(models, angles, objective, family)
    return Points(np.array(node), np.array(t), np.array(row), np.array(s), targets)


def grow(targets: Targets, lobes: int) -> list[Array]:
    """Return fits (5, k) of one target for k = 1 … lobes, each grown from the one before at its worst place."""
    one = targets.take([0])
    u, _ = solve_each(one, from_natural(_moments(one)[None]), iterations=40)
    fits = [u[0]]
    for _ in range(1, lobes):
        candidates = _with_one_more(one, fits[-1])
        u, value = solve_each(one.take(np.zeros(len(candidates), np.intp)), candidates, iterations=40)
        fits.append(u[int(np.argmin(value))])
    return fits


def _moments(targets: Targets) -> Array:
    mass = targets.q[0] * np.outer(targets.theta_weight[0], targets.phi_weight[0])
    means, sigmas = [], []
    for x, m in ((targets.theta[0], mass.sum(axis=1)), (targets.phi[0], mass.sum(axis=0))):
        means.append((m * x).sum() / m.sum())
        sigmas.append(np.sqrt((m * (x - means[-1]) ** 2).sum() / m.sum()))
    return np.array([1.0, *means, *sigmas])[:, None]


def _with_one_more(targets: Targets, u: Array) -> Array:
    """Return starts with a lobe more, narrow and wide, where the mixture is too low by ratio and by mass."""
    x = to_natural(u)
    q, cell = targets.q[0], np.outer(targets.theta_weight[0], targets.phi_weight[0])
    p = _density(targets, x)
    excess = np.maximum(q - p, 0) ** 2 / np.maximum(p, 1e-9)
    places = [
        np.argmax(excess * cell),
        np.argmax(np.where(q > 1e-3 * q.max(), q / np.maximum(p, 1e-9), 0)),
        np.argmax(excess),
    ]
    starts = []
    for place in dict.fromkeys(int(i) for i in places):
        a, b = np.unravel_index(place, q.shape)
        for width, spread in ((0.1, 0.2), (0.25, 0.6), (0.6, 1.2)):
            new = np.array([0.08, targets.theta[0][a], targets.phi[0][b], width, spread])[:, None]
            grown = np.concatenate([x, new], axis=1)
            grown[WEIGHT] /= grown[WEIGHT].sum()
            starts.append(from_natural(grown))
    return np.array(starts)


def _density(targets: Targets, x: Array) -> Array:
    sides = 2 if targets.even else 1  # q holds both signs of phi on [0, pi]
    return sides * mixture_density(x, targets.theta[0], targets.phi[0], targets.even, targets.family)


def carry(points: Points, start: Array, rows: int) -> Array:
    """Return u (rows, nodes, 5, K): from one fit at the middle node to every row, then node by node to both poles."""
    lobes = start.shape[-1]
    u = np.empty((rows, THETA_NODES, 5, lobes))
    on_node = {
        (int(r), int(i) + int(t)): k
        for k, (r, i, t, s) in enumerate(zip(points.row, points.node, points.t, points.s, strict=True))
        if s == 0 and t in (0.0, 1.0)
    }
    previous = start
    for r in range(rows):
        solved, _ = solve_each(points.targets.take([on_node[r, _START]]), previous[None], iterations=40)
        u[r, _START] = previous = solved[0]
    step = np.pi / (THETA_NODES - 1)
    for distance in range(1, THETA_NODES - _START):
        places = [(r, _START + sign * distance, sign) for r in range(rows) for sign in (-1, 1)]
        starts = np.array([u[r, i - sign] for r, i, sign in places])
        starts[:, MEAN_THETA] -= np.array([sign for *_, sign in places])[:, None] * step
        targets = points.targets.take([on_node[r, i] for r, i, _ in places])
        solved, value = solve_each(targets, starts, iterations=20, tolerance=1e-3)
        lost = np.flatnonzero(value > _LOST)
        if len(lost):  # narrow lobes can miss their target: start those again from wider ones
            wide = starts[lost]
            wide[:, SIGMA_THETA] += 1.0
            wide[:, SIGMA_PHI] += 0.5
            again, new = solve_each(targets.take(lost), wide, iterations=80, tolerance=1e-3)
            better = new < value[lost]
            solved[lost[better]] = again[better]
        for (r, i, _), value in zip(places, solved, strict=True):
            u[r, i] = value
    return u


def polish(points: Points, u: Array, *, iterations: int, progress: Callable[[float], None], smooth: float = 1e-5) -> Array:
    """Fit all nodes and rows together, by Levenberg-Marquardt on a block-tridiagonal system.

    The objective is the mean of ½ (1/ESS - 1) over the points, those between nodes included, plus a small penalty
    on second differences along theta_r that settles parameters of lobes that hardly count.
    """
    rows, nodes, _, lobes = u.shape
    even = points.targets.even
    u = confine(u, even)
    damping = 1e-3

    def objective(v: Array, losses: Array) -> float:
        return float(losses.sum() + 0.5 * smooth * (np.diff(v, 2, axis=1) ** 2).sum())

    x = to_natural(u)
    losses, gradient, hessian = equations(points.targets, points.natural(x))
    value = objective(u, losses)
    for iteration in range(iterations):
        diagonal, upper, g = _assemble(points, x, gradient, hessian, rows)
        _add_smoothness(diagonal, upper, g, u, smooth)
        for _ in range(12):
            step = _solve_tridiagonal(diagonal, upper, g, damping).reshape(nodes, rows, 5, lobes).swapaxes(0, 1)
            trial = confine(u - np.clip(step, -0.5, 0.5), even)
            new_x = to_natural(trial)
            new_value = objective(trial, loss(points.targets, points.natural(new_x)))
            if new_value < value:
                break
            damping *= 8
        else:
            break
        gain = value - new_value
        u, x, value = trial, new_x, new_value
        damping = max(damping * 0.3, 1e-7)
        progress((iteration + 1) / iterations)
        if gain < max(1e-3 * value, _LEAST_GAIN * len(points.node)):
            break
        losses, gradient, hessian = equations(points.targets, points.natural(x))
    return u


def _assemble(points: Points, x: Array, gradient: Array, hessian: Array, rows: int) -> tuple[Array, Array, Array]:
    """Return the Gauss-Newton system over nodes: diagonal blocks, blocks to the next node, gradient."""
    nodes, lobes = x.shape[1], x.shape[3]
    size = 5 * lobes
    d = jacobian(x)
    diagonal = np.zeros((nodes, rows, size, rows, size))
    upper = np.zeros((nodes - 1, rows, size, rows, size))
    g = np.zeros((nodes, rows, size))
    upper_row = np.minimum(points.row + 1, rows - 1)
    corners = [
        (points.node + a, r, (points.t if a else 1 - points.t) * c)
        for a in (0, 1)
        for r, c in ((points.row, 1 - points.s), (upper_row, points.s))
    ]
    mapped = [(i, r, c, d[r, i]) for i, r, c in corners]
    for i, r, c, di in mapped:
        np.add.at(g, (i, r), c[:, None] * np.einsum("pij,pi->pj", di, gradient))
    for i, r, c, di in mapped:
        used = np.flatnonzero(c)
        left = di[used].transpose(0, 2, 1) @ hessian[used] * c[used, None, None]
        for j, q, e, dj in mapped:
            both = e[used] != 0
            at = used[both]
            if not len(at) or (j[at] < i[at]).any():
                continue
            block = left[both] @ dj[at] * e[at, None, None]
            same = j[at[0]] == i[at[0]]
            np.add.at(diagonal if same else upper, (i[at], r[at], slice(None), q[at]), block)  # type: ignore[arg-type]
    return (
        diagonal.reshape(nodes, rows * size, rows * size),
        upper.reshape(nodes - 1, rows * size, rows * size),
        g.reshape(nodes, rows * size),
    )


def _add_smoothness(diagonal: Array, upper: Array, g: Array, u: Array, smooth: float) -> None:
    # Of the second differences only the part within neighbours enters the matrix; the gradient is whole.
    nodes = u.shape[1]
    flat = u.swapaxes(0, 1).reshape(nodes, -1)
    bend = np.diff(flat, 2, axis=0)
    g[:-2] += smooth * bend
    g[1:-1] -= 2 * smooth * bend
    g[2:] += smooth * bend
    i = np.arange(flat.shape[1])
    diagonal[:, i, i] += 6 * smooth


def _solve_tridiagonal(diagonal: Array, upper: Array, g: Array, damping: float) -> Array:
    """Return h for (A + damping diag A) h = g, A symmetric block-tridiagonal and positive semidefinite."""
    nodes, size = g.shape
    i = np.arange(size)
    factors: list[Array] = []
    rhs = g.copy()
    block = np.empty((size, size))
    for k in range(nodes):
        block = diagonal[k].copy()
        own = np.diagonal(diagonal[k])
        block[i, i] += damping * own + 1e-9 + 1e-7 * own.max()
        if k:
            carry_over = np.linalg.solve(factors[-1], np.column_stack([upper[k - 1], rhs[k - 1]]))
            block -= upper[k - 1].T @ carry_over[:, :-1]
            rhs[k] -= upper[k - 1].T @ carry_over[:, -1]
        factors.append(block)
    h = np.empty_like(g)
    h[-1] = np.linalg.solve(factors[-1], rhs[-1])
    for k in range(nodes - 2, -1, -1):
        h[k] = np.linalg.solve(factors[k], rhs[k] - upper[k] @ h[k + 1])
    return h
