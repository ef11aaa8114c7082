"""Three energy-conserving M's in place of one, for energies over theta_i: by expectation and maximisation.

Light that other strands scattered has a peak for each of their lobes, and wider tails. Expectation and maximisation:
Dempster, Laird and Rubin 1977. An M is the latitude of a von Mises-Fisher distribution of concentration k = 1/v, so that
maximising is matching the mean values of sin theta_i and of its square.
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
_MOST = 1e40  # of energy over the mixture's
_LEAST_SHARE = 1e-7
_NONE = 1e-12  # of the light: an M with less stays as it is
_NARROWEST = math.log(6 / math.radians(4) ** 2)  # ln k: as wide as a hat between rows, 4° apart; needles fit between them
_UNREACHED = 1e-250  # where no M puts energy: the widest takes it
_DARK = math.exp(-230)  # the least energy that keeps its shape
_LOG_K = math.log(0.05), math.log(1e5)


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
    single = np.stack(axis_and_variance(*_means(_sums(theta, here))))[..., None]
    found = np.empty((3, *share.shape[:-1], len(start[0])))
    of, count = found[:, middle], len(here)
    each = [slice(count)] if turned is None else [slice(k, k + 1) for k in reversed(range(count))]
    shares = np.full(of[0, each[0], among].shape, 1 / len(start[0]))
    mixture = _as_single(single[:, each[0], among], shares, *(np.broadcast_to(x, shares.shape) for x in start))
    for _ in range(_SETTLED):
        mixture = _nearer(theta, here[each[0], among], mixture, 1)
    for k, before in zip(each, [each[0], *each], strict=False):
        if turned:
            mixture = _turned(mixture, single[:, before, among], single[:, k, among])
        for _ in range(_STEPS):
            mixture = _nearer(theta, here[k, among], mixture, _ORDER)
        of[:, k, among] = mixture
    for a, before in _outward(among, here.shape[1]):
        of[:, :, a] = _turned(of[:, :, before], single[:, :, before], single[:, :, a])
        for _ in range(_STEPS_ON):
            of[:, :, a] = _nearer(theta, here[:, a], of[:, :, a], _ORDER)
    for v, inner in _outward(middle, len(viewers)):
        found[:, v] = found[:, inner]
        found[1, v] = _inside(found[1, inner] - (viewers[v] - viewers[inner]))
        for _ in range(_STEPS_ON):
            found[:, v] = _nearer(theta, share[v], found[:, v], _ORDER)
    return found


def _outward(first: int, count: int) -> Iterator[tuple[int, int]]:
    """Indices up and down from the first, which is left out, each with the one before it."""
    yield from ((k, k - 1) for k in range(first + 1, count))
    yield from ((k, k + 1) for k in range(first - 1, -1, -1))


def _as_single(single: Array, share: Array, axis: Array, variance: Array) -> Array:
    """A mixture whose axes are in deviations of a single M from its own, and whose variances are out of that one's."""
    axes = _inside(single[0] + np.sqrt(single[1]) * axis)
    return np.stack([share, axes, np.maximum(single[1] * variance, math.exp(-_NARROWEST))])


def _turned(mixture: Array, before: Array, single: Array) -> Array:
    """A mixture as it is after a single M has turned and widened so."""
    share, axis, variance = mixture
    return _as_single(single, share, (axis - before[0]) / np.sqrt(before[1]), variance / before[1])


def _inside(theta: Array) -> Array:
    """Inclinations from pole to pole: past a pole light comes from the other side."""
    return np.arctan2(np.sin(theta), np.abs(np.cos(theta)))


def _lost(theta: Array, share: Array, found: Array) -> Array:
    """1 - ESS, the mean over viewers."""
    return np.asarray((1 - 1 / (share**2 / np.maximum(_summed(theta, found), _UNREACHED)).sum(axis=-1)).mean(axis=0), float)


def _summed(theta: Array, found: Array) -> Array:
    """What shares, axes and variances, (3, ..., M's), put into each row."""
    shares, axes, variances = found
    return np.asarray((shares[..., None] * m_in_rows(theta, axes, variances)).sum(axis=-2), np.float64)


def axis_and_variance(first: Array, second: Array) -> tuple[Array, Array]:
    """Return the axis and the variance of the M with these mean values of sin theta_i and of its square.

    M is the latitude of a von Mises-Fisher distribution of concentration k = 1/v about the axis, whose moments are known:
    with A = coth k - 1/k, E[sin] = A sin(axis) and E[sin²] = A/k + (1 - 3 A/k) sin²(axis). Taken so, what the poles cut
    off a lobe is not mistaken for a shift.
    """
    low, high = (np.full_like(first, x) for x in _LOG_K)
    for _ in range(60):  # E[sin²] falls as the lobe narrows, for one mean
        middle = 0.5 * (low + high)
        sine, square = _of_concentration(np.exp(middle), first)
        wide = (square > second) | (np.abs(sine) >= 1)
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    k = np.exp(0.5 * (low + high))
    return np.arcsin(_of_concentration(k, first)[0]), 1 / k


def _of_concentration(k: Array, first: Array) -> tuple[Array, Array]:
    """The sine of the axis and E[sin²] of the M of concentration k with this E[sin]."""
    a = 1 / np.tanh(k) - 1 / k
    sine = np.clip(first / a, -1, 1)
    return sine, a / k + (1 - 3 * a / k) * sine**2


def _sums(theta: Array, energy: Array) -> Array:
    """Sums of energies, times sin theta, and times its square: shape (..., 3)."""
    return energy @ np.sin(theta)[:, None] ** np.arange(3)


def _means(sums: Array) -> tuple[Array, Array]:
    """Mean values of sin theta and of its square, from `_sums`."""
    weight = np.maximum(sums[..., 0], _NONE)
    return sums[..., 1] / weight, sums[..., 2] / weight


def m_in_rows(theta: Array, axis: Array, variance: Array) -> Array:
    """Return what the energy-conserving M puts into each row, out of 1, shape (..., rows)."""
    rows = len(theta)
    m = np.empty((*axis.shape, rows))
    _core.energy_conserving_m(np.tile(theta, axis.size), np.repeat(axis, rows), np.repeat(variance, rows), m.reshape(-1))
    m *= np.cos(theta)
    m /= np.maximum(m.sum(axis=-1, keepdims=True), 1e-300)
    return m


def _nearer(theta: Array, energy: Array, mixture: Array, order: float) -> Array:
    """Shares, axes and variances of mixtures, (3, ..., M's), after a step nearer to energies out of 1."""
    share, axis, variance = mixture
    of_each = share[..., None] * m_in_rows(theta, axis, variance)
    whole = of_each.sum(axis=-2)
    reached = whole > _UNREACHED
    over = np.minimum(energy / np.maximum(whole, _UNREACHED), _MOST) ** (order - 1)
    weighed = energy * over
    weighed /= weighed.sum(axis=-1, keepdims=True)
    belongs = of_each * np.where(reached, weighed / np.maximum(whole, _UNREACHED), 0)[..., None, :]
    if not reached.all():
        widest = np.arange(share.shape[-1]) == variance.argmax(axis=-1)[..., None]
        belongs += widest[..., None] * np.where(reached, 0, weighed)[..., None, :]
    sums = _sums(theta, belongs)
    weight, means = sums[..., 0], _means(sums)
    new_axis, new_variance = _closer(variance, *means)
    some = weight > _NONE
    weight = np.maximum(weight, _LEAST_SHARE)
    return np.stack(
        [weight / weight.sum(axis=-1, keepdims=True), np.where(some, new_axis, axis), np.where(some, new_variance, variance)]
    )


def _closer(variance: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Two of Newton's steps toward the axis and variance that `axis_and_variance` bisects for.

    Below coth k - 1/k = |E[sin]| there is no M. k is held where it is, by the approximation of Banerjee et al. 2005, at most
    5 % above.
    """
    r = np.minimum(np.abs(first), 1 - 1e-9)
    low = np.clip(np.log(np.maximum(r * (3 - r**2) / (1 - r**2), 1e-9)), *_LOG_K)
    log_k, step = -np.log(variance), 1e-4
    for _ in range(2):
        log_k = np.maximum(log_k, low)
        square, further = (_of_concentration(np.exp(x), first)[1] for x in (log_k, log_k + step))
        slope = np.minimum((further - square) / step, -1e-9)
        log_k = np.clip(log_k - np.clip((square - second) / slope, -1, 1), low, _LOG_K[1])
    k = np.exp(np.minimum(log_k, _NARROWEST))
    return np.arcsin(_of_concentration(k, first)[0]), 1 / k
