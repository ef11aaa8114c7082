"""The directional albedo of dual scattering as printed, in ball arithmetic; its error is proven.

Over phi, N_p and N^G_p sum to W_p (`inclinations`). What is left is an integral over t = theta_d, theta_i = theta_r - 2t.
The averages are Taylor polynomials on panels, with balls for their errors, and so is the integrand.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi

from cuticle.reference.among_strands_in_balls import (
    BITS_OF_AVERAGES,
    Fibre,
    averages_of,
    both_cosines,
    combined,
    energies_of,
    fibre_of,
)
from cuticle.reference.balls import Ball, Series, flint, working_precision
from cuticle.reference.inclinations import over_inclinations, toward_poles
from cuticle.reference.pieces import BEYOND, Piece, expanded, integrated
from cuticle.reference.proven import LOBES, Row, absorptions, gaussian, luminance_weights

FURTHEST = 1.5706  # of theta_r
_GOAL = 1e-13  # of the remainders of averages
_ERROR = 1e-11  # of the remainder of the albedo, out of it
_TOWARD_POLES = 14  # panels, each half as wide as the one before: up to 6e-5 from a pole


class _NoSumError(Exception):
    """A fibre sends on all light that it gets, or more."""


def albedo(row: Row) -> Ball | None:
    """Return the luminance of the integral of f cos theta_i over directions; |theta_r| is `FURTHEST` at most.

    None where there is none: where at some theta_d a fibre sends on all light that it gets, the light behind has no sum.
    """
    arb = flint().arb
    with working_precision(BITS_OF_AVERAGES):
        theta_r = arb(row["theta_r"])
        low, high = (((theta_r - side * arb.pi() / 2) / 2).mid() for side in (1, -1))
        light = _Light(row, low, high)
        ends = [low, *_apart(light.ends, low, high), high]
        try:
            found = integrated(light, ends, _ERROR)
            if found.rad() > 10 * _ERROR * found.mid():
                found = integrated(light, ends, _ERROR * float(found.mid()))
        except _NoSumError:
            return None
        return found + arb(0, 1) * 2.0**-75  # the first end and the last are rounded, and cos theta_i is as small there


class _Light:
    """The integrand, a function of theta_d in [low, high]."""

    def __init__(self, row: Row, low: Ball, high: Ball) -> None:
        arb = flint().arb
        self._row, self._fibre, self._theta_r = row, fibre_of(row), arb(row["theta_r"])
        self._energies = energies_of(self._fibre)
        self._averages = [_averages_between(self._fibre, p, low, high) for p in range(len(LOBES))]
        self._weights = luminance_weights(len(absorptions(row)))
        self.ends = [*self._energies.ends, *(p.middle + p.half for pieces in self._averages for p in pieces)]

    def __call__(self, t: Series) -> Series:
        arb, at, channels = flint().arb, t[0].mid(), len(self._weights)
        energies, by_lobe = [], []
        for p, pieces in enumerate(self._averages):
            both_ways = self._energies.with_errors(p, t, at)
            energies.append([on + back for on, back in zip(both_ways[:channels], both_ways[channels:], strict=True)])
            piece = next(x for x in pieces if at <= x.middle + x.half)
            by_lobe.append([x + arb(0, 1) * e for x, e in zip(piece.at(t), piece.off, strict=True)])
        averages = averages_of(self._fibre, by_lobe, 0 * t)
        if self._row["d_b"] > 0 and any(a.a_f[0].lower() >= 1 for a in averages):
            raise _NoSumError
        light, cosine, half = 0 * t, t.cos(), self._theta_r - t
        for c, (weight, a) in enumerate(zip(self._weights, averages, strict=True)):
            spread = [e[c] for e in energies]
            own = zip(spread, self._energies.tilts, self._energies.deviations, strict=True)
            direct = [e * gaussian(half - tilt, beta) / (cosine * cosine) for e, tilt, beta in own]
            light = light + weight * sum(combined(self._row, a, half, cosine, direct, spread, 2 * arb.pi()), 0 * t)
        into = (self._theta_r - 2 * t).cos()
        return 2 * light * into * into


def _averages_between(fibre: Fibre, lobe: int, low: Ball, high: Ball) -> list[Piece]:
    """Return a lobe's energies on and back, for each channel, over an interval of theta_d."""
    ends = _ends(fibre)
    within = [k for k in range(len(ends) - 1) if ends[k + 1] > low and ends[k] < high]
    return [piece for k in within for piece in _averages_on(fibre, lobe, k)]


@lru_cache(maxsize=512)
def _averages_on(fibre: Fibre, lobe: int, k: int) -> list[Piece]:
    energies = energies_of(fibre)

    def averages(here: Series, panel: Ball) -> list[Series]:
        return over_inclinations(energies, lobe, here, panel, both_cosines)

    return list(expanded(averages, _ends(fibre)[k : k + 2], _GOAL))


@lru_cache(maxsize=16)
def _ends(fibre: Fibre) -> list[Ball]:
    """Return ends of panels of theta_d: where x at a pole is at one of W's ends, and ever closer to the poles."""
    arb = flint().arb
    toward = toward_poles(_TOWARD_POLES)
    at_pole = [float(2 * x) - side * pi / 2 for x in energies_of(fibre).ends for side in (1, -1)]
    first, last = arb(min(toward)), arb(max(toward))
    return [first, *_apart([arb(x) for x in (*at_pole, *toward)], first, last), last]


def _apart(ends: list[Ball], low: Ball, high: Ball) -> list[Ball]:
    """Return those between low and high that are not the same but for rounding."""
    kept = [low]
    for x in sorted(ends, key=float):
        if x > kept[-1] + BEYOND / 8 and x < high - BEYOND / 8:
            kept.append(x)
    return kept[1:]
