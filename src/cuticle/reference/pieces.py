"""Functions of one variable as polynomials on panels, in ball arithmetic, with proven errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
from math import log, pi
from typing import Any, NamedTuple

from cuticle.reference.balls import DEEPEST, RHO, Ball, Series, ellipse, flint, series_terms, working_precision

_TERMS = 30  # of a Taylor polynomial
_SUMMED = 16  # of one that is integrated
_ORDERS = (8, 12, 16, 20, 24, 28, 32, 36, 40)
BEYOND = 1e-8  # a panel's ends: radii of balls are rounded to 30 bits
Functions = Callable[[Ball], Sequence[Ball]]


class Piece(NamedTuple):
    """Functions on one panel, and `BEYOND` its ends: polynomials, and how far off they are at most."""

    middle: Ball
    half: Ball
    polynomials: list[Any]  # of (x - middle)/half
    off: list[Ball]

    def at(self, x: Series, some: slice = slice(None)) -> list[Series]:
        """Return some of the polynomials of a series whose constant lies in the panel, not what they are off."""
        module, u = flint(), ((x - self.middle) / self.half).coeffs()
        real = isinstance(x, module.arb_series)
        poly, series = (module.arb_poly, module.arb_series) if real else (module.acb_poly, module.acb_series)
        if len(u) < 2:  # faster
            return [series([poly(p)(sum(u))]) for p in self.polynomials[some]]
        return [series(poly(p)(poly(u)).coeffs()) for p in self.polynomials[some]]


class Interpolated:
    """Functions on an interval by their values at Chebyshev points of panels, each made when it is first asked for.

    If f is analytic and at most m in the ellipse of foci at a panel's ends and sum of half axes rho times half its length,
    the polynomial through n + 1 points is off by at most 4 m q^-n/(q - 1), q = rho on the panel (Trefethen, "Approximation
    Theory and Approximation Practice", 2013, Theorem 8.2) and, by the same proof, q = rho/s in the ellipse of sum s. Errors
    of its values count 2 ln(n + 1)/pi + 1 times at most (Theorem 15.2). Panels are halved until some n suffices.

    Parameters
    ----------
    values
        Of the functions at a real ball.
    largest
        Bounds of their absolute values over a complex box; not finite where one is not analytic.
    low, high
        The ends, exact.
    goal
        Of the error of interpolation.
    """

    def __init__(self, values: Functions, largest: Functions, low: Ball, high: Ball, goal: float) -> None:
        self._values = values
        self._made: dict[int, Piece] = {}
        self._panels, todo = [], [(low, high, 0)]
        while todo:
            a, b, depth = todo.pop()
            bounds = [x.abs_upper() for x in largest(ellipse(a, b))]
            most = max(float(x) if x.is_finite() else float("inf") for x in bounds)
            beyond = 2 * BEYOND / float(b - a)
            q = RHO / (1 + beyond + (3 * beyond) ** 0.5)
            off = {n: 4 * q**-n / (q - 1) for n in _ORDERS}
            n = next((n for n in _ORDERS if off[n] * most <= goal), None)
            if n is not None:
                self._panels.append((a, b, n, [off[n] * 1.000001 * x for x in bounds]))
            elif depth >= DEEPEST:
                raise ArithmeticError("an interpolation did not converge: a function is not smooth on its panel")
            else:
                middle = (a + b) / 2
                todo += [(middle, b, depth + 1), (a, middle, depth + 1)]
        self.ends = [low, *(b for _, b, _, _ in self._panels)]

    def at(self, x: Ball) -> Piece:
        """Return the panel around a point."""
        k = next(k for k, end in enumerate(self.ends[1:]) if x <= end)
        if k not in self._made:
            self._made[k] = _on_panel(self._values, *self._panels[k])
        return self._made[k]


def expanded(functions: Callable[[Series, Ball], Sequence[Series]], ends: Sequence[Ball], goal: float) -> Iterator[Piece]:
    """Yield functions as Taylor polynomials, panel by panel from left to right.

    Constants that hold errors make the polynomials' constants balls: for each x there is another one in them.

    Parameters
    ----------
    functions
        Of a series and a panel, of which its constant is the middle or all. They are the same functions for both, and may
        raise ArithmeticError where the panel is too wide.
    ends
        Increasing, exact; panels between them are halved until the remainder meets the goal.
    goal
        Of the remainder.
    """
    module = flint()
    todo = [(a, b, 0) for a, b in pairwise(ends)][::-1]
    while todo:
        low, high, depth = todo.pop()
        half, panel = (high - low) / 2, low.union(high) + module.arb(0, BEYOND / 2)
        with series_terms(_TERMS + 1):
            try:
                whole = functions(module.arb_series([panel, half]), panel)
            except ArithmeticError:
                whole = [module.arb_series([module.arb("nan")] * (_TERMS + 1))]
        remainders = {n: [s[n].abs_upper() for s in whole] for n in range(1, _TERMS + 1)}
        terms = next((n for n, rest in remainders.items() if all(x <= goal for x in rest)), None)
        if terms is not None:
            middle = ((low + high) / 2).mid()
            with series_terms(terms):
                found = functions(module.arb_series([middle, half]), panel)
            beyond = (1 + BEYOND / half) ** terms
            rest = [x * beyond for x in remainders[terms]]
            yield Piece(middle, half, [module.arb_poly(s.coeffs()) for s in found], rest)
        elif depth >= DEEPEST:
            raise ArithmeticError("a Taylor series did not converge: a function is not smooth on its panel")
        else:
            middle = (low + high) / 2
            todo += [(middle, high, depth + 1), (low, middle, depth + 1)]


def integrated(f: Callable[[Series], Series], ends: Sequence[Ball], goal: float) -> Ball:
    """Return a ball around the integral of f from the first of `ends` to the last.

    On a panel f is its Taylor polynomial and a remainder: the next coefficient, somewhere in the panel. Radii of
    coefficients add up, whatever the powers' signs: a constant in f that is known up to a radius may be another at each x.

    Parameters
    ----------
    f
        Of a series whose constant is a point, or a whole panel; then it may raise ArithmeticError or ValueError, which is
        what python-flint has for a division by a ball around 0.
    ends
        Increasing, exact; panels between them are halved until remainders meet the goal.
    goal
        Of the error.
    """
    module, total = flint(), flint().arb(0)
    todo, whole = [(a, b, 0) for a, b in pairwise(ends)], float(ends[-1] - ends[0])
    while todo:
        low, high, depth = todo.pop()
        half, middle = (high - low) / 2, ((low + high) / 2).mid()
        with series_terms(_SUMMED + 1):
            try:
                rest = 2 * f(module.arb_series([low.union(high), half]))[_SUMMED].abs_upper() * half
            except (ArithmeticError, ValueError):
                rest = module.arb("nan")
        if rest <= goal * float(2 * half) / whole:
            with series_terms(_SUMMED):
                polynomial = module.arb_poly(f(module.arb_series([middle, half])).coeffs()).integral()
            total += half * (polynomial(1) - polynomial(-1)) + module.arb(0, 1) * rest
        elif depth >= DEEPEST:
            raise ArithmeticError("a quadrature did not converge: the integrand is not smooth on its panel")
        else:
            todo += [(low, middle, depth + 1), (middle, high, depth + 1)]
    return total


def _on_panel(values: Functions, low: Ball, high: Ball, n: int, between: list[Ball]) -> Piece:
    module = flint()
    middle, half = (low + high) / 2, (high - low) / 2
    at_points = [values(middle + half * u) for u in _points(n)]
    with working_precision(3 * module.ctx.prec):  # powers of such a polynomial largely cancel
        powers = _to_powers(n, module.ctx.prec) * module.arb_mat([[v.mid() for v in row] for row in at_points])
    factor = 2 * log(n + 1) / pi + 1.001
    off = [x + factor * max((row[k].rad() for row in at_points), key=float) for k, x in enumerate(between)]
    polynomials = [module.arb_poly([powers[i, k] for i in range(n + 1)]) for k in range(len(between))]
    return Piece(middle, half, polynomials, off)


def _points(n: int) -> list[Ball]:
    arb = flint().arb
    return [(arb.pi() * j / n).cos() for j in range(n + 1)]


@lru_cache(maxsize=32)
def _to_powers(n: int, bits: int) -> Any:
    """Return the matrix from values at Chebyshev points to coefficients of powers."""
    module = flint()
    arb = module.arb
    ends = [arb("0.5") if j in (0, n) else arb(1) for j in range(n + 1)]
    to_chebyshev = module.arb_mat(
        [[2 * ends[k] * ends[j] * (arb.pi() * j * k / n).cos() / n for j in range(n + 1)] for k in range(n + 1)]
    )
    powers = [[arb(module.fmpz_poly.chebyshev_t(k)[i]) for k in range(n + 1)] for i in range(n + 1)]
    return module.arb_mat(powers) * to_chebyshev
