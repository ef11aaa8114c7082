"""Integrals of Gaussian lobes over one inclination, in ball arithmetic, with proven errors.

The directional albedo of Marschner's Gaussian form and the averages of dual scattering are such integrals: at an inclination
`here`, over the other inclination x, with half = (here + x)/2 and t = (here - x)/2, which is theta_d, of

    g(half - alpha_p; beta_p) c(x)/cos² t · W_p(t),    W_p(t) = ½ ∫ A_p(t, h) share(h) dh,    c a product of two cosines.

W_p is a polynomial on each of a few panels. `here` is a Taylor series: so the integral at a point is had, or a polynomial
around it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import ceil, nextafter, pi
from typing import Any

from cuticle.reference.balls import Ball, Series, flint, integrate, quotient, series_terms
from cuticle.reference.pieces import BEYOND, Interpolated
from cuticle.reference.proven import LOBES, CrossSection, Row, absorptions, gaussian, over_h, radians

Shares = Callable[[int, Ball, Ball], Sequence[Ball]]  # of lobe, gamma_i, gamma_t
_REACH = 9  # deviations of the Gaussian that are integrated over
_GOAL, _VALUE_GOAL, _OVER_T_GOAL = 1e-15, 2.0**-53, 1e-16  # of the errors of W between its values, of those, of integrals
_WIDEST = 1.4  # deviations in a panel of t
_TOWARD_POLES = 18  # panels of t, each half as wide as the one before
_ACROSS, _STRIPS = 24, 8  # intervals of gamma, and of t, in which W is bounded


class LobeEnergies:
    """W_p of a fibre's lobes, for each of some shares and each channel.

    Parameters
    ----------
    row
        The fibre's parameters: degrees, sigma_a per radius.
    shares
        Of light at offset sin gamma_i, even in gamma, at most 1; of real and complex balls.
    """

    def __init__(self, row: Row, shares: Shares) -> None:
        arb = flint().arb
        self.tilts = [radians(row[f"alpha_{p}"]) for p in LOBES]
        self.deviations = [radians(row[f"beta_{p}"]) for p in LOBES]
        self._eta, self._sigma_a, self._shares = arb(row["eta"]), absorptions(row), shares
        self.count = len(self._scattered(arb(0), arb(0), arb(1))) // len(LOBES)  # of a lobe: shares, then channels
        top = arb(nextafter(pi / 2, 2))  # few bits, so that parts of it are exact
        self._pieces = Interpolated(self._values, self._largest, arb(0), top, _GOAL)
        right = self._pieces.ends[1:]
        self.ends = [*(-x for x in reversed(right)), arb(0), *right]  # of panels on which W is a polynomial

    def at(self, lobe: int, t: Series, between: Ball) -> list[Series]:
        """Return a lobe's W, without their errors, at a series near `between`, a point within one panel."""
        return self._pieces.at(abs(between)).at(-t if between < 0 else t, self._of(lobe))

    def off(self, lobe: int, between: Ball) -> list[Ball]:
        """Return the errors of a lobe's W at most, in the panel around a point."""
        return self._pieces.at(abs(between)).off[self._of(lobe)]

    def with_errors(self, lobe: int, t: Series, between: Ball) -> list[Series]:
        """Return a lobe's W; constants hold the errors, too."""
        here = zip(self.at(lobe, t, between), self.off(lobe, between), strict=True)
        return [w + flint().arb(0, 1) * e for w, e in here]

    def _of(self, lobe: int) -> slice:
        return slice(lobe * self.count, (lobe + 1) * self.count)

    def _scattered(self, t: Ball, gamma: Ball, cosine: Ball) -> list[Ball]:
        ray, found = CrossSection(t, self._eta, self._sigma_a), []
        refracted = ray.refracted(gamma.sin(), cosine)
        for p, passed in enumerate(ray.attenuations(cosine, range(len(LOBES)), closed=False)):
            found += [s * a for s in self._shares(p, gamma, refracted) for a in passed]
        return found

    def _values(self, t: Ball) -> list[Ball]:
        arb, sizes = flint().arb, [1.0] * (self.count * len(LOBES))
        half = over_h(lambda g, c: self._scattered(t, g, c), arb(0), arb(1), sizes, _VALUE_GOAL)
        return [2 * x for x in half]

    def _largest(self, box: Ball) -> list[Ball]:
        """Bound |W| over a box: the most of its strips."""
        module = flint()
        low, width = box.real.lower(), (box.real.upper() - box.real.lower()) / _STRIPS
        strips = [(low + k * width).union(low + (k + 1) * width) for k in range(_STRIPS)]
        bounds = [self._at_most(module.acb(strip, box.imag)) for strip in strips]
        return [max(of_strips, key=float) for of_strips in zip(*bounds, strict=True)]

    def _at_most(self, t: Ball) -> list[Ball]:
        arb, total = flint().arb, list[Ball]()
        step = arb.pi() / 2 / _ACROSS
        for k in range(_ACROSS):
            gamma = (k * step).union((k + 1) * step)
            cosine = gamma.cos()
            each = [(x * cosine).abs_upper() * step for x in self._scattered(t, gamma, cosine)]
            total = [a + b for a, b in zip(total, each, strict=True)] if total else each
        return [x.abs_upper() for x in total]


def over_inclinations(
    energies: LobeEnergies, lobe: int, here: Series, panel: Ball, cosines: Callable[[Any, Any], Any]
) -> list[Series]:
    """Return the integral of one lobe for each share and channel.

    Parameters
    ----------
    energies
        Of the fibre.
    lobe
        0, 1 or 2: R, TT or TRT.
    here
        The inclination that stays, radians, as a series. Its constant is a point of `panel`, or all of it.
    panel
        Where the series is to hold; what is left out there is in the constants. For the integral at a point, that point.
    cosines
        c, of cos x and cos `here`.

    Raises
    ------
    ArithmeticError
        `panel` is too wide.
    """
    arb, series, terms = flint().arb, flint().arb_series, flint().ctx.cap
    alpha, beta = energies.tilts[lobe], energies.deviations[lobe]
    middle, fixed = here - alpha, here.cos()
    integral = _in_bounds if here[0].rad() > BEYOND / 8 else _precisely
    found, off = [[arb(0)] * terms for _ in range(energies.count)], [arb(0)] * energies.count
    for a, b in pairwise(_ends(energies, here, panel, alpha, beta)):
        length, between = b - a, ((a[0] + b[0]) / 2).mid()

        def integrand(v: Ball, a: Series = a, length: Series = length, between: Ball = between) -> list[Ball]:
            t = a + length * v
            cosine = t.cos()
            weight = 2 * length * gaussian(middle - t, beta) * cosines((here - 2 * t).cos(), fixed)
            weight = quotient(weight, cosine * cosine)
            return [c for w in energies.at(lobe, t, between) for c in _coefficients(weight * w, terms)]

        flat = integral(integrand, energies.count * terms)
        found = [[x + y for x, y in zip(f, flat[k * terms :], strict=False)] for k, f in enumerate(found)]
        off = [x.max(y) for x, y in zip(off, energies.off(lobe, between), strict=True)]
    # dx = 2 dt, A_p is at most 1, and with t = (here - x)/2 no cosine is over 2 cos t: so much is outside the reach, and
    # what W is off counts as much.
    most, tail = arb(0, 8), (arb(_REACH) / arb(2).sqrt()).erfc()
    for coefficients, x in zip(found, off, strict=True):
        coefficients[0] += most * (tail + x)
    return [series(x) for x in found]


def _ends(energies: LobeEnergies, here: Series, panel: Ball, alpha: Ball, beta: Ball) -> list[Series]:
    """Return ends of panels of t, each within one of W's: of the reach, or where x is at a pole, which moves with `here`.

    They are the same for all of `panel`, but for those that move.
    """
    arb, series = flint().arb, flint().arb_series
    lowest, highest = ((panel - side * arb.pi() / 2) / 2 for side in (1, -1))
    low, high = (panel - alpha - _REACH * beta).lower(), (panel - alpha + _REACH * beta).upper()
    if high < lowest or low > highest:
        return []
    low, high = low.min(highest.lower()), high.max(lowest.upper())
    from_pole, to_pole = not low > lowest, not high < highest
    first, last = lowest if from_pole else low, highest if to_pole else high
    kept = [x for x in energies.ends if x > first.lower() + BEYOND and x < last.upper() - BEYOND]
    if not all(x > first.upper() - BEYOND and x < last.lower() + BEYOND for x in kept):
        raise ArithmeticError("the pole moves from one of W's panels to another: halve the panel of inclinations")
    more = [arb(x) for x in toward_poles(_TOWARD_POLES)]  # cos t vanishes there
    for a, b in pairwise(energies.ends):
        parts = ceil(float((b - a) / (_WIDEST * beta)))
        more += [a + (b - a) * k / parts for k in range(1, parts)]
    kept += [x for x in more if x > first and x < last]
    return [
        (here - arb.pi() / 2) / 2 if from_pole else series([low]),
        *(series([x]) for x in sorted(kept, key=float)),
        (here + arb.pi() / 2) / 2 if to_pole else series([high]),
    ]


def _precisely(f: Callable[[Ball], list[Ball]], count: int) -> list[Ball]:
    """Return the integral of f over [0, 1]."""
    return integrate(f, flint().arb(0), flint().arb(1), [1.0] * count, _OVER_T_GOAL)


def _in_bounds(f: Callable[[Ball], list[Ball]], count: int) -> list[Ball]:
    """Return balls that hold the integral of f over [0, 1], for an f that is itself known in bounds."""
    arb, steps = flint().arb, 4
    each = [f((arb(k) / steps).union(arb(k + 1) / steps)) for k in range(steps)]
    return [sum(x, arb(0)) / steps for x in zip(*each, strict=True)]


def toward_poles(count: int) -> list[float]:
    """Return ends of panels toward both poles, each panel half as wide as the one before."""
    return [side * (pi / 2 - 2.0**-k) for k in range(1, count + 1) for side in (1, -1)]


def _coefficients(x: Series, terms: int) -> list[Ball]:
    return [x[k] for k in range(terms)]


def gaussian_energies(row: Row) -> list[list[Ball]]:
    """Return the integral of each lobe's part of f cos theta_i over directions, [lobe][channel].

    Of Marschner's Gaussian form. Over phi, the integral of N_p is ½ ∫ A_p dh.
    """
    module = flint()
    one, here = module.arb(1), module.arb_series([module.arb(row["theta_r"])])
    energies = LobeEnergies(row, lambda *_: [one])
    with series_terms(1):
        found = [over_inclinations(energies, p, here, here[0], lambda x, _: x * x) for p in range(len(LOBES))]
    return [[s[0] for s in of_lobe] for of_lobe in found]
