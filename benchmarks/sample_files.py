"""How often `cuticle audit` flags a right file of samples, and how often a wrong one: prints the rates in docs/audit.md.

    python benchmarks/sample_files.py [FILES]

The documentation has the rates of 500 files of each kind, a fifth of them at 60,000 rows and a tenth of wrong ones: five
minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

import cuticle
from cuticle.checking.patches import follows

Samples = tuple[np.ndarray, np.ndarray, np.ndarray]  # theta, phi, pdf
Draw = Callable[[int, np.random.Generator], Samples]


def near(low: float, high: float, *, pdf_of: float = 1.0) -> Draw:
    """Return what draws from a random near field, and has the pdf of another whose beta_M is `pdf_of` times as large."""

    def draw(n: int, rng: np.random.Generator) -> Samples:
        beta_m, beta_n, eumelanin = rng.uniform(low, high), rng.uniform(low, high), rng.uniform(0.1, 3)
        h, theta_r = rng.uniform(-0.9, 0.9), rng.uniform(-1.4, 1.4)
        drawn, told = (cuticle.Chiang(beta_m=k * beta_m, beta_n=beta_n, eumelanin=eumelanin).near(h) for k in (1.0, pdf_of))
        theta, phi, _ = drawn.sample(theta_r, rng.random((n, 3)))
        return np.array(theta), np.array(phi), np.array(told.pdf(theta, theta_r, phi))

    return draw


def fitted(name: str) -> Draw:
    """Return what draws from four lobes fitted to a preset."""
    sampler = cuticle.fit(cuticle.Marschner(cuticle.Fibre.preset(name)), 4).sampler
    return lambda n, rng: tuple(map(np.array, sampler.sample(rng.uniform(-1.4, 1.4), rng.random((n, 3)))))  # type: ignore[return-value]


def hemisphere(n: int, rng: np.random.Generator) -> Samples:
    """Draw half a sphere by the cosine."""
    z, a = np.sqrt(rng.random(n)), rng.uniform(-np.pi, np.pi, n)
    y = np.sqrt(1 - z**2) * np.sin(a)
    return np.arcsin(y), np.arctan2(z, np.sqrt(1 - z**2) * np.cos(a)), z / np.pi


def uniform(n: int, rng: np.random.Generator) -> Samples:
    """Draw the sphere."""
    return np.arcsin(rng.uniform(-1, 1, n)), rng.uniform(-np.pi, np.pi, n), np.full(n, 1 / (4 * np.pi))


def shuffled(draw: Draw) -> Draw:
    """Return what gives each sample the pdf of another."""

    def wrong(n: int, rng: np.random.Generator) -> Samples:
        theta, phi, pdf = draw(n, rng)
        return theta, phi, rng.permutation(pdf)

    return wrong


def scaled(draw: Draw, factor: float) -> Draw:
    """Return what tells a pdf off by a factor."""

    def wrong(n: int, rng: np.random.Generator) -> Samples:
        theta, phi, pdf = draw(n, rng)
        return theta, phi, factor * pdf

    return wrong


SHARP, MIDDLE, ROUGH = near(0.1, 0.3), near(0.3, 0.6), near(0.6, 0.95)
WRONG = {
    "shuffled, sharp": shuffled(SHARP),
    "shuffled, middle": shuffled(MIDDLE),
    "shuffled, rough": shuffled(ROUGH),
    "shuffled, hemisphere": shuffled(hemisphere),
    "pdf x 1.1": scaled(near(0.3, 0.9), 1.1),
    "pdf x 0.9": scaled(near(0.3, 0.9), 0.9),
    "pdf of 1.2 beta_M": near(0.2, 0.4, pdf_of=1.2),
}


def p_values(draw: Draw, rows: int, files: int, rng: np.random.Generator) -> np.ndarray:
    """Return the p-value of each file."""
    return np.array([follows(*draw(rows, rng), rows, rng).p_value for _ in range(files)])


def main() -> None:
    """Print a row for each kind of file."""
    files = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    rng = np.random.default_rng(5)
    right = {
        "sharp": SHARP, "middle": MIDDLE, "rough": ROUGH, "brown, 4 lobes": fitted("brown"), "hemisphere": hemisphere,
        "uniform": uniform,
    }  # fmt: skip
    print("right: share of files with a p-value of at most", *(LEVELS := (0.1, 0.01, 1e-3, 1e-4)))
    for rows in (2_000, 6_000, 60_000):
        for name, draw in right.items():
            p = p_values(draw, rows, files if rows < 60_000 else -(-files // 5), rng)
            print(
                f"{rows:>6} rows, {name:<16}",
                *(f"{(p <= level).mean():.4f}" for level in LEVELS),
                f"of {len(p)}",
                flush=True,
            )
    print("wrong: share of files of 6,000 rows that are found at 1e-4")
    for name, draw in WRONG.items():
        p = p_values(draw, 6_000, -(-files // 10), rng)
        print(f"{name:<22}", f"{(p <= 1e-4).mean():.2f} of {len(p)}", flush=True)


if __name__ == "__main__":
    main()
