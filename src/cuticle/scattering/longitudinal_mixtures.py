"""Three energy-conserving M's in place of one, for energies over theta_i: by expectation and maximisation.

Light that other strands scattered has a peak for each of their lobes, and wider tails. The core has the steps
(src/native/longitudinal.cpp); here is where they start from, and in what order.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from cuticle import _core

Array = NDArray[np.float64]
# The M's at the start: axes in deviations of the single M from its own, variances out of its.
_STARTS = ((0.0, 0.0, 0.0), (0.15, 0.7, 2.0)), ((-1.5, 1.5, 0.0), (0.3, 0.3, 0.3))
# How M's of one number of strands follow from those of more (None: each starts alone; True: turned and widened as a single
# M is from one to the other), and a start. The next is tried where the one before loses more of ESS than `_POOR` on average.
# It is taken where it loses less than `_BETTER` of that, and at no number that is returned more than `_WORSE` more: of two
# that are as good, like fibres should not have now one, now the other.
_WAYS = [(turned, start) for start in _STARTS for turned in (None, False, True)]
_POOR, _BETTER, _WORSE = 0.01, 0.7, 0.01
_STEPS, _SETTLED = 60, 5  # for the middle viewer and absorption; before them, at order 1
_STEPS_ON = 8  # for each absorption and viewer that follows
# The order of Rényi's divergence that is lowered. At 1, the likelihood's, tails of smooth dark fibres are lost: 1e-40 where
# 1e-7 of the light is. Toward 2, ESS's own, tails draw the M's away from the peaks.
_ORDER = 1.2
_NARROWEST = math.radians(4) ** 2 / 6  # a variance: as wide as a hat between rows, 4° apart; needles fit between them
_LEAST = 1e-250  # of light where there is none
_DARK = math.exp(-230)  # the least energy that keeps its shape


def longitudinal_mixtures(
    theta: Array, viewers: Array, energy: Array, nodes: Sequence[int], halfway: Sequence[int]
) -> Array:
    """Return mixtures of three M's near the energies of some numbers of strands, to be interpolated between these.

    The M's of successive absorptions and viewers are alike: each was found from its neighbour's. Where the M's of each
    number of strands, found alone, lose much, or means of two numbers' M's lie beside the peaks halfway, those of fewer
    strands are found from those of more, whose light is spread out.

    Parameters
    ----------
    theta
        Evenly spaced inclinations theta_i, radians, shape (rows,).
    viewers
        Inclinations theta_r, in their order, radians, shape (viewers,).
    energy
        In the rows, at least 0, in any unit, shape (viewers, numbers of strands, absorptions, ..., rows), the two in order.
    nodes
        Which of the numbers mixtures are returned of.
    halfway
        For each node but the last, the number of strands halfway to the next; the node itself where none is known. There
        the mean of both should be near, too.

    Returns
    -------
    ndarray
        Shares of the first and the second M, then axis and variance of each of the three, radians and radians², shape
        (viewers, nodes, absorptions, ..., 8). Without energy (below exp(-230)) they are those of even energies.
    """
    total = energy.sum(axis=-1, keepdims=True)
    share = np.where(total > _DARK, energy / np.maximum(total, _DARK), 1 / len(theta))
    each = share.reshape(*energy.shape[:3], -1, len(theta))
    between = [(k, h) for k, h in enumerate(halfway) if h != nodes[k]]

    def lost(found: Array, of: Array) -> Array:
        """What mixtures lose of ESS at nodes, then halfway from one to the next, (numbers, n)."""
        at = [(n, found[:, :, k]) for k, n in enumerate(nodes)]
        at += [(h, 0.5 * (found[:, :, k] + found[:, :, k + 1])) for k, h in between]
        return np.array([_lost(theta, of[:, n], x).mean(axis=0) for n, x in at])

    found = _followed(theta, viewers, each[:, nodes], *_WAYS[0])
    losses = lost(found, each)
    for way in _WAYS[1:] if between else [_WAYS[3]]:  # of one number nothing follows
        poor = np.flatnonzero(losses.mean(axis=0) > _POOR)
        if not poor.size:
            break
        of = each[:, :, :, poor]
        others = _followed(theta, viewers, of[:, nodes], *way)
        less = lost(others, of)
        better = less.mean(axis=0) < _BETTER * losses[:, poor].mean(axis=0)
        better &= (less < losses[:, poor] + _WORSE)[: len(nodes)].all(axis=0)
        found[:, :, :, :, poor[better]] = others[:, :, :, :, better]
        losses[:, poor[better]] = less[:, better]
    shares, axes, variances = found.reshape(3, len(viewers), len(nodes), *energy.shape[2:-1], -1)
    return np.concatenate([shares[..., :-1], np.stack([axes, variances], axis=-1).reshape(*axes.shape[:-1], -1)], axis=-1)


def in_rows(theta: Array, mixtures: Array) -> Array:
    """Return what mixtures, as `longitudinal_mixtures` returns them, put into each row, out of 1: shape (..., rows)."""
    shares = np.append(mixtures[..., :2], np.maximum(1 - mixtures[..., :2].sum(axis=-1, keepdims=True), 0), axis=-1)
    return _summed(theta, np.stack([shares, mixtures[..., 2::2], mixtures[..., 3::2]]))


def _followed(
    theta: Array, viewers: Array, share: Array, turned: bool | None, start: tuple[tuple[float, ...], tuple[float, ...]]
) -> Array:
    """Shares, axes and variances, (3, viewers, numbers, absorptions, n, M's), for energies out of 1.

    Of the middle viewer and absorption: of all numbers of strands, or from the last to the first. Then from that absorption
    to the others, and from that viewer.
    """
    middle, among = len(viewers) // 2, share.shape[2] // 2
    here = share[middle]
    single = np.stack(axis_and_variance(here @ np.sin(theta), here @ np.sin(theta) ** 2))[..., None]
    found = np.empty((3, *share.shape[:-1], len(start[0])))
    of, count = found[:, middle], len(here)
    each = [slice(count)] if turned is None else [slice(k, k + 1) for k in reversed(range(count))]
    shares = np.full(of[0, each[0], among].shape, 1 / len(start[0]))
    mixture = _as_single(single[:, each[0], among], shares, *(np.broadcast_to(x, shares.shape) for x in start))
    mixture = _nearer(theta, here[each[0], among], mixture, 1, _SETTLED)
    for k, before in zip(each, [each[0], *each], strict=False):
        if turned:
            mixture = _turned(mixture, single[:, before, among], single[:, k, among])
        of[:, k, among] = mixture = _nearer(theta, here[k, among], mixture, _ORDER, _STEPS)
    for a, before in _outward(among, here.shape[1]):
        turned_on = _turned(of[:, :, before], single[:, :, before], single[:, :, a])
        of[:, :, a] = _nearer(theta, here[:, a], turned_on, _ORDER, _STEPS_ON)
    for v, inner in _outward(middle, len(viewers)):
        shares, axes, variances = found[:, inner]
        turned_on = np.stack([shares, _inside(axes - (viewers[v] - viewers[inner])), variances])
        found[:, v] = _nearer(theta, share[v], turned_on, _ORDER, _STEPS_ON)
    return found


def _outward(first: int, count: int) -> Iterator[tuple[int, int]]:
    """Indices up and down from the first, which is left out, each with the one before it."""
    yield from ((k, k - 1) for k in range(first + 1, count))
    yield from ((k, k + 1) for k in range(first - 1, -1, -1))


def _as_single(single: Array, share: Array, axis: Array, variance: Array) -> Array:
    """A mixture whose axes are in deviations of a single M from its own, and whose variances are out of that one's."""
    axes = _inside(single[0] + np.sqrt(single[1]) * axis)
    return np.stack([share, axes, np.maximum(single[1] * variance, _NARROWEST)])


def _turned(mixture: Array, before: Array, single: Array) -> Array:
    """A mixture as it is after a single M has turned and widened so."""
    share, axis, variance = mixture
    return _as_single(single, share, (axis - before[0]) / np.sqrt(before[1]), variance / before[1])


def _inside(theta: Array) -> Array:
    """Inclinations from pole to pole: past a pole light comes from the other side."""
    return np.arctan2(np.sin(theta), np.abs(np.cos(theta)))


def _lost(theta: Array, share: Array, found: Array) -> Array:
    """1 - ESS, the mean over viewers."""
    return np.asarray((1 - 1 / (share**2 / np.maximum(_summed(theta, found), _LEAST)).sum(axis=-1)).mean(axis=0), float)


def _summed(theta: Array, found: Array) -> Array:
    """What shares, axes and variances, (3, ..., M's), put into each row."""
    shares, axes, variances = found
    return np.asarray((shares[..., None] * m_in_rows(theta, axes, variances)).sum(axis=-2), np.float64)


def axis_and_variance(first: Array, second: Array) -> tuple[Array, Array]:
    """Return the axis and the variance of the M with these mean values of sin theta_i and of its square.

    Taken from the known moments of an M, what the poles cut off a lobe is not mistaken for a shift.
    """
    axis, variance = np.empty((2, *np.shape(first)))
    _core.axis_and_variance(np.ascontiguousarray(first), np.ascontiguousarray(second), axis, variance)
    return axis, variance


def m_in_rows(theta: Array, axis: Array, variance: Array) -> Array:
    """Return what the energy-conserving M puts into each row, out of 1, shape (..., rows)."""
    m = np.empty((*np.shape(axis), len(theta)))
    _core.m_in_rows(theta, np.ascontiguousarray(axis), np.ascontiguousarray(variance), m)
    return m


def _nearer(theta: Array, energy: Array, mixture: Array, order: float, steps: int) -> Array:
    """Shares, axes and variances of mixtures, (3, ..., M's), after some steps nearer to energies out of 1."""
    found = np.array(mixture, order="C")
    _core.nearer_mixtures(theta, np.ascontiguousarray(energy), order, steps, _NARROWEST, found)
    return found
