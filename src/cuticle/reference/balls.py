"""Ball arithmetic (Arb, by python-flint) and a quadrature whose error is proven.

A ball is a number with a radius; what is computed from balls is a ball that holds the true result. Nothing here or in
`proven.py` calls the C++ core.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import lru_cache
from typing import Any

from cuticle._support.extras import needed

Ball = Any  # flint.arb, or flint.acb where a complex argument is needed
Series = Any  # flint.arb_series
Integrand = Callable[[Ball], Sequence[Ball]]

BITS = 128  # of working precision; values are told to DIGITS
DIGITS = 25
GOAL = 2.0**-66  # of a quadrature: its error over the size that the caller expects
_ORDERS = (6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 64)  # of Gauss-Legendre rules
RHO = 2.5  # of the Bernstein ellipse in which the integrand is bounded
DEEPEST = 60  # halvings of a panel
# Of each order: what its error is at most, over half the panel's length times the largest value in the ellipse.
DECAYS = tuple((n, 64 / 15 * RHO ** (-2 * n) / (1 - RHO**-2)) for n in _ORDERS)


@lru_cache(maxsize=1)
def flint() -> Any:
    """Return the module `flint`, or raise the one line that says how to install it."""
    with needed("the reference"):
        import flint as module
    return module


def working_precision(bits: int = BITS) -> AbstractContextManager[None]:
    """Within this context, balls have so many bits."""
    return _with("prec", bits)


def series_terms(terms: int) -> AbstractContextManager[None]:
    """Within this context, series have so many terms."""
    return _with("cap", terms)


@contextmanager
def _with(setting: str, value: int) -> Iterator[None]:
    context = flint().ctx
    before = getattr(context, setting)
    setattr(context, setting, value)
    try:
        yield
    finally:
        setattr(context, setting, before)


def root(x: Ball) -> Ball:
    """Return the square root; not finite for a complex ball that meets its cut."""
    return x.sqrt() if isinstance(x, flint().arb) else x.sqrt(analytic=True)


def square(x: Ball) -> Ball:
    """Return x². Of a wide real ball, or a box's sides, no square is taken for negative."""
    if not isinstance(x, flint().arb):
        return flint().acb(square(x.real) - square(x.imag), 2 * x.real * x.imag)
    if x.rad() < 1e-6:
        return x * x
    low, high = x.abs_lower(), x.abs_upper()
    return (low * low).union(high * high)


def quotient(a: Series, b: Series) -> Series:
    """Return a/b; not finite where b may be 0, where python-flint raises an error."""
    return a * flint().arb("nan") if b[0].contains(0) else a / b


def told(ball: Ball) -> tuple[str, str]:
    """Return a ball as decimal text of `DIGITS` digits, and a bound of how far that is from what the ball holds."""
    arb = flint().arb
    if not ball.is_finite():
        raise ArithmeticError("a reference value has no finite bound; more bits are needed")
    text = ball.mid().str(DIGITS, radius=False)
    off = float((arb(text) - ball).abs_upper().str(6, radius=False)) * (1 + 1e-5)
    return text, f"{off * 1.06:.1e}" if off else "0"  # rounded to two digits, never below `off`


def rule(order: int) -> list[tuple[Ball, Ball]]:
    """Return the nodes in [-1, 1] and weights of a Gauss-Legendre rule, at the working precision."""
    return _rule(order, flint().ctx.prec)


@lru_cache(maxsize=64)
def _rule(order: int, bits: int) -> list[tuple[Ball, Ball]]:
    arb = flint().arb
    return [arb.legendre_p_root(order, k, weight=True) for k in range(order)]


def ellipse(low: Ball, high: Ball) -> Ball:
    """Return a box around the ellipse of foci `low` and `high` whose half axes sum to RHO times half their distance."""
    arb, r = flint().arb, (high - low) / 2
    across, up = r * (RHO + 1 / RHO) / 2, r * (RHO - 1 / RHO) / 2
    return flint().acb((low + high) / 2 + arb(0, 1) * across, arb(0, 1) * up)


def least_order(largest: Sequence[Ball], goals: Sequence[float], size: Ball) -> tuple[int, float] | None:
    """Return the least order for which `size` times its decay times the largest values meets all goals, and that decay.

    None if there is none, or a value is not finite.
    """
    if not all(m.is_finite() for m in largest):
        return None
    worst = max(float(m) / g for m, g in zip(largest, goals, strict=True)) * float(size)
    return next(((n, d) for n, d in DECAYS if d * worst <= 1), None)


def integrate(f: Integrand, a: Ball, b: Ball, sizes: Sequence[float], goal: float = GOAL) -> list[Ball]:
    """Return balls around the integrals of the components of f over [a, b].

    Gauss-Legendre rules on panels. If f is analytic in the ellipse of foci at a panel's ends and sum of half axes rho times
    half its length r, and at most m there, the rule of n points is off by at most r (64/15) m rho^-2n / (1 - rho^-2)
    (Trefethen, "Is Gauss quadrature better than Clenshaw-Curtis?", 2008, Theorem 4.5). m is had by evaluating f on a box
    around the ellipse, in balls; panels are halved until some order suffices.

    Parameters
    ----------
    f
        Takes a real or complex ball and returns one for each component; not finite where it is not analytic.
    a, b
        The ends, exact.
    sizes
        About how large each integral is. They steer the effort only: the radius of what is returned is true for any.
    goal
        Of the errors, out of the sizes; it steers the effort, too.
    """
    arb, matrix = flint().arb, flint().arb_mat
    goals = [max(s, 1e-300) * goal for s in sizes]
    total = [arb(0)] * len(goals)
    todo = [(a, b, 0)]
    whole = b - a
    while todo:
        low, high, depth = todo.pop()
        middle, r = (low + high) / 2, (high - low) / 2
        largest = [value.abs_upper() for value in f(ellipse(low, high))]
        needed = least_order(largest, goals, whole / 2)
        if needed is None:
            if depth >= DEEPEST:
                raise ArithmeticError("a quadrature did not converge: the integrand is not smooth on its panel")
            todo += [(low, middle, depth + 1), (middle, high, depth + 1)]
            continue
        order, factor = needed
        nodes, weights = zip(*rule(order), strict=True)
        sums = (matrix([weights]) * matrix([list(f(middle + r * x)) for x in nodes])).entries()
        for k, (value, m) in enumerate(zip(sums, largest, strict=True)):
            total[k] += r * value + arb(0, 1) * (r * m * arb(factor) * 1.000001)
    return total
