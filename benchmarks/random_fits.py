"""How well the fit does on random fibres, and whether more lobes ever do worse: ESS between nodes and rows.

For each fibre and number of lobes it prints the mean and the worst ESS over viewers on and between the table's nodes and
over strand counts on, between and past its rows; the largest weight f cos/pdf over its integral; by how much the worst viewer
of a count falls below that of fewer lobes; and the fit's seconds of the processor. docs/sampler.md has a summary.

python benchmarks/random_fits.py
python benchmarks/random_fits.py --strands 0,1,2,4,8 --lobes 4 12 16 --count 0
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

import cuticle

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


def qualities(sampler: cuticle.Sampler, model: cuticle.DualScattering) -> tuple[NDArray, NDArray]:
    """Return ESS and largest weight, (counts, viewers)."""
    found = [
        [(q.ess, q.largest_weight) for q in (cuticle.measure(sampler, model.with_strands(n), float(t), n) for t in VIEWERS)]
        for n in COUNTS
    ]
    ess, weight = np.moveaxis(np.array(found), 2, 0)
    return ess, weight


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
        model.eval(0.0, 0.0, 3.0)  # its tables are no part of the fit's time
        for k in lobes:
            start = time.process_time()
            sampler = cuticle.fit(model, k, strands=strands).sampler
            seconds = time.process_time() - start
            ess, weight = qualities(sampler, model)
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
