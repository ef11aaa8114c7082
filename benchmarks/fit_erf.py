"""Print the coefficients of the single-precision erf in include/cuticle/math.h: x P(x²)/Q(x²) on |x| ≤ 4.

A minimax rational approximation of relative error by reweighted linear least squares.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erf

LIMIT, DEGREE = 4.0, 5


def main() -> None:
    x = LIMIT * np.cos(np.linspace(0, np.pi / 2, 4001))[:-1]
    x = x[x > 1e-4]
    s, y = x**2 / LIMIT**2, erf(x)
    powers = s[:, None] ** np.arange(DEGREE + 1)
    weight, denominator = np.ones_like(x), np.ones_like(x)
    best = (np.inf, np.empty(0), np.empty(0))
    for _ in range(400):
        columns = np.hstack([x[:, None] * powers, -y[:, None] * powers[:, 1:]]) * (weight / denominator)[:, None]
        solution = np.linalg.lstsq(columns, y * weight / denominator, rcond=None)[0]
        p, q = solution[: DEGREE + 1], np.concatenate([[1.0], solution[DEGREE + 1 :]])
        denominator = powers @ q
        error = np.abs((x * (powers @ p) / denominator - y) / y)
        if error.max() < best[0]:
            best = (error.max(), p, q)
        weight *= 1 + 0.5 * error / error.max()
        weight /= weight.mean()
    scale = LIMIT ** (2 * np.arange(DEGREE + 1))
    print(f"largest relative error {best[0]:.2g} before rounding")
    for name, c in (("P", best[1] / scale), ("Q", best[2] / scale)):
        print(f"{name}, highest degree first:", ", ".join(f"{v:.9g}f" for v in c[::-1].astype(np.float32)))


if __name__ == "__main__":
    main()
