"""Fitted lobes beside the obvious alternatives for a fibre's far field: ESS, memory, cost and efficiency.

The scattering function is one strand's (`cuticle.Marschner`): energy-conserving for brown, blond and black, Gaussian for the
document fibre, as its preset has it. Beside lobes: the uniform sphere; the function's own lobes after d'Eon, Marschner and
Hanika 2013 (benchmarks/alternatives.h); a table of 64 × 128 cells of theta_i and |phi| for each of 25 viewers, the densities
of two viewers mixed. Costs are medians of interleaved rounds on one thread (g++ -O3 -march=native, if not told) in
calibration kernels, 16 expf calls, timed in the same rounds. Whether the alternatives draw what their pdf says is checked as
well.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.integrate import cumulative_trapezoid

import cuticle
from compiled import compiled
from cuticle.fitting.costs import traced_cost
from cuticle.sampling.quality import MEASURED_AT, UniformSphere, measure
from cuticle.scattering.bcsdf import luminance

LOBES = (1, 2, 4, 8, 16)
VIEWERS, THETAS, PHIS = 25, 64, 128
PATH_COST = traced_cost(0) - traced_cost(0, path=0)  # kernels to trace and shade one ray: an assumption
out = Console() if sys.stdout.isatty() else Console(width=124)


def single(name: str) -> cuticle.Marschner:
    fibre = cuticle.Fibre.preset(name)
    return cuticle.Marschner(fibre, "gaussian" if fibre.formulation == "zinke2008" else "energy_conserving")


def write_input(path: Path, model: cuticle.Marschner, samplers: list[cuticle.Sampler]) -> dict[str, int]:
    """Write what alternatives.cpp reads; return the bytes of each alternative's tables."""
    n = np.moveaxis(luminance(np.asarray(model.tables.direct)), 2, 0)  # (lobes, rows, columns)
    step = np.pi / (n.shape[2] - 1)
    sums = cumulative_trapezoid(n, dx=step, axis=2, initial=0)
    viewers = np.clip(np.linspace(-np.pi / 2, np.pi / 2, VIEWERS), -1.56, 1.56)
    mass = np.array([_cells(model, float(t)) for t in viewers])
    rows, columns = np.cumsum(mass.sum(axis=2), axis=1), np.cumsum(mass / mass.sum(axis=2, keepdims=True), axis=2)
    with open(path, "wb") as file:

        def integers(*values: int) -> None:
            file.write(np.array(values, np.int32).tobytes())

        def numbers(values: object, kind: type = np.float32) -> None:
            file.write(np.ascontiguousarray(values, kind).tobytes())

        numbers(model.fibre.alpha)
        numbers(model.fibre.beta)
        integers(int(model.longitudinal == "energy_conserving"), n.shape[1], n.shape[2])
        numbers(n)
        numbers(sums)
        integers(VIEWERS, THETAS, PHIS)
        for array in (mass, rows, columns):
            numbers(array)
        integers(len(samplers))
        for s in samplers:
            count, nodes, _, lobes = s.nodes.shape
            integers(lobes, count, nodes, int(s.even))
            for array in (s.nodes, s.energy, s.strands):
                numbers(array, np.float64)
    return {"d'Eon": 8 * n.size, "table": 4 * (2 * mass.size + rows.size), "uniform": 0}


def _cells(model: cuticle.Marschner, theta_r: float) -> NDArray[np.float64]:
    """Probabilities of the cells: four by four points in each."""
    fine = 4
    theta = ((np.arange(THETAS * fine) + 0.5) / (THETAS * fine) - 0.5) * np.pi
    phi = (np.arange(PHIS * fine) + 0.5) / (PHIS * fine) * np.pi
    f = luminance(model.eval(theta[:, None], theta_r, phi)) * np.cos(theta)[:, None] ** 2
    mass = f.reshape(THETAS, fine, PHIS, fine).sum(axis=(1, 3))
    return mass / mass.sum()


class Compiled:
    """One of the alternatives' densities, from the program that is timed."""

    def __init__(self, program: Path, data: Path, name: str) -> None:
        self.command, self.folder = [str(program), str(data), "pdf", name], data.parent

    def pdf(self, theta_i: object, theta_r: object, phi: object, strands: object = None) -> NDArray[np.float64]:
        arrays = np.broadcast_arrays(theta_i, theta_r, phi)
        points = np.stack([np.ravel(a) for a in arrays], axis=1).astype(np.float32)
        points.tofile(self.folder / "points")
        subprocess.run([*self.command, str(self.folder / "points"), str(self.folder / "out")], check=True)
        return np.fromfile(self.folder / "out", np.float32).astype(float).reshape(arrays[0].shape)


def integral(density: Compiled) -> float:
    """∫ of the function that alternatives.cpp averages over samples, over a density, at theta_r 0.4."""
    theta = ((np.arange(2000) + 0.5) / 2000 - 0.5) * np.pi
    phi = ((np.arange(1000) + 0.5) / 1000 - 0.5) * 2 * np.pi
    p = density.pdf(theta[:, None], 0.4, phi) * np.cos(theta)[:, None]
    function = np.exp(-8 * (theta[:, None] + 0.3) ** 2) * (1 + np.cos(phi))
    return float((p * function).sum() * np.pi / 2000 * 2 * np.pi / 1000)


def run(name: str, rounds: int, march: str) -> dict[str, object]:
    model = single(name)
    fits = {k: cuticle.fit(model, k) for k in LOBES}
    samplers = [f.sampler for f in fits.values()]
    dual = cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset(name)), 4, strands=(0, 1, 2, 4, 8)).sampler
    with tempfile.TemporaryDirectory() as folder:
        program, data = compiled("alternatives", folder, f"-march={march}"), Path(folder) / "input"
        memory = write_input(data, model, [*samplers, dual])
        done = subprocess.run([str(program), str(data), "time", str(rounds)], check=True, capture_output=True, text=True)
        costs = json.loads(done.stdout)
        densities: dict[str, object] = {"uniform": UniformSphere()}
        densities |= {n: Compiled(program, data, n) for n in ("d'Eon", "table")}
        for n in ("d'Eon", "table"):
            expected = integral(densities[n])  # type: ignore[arg-type]
            if not abs(costs[f"{n} mean"] - expected) <= 0.01 * expected:
                sys.exit(f"{n}: samples average {costs[f'{n} mean']:.4f}, its density says {expected:.4f}")
        inner = MEASURED_AT[np.abs(MEASURED_AT) <= np.radians(75.01)] + np.radians(2)  # between the tables' viewers
        ess = {n: [measure(d, model, float(t)).ess for t in inner] for n, d in densities.items()}  # type: ignore[arg-type]
        ess |= {f"K={k}": [measure(f.sampler, model, float(t)).ess for t in inner] for k, f in fits.items()}
    memory |= {f"K={k}": 4 * (f.sampler.nodes.size + f.sampler.energy.size) for k, f in fits.items()}
    return {"costs": costs, "ess": ess, "memory": memory, "name": name}


def tell(result: dict[str, object]) -> None:
    costs, ess, memory = result["costs"], result["ess"], result["memory"]
    unit = costs["calibration"]
    table = Table(
        box=box.SIMPLE_HEAD, title=f"{result['name']}, far field: |theta_r| ≤ 77°, costs in kernels of {unit:.1f} ns"
    )
    for column in ("sampler", "ESS mean", "worst", "table, bytes", "sample", "pdf", "ESS/sample", "ESS/(sample + path)"):
        table.add_column(column, justify="left" if column == "sampler" else "right")
    for n in ("uniform", "table", "d'Eon", *(f"K={k}" for k in LOBES)):
        suffix = " float" if n.startswith("K") else ""
        sample, pdf = (costs[f"{n}{suffix} {what}"] / unit for what in ("sample", "pdf"))
        mean = float(np.mean(ess[n]))
        table.add_row(
            n, f"{mean:.3f}", f"{min(ess[n]):.3f}", f"{memory[n]:,}", f"{sample:.2f}", f"{pdf:.2f}", f"{mean / sample:.2f}",
            f"{1000 * mean / (sample + PATH_COST):.2f}e-3",
        )  # fmt: skip
    out.print(table)


def tell_costs(costs: dict[str, float]) -> None:
    unit = costs["calibration"]
    title = "Lobes: cost in calibration kernels. batch: arrays of 65,536, a viewer each; viewer: one for all of them"
    table = Table(box=box.SIMPLE_HEAD, title=title)
    columns = (
        "float pdf", "float sample", "double pdf", "double sample", "batch pdf", "batch sample", "prepared pdf",
        "viewer pdf", "viewer sample",
    )  # fmt: skip
    for column in ("", *columns):
        table.add_column(column, justify="right" if column else "left")
    for name in (*(f"K={k}" for k in LOBES), "K=4, n=2"):
        table.add_row(name, *(f"{costs[f'{name} {c}'] / unit:.2f}" for c in columns))
    out.print(table)
    each = [costs[f"K=4, n=2 each {what}"] / unit for what in ("pdf", "sample")]
    out.print(f"K=4, batch with 0 to 8 strands, a number each: pdf {each[0]:.2f}, sample {each[1]:.2f}")


def picture(results: list[dict[str, object]], path: Path) -> None:
    """Cost against K, and efficiency with a path, as a figure."""
    ink, paper, accent = "#e8e6e3", "#14161a", "#ffb45c"
    figure = Figure(figsize=(11, 4.1), facecolor=paper, dpi=150)
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.35])
    costs = results[0]["costs"]
    unit = costs["calibration"]
    lines = {"sample": ("float sample", accent, "-"), "pdf": ("float pdf", "#5aa9ff", "-"),
             "sample, batch": ("batch sample", accent, ":"), "pdf, batch": ("batch pdf", "#5aa9ff", ":")}  # fmt: skip
    for label, (key, color, style) in lines.items():
        left.plot(LOBES, [costs[f"K={k} {key}"] / unit for k in LOBES], style, marker="o", ms=4, color=color, label=label)
    left.set_xscale("log", base=2)
    left.set_xticks(LOBES, [str(k) for k in LOBES])
    left.set_xlabel("lobes K", color=ink)
    left.set_ylabel("calibration kernels (16 expf)", color=ink)
    left.set_ylim(0)
    left.set_title("What one more lobe costs", color=ink, fontsize=11)
    left.legend(facecolor=paper, edgecolor="#2b3440", labelcolor=ink, fontsize=8)
    names = ["uniform", "table", "d'Eon", "K=1", "K=4", "K=8"]
    width = 0.8 / len(results)
    shades = ["#ffb45c", "#c06bd0", "#5aa9ff", "#7fe0ae"]
    for j, result in enumerate(results):
        heights = []
        for n in names:
            suffix = " float" if n.startswith("K") else ""
            sample = result["costs"][f"{n}{suffix} sample"] / result["costs"]["calibration"]
            heights.append(float(np.mean(result["ess"][n])) * PATH_COST / (sample + PATH_COST))
        x = np.arange(len(names)) + (j - (len(results) - 1) / 2) * width
        right.bar(x, heights, width * 0.92, color=shades[j], label=result["name"])
    right.set_xticks(np.arange(len(names)), names)
    right.set_ylabel("perfect samples, for the time of one path", color=ink)
    right.set_ylim(0, 1.22)
    right.set_yticks(np.arange(0, 1.01, 0.2))
    right.set_title(f"Efficiency with a path of {PATH_COST:g} kernels a sample", color=ink, fontsize=11)
    right.legend(facecolor=paper, edgecolor="#2b3440", labelcolor=ink, fontsize=8, ncols=4, loc="upper center")
    for axes in (left, right):
        axes.set_facecolor(paper)
        axes.tick_params(colors=ink)
        axes.grid(axis="y", color="#2b3440", lw=0.6)
        axes.set_axisbelow(True)
        for spine in axes.spines.values():
            spine.set_color("#2b3440")
    figure.tight_layout()
    figure.savefig(path, facecolor=paper)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fibres", default="document,brown,blond,black", help="presets, with commas between")
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--march", default="native", help="the compiler's -march, x86-64 for what runs on all of them")
    parser.add_argument("--picture", type=Path, help="also draw the results there")
    arguments = parser.parse_args()
    results = [run(name, arguments.rounds, arguments.march) for name in arguments.fibres.split(",")]
    for result in results:
        tell(result)
    tell_costs(results[0]["costs"])
    if arguments.picture:
        picture(results, arguments.picture)


if __name__ == "__main__":
    main()
