"""Dual scattering as Zinke et al. 2008 print it, in double precision, each formula a field that a slip may replace."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cuticle._support.quadrature import gauss_legendre
from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import Evaluated, Formulas, arguments, evaluate_fibre, marschner, optics

Array = NDArray[np.float64]
LOBES = ("R", "TT", "TRT", "back")
_REACH = 9.5  # deviations of a Gaussian that are integrated over
_TURNS = range(-8, 9)  # half turns at which a triangle wave has its kinks


class Averages(NamedTuple):
    """What a fibre does to light on average, (n, channels): energies on and back, their mean shifts and widths."""

    a_f: Array
    a_b: Array
    alpha_f: Array
    alpha_b: Array
    beta_f: Array
    beta_b: Array


@dataclass(frozen=True)
class Back:
    """Zinke's formulas; `a` are the averages, `q` the inputs as columns."""

    energy: Callable[[Averages], Array] = lambda a: _orders(a)[0] + _orders(a)[1]
    shift: Callable[[Averages], Array] = lambda a: (
        a.alpha_b * (1 - 2 * a.a_b**2 / (1 - a.a_f**2) ** 2)
        + a.alpha_f * (2 * (1 - a.a_f**2) ** 2 + 4 * a.a_f**2 * a.a_b**2) / (1 - a.a_f**2) ** 3
    )
    deviation: Callable[[Averages, Any], Array] = lambda a, q: (
        (1 + q.d_b * a.a_f**2)
        * (a.a_b * np.sqrt(2 * a.beta_f**2 + a.beta_b**2) + a.a_b**3 * np.sqrt(2 * a.beta_f**2 + 3 * a.beta_b**2))
        / (a.a_b + a.a_b**3 * (2 * a.beta_f + 3 * a.beta_b))
    )
    direct_factor: float = 2 / np.pi  # of d_b A_b g / cos² theta_d
    backward: Callable[[Any], Array] = lambda q: q.d_b
    spread_factor: float = np.pi  # before f_back of light through strands
    density: Callable[[Any], Array] = lambda q: q.d_f**2
    transmittance: Callable[[Averages, Array], Array] = lambda a, n: a.a_f**n
    spread: Callable[[Averages, Array], Array] = lambda a, n: n * a.beta_f**2
    half_turn: bool = True  # N^G is the mean of N over half a turn


def _orders(a: Averages) -> tuple[Array, Array]:
    """Return A_1 and A_3."""
    q = 1 - a.a_f**2
    return a.a_b * a.a_f**2 / q, a.a_b**3 * a.a_f**2 / q**3


# Each of the formulas times a number, as `scans` tries it.
BACK_TIMES: dict[str, Callable[[Back, float], Back]] = {
    "A_b": lambda B, k: replace(B, energy=lambda a: B.energy(a) * k),
    "Δ_b": lambda B, k: replace(B, shift=lambda a: B.shift(a) * k),
    "σ_b": lambda B, k: replace(B, deviation=lambda a, q: B.deviation(a, q) * k),
    "f_back through strands": lambda B, k: replace(B, spread_factor=B.spread_factor * k),
    "T_f d_f": lambda B, k: replace(B, density=lambda q: B.density(q) * k),
    "σ_f²": lambda B, k: replace(B, spread=lambda a, n: B.spread(a, n) * abs(k)),
}


def dual_scattering() -> Formulas:
    """Return Zinke et al. 2008 as printed, on Marschner's Gaussian lobes."""
    return replace(marschner(conserving=False), back=Back())


def triangle(x: Array, beta: Array) -> Array:
    """Return |x|/pi, periodic, smoothed by a normal distribution of deviation beta: the share of light that goes on."""
    total = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(beta)))
    for k in _TURNS:
        d = x - k * np.pi
        smooth = d * special.erf(d / (beta * np.sqrt(2))) + beta * np.sqrt(2 / np.pi) * np.exp(-(d**2) / (2 * beta**2))
        total = total + (-1) ** k * smooth
    return np.asarray(total / np.pi - _TURNS.stop + 1)


def half_turn(x: Array, beta: Array) -> Array:
    """Return the mean of a wrapped normal density over x ± pi/2."""
    total = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(beta)))
    for k in range(-3, 4):
        d = (x - 2 * np.pi * k) / (beta * np.sqrt(2))
        edge = np.pi / 2 / (beta * np.sqrt(2))
        total = total + special.erf(d + edge) - special.erf(d - edge)
    return np.asarray(total / (2 * np.pi))


def _energies(F: Formulas, q: Any, theta: Array) -> tuple[Array, Array]:
    """Return ½ ∫ A_p dh that goes on and back at inclinations theta (n, 1): (n, lobes, channels)."""
    gamma, weight = gauss_legendre(np.linspace(0, np.pi / 2, 25), 8)
    q.h = np.sin(gamma)[None, :]
    energies, ray = optics(replace(F, inclination=lambda _: theta), q)
    forward, backward = [], []
    for p, a in enumerate(energies):
        light = a * (weight * np.cos(gamma))[None, :, None]
        on = triangle(F.azimuth(p, ray) - 2 * np.pi * (p == 2), np.radians(q.beta_N))[..., None]
        forward.append((light * on).sum(axis=1))
        backward.append((light * (1 - on)).sum(axis=1))
    return np.stack(forward, axis=1), np.stack(backward, axis=1)


def averages(inputs: Inputs) -> Averages:
    """Return the averages at theta_d of each case, by quadrature over the other inclination and the width."""
    names = [n for n in inputs.columns if n not in ("phi", "strands", "d_f", "d_b", "theta_i", "theta_r")]
    twice = inputs.columns["theta_r"] - inputs.columns["theta_i"]
    key = np.column_stack([twice, *(inputs.columns[n] for n in names), inputs.sigma_a])
    _, first, back = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Averages(*(x[back.ravel()] for x in _averages(inputs.take(first))))


@lru_cache(maxsize=8)
def _averages(inputs: Inputs) -> Averages:
    F, q = marschner(conserving=False), arguments(inputs)
    here = (q.theta_r - q.theta_i) / 2
    z, weight = gauss_legendre(np.linspace(-1, 1, 9), 6)
    forward, backward = [], []
    for p, (alpha, variance) in enumerate(zip(F.tilts(q), F.variances(q), strict=True)):
        beta = np.sqrt(variance)
        low = np.maximum(2 * (alpha - _REACH * beta) - here, -np.pi / 2)
        high = np.minimum(2 * (alpha + _REACH * beta) - here, np.pi / 2)
        ends = (high - low) / 2
        total = np.zeros((2, len(inputs), inputs.channels))
        for node, w in zip(z, weight, strict=True):
            other = (low + high) / 2 + ends * node
            half, difference = (other + here) / 2, (here - other) / 2
            m = np.exp(-((half - alpha) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance) / np.cos(difference) ** 2
            factor = w * ends * m * np.cos(other) * np.cos(here) * (ends > 0)
            on, off = _energies(F, q, difference)
            total += np.stack([factor * on[:, p], factor * off[:, p]])
        forward.append(total[0])
        backward.append(total[1])
    (a_f, alpha_f, beta_f), (a_b, alpha_b, beta_b) = _moments(F, q, forward), _moments(F, q, backward)
    return Averages(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b)


def _moments(F: Formulas, q: Any, energy: list[Array]) -> tuple[Array, Array, Array]:
    total = np.maximum(sum(energy), 1e-30)
    shift = sum(e * t for e, t in zip(energy, F.tilts(q), strict=True)) / total
    width = sum(e * np.sqrt(v) for e, v in zip(energy, F.variances(q), strict=True)) / total
    return np.asarray(total), np.asarray(shift), np.asarray(width)


def among_strands(F: Formulas, inputs: Inputs) -> Evaluated:
    """Return dual scattering of all cases: lit directly, through strands, or a blend below one strand."""
    B: Back = F.back
    with np.errstate(all="ignore"):
        a, q = averages(inputs), arguments(inputs)
        single = evaluate_fibre(replace(F, back=None, finish=lambda q, f: f), inputs)
        lit, count = np.clip(1 - q.strands, 0, 1), np.maximum(q.strands, 1)
        share = B.density(q) * (1 - lit) * B.transmittance(a, count)
        difference = (q.theta_r - q.theta_i) / 2

        def m(shift: Array, variance: Array) -> Array:
            half = (q.theta_i + q.theta_r) / 2 - shift
            return np.asarray(np.exp(-(half**2) / (2 * variance)) / np.sqrt(2 * np.pi * variance) / np.cos(difference) ** 2)

        energies, ray = optics(F, arguments(inputs))
        gamma, weight = gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, 97), 8)
        parts, spread, beta = [], B.spread(a, count), np.radians(q.beta_N)
        for p, (alpha, variance) in enumerate(zip(F.tilts(q), F.variances(q), strict=True)):
            x = F.wrap(q.phi - F.azimuth(p, ray))
            density = half_turn(x, beta) if B.half_turn else F.density(x, beta)
            n = (density[..., None] * energies[p] * (weight * np.cos(gamma) / 2)[None, :, None]).sum(axis=1)
            parts.append(lit * single.parts[:, p] + share * m(alpha, variance + spread) * n)
        back, variance = B.backward(q) * B.direct_factor * B.energy(a), B.deviation(a, q) ** 2
        behind = lit * back * m(B.shift(a), variance) + share * B.spread_factor * back * m(B.shift(a), variance + spread)
        stacked = np.stack([*parts, behind], axis=1)
        f = F.finish(q, stacked.sum(axis=1))
    return Evaluated(stacked, f, np.full(len(inputs), np.nan), single.around, single.mean)
