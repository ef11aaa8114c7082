"""Print the single-precision approximations of include/cuticle/math/functions.h and erf.h: minimax in relative error.

erf as x P(x²)/Q(x²) on |x| ≤ 4 and, coarser, 3.7, erfc as exp(-x²) t P(t) with t = 1/(1 + x/2), the tail of erfinv, exp on
±½ ln 2, log as r P(r) with r = m - 1 for m from √½ to √2, and sin on [0, pi/2], each by least squares, reweighted where the
error is largest.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.chebyshev import cheb2poly, chebvander
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import erf, erfcinv, erfcx

Array = NDArray[np.float64]


def minimax(columns: Array, y: Array, rounds: int = 400) -> tuple[float, Array]:
    """Return the largest relative error and the coefficients of columns @ c ≈ y."""
    weight, best = np.ones_like(y), (np.inf, np.empty(0))
    for _ in range(rounds):
        c = np.linalg.lstsq(columns * (weight / y)[:, None], weight, rcond=None)[0]
        error = np.abs(columns @ c / y - 1)
        if error.max() < best[0]:
            best = (float(error.max()), c)
        weight *= 1 + 0.5 * error / error.max()
        weight /= weight.mean()
    return best


def rational_erf(limit: float, over: int, under: int, rounds: int = 200) -> tuple[float, Array, Array]:
    """Return the largest relative error, P and Q of degrees `over` and `under`, lowest first.

    In Chebyshev's polynomials of x², by nonlinear least squares from the linear form's solution, reweighted where the error
    is largest.
    """
    x = limit * np.cos(np.linspace(0, np.pi / 2, 3001))[:-1]
    x = x[x > 1e-4]
    y, t = erf(x) / x, 2 * (x / limit) ** 2 - 1
    tops, bottoms = chebvander(t, over), chebvander(t, under)[:, 1:]
    top = slice(over + 1)

    def split(c: Array) -> tuple[Array, Array]:
        return tops @ c[top], 1 + bottoms @ c[over + 1 :]

    denominator = np.ones_like(x)
    for _ in range(30):
        columns = np.hstack([tops, -y[:, None] * bottoms]) / (denominator * y)[:, None]
        c = np.linalg.lstsq(columns, 1 / denominator, rcond=None)[0]
        denominator = split(c)[1]
    weight, best = np.ones_like(x), (np.inf, c)
    for _ in range(rounds):

        def residual(c: Array, root: Array) -> Array:
            p, q = split(c)
            return 1e6 * root * (p / (q * y) - 1)

        def slope(c: Array, root: Array) -> Array:
            p, q = split(c)
            return 1e6 * root[:, None] * np.hstack([tops / (q * y)[:, None], -bottoms * (p / (q * q * y))[:, None]])

        c = least_squares(residual, c, slope, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15, args=(np.sqrt(weight),)).x
        p, q = split(c)
        error = np.abs(p / (q * y) - 1)
        if error.max() < best[0]:
            best = (float(error.max()), c)
        weight *= (error / error.max()) ** 0.6 + 1e-3
        weight /= weight.mean()

    def powers(chebyshev: Array) -> Array:
        return np.asarray(Polynomial(cheb2poly(chebyshev))(Polynomial([-1, 2 / limit**2])).coef)

    c = best[1]
    numerator, bottom = powers(c[top]), powers(np.concatenate([[1.0], c[over + 1 :]]))
    return best[0], numerator / bottom[0], bottom / bottom[0]


def tell(name: str, error: float, **parts: Array) -> None:
    print(f"{name}: largest relative error {error:.2g} before rounding; highest degree first")
    for part, c in parts.items():
        print(f"  {part}:", ", ".join(f"{v:.9g}f" for v in c[::-1].astype(np.float32)))


def main() -> None:
    for limit, over, under in ((4.0, 5, 5), (3.7, 4, 5)):
        error, p, q = rational_erf(limit, over, under)
        tell(f"erf(x) = x P(x²)/Q(x²), |x| ≤ {limit}", error, P=p, Q=q)
    t = 1 - 0.8 * (0.5 + 0.5 * np.cos(np.linspace(0, np.pi, 4001)))
    error, c = minimax(t[:, None] ** np.arange(7), erfcx(2 / t - 2) / t)
    tell("erfc(x) = exp(-x²) t P(t), t = 1/(1 + x/2), 0 ≤ x ≤ 8", error, P=c)
    root = np.sqrt(5) + (6.2 - np.sqrt(5)) * (0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 4001)))
    beyond = np.exp(-(root**2)) / (1 + np.sqrt(-np.expm1(-(root**2))))  # 1 - p
    error, c = minimax((root[:, None] - 4) ** np.arange(10), erfcinv(beyond) / (1 - beyond))
    tell("erfinv(p) = p P(√w - 4), w = -ln(1 - p²), 5 ≤ w ≤ 38", error, P=c)
    r = np.log(2) / 2 * 1.0001 * np.cos(np.linspace(0, np.pi, 4001))
    error, c = minimax(r[:, None] ** np.arange(6), np.exp(r))
    tell("exp(r), |r| ≤ ½ ln 2", error, P=c)
    r = -1 + 1.06066017 + 0.35355339 * np.cos(np.linspace(0, np.pi, 4000))
    error, c = minimax(r[:, None] ** np.arange(1, 9), np.log1p(r))
    tell("log(1 + r) = r P(r), √½ - 1 ≤ r ≤ √2 - 1", error, P=c)
    x = np.pi / 2 * np.cos(np.linspace(0, np.pi / 2, 4001))[:-1]
    error, c = minimax(x[:, None] ** (2 * np.arange(5) + 1), np.sin(x))
    tell("sin(x) = x P(x²), 0 ≤ x ≤ pi/2", error, P=c)


if __name__ == "__main__":
    main()
