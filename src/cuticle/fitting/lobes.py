"""K lobes over all viewers and strand counts: grown at one viewer, carried to the others, split into more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cuticle._support.progress import Progress, part
from cuticle.fitting.mixture import Array, confine, from_natural, loss, solve_each, to_natural
from cuticle.fitting.points import Points, shares
from cuticle.fitting.polish import polish
from cuticle.fitting.targets import Targets
from cuticle.sampling.families import mixture_density
from cuticle.sampling.lobe_table import MEAN_THETA, SIGMA_PHI, SIGMA_THETA, WEIGHT

Again = Callable[[Sequence[float], Points, int], Points]  # of strand counts, points known, nodes
_LOST = 0.05  # ½ (1/ESS - 1): ESS below .91 at one viewer, where its neighbour was well fitted
_LEAST = 1e-4  # of ½ (1/ESS - 1) that an exchange of two lobes gains
_STEPS, _FEW_STEPS = 30, 8  # of a polish, at most
_UNFOLLOWED = 0.0076  # ½ (1/ESS - 1) between two rows: ESS below .985
_HEAVY = 3e-4  # price of large weights between two rows
_HALVINGS = 2  # of the gap between two rows
_FEWEST, _GROWN = 2, 4  # lobes that are split first; lobes up to which they are grown one by one
_HELD = 0.0125  # ½ (1/ESS - 1) at the worst place, before the last polish: ESS .9756; else another row is the first


def fit_table(points: Points, lobes: int, progress: Progress, again: Again | None = None) -> tuple[Points, Array]:
    """Return where the fit looked in the end, and the table u (rows, nodes, 5, K).

    Lobes can hold the light of one row in several ways, and rows or viewers that hold it in different ways leave a gap
    between them. So up to four lobes are fitted to one row and follow the light from there, from row to row. They begin at
    the first row. If four of them lose light somewhere, they begin at the last, at the one before it, and then with twice as
    many nodes; the best is kept. More lobes are splits of four: the new table starts where the old one was, for all viewers
    and counts, so they do no worse anywhere. Coarse grids lead the way. `again` returns the points of other counts, and with
    twice as many nodes; without it, both stay as they are.
    """
    few, last = min(lobes, _GROWN), len(points.on_nodes) - 1
    tries = [(0, points.nodes)]
    if few == _GROWN and last > 0:
        tries += [(last, points.nodes), (last - 1, points.nodes)]
        tries += [(first, 2 * points.nodes - 1) for first in (0, last)] if again is not None else []
        tries = list(dict.fromkeys(tries))
    found: list[tuple[float, Points, Array]] = []
    for i, (first, nodes) in enumerate(tries):
        name = f"following light from {points.rows[first]:g} strands, {nodes} viewers" if last > 0 else "growing lobes"
        report = part(progress, 0.5 * i / len(tries), 0.5 / len(tries))
        begun = points if nodes == points.nodes or again is None else again(list(points.rows), points, nodes)
        seen, table = _followed(begun, few, first, again, partial(report, name))
        found.append((float(loss(seen.targets, seen.natural(to_natural(table)), bounded=False).max()), seen, table))
        if found[-1][0] < _HELD:
            break
    _, best, u = min(found, key=lambda f: f[0])
    coarse = best.coarse
    while u.shape[3] < lobes:
        progress(f"splitting {u.shape[3]} lobes", 0.5 * u.shape[3] / lobes)
        more = min(2 * u.shape[3], lobes)
        u = polish(coarse, split(coarse, u, more), _steps(more) if more == lobes else _FEW_STEPS)
    return best, polish(best, u, _steps(lobes), lambda f: progress("polishing", 0.5 + 0.5 * f))


def _steps(lobes: int) -> int:
    return min(_STEPS, 8 * _STEPS // lobes)  # a step's cost grows with the square of the lobes, and later ones gain little


def _followed(
    points: Points, lobes: int, first: int, again: Again | None, report: Callable[[float], None]
) -> tuple[Points, Array]:
    """Return the points and a table whose row `first` is fitted by itself and leads to the next, on to either end."""
    coarse = points.coarse
    places = points.whole  # rows, and numbers of strands between them
    begin = int(np.searchsorted(places, np.argmax(points.by_row[:, first])))
    row = coarse.of_row(places[begin])
    u = _carried(row, lobes, _STEPS)
    if len(points.on_nodes) == 1 and lobes > _FEWEST:  # splits may find more of the peaks of direct light
        other = polish(row, split(row, _carried(row, _FEWEST, _FEW_STEPS), lobes), _steps(lobes))
        u = min(u, other, key=lambda v: loss(row.targets, row.natural(to_natural(v))).sum())
    found = {float(row.strands[0]): u[0]}
    for way in (places[begin + 1 :], places[:begin][::-1]):
        table = u
        for place in way:
            row = coarse.of_row(place)
            table = polish(row, table, _STEPS)
            found[float(row.strands[0])] = table[0]
            report(0.5 * len(found) / len(places))
    counts = sorted(found)
    tables = np.array([found[n] for n in counts])

    def of_rows() -> Array:
        at = np.interp(points.rows, counts, np.arange(len(counts)))
        return np.tensordot(shares(at, len(counts)), tables, 1)

    if again is not None and len(points.on_nodes) > 1:
        for _ in range(_HALVINGS):
            rows = _halved_gaps(points, of_rows())
            if len(rows) == len(points.on_nodes):
                break
            points = again(rows, points, points.nodes)
    coarse = points.coarse
    return points, polish(coarse, relabel(coarse, of_rows()), _steps(lobes), lambda f: report(0.5 + 0.5 * f))


def _carried(row: Points, lobes: int, steps: int) -> Array:
    u = polish(row, relabel(row, carry(row, grow_at_start(row, lobes)[-1])), steps)
    return polish(row, relabel(row, u), steps)


def _halved_gaps(points: Points, u: Array) -> list[float]:
    """Return the rows, with one more in each gap where the lobes lose the light that they hold at either end."""
    x = points.natural(to_natural(u))
    losses = loss(points.targets, x, bounded=False)
    gap, between = points.row.astype(np.intp), points.row % 1 > 0
    place = np.nonzero(points.seen)[1]
    lost = np.zeros(len(gap), bool)
    for found, least in ((losses, _UNFOLLOWED), (loss(points.targets, x) - losses, _HEAVY)):
        at_rows = found[points.on_nodes] @ points.by_node.T  # (rows, node places)
        ends = np.minimum(at_rows[gap, place], at_rows[np.minimum(gap + 1, len(at_rows) - 1), place])
        lost |= between & (found > np.maximum(least, 2 * ends))
    rows = points.rows
    return sorted([*rows, *(0.5 * (rows[g] + rows[g + 1]) for g in np.unique(gap[lost]))])


def grow_at_start(points: Points, lobes: int) -> list[Array]:
    """Return `grow`'s fits at normal view of the first row."""
    return grow(points.targets.take([points.on_nodes[0, points.nodes // 2]]), lobes)


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


def carry(points: Points, start: Array) -> Array:
    """Return u (rows, nodes, 5, K): from one fit at the middle node to every row, then node by node to both poles."""
    rows, nodes, on_node = len(points.on_nodes), points.nodes, points.on_nodes
    u = np.empty((rows, nodes, *start.shape))
    previous, middle = start, nodes // 2
    for r in range(rows):
        solved, _ = solve_each(points.targets.take([on_node[r, middle]]), previous[None], iterations=40)
        u[r, middle] = previous = solved[0]
    step = np.pi / (nodes - 1)
    for distance in range(1, nodes - middle):
        places = [(r, middle + sign * distance, sign) for r in range(rows) for sign in (-1, 1)]
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


def relabel(points: Points, u: Array) -> Array:
    """Return the table with pairs of lobes exchanged from a row or node on, where it then fits better between its entries.

    Neighbours that were fitted one by one can hold the same lobes in another order, and interpolation joins lobes by it.
    """
    for axis, place in enumerate((points.row, points.node)):
        gaps = u.shape[axis] - 1
        gap = np.minimum(place.astype(np.intp), gaps - 1)
        orders = np.tile(np.arange(u.shape[3]), (gaps + 1, 1))

        def losses(v: Array, gap: NDArray = gap, gaps: int = gaps) -> NDArray:
            return np.bincount(gap, loss(points.targets, points.natural(to_natural(v))), gaps)

        best = losses(u) - _LEAST if gaps else np.empty(0)
        for pair in combinations(range(u.shape[3]), 2) if gaps else ():
            exchanged = u.copy()
            odd = np.moveaxis(exchanged, axis, 0)[1::2]  # each gap has one end among these
            odd[..., pair] = odd[..., pair[::-1]]
            new = losses(exchanged)
            better = np.flatnonzero(new < best)
            best[better] = new[better]
            orders[better + 1] = np.arange(u.shape[3])
            orders[better[:, None] + 1, pair] = pair[::-1]
        for i in range(gaps):
            orders[i + 1] = orders[i + 1][orders[i]]
        u = np.take_along_axis(u, orders[:, None, None].swapaxes(0, axis), axis=-1)
    return u


def split(points: Points, u: Array, lobes: int) -> Array:
    """Return a table of more lobes, up to twice as many, whose density differs little from u's, at and between all entries.

    A lobe turns into two that lie apart, or differ in width. Each is split in the way that gains most in a few steps at some
    of the nodes by themselves; those whose split gains most are.
    """
    rows, even = sorted({int(r) for r in np.linspace(0, len(u) - 1, 3)}), points.targets.even
    nodes = [(r, i) for r in rows for i in range(0, points.nodes, 6)]
    on_node, some = points.on_nodes, np.array([u[r, i] for r, i in nodes])
    ways = [(k, way) for k in range(u.shape[3]) for way in _WAYS]
    starts = np.concatenate([_halved(some, k, way) for k, way in ways])
    targets = points.targets.take(np.tile([on_node[r, i] for r, i in nodes], len(ways)))
    _, value = solve_each(targets, starts, iterations=2)
    best: dict[int, tuple[int, tuple[float, ...]]] = {}
    for j in np.argsort(value.reshape(len(ways), -1).sum(axis=1)):
        best.setdefault(ways[j][0], ways[j])
    for k, way in list(best.values())[: lobes - u.shape[3]]:
        u = _halved(u, k, way)
    return confine(u, even)


# How far two halves of a lobe move: means in sigmas, sigmas in their logs.
_WAYS = ((0.5, 0, 0, 0), (0, 0.5, 0, 0), (0.4, 0.4, 0, 0), (0.4, -0.4, 0, 0),
         (0, 0, 0.4, 0), (0, 0, 0, 0.4), (0, 0, 0.4, 0.4), (0, 0, 0.4, -0.4))  # fmt: skip


def _halved(u: Array, lobe: int, way: tuple[float, ...]) -> Array:
    """Return u with one lobe in two halves, the second of which comes last."""
    u = np.concatenate([u, u[..., lobe : lobe + 1]], axis=-1)
    sigma = np.exp(u[..., SIGMA_THETA:, lobe])
    for side, k in ((1, lobe), (-1, -1)):
        u[..., WEIGHT, k] -= np.log(2)
        u[..., MEAN_THETA:SIGMA_THETA, k] += side * np.array(way[:2]) * sigma
        u[..., SIGMA_THETA:, k] += 0.5 * np.log1p(-np.square(way[:2])) + side * np.array(way[2:])
    return u
