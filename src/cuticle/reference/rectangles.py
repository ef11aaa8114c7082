"""A quadrature over two variables in ball arithmetic whose error is proven: Gauss-Legendre rules on rectangles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cuticle.reference.balls import DEEPEST, Ball, Integrand, ellipse, flint, least_order, rule

Section = Callable[[Ball], Integrand]  # of x: the integrand as a function of y
GOAL = 2.0**-40  # of the error, over the size that the caller expects
Range = tuple[Ball, Ball]


def integrate_over_rectangle(section: Section, x: Range, y: Range, sizes: Sequence[float]) -> list[Ball]:
    """Return balls around the integrals of the components of f(x, y) = section(x)(y) over a rectangle.

    On a rectangle of half sides a and b, the product of the rules of m and n points is off by at most
    2 b e(a, m) + 2 a e(b, n), where e is the bound of `balls.integrate` for one variable: the first with the largest value
    of f for x in the ellipse around its side and y real, the second with x real and y in its ellipse. Both are had by
    evaluating f on boxes, in balls. Rectangles are halved along the variable for which no order suffices; where that is
    both, along x.

    Parameters
    ----------
    section
        Takes x, a real or complex ball, and returns a function of y, which returns a ball for each component; not finite
        where f is not analytic. It is called once for each node of x.
    x, y
        The ends, exact.
    sizes
        About how large each integral is. They steer the effort only: the radius of what is returned is true for any.
    """
    arb = flint().arb
    goals = [max(s, 1e-300) * GOAL for s in sizes]
    area = (x[1] - x[0]) * (y[1] - y[0])
    total = [arb(0)] * len(goals)
    todo = [(x, y, 0)]
    while todo:
        (left, right), (low, high), depth = todo.pop()
        across, up = left.union(right), low.union(high)
        along_x = [v.abs_upper() for v in section(ellipse(left, right))(up)]
        along_y = [v.abs_upper() for v in section(across)(ellipse(low, high))]
        of_x, of_y = (least_order(largest, goals, area) for largest in (along_x, along_y))  # each half of the error
        if of_x is None or of_y is None:
            if depth >= 2 * DEEPEST:
                raise ArithmeticError("a quadrature did not converge: the integrand is not smooth on its rectangle")
            if of_x is None:
                middle = (left + right) / 2
                todo += [((left, middle), (low, high), depth + 1), ((middle, right), (low, high), depth + 1)]
            else:
                middle = (low + high) / 2
                todo += [((left, right), (low, middle), depth + 1), ((left, right), (middle, high), depth + 1)]
            continue
        sums = _product(section, (left, right), (low, high), (of_x[0], of_y[0]), len(goals))
        quarter = (right - left) * (high - low) / 4
        for k, (s, m_x, m_y) in enumerate(zip(sums, along_x, along_y, strict=True)):
            off = 2 * (m_x * of_x[1] + m_y * of_y[1])
            total[k] += quarter * (s + arb(0, 1) * off * 1.000001)
    return total


def _product(section: Section, x: Range, y: Range, orders: tuple[int, int], count: int) -> list[Ball]:
    """Return the sum of the product rule on [-1, 1]²."""
    (left, right), (low, high) = x, y
    a, b = (right - left) / 2, (high - low) / 2
    total = [flint().arb(0)] * count
    nodes = [((low + high) / 2 + b * node, weight) for node, weight in rule(orders[1])]
    for node, weight in rule(orders[0]):
        inner = section((left + right) / 2 + a * node)
        sums = [flint().arb(0)] * count
        for at, w in nodes:
            for k, value in enumerate(inner(at)):
                sums[k] += w * value
        for k, s in enumerate(sums):
            total[k] += weight * s
    return total
