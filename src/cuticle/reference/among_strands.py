"""Dual scattering as Zinke et al. 2008 print it, in double precision, each formula a field that a slip may replace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cuticle._support.quadrature import gauss_legendre
from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import Evaluated, Formulas, along, arguments, evaluate_fibre, marschner, optics, unchanged
from cuticle.reference.strand_averages import Averages, averages

Array = NDArray[np.float64]
LOBES = ("R", "TT", "TRT", "back")


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


def half_turn(x: Array, beta: Array) -> Array:
    """Return the mean of a wrapped normal density over x ± pi/2."""
    total = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(beta)))
    for k in range(-3, 4):
        d = (x - 2 * np.pi * k) / (beta * np.sqrt(2))
        edge = np.pi / 2 / (beta * np.sqrt(2))
        total = total + special.erf(d + edge) - special.erf(d - edge)
    return np.asarray(total / (2 * np.pi))


def among_strands(F: Formulas, inputs: Inputs, detail: int = 1) -> Evaluated:
    """Return dual scattering of all cases: lit directly, through strands, or a blend below one strand."""
    with np.errstate(all="ignore"):
        a, q = averages(F, inputs, detail), arguments(inputs)
        single = evaluate_fibre(replace(F, back=None, finish=unchanged), inputs)
        energies, ray = optics(F, q)
        gamma, weight = gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, 97), 8)
        across, scale = (weight * np.cos(gamma) / 2)[None, :, None], F.scale(q)
        spread, light = [], [(energy * across).sum(axis=1) for energy in energies]
        for p in range(len(F.lobes)):
            x = F.wrap(q.phi - F.azimuth(p, ray))
            density = half_turn(x, scale) if F.back.half_turn else F.density(x, scale)
            spread.append((density[..., None] * energies[p] * across).sum(axis=1))
        stacked = combined(F, inputs, a, list(single.parts.transpose(1, 0, 2)), spread)
        f = F.finish(q, stacked.sum(axis=1))
        everywhere = [m * e for m, e in zip(along(F, q), light, strict=True)]
        mean = combined(F, inputs, a, everywhere, light, turn=2 * np.pi).sum(axis=1) / (2 * np.pi)
    return Evaluated(stacked, f, np.full(len(inputs), np.nan), single.around, mean)


def combined(
    F: Formulas, inputs: Inputs, a: Averages, direct: Sequence[Array], spread: Sequence[Array], turn: float = 1.0
) -> Array:
    """Return the parts of f among strands, (n, lobes and back, channels).

    `direct` are the strand's own, (n, channels), `spread` the azimuthal parts of light that comes evenly over half a turn;
    or both integrated over `turn`, the azimuths.
    """
    B: Back = F.back
    q = arguments(inputs, 1)
    lit, count = np.clip(1 - q.strands, 0, 1), np.maximum(q.strands, 1)
    share, wider = B.density(q) * (1 - lit) * B.transmittance(a, count), B.spread(a, count)
    tilts, variances = [*F.tilts(q), B.shift(a)], [*F.variances(q), B.deviation(a, q) ** 2]
    back = B.backward(q) * B.direct_factor * B.energy(a) * turn
    first = [*direct, back * along(F, q, tilts[-1:], variances[-1:])[0]]
    through = along(F, q, tilts, [v + wider for v in variances])
    further = [m * s for m, s in zip(through, [*spread, B.spread_factor * back], strict=True)]
    return np.stack([lit * x + share * y for x, y in zip(first, further, strict=True)], axis=1)
