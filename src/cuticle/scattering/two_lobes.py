"""Two energy-conserving M's in place of one, for energies over theta_i: by expectation and maximisation.

Light that other strands scattered is more peaked than one M, and has wider tails. Expectation and maximisation: Dempster,
Laird and Rubin 1977. An M is the latitude of a von Mises-Fisher distribution of concentration k = 1/v, so that maximising is
matching the mean values of sin theta_i and of its square, which the mixture therefore keeps.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cuticle import _core

Array = NDArray[np.float64]
_STEPS = 20
# The order of Rényi's divergence that is lowered. At 1, the likelihood's, tails of smooth dark fibres are lost: 1e-40 where
# 1e-7 of the light is. Toward 2, ESS's own, tails draw the M's away from the peaks.
_ORDER = 1.15
_SETTLED = 5  # steps at order 1 before
_MOST = 1e40  # of energy over the mixture's
_OVER = 1.8  # what each step but the last does of its change: over-relaxation, which takes half as many of them
_NARROW, _WIDE = 0.3, 2.0  # of the single M's variance, at the start
_LEAST_SHARE = 1e-6  # of a row's energy, for either M
_FLOOR = math.radians(1.2) ** 2  # of variances where M is taken at the rows' centres alone, 4° apart
_DARK = math.exp(-230)  # the least energy that keeps its shape
_LOG_K = math.log(0.05), math.log(1e5)


def two_lobes(theta: Array, energy: Array) -> Array:
    """Return a mixture of two M's near the energies, with their mean sin theta_i and its square.

    Parameters
    ----------
    theta
        Evenly spaced inclinations theta_i, radians, shape (rows,).
    energy
        In the rows, at least 0, in any unit, shape (..., rows).

    Returns
    -------
    ndarray
        Share of the first M, its axis and variance, the second's axis and variance, radians and radians², shape (..., 5).
        The first M starts as the narrow one, and mostly stays it. Without energy (below exp(-230)) both are one M, finite.
    """
    total = energy.sum(axis=-1)
    share = energy / np.maximum(total, _DARK)[..., None]
    axis, variance = axis_and_variance(*np.moveaxis(share @ _sines(theta)[:, 1:], -1, 0))
    out = np.stack([np.full(total.shape, 0.5), axis, variance, axis, variance], axis=-1)
    lit = total > _DARK
    out[lit] = _fitted(theta, share[lit], out[lit])
    return out


def labelled(theta: Array, lobes: Array, between: Array) -> Array:
    """Return mixtures of successive viewers with their M's in the order in which they are to be interpolated.

    From the middle outward, a viewer's two M's change places if the mean of its parameters and its inner neighbour's is then
    likelier halfway.

    Parameters
    ----------
    theta
        As in `two_lobes`.
    lobes
        What it returned, shape (..., viewers, 5).
    between
        Energies over theta_i halfway between viewers, shape (..., viewers - 1, rows).
    """
    out = lobes.copy()
    share = between / np.maximum(between.sum(axis=-1, keepdims=True), _DARK)

    def likelihood(at: int, one: Array, other: Array) -> Array:
        q = sum(_weighted(theta, 0.5 * (one + other)))
        return np.asarray((share[..., at, :] * np.log(np.maximum(q, 1e-30))).sum(axis=-1), np.float64)

    viewers = lobes.shape[-2]
    middle = viewers // 2
    pairs = [(v, v - 1, v - 1) for v in range(middle + 1, viewers)] + [(v, v + 1, v) for v in range(middle - 1, -1, -1)]
    for v, inner, at in pairs:
        kept, near = out[..., v, :], out[..., inner, :]
        swapped = np.concatenate([1 - kept[..., :1], kept[..., 3:], kept[..., 1:3]], axis=-1)
        likelier = likelihood(at, near, swapped) > likelihood(at, near, kept) + 1e-9  # not by rounding
        out[..., v, :] = np.where(likelier[..., None], swapped, kept)
    return out


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


def _sines(theta: Array) -> Array:
    return np.sin(theta)[:, None] ** np.arange(3)


def _weighted(theta: Array, lobes: Array) -> tuple[Array, Array]:
    """What each M of a mixture puts into each row, out of 1 for both, shape (..., rows)."""
    share, axis, variance = lobes[..., :1], lobes[..., [1, 3]], np.maximum(lobes[..., [2, 4]], _FLOOR)
    rows = len(theta)
    m = np.empty((*axis.shape, rows))
    _core.energy_conserving_m(np.tile(theta, axis.size), np.repeat(axis, rows), np.repeat(variance, rows), m.reshape(-1))
    m *= np.cos(theta)
    m /= np.maximum(m.sum(axis=-1, keepdims=True), 1e-300)
    return share * m[..., 0, :], (1 - share) * m[..., 1, :]


def _fitted(theta: Array, energy: Array, single: Array) -> Array:
    """The mixtures for energies out of 1, shape (n, rows), from single M's given as mixtures.

    The last step is an ordinary one, and exact: the means are then the energies'.
    """
    lobes = single * [1, 1, _NARROW, 1, _WIDE]
    log_k = -np.log(lobes[:, [2, 4]].T)
    belongs = np.full_like(energy, 0.5)
    for step in range(_STEPS + 1):
        one, other = _weighted(theta, lobes)
        both = one + other
        share = np.where(both > 1e-250, one / np.maximum(both, 1e-250), 0.5)
        belongs = np.clip(belongs + (_OVER if 0 < step < _STEPS else 1) * (share - belongs), _LEAST_SHARE, 1 - _LEAST_SHARE)
        weighed = energy
        if _SETTLED < step < _STEPS:
            weighed = energy * np.minimum(energy / np.maximum(both, 1e-250), _MOST) ** (_ORDER - 1)
            weighed /= weighed.sum(axis=-1, keepdims=True)
        first = belongs * weighed
        sums = np.stack([first, weighed - first]) @ _sines(theta)
        weight = np.maximum(sums[..., 0], 1e-12)
        means = sums[..., 1] / weight, sums[..., 2] / weight
        if step < _STEPS:
            log_k = _closer(log_k, *means)
            k = np.exp(log_k)
            axis, variance = np.arcsin(_of_concentration(k, means[0])[0]), 1 / k
        else:
            axis, variance = axis_and_variance(*means)
        lobes = np.stack([weight[0] / weight.sum(axis=0), axis[0], variance[0], axis[1], variance[1]], axis=-1)
    return lobes


def _closer(log_k: Array, first: Array, second: Array) -> Array:
    """Two of Newton's steps toward the concentration that `axis_and_variance` bisects for.

    Below coth k - 1/k = |E[sin]| there is no M. k is held where it is, by the approximation of Banerjee et al. 2005, at most
    5 % above.
    """
    r = np.minimum(np.abs(first), 1 - 1e-9)
    low = np.clip(np.log(np.maximum(r * (3 - r**2) / (1 - r**2), 1e-9)), *_LOG_K)
    step = 1e-4
    for _ in range(2):
        log_k = np.maximum(log_k, low)
        square, further = (_of_concentration(np.exp(x), first)[1] for x in (log_k, log_k + step))
        slope = np.minimum((further - square) / step, -1e-9)
        log_k = np.clip(log_k - np.clip((square - second) / slope, -1, 1), low, _LOG_K[1])
    return log_k
