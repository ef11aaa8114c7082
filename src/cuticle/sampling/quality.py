"""How well a sampler matches a scattering function, by quadrature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.quadrature import Grid, adapted_edges, grid
from cuticle.scattering.bcsdf import Bcsdf, check_model, checked_even, evaluate, luminance

MEASURED_AT = np.radians([-85, -75, -60, -30, 0, 30, 60, 75, 85.0])  # viewers of a fit, a check and an audit, by default
_COARSE = (360, 120)
_FINE = (80, 48)
_ORDER = 4
_LEAST_DENSITY = 1e-30  # 1/sr
_LEAST_SQRT = 1e-100  # of a density's square: where no channel has light
_GAP = 1e-5  # of `ChannelBounds.worst`, relative
_STEPS = 100  # toward it; 12 are usual


_Edges = tuple[NDArray[np.float64], NDArray[np.float64]]


class Density(Protocol):
    """Anything with a pdf per steradian."""

    def pdf(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, strands: ArrayLike | None = None) -> NDArray:
        """Return the density."""
        ...


class UniformSphere:
    """Uniform density over the sphere, 1/(4 pi) per steradian: the baseline."""

    def pdf(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, strands: ArrayLike | None = None) -> NDArray:
        """Return 1/(4 pi), of the arguments' broadcast shape."""
        return np.full(np.broadcast_shapes(np.shape(theta_i), np.shape(theta_r), np.shape(phi)), 0.25 / np.pi)


@dataclass(frozen=True)
class Quality:
    """How well a density p matches f·cos for one viewer.

    Attributes
    ----------
    ess
        Effective sample size of the luminance, (∫ f cos)²/∫ (f cos)²/p, from 0 to 1: the number of samples drawn from f·cos
        itself that one sample of p is worth.
    ess_channels
        The same for each channel.
    largest_weight
        Largest f cos/(p ∫ f cos) of the luminance. A perfect match has 1.
    energy
        ∫ f cos for each channel.
    energy_error
        Difference of the luminance's energy between two quadrature rules; None if it was not asked for.
    total_variation
        ½ ∫ |f cos/∫ f cos - p|, 0 to 1.
    """

    ess: float
    ess_channels: tuple[float, ...]
    largest_weight: float
    energy: tuple[float, ...]
    energy_error: float | None
    total_variation: float


def effective_sample_size(energy: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ESS = (∫ f cos)²/∫ (f cos)²/p, from the two integrals; 0 where f is 0."""
    return np.divide(energy**2, second, out=np.zeros_like(second), where=second > 0)


def measure(sampler: Density, model: Bcsdf, theta_r: float, strands: float | None = None, *, error: bool = True) -> Quality:
    """Measure how well a sampler matches a model for one viewer, by quadrature over both angles.

    Parameters
    ----------
    sampler
        Anything with a `pdf` per steradian.
    model
        The scattering function, for the strand count `strands`.
    theta_r
        The viewer's inclination, radians.
    strands
        Passed to the sampler.
    error
        Whether to find `energy_error`, with a second rule: a quarter of all values of f.

    Raises
    ------
    ValueError
        The model scatters nothing toward the viewer, or is not even in phi though it has `even = True`.
    """
    if not callable(getattr(sampler, "pdf", None)):
        raise TypeError(f"sampler must have pdf(theta_i, theta_r, phi), got {type(sampler).__name__}")
    check_model(model)
    theta_r, sides, values, edges = _over_both_angles(model, theta_r)
    g = grid(*edges, _ORDER)
    f = values(g)  # f cos, per steradian
    solid_angle = g.weights * np.cos(g.theta)[:, None] * sides
    p = sampler.pdf(g.theta[:, None], theta_r, g.phi[None, :], strands)
    channels = np.concatenate([f, luminance(f)[..., None]], axis=-1)
    energy = np.tensordot(solid_angle, channels, axes=2)
    if not energy[-1] > 0:
        raise ValueError(
            f"the model scatters nothing toward theta_r {np.degrees(theta_r):.4g}°: there is nothing to measure"
        )
    q = channels / np.where(energy > 0, energy, 1)  # whose square neither underflows nor overflows, however dark f is
    # Where p underflows, q below 1e-15 is a tail that no number of samples sees; a larger one still counts in full.
    floor = np.maximum(p, _LEAST_DENSITY)
    ess = effective_sample_size((energy > 0).astype(np.float64), np.tensordot(solid_angle / floor, q**2, axes=2))
    weight = float(np.max(q[..., -1] / floor))
    variation = 0.5 * float((solid_angle * np.abs(q[..., -1] - p)).sum())
    apart = None
    if error:
        lower = grid(*edges, _ORDER - 1)
        light = float((lower.weights * np.cos(lower.theta)[:, None] * luminance(values(lower))).sum()) * sides
        apart = abs(light - float(energy[-1]))
    return Quality(float(ess[-1]), tuple(map(float, ess[:-1])), weight, tuple(map(float, energy[:-1])), apart, variation)


def _over_both_angles(model: Bcsdf, theta_r: float) -> tuple[float, int, Callable[[Grid], NDArray[np.float64]], _Edges]:
    """The viewer's inclination, once it is checked; on how many sides phi is; f cos on a grid; and edges of cells.

    Cells follow f·cos: in this measure the integrands are smooth.
    """
    theta_r = validate.number("theta_r", theta_r, -validate.HALF_PI, validate.HALF_PI, unit="rad", remedy=validate.RADIANS)
    even = checked_even(model)

    def values(g: Grid) -> NDArray[np.float64]:
        return evaluate(model, g.theta, theta_r, g.phi)

    edges = adapted_edges(lambda c: luminance(values(c)) * np.cos(c.theta)[:, None], even=even, coarse=_COARSE, fine=_FINE)
    return theta_r, 2 if even else 1, values, edges


@dataclass(frozen=True)
class ChannelBounds:
    """Bounds on the ESS of single channels when one density serves all of them.

    Attributes
    ----------
    luminance
        ESS by channel of the density proportional to the luminance of f·cos, the optimum of `objective="luminance"`.
    rgb
        ESS by channel of the density with the smallest mean of 1/ESS, the optimum of `objective="rgb"`.
    worst
        The largest ESS that a density can have in its worst channel.
    """

    luminance: tuple[float, ...]
    rgb: tuple[float, ...]
    worst: float


def channel_bounds(model: Bcsdf, theta_r: float) -> ChannelBounds:
    """Return bounds on the ESS of single channels for one viewer (radians), if one density serves all channels.

    With q_c = f_c cos/∫ f_c cos, Σ λ_c/ESS_c is smallest for p ∝ sqrt(Σ λ_c q_c²). Equal λ give `rgb`; the λ whose
    smallest sum is the largest give `worst`.
    """
    check_model(model)
    theta_r, sides, values, edges = _over_both_angles(model, theta_r)
    g = grid(*edges, 2)
    weight = (g.weights * np.cos(g.theta)[:, None] * sides).ravel()
    f = values(g).reshape(weight.size, -1)
    energy = weight @ f
    square = (f / np.where(energy > 0, energy, 1)) ** 2

    def ess(p: NDArray[np.float64]) -> NDArray[np.float64]:
        density = np.maximum(p / np.sum(weight * p), _LEAST_DENSITY)
        return 1 / np.maximum((weight / density) @ square, 1e-300)

    lit = square[:, energy > 0]
    rgb = ess(np.sqrt(lit.mean(axis=1)))
    bright = ess(luminance(f))
    worst = ess(np.sqrt(lit @ worst_shares(weight, lit)))
    return ChannelBounds(tuple(map(float, bright)), tuple(map(float, rgb)), float(worst.min()))


def worst_shares(weight: NDArray[np.float64], square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the λ, out of 1, for which the smallest Σ λ_c/ESS_c over all densities is largest.

    That sum is (∫ sqrt(Σ λ_c q_c²))², with `square` the q_c², (points, channels); it is concave in λ. No density's largest
    1/ESS_c is below it, whatever λ. The search ends where that of the density of λ itself is hardly above. It takes
    Levenberg-Marquardt steps in ln λ, for a λ that goes to 0.
    """
    # Not `weight @ root`: BLAS sums in threads, which on a busy machine wait for one another.
    share, damping = np.full(square.shape[1], 1 / max(square.shape[1], 1)), 0.1
    root = np.maximum(np.sqrt(square @ share), _LEAST_SQRT)
    for _ in range(_STEPS):
        whole, slope = np.sum(weight * root), (weight / root) @ square
        loss = whole * slope  # 1/ESS_c
        if loss.max(initial=0) - share @ loss <= _GAP * loss.max(initial=0):
            break
        bend = (square.T * (weight / root**3)) @ square * whole - np.outer(slope, slope)
        bend *= 0.5 / (share @ loss) * np.outer(share, share)
        for _ in range(20):
            step = np.linalg.solve(bend + damping * np.diag(share), share * (loss / (share @ loss) - 1))
            trial = share * np.exp(np.clip(step, -4, 4))
            trial /= trial.sum()
            root = np.maximum(np.sqrt(square @ trial), _LEAST_SQRT)
            if np.sum(weight * root) >= whole:
                break
            damping *= 8
        share, damping = trial, 0.1 * damping
    return share
