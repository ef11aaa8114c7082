"""Dual scattering as Zinke et al. 2008 print it, in ball arithmetic; the averages' quadrature error is estimated.

What is proven: rounding, N^G_p and the strand's own scattering. What is estimated: the double integrals of the averages,
from Gauss-Legendre rules of two orders; each value's radius holds eight times the difference that they make.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, pi
from typing import NamedTuple

from cuticle.reference.balls import Ball, flint, rule
from cuticle.reference.proven import CrossSection, Row, Values, absorptions, azimuth, gaussian, marschner, over_h, radians

LOBES = ("R", "TT", "TRT")
PARTS = (*LOBES, "back")
_ORDERS = ((40, 14), (48, 18))  # over the Gaussian, and over each panel of the width
_REACH = 11  # deviations of a Gaussian that are integrated over
_KINKS, _FAR = 8, 13  # half turns on either side; deviations past which a kink is sharp
_WIDEST = 1.5  # panel of the width, in deviations of D
_SAFETY = 8


class Averages(NamedTuple):
    """Energies on and back, their mean shifts and widths, for one channel."""

    a_f: Ball
    a_b: Ball
    alpha_f: Ball
    alpha_b: Ball
    beta_f: Ball
    beta_b: Ball


def dual_scattering(row: Row, sizes: Sequence[Sequence[float]]) -> Values:
    """Return f and its parts: R, TT, TRT, lit or through strands, and what the strands behind send back."""
    first, second = (_parts(row, sizes, order) for order in _ORDERS)
    wide = flint().arb(0, 1) * _SAFETY
    parts = [
        [b + wide * (b - a).abs_upper() for a, b in zip(*pair, strict=True)] for pair in zip(first, second, strict=True)
    ]
    return Values(parts, None, flint().arb(row["theta_i"]).cos(), PARTS)


def _parts(row: Row, sizes: Sequence[Sequence[float]], orders: tuple[int, int]) -> list[list[Ball]]:
    arb = flint().arb
    theta_i, theta_r, d_b, n = (arb(row[k]) for k in ("theta_i", "theta_r", "d_b", "strands"))
    half, difference = (theta_i + theta_r) / 2, (theta_r - theta_i) / 2
    fibre = tuple(sorted((k, v) for k, v in row.items() if k[:4] in ("alph", "beta", "eta", "sigm")))
    averages = _averages(fibre, row["theta_r"] - row["theta_i"], orders)
    lit = min(max(1 - row["strands"], 0.0), 1.0)
    count = n if row["strands"] > 1 else arb(1)
    direct, spread = _of_the_strand(tuple(sorted(row.items())), tuple(map(tuple, sizes)))
    parts: list[list[Ball]] = [[] for _ in PARTS]
    for c, a in enumerate(averages):
        share = arb(row["d_f"]) ** 2 * (1 - arb(lit)) * a.a_f**count
        for p, lobe in enumerate(LOBES):
            width = (radians(row[f"beta_{lobe}"]) ** 2 + count * a.beta_f**2).sqrt()
            m = gaussian(half - radians(row[f"alpha_{lobe}"]), width) / difference.cos() ** 2
            parts[p].append(lit * direct[p][c] + share * m * spread[p][c])
        back, shift, deviation = _back(a, d_b)
        m = gaussian(half - shift, deviation) / difference.cos() ** 2
        through = gaussian(half - shift, (deviation**2 + count * a.beta_f**2).sqrt()) / difference.cos() ** 2
        f_back = 2 * d_b * back / arb.pi()
        parts[3].append(lit * f_back * m + share * arb.pi() * f_back * through)
    return parts


@lru_cache(maxsize=4)
def _of_the_strand(given: tuple[tuple[str, float], ...], sizes: tuple[tuple[float, ...], ...]) -> tuple[list, list]:
    """Return the parts of the strand on its own, and N^G_p, the mean of N_p over half a turn: [lobe][channel]."""
    arb, row = flint().arb, dict(given)
    phi, beta = arb(row["phi"]), radians(row["beta_N"])
    direct = marschner(row, sizes, conserving=False).parts
    ray = CrossSection((arb(row["theta_r"]) - arb(row["theta_i"])) / 2, arb(row["eta"]), absorptions(row))
    root = beta * arb(2).sqrt()
    edge, left_out = arb.pi() / 2 / root, arb(14 / 2**0.5).erfc()

    def mean(lobe: int) -> list[Ball]:
        def value(gamma: Ball, cosine: Ball) -> list[Ball]:
            sine = gamma.sin()
            x = phi - azimuth(lobe, gamma, ray.refracted(sine))
            total = arb(0)
            for k in range(-4, 5):  # turns past these lie over 14 deviations away
                d = (x - 2 * arb.pi() * k) / root
                total = total + (d + edge).erf() - (d - edge).erf()
            return [a * total / (2 * arb.pi()) for a in ray.attenuations(sine, cosine, lobe, closed=False)]

        return [x + arb(0, 1) * 4 * left_out for x in over_h(value, arb(-1), arb(1), [0.05] * len(ray.sigma_a))]

    return direct, [mean(p) for p in range(3)]


def _back(a: Averages, d_b: Ball) -> tuple[Ball, Ball, Ball]:
    """Return A_b, its shift and its deviation, as printed."""
    f2, b2 = a.a_f**2, a.a_b**2
    q = 1 - f2
    energy = a.a_b * f2 / q + a.a_b * b2 * f2 / q**3
    shift = a.alpha_b * (1 - 2 * b2 / q**2) + a.alpha_f * (2 * q**2 + 4 * f2 * b2) / q**3
    first, second = 2 * a.beta_f**2 + a.beta_b**2, 2 * a.beta_f**2 + 3 * a.beta_b**2
    cubed = a.a_b * b2
    top = a.a_b * first.sqrt() + cubed * second.sqrt()
    return energy, shift, (1 + d_b * f2) * top / (a.a_b + cubed * (2 * a.beta_f + 3 * a.beta_b))


@lru_cache(maxsize=16)
def _averages(fibre: tuple[tuple[str, float], ...], twice: float, orders: tuple[int, int]) -> list[Averages]:
    """Return the averages of each channel at theta_d = twice/2: integrals over the other inclination and over the width."""
    arb, row = flint().arb, dict(fibre)
    here, eta, sigma_a = arb(twice) / 2, arb(row["eta"]), absorptions(row)
    on: list[list[Ball]] = []
    off: list[list[Ball]] = []
    for p, lobe in enumerate(LOBES):
        alpha, beta = radians(row[f"alpha_{lobe}"]), radians(row[f"beta_{lobe}"])
        low = (2 * (alpha - _REACH * beta) - here).max(-arb.pi() / 2)
        high = (2 * (alpha + _REACH * beta) - here).min(arb.pi() / 2)
        forward, backward = [arb(0)] * len(sigma_a), [arb(0)] * len(sigma_a)
        for node, weight in rule(orders[0]) if high > low else ():
            other = (low + high) / 2 + (high - low) / 2 * node
            difference = (here - other) / 2
            m = gaussian((other + here) / 2 - alpha, beta) / difference.cos() ** 2
            factor = weight * (high - low) / 2 * m * other.cos() * here.cos()
            ray = CrossSection(difference, eta, sigma_a)
            for c, (f, b) in enumerate(_halves(ray, p, radians(row["beta_N"]), orders[1])):
                forward[c] += factor * f
                backward[c] += factor * b
        on.append(forward)
        off.append(backward)
    found = []
    for c in range(len(sigma_a)):
        (a_f, alpha_f, beta_f), (a_b, alpha_b, beta_b) = (_moments(row, [e[c] for e in energy]) for energy in (on, off))
        found.append(Averages(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b))
    return found


def _moments(row: Row, energy: list[Ball]) -> tuple[Ball, Ball, Ball]:
    """Return the total, and the means of the lobes' shifts and widths."""
    total = sum(energy, flint().arb(0))
    shift = sum((e * radians(row[f"alpha_{p}"]) for e, p in zip(energy, LOBES, strict=True)), flint().arb(0))
    width = sum((e * radians(row[f"beta_{p}"]) for e, p in zip(energy, LOBES, strict=True)), flint().arb(0))
    return total, shift / total, width / total


def _halves(ray: CrossSection, lobe: int, beta: Ball, order: int) -> list[tuple[Ball, Ball]]:
    """Return N_p's energy that goes on and back, for light even over half a turn, of each channel: twice the half h >= 0."""
    arb = flint().arb
    panels = max(3, ceil(pi / 2 / (_WIDEST * float(beta.mid()))))
    step = arb.pi() / 2 / panels
    found = [(arb(0), arb(0))] * len(ray.sigma_a)
    for k in range(panels):
        for node, weight in rule(order):
            gamma = step * (k + (1 + node) / 2)
            sine, cosine = gamma.sin_cos()
            on = _triangle(azimuth(lobe, gamma, ray.refracted(sine)) - (2 * arb.pi() if lobe == 2 else 0), beta)
            w = weight * step / 2 * cosine
            for c, a in enumerate(ray.attenuations(sine, cosine, lobe, closed=False)):
                light = w * a
                found[c] = found[c][0] + light * on, found[c][1] + light * (1 - on)
    return found


def _triangle(x: Ball, beta: Ball) -> Ball:
    """Return |x|/pi, periodic, smoothed by a normal distribution of deviation beta."""
    arb = flint().arb
    total = arb(0)
    for k in range(-_KINKS, _KINKS + 1):
        d = x - k * arb.pi()
        smooth = abs(d)
        if smooth < _FAR * beta:
            smooth = (
                d * (d / (beta * arb(2).sqrt())).erf() + beta * (2 / arb.pi()).sqrt() * (-d * d / (2 * beta * beta)).exp()
            )
        total += smooth if k % 2 == 0 else -smooth
    return total / arb.pi() - _KINKS
