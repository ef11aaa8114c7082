"""Least squares of mixtures of product lobes: unconstrained coordinates, and Levenberg-Marquardt over many at once.

1/ESS - 1 = ∫ (q - p)²/p is a sum of squares, so minimising 1/ESS itself is least squares (src/native/fit.cpp).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle.fitting.targets import Targets
from cuticle.sampling.lobe_table import MEAN_PHI, MEAN_THETA, SIGMA_PHI, SIGMA_THETA, WEIGHT

Array = NDArray[np.float64]

SIGMA_THETA_RANGE = (np.radians(0.2), 2.5)
SIGMA_PHI_RANGE = (np.radians(0.2), 6.0)
_OUTSIDE = 0.95  # of a sigma, how far a mean may leave its domain; the core allows 1
_LEAST_LOGIT = -9.0
# Far out, where f is small, ESS does not see a lobe's tail fall below it. A weight f cos/(p ∫ f cos) of r times the first
# number costs ½ the second times the mean of ln² r over theta and phi: little ESS, and few weights are three times as large.
_ALLOWED_WEIGHT = 12.0
_PRICE = 1.0


def to_natural(u: Array) -> Array:
    """Map logits, means and log sigmas (..., 5, K) to weights, means and sigmas."""
    x = u.copy()
    e = np.exp(u[..., WEIGHT, :] - u[..., WEIGHT, :].max(axis=-1, keepdims=True))
    x[..., WEIGHT, :] = e / e.sum(axis=-1, keepdims=True)
    x[..., SIGMA_THETA, :] = np.exp(u[..., SIGMA_THETA, :])
    x[..., SIGMA_PHI, :] = np.exp(u[..., SIGMA_PHI, :])
    return x


def from_natural(x: Array) -> Array:
    """Map weights, means and sigmas to unconstrained coordinates."""
    u = x.copy()
    u[..., WEIGHT, :] = np.log(np.maximum(x[..., WEIGHT, :], 1e-6))
    u[..., SIGMA_THETA, :] = np.log(x[..., SIGMA_THETA, :])
    u[..., SIGMA_PHI, :] = np.log(x[..., SIGMA_PHI, :])
    return u


def in_coordinates(x: Array, gradient: Array, hessian: Array) -> tuple[Array, Array]:
    """Map a gradient (E, 5K) and a matrix (E, 5K, 5K) from natural parameters x (E, 5, K) to unconstrained coordinates."""
    lobes = x.shape[-1]
    w, scale = x[:, WEIGHT], x.reshape(len(x), -1).copy()
    scale[:, : SIGMA_THETA * lobes] = 1  # means are coordinates; of sigmas the logs are
    g, h = gradient * scale, hessian * (scale[:, :, None] * scale[:, None, :])
    by_logit = w[:, :, None] * (np.eye(lobes) - w[:, None, :])  # symmetric
    g[:, :lobes] = np.einsum("eij,ei->ej", by_logit, g[:, :lobes])
    h[:, :lobes] = by_logit @ h[:, :lobes]
    h[:, :, :lobes] = h[:, :, :lobes] @ by_logit
    return g, h


def confine(u: Array, even: bool) -> Array:
    """Return coordinates moved into the ranges that a sampler's table has."""
    v = u.copy()
    v[..., WEIGHT, :] = np.maximum(u[..., WEIGHT, :] - u[..., WEIGHT, :].max(axis=-1, keepdims=True), _LEAST_LOGIT)
    v[..., SIGMA_THETA, :] = np.clip(u[..., SIGMA_THETA, :], *np.log(SIGMA_THETA_RANGE))
    v[..., SIGMA_PHI, :] = np.clip(u[..., SIGMA_PHI, :], *np.log(SIGMA_PHI_RANGE))
    reach = np.pi / 2 + _OUTSIDE * np.exp(v[..., SIGMA_THETA, :])
    v[..., MEAN_THETA, :] = np.clip(u[..., MEAN_THETA, :], -reach, reach)
    if even:
        beyond = _OUTSIDE * np.exp(v[..., SIGMA_PHI, :])
        v[..., MEAN_PHI, :] = np.clip(u[..., MEAN_PHI, :], -beyond, np.pi + beyond)
    else:
        v[..., MEAN_PHI, :] = np.clip(u[..., MEAN_PHI, :], -2 * np.pi, 2 * np.pi)
    return v


def loss(targets: Targets, x: Array, *, bounded: bool = True) -> Array:
    """Return ½ (1/ESS - 1) for each target, parameters (E, 5, K); `bounded` adds the price of large weights."""
    out = np.empty(len(x))
    none = np.empty((0, 0, 0))
    _call(targets, x, bounded, out, np.empty((0, 0)), none)
    return out


def ess_of(targets: Targets, x: Array) -> Array:
    """Return the ESS for each target, parameters (E, 5, K), as the targets' grids see it."""
    return 1 / (1 + 2 * loss(targets, x, bounded=False))


def equations(targets: Targets, x: Array) -> tuple[Array, Array, Array]:
    """Return bounded loss (E,), gradient (E, 5K) and Gauss-Newton matrix (E, 5K, 5K) in natural parameters."""
    size = x.shape[-1] * 5
    value, gradient, hessian = np.empty(len(x)), np.empty((len(x), size)), np.empty((len(x), size, size))
    _call(targets, x, True, value, gradient, hessian)
    return value, gradient, hessian


def _call(t: Targets, x: Array, bounded: bool, value: Array, gradient: Array, hessian: Array) -> None:
    _core.normal_equations(
        t.q, t.theta, t.theta_weight, t.phi, t.phi_weight, np.ascontiguousarray(x), t.even, _ALLOWED_WEIGHT,
        _PRICE if bounded else 0.0, value, gradient, hessian, t.family,
    )  # fmt: skip


def solve_each(targets: Targets, u: Array, *, iterations: int, tolerance: float = 1e-5) -> tuple[Array, Array]:
    """Fit each target by itself from `u` (E, 5, K); return coordinates and losses. One damping a problem."""
    u = confine(u, targets.even)
    shape = u.shape
    damping = np.full(len(u), 1e-2)
    x = to_natural(u)
    value, gradient, hessian = equations(targets, x)
    active = np.arange(len(u))
    identity = np.eye(shape[1] * shape[2])
    for _ in range(iterations):
        g, h = in_coordinates(x[active], gradient[active], hessian[active])
        diagonal = np.einsum("eii->ei", h)
        scale = diagonal + 1e-4 * diagonal.max(axis=1, keepdims=True)
        h = h + damping[active, None, None] * scale[:, None, :] * identity
        step = -np.linalg.solve(h, g[..., None])[..., 0].reshape(-1, *shape[1:])
        trial = confine(u[active] + np.clip(step, -1.0, 1.0), targets.even)
        new = equations(targets.take(active), to_natural(trial))
        better = new[0] < value[active]
        gain = value[active] - new[0]
        done = better & (gain < tolerance * value[active])
        damping[active] = np.where(better, np.maximum(damping[active] * 0.25, 1e-7), damping[active] * 6)
        kept = active[better]
        u[kept], value[kept], gradient[kept], hessian[kept] = trial[better], *(a[better] for a in new)
        x[kept] = to_natural(trial[better])
        active = active[~done & (damping[active] < 1e5)]
        if not len(active):
            break
    return u, value
