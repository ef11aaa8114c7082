"""How well the fit does on random fibres, and whether more lobes ever do worse: ESS between nodes and rows.

For each fibre and number of lobes it prints the mean and the worst ESS over viewers on and between the table's nodes and
over strand counts on and between its rows; the largest weight f cos/pdf over its integral; by how much the worst viewer of a
count falls below that of fewer lobes; and the fit's seconds of the processor. docs/sampler.md has a summary.

python benchmarks/random_fits.py
python benchmarks/random_fits.py --strands 0,1,2,4,8 --lobes 4 12 16 --count 0
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import cuticle
from cuticle._support.quadrature import Grid, adapted_edges, grid
from cuticle.scattering.bcsdf import evaluate, luminance

VIEWERS = np.radians([-87, -83.3, -78.75, -63.7, -41, -22.5, 3.75, 33.75, 50, 72, 82.5, 86])
COUNTS = (0, 0.5, 1, 1.4, 3, 5, 8, 10, 12, 16, 20, 26, 32, 45, 64)
PRESETS = ("blond", "brown", "black", "marschner", "document")
KNOWN = {  # fibres that fits of the past did badly at
    "tilted": cuticle.Fibre(
        alpha_R=3.8035647528376035, beta_R=6.865855388280174, beta_N=20.035567641838835, eta=1.4348309590403527,
        sigma_a=(4.140462103699315, 2.0372631817897005, 1.2203469554889044),
    ),
}  # fmt: skip


def random_fibres(count: int, seed: int) -> Iterator[tuple[str, cuticle.Fibre]]:
    """Return fibres over the whole range of hair: absorptions are log-uniform, and vary by channel."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        absorption = np.clip(np.exp(rng.uniform(np.log(0.01), np.log(5)) + rng.normal(0, 0.5, 3)), 0.01, 5)
        yield (
            f"{seed}.{i}",
            cuticle.Fibre(
                alpha_R=rng.uniform(-12, 5), beta_R=rng.uniform(3, 25), beta_N=rng.uniform(2, 30), eta=rng.uniform(1.4, 1.7),
                sigma_a=tuple(absorption),
            ),
        )  # fmt: skip


class Seen(NamedTuple):
    """f cos of one viewer and count on a grid that follows it, as shares of its integral per d theta d phi."""

    strands: float
    theta_r: float
    theta: NDArray
    phi: NDArray
    weights: NDArray
    density: NDArray

    def quality(self, sampler: cuticle.Sampler) -> tuple[float, float]:
        """Return ESS and largest weight."""
        p = sampler.pdf(self.theta[:, None], self.theta_r, self.phi, self.strands) * 2 * np.cos(self.theta)[:, None]
        ratio = self.density / np.maximum(p, 1e-30)
        return 1 / float((self.weights * self.density * ratio).sum()), float(ratio.max())


def views(model: cuticle.DualScattering) -> list[Seen]:
    """Return what all viewers see through all counts; an even function, on phi from 0 to pi."""
    seen = []
    for n in COUNTS:
        own = model.with_strands(n)
        for t in VIEWERS:

            def f_cos(g: Grid, own: cuticle.DualScattering = own, t: float = float(t)) -> NDArray:
                return luminance(evaluate(own, g.theta, t, g.phi)) * np.cos(g.theta)[:, None]

            g = grid(*adapted_edges(f_cos, even=True, coarse=(150, 36), fine=(60, 40)), 2)
            f = f_cos(g)
            seen.append(Seen(n, float(t), g.theta, g.phi, g.weights, f / (g.weights * f).sum()))
    return seen


def row(fit_seconds: float, ess: NDArray, weight: NDArray, before: NDArray | None) -> str:
    """Return a line of the table."""
    k, j = np.unravel_index(int(np.argmin(ess)), ess.shape)
    place = f"n = {COUNTS[k]:g}, {np.degrees(VIEWERS[j]):.1f}°"
    lost = "" if before is None else f"{max(float((before.min(axis=1) - ess.min(axis=1)).max()), 0.0):.4f}"
    return f"{ess.mean():.4f} | {ess.min():.4f} | {place} | {weight.max():.1f} | {lost} | {fit_seconds:.1f} |"


def compare(fibres: Sequence[tuple[str, cuticle.Fibre]], lobes: Sequence[int], strands: Sequence[float] | str) -> None:
    """Print a line for each fibre and number of lobes, and one for each number of lobes over all fibres."""
    print("| fibre | K | mean ESS | worst | where | largest weight | below fewer lobes | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    every: dict[int, list[tuple[float, NDArray, NDArray, NDArray | None]]] = {k: [] for k in lobes}
    for name, fibre in fibres:
        model, before = cuticle.DualScattering(fibre), None
        seen = views(model)
        for k in lobes:
            start = time.process_time()
            sampler = cuticle.fit(model, k, strands=strands).sampler
            seconds = time.process_time() - start
            ess, weight = np.array([v.quality(sampler) for v in seen]).T.reshape(2, len(COUNTS), -1)
            every[k].append((seconds, ess, weight, before))
            print(f"| {name} | {k} | {row(*every[k][-1])}", flush=True)
            before = ess
    for k, found in every.items():
        seconds, ess, weight = (np.array([f[i] for f in found]) for i in range(3))
        falls = [float((b.min(axis=1) - e.min(axis=1)).max()) for _, e, _, b in found if b is not None]
        bad, heavy = (ess.min(axis=(1, 2)) < 0.98).sum(), (weight.max(axis=(1, 2)) > 50).sum()
        print(
            f"K = {k}, {len(ess)} fibres: mean ESS {ess.mean():.4f}, worst {ess.min():.4f}, {bad} below .98; largest weight"
            f" {weight.max():.1f}, {heavy} above 50; at most {max(falls, default=0):.4f} below fewer lobes;"
            f" {np.mean(seconds):.1f} s, at most {seconds.max():.1f} s"
        )
        print("  worst by count: " + ", ".join(f"{n:g}: {e:.4f}" for n, e in zip(COUNTS, ess.min(axis=(0, 2)), strict=True)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=25, help="random fibres")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lobes", type=int, nargs="*", default=[2, 4, 8])
    parser.add_argument("--strands", default="auto", help="the table's rows")
    parser.add_argument("fibres", nargs="*", help="of those, by name; default: all")
    arguments = parser.parse_args()
    fibres = [(name, cuticle.Fibre.preset(name)) for name in PRESETS] + list(KNOWN.items())
    fibres += list(random_fibres(arguments.count, arguments.seed))
    fibres = [(name, fibre) for name, fibre in fibres if not arguments.fibres or name in arguments.fibres]
    rows = arguments.strands
    compare(fibres, arguments.lobes, rows if rows == "auto" else [float(n) for n in rows.split(",")])


if __name__ == "__main__":
    main()
