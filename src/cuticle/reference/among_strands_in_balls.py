"""Dual scattering as Zinke et al. 2008 print it, in ball arithmetic; every error is proven."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from cuticle.reference.balls import Ball, flint, series_terms, working_precision
from cuticle.reference.inclinations import LobeEnergies, over_inclinations
from cuticle.reference.proven import (
    LOBES,
    CrossSection,
    Row,
    Values,
    absorptions,
    azimuth,
    gaussian,
    marschner,
    over_h,
    radians,
)
from cuticle.reference.triangle_wave import TriangleWave

PARTS = (*LOBES, "back")
Fibre = tuple[tuple[str, float], ...]
BITS_OF_AVERAGES = 80  # of working precision: their quadrature is far less exact


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
    arb = flint().arb
    theta_i, theta_r = arb(row["theta_i"]), arb(row["theta_r"])
    half, difference = (theta_i + theta_r) / 2, (theta_r - theta_i) / 2
    averages = _averages(fibre_of(row), row["theta_r"] - row["theta_i"])
    direct, spread = _of_the_strand(tuple(sorted(row.items())), tuple(map(tuple, sizes)))
    found = []
    for c, a in enumerate(averages):
        own, around = ([lobe[c] for lobe in x] for x in (direct, spread))
        found.append(combined(row, a, half, difference.cos(), own, around, arb(1)))
    return Values([list(part) for part in zip(*found, strict=True)], None, theta_i.cos(), PARTS)


def combined(
    row: Row, a: Averages, half: Ball, cosine: Ball, direct: Sequence[Ball], spread: Sequence[Ball], turn: Ball
) -> list[Ball]:
    """Return the parts of f in one channel, of balls or of series: R, TT and TRT, and what the strands behind send back.

    `direct` are the strand's own parts, `spread` the azimuthal parts of light that comes evenly over half a turn; or both
    integrated over `turn`, the azimuths. `half` is theta_h, `cosine` that of theta_d.
    """
    arb, pi = flint().arb, flint().arb.pi()
    lit, count, d_b = arb(min(max(1 - row["strands"], 0.0), 1.0)), arb(max(row["strands"], 1.0)), arb(row["d_b"])
    share = arb(row["d_f"]) ** 2 * (1 - lit) * (count * a.a_f.log()).exp()
    spreading = count * a.beta_f * a.beta_f

    def through(x: Ball, deviation: Ball) -> Ball:
        return gaussian(x, (deviation * deviation + spreading).sqrt()) / (cosine * cosine)

    parts = []
    for lobe, own, around in zip(LOBES, direct, spread, strict=True):
        x, beta = half - radians(row[f"alpha_{lobe}"]), radians(row[f"beta_{lobe}"])
        parts.append(lit * own + share * through(x, beta) * around)
    if not d_b > 0:
        return [*parts, 0 * half]
    back, shift, deviation = _back(a, d_b)
    own = gaussian(half - shift, deviation) / (cosine * cosine)
    return [*parts, 2 * d_b / pi * turn * back * (lit * own + share * pi * through(half - shift, deviation))]


def fibre_of(row: Row) -> Fibre:
    """Return what averages depend on, as a key."""
    return tuple(sorted((k, v) for k, v in row.items() if k[:4] in ("alph", "beta", "eta", "sigm")))


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
            x = phi - azimuth(lobe, gamma, ray.refracted(sine, cosine))
            total = arb(0)
            for k in range(-4, 5):  # turns past these lie over 14 deviations away
                d = (x - 2 * arb.pi() * k) / root
                total = total + (d + edge).erf() - (d - edge).erf()
            return [a * total / (2 * arb.pi()) for a in ray.attenuations(cosine, [lobe], closed=False)[0]]

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
def _averages(fibre: Fibre, twice: float) -> list[Averages]:
    """Return the averages of each channel at theta_d = twice/2."""
    module, energies = flint(), energies_of(fibre)
    with working_precision(BITS_OF_AVERAGES), series_terms(1):
        here = module.arb_series([module.arb(twice) / 2])
        by_lobe = [over_inclinations(energies, p, here, here[0], both_cosines) for p in range(len(LOBES))]
        return averages_of(fibre, [[s[0] for s in lobe] for lobe in by_lobe], module.arb(0))


@lru_cache(maxsize=2)
def energies_of(fibre: Fibre) -> LobeEnergies:
    """Return what each lobe sends on, and back."""
    row = dict(fibre)
    with working_precision(BITS_OF_AVERAGES):
        return LobeEnergies(row, _halves(radians(row["beta_N"])))


def both_cosines(x: Any, here: Any) -> Any:
    """Return what averages are weighted by."""
    return x * here


def averages_of(fibre: Fibre, by_lobe: Sequence[Sequence[Ball]], zero: Ball) -> list[Averages]:
    """Return the averages from the energies on, then back, of each lobe and channel."""
    row, channels, found = dict(fibre), len(by_lobe[0]) // 2, []
    for c in range(channels):
        on, back = (_moments(row, [lobe[way * channels + c] for lobe in by_lobe], zero) for way in range(2))
        found.append(Averages(on[0], back[0], on[1], back[1], on[2], back[2]))
    return found


def _moments(row: Row, energy: list[Ball], zero: Ball) -> tuple[Ball, Ball, Ball]:
    """Return the total, and the means of the lobes' shifts and widths."""
    total = sum(energy, zero)
    shift = sum((e * radians(row[f"alpha_{p}"]) for e, p in zip(energy, LOBES, strict=True)), zero)
    width = sum((e * radians(row[f"beta_{p}"]) for e, p in zip(energy, LOBES, strict=True)), zero)
    return total, shift / total, width / total


def _halves(beta: Ball) -> Callable[[int, Ball, Ball], list[Ball]]:
    """Return the shares of light that go on and back, for light even over half a turn."""
    arb, acb = flint().arb, flint().acb
    wave = TriangleWave(beta)

    def shares(lobe: int, gamma_i: Ball, gamma_t: Ball) -> list[Ball]:
        x = azimuth(lobe, gamma_i, gamma_t)
        if isinstance(x, acb):
            disc = arb(0, 1) * wave.largest(x)
            return [acb(disc, disc)] * 2
        on = wave(x)
        return [on, 1 - on]

    return shares
