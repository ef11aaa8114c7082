"""Print the single-precision approximations of include/cuticle/math.h: minimax in relative error.

erf as x P(x²)/Q(x²) on |x| ≤ 4, exp on ±½ ln 2, log as r P(r) with r = m - 1 for m from √½ to √2, and sin on [0, pi/2],
each by linear least squares, reweighted where the error is largest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

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


def rational_erf(limit: float = 4.0, degree: int = 5, rounds: int = 400) -> tuple[float, Array, Array]:
    """Return the largest relative error, P and Q, lowest degree first; Q's own size reweights each round."""
    x = limit * np.cos(np.linspace(0, np.pi / 2, 4001))[:-1]
    x = x[x > 1e-4]
    y, powers = erf(x), ((x / limit) ** 2)[:, None] ** np.arange(degree + 1)
    weight, denominator = np.ones_like(x), np.ones_like(x)
    best = (np.inf, np.empty(0), np.empty(0))
    for _ in range(rounds):
        columns = np.hstack([x[:, None] * powers, -y[:, None] * powers[:, 1:]]) * (weight / denominator)[:, None]
        c = np.linalg.lstsq(columns, y * weight / denominator, rcond=None)[0]
        p, q = c[: degree + 1], np.concatenate([[1.0], c[degree + 1 :]])
        denominator = powers @ q
        error = np.abs((x * (powers @ p) / denominator - y) / y)
        if error.max() < best[0]:
            best = (float(error.max()), p, q)
        weight *= 1 + 0.5 * error / error.max()
        weight /= weight.mean()
    scale = limit ** (2 * np.arange(degree + 1))
    return best[0], best[1] / scale, best[2] / scale


def tell(name: str, error: float, **parts: Array) -> None:
    print(f"{name}: largest relative error {error:.2g} before rounding; highest degree first")
    for part, c in parts.items():
        print(f"  {part}:", ", ".join(f"{v:.9g}f" for v in c[::-1].astype(np.float32)))


def main() -> None:
    error, p, q = rational_erf()
    tell("erf(x) = x P(x²)/Q(x²), |x| ≤ 4", error, P=p, Q=q)
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
