"""Costs and effective sample sizes, as tables.

Costs are medians of interleaved rounds on one thread in single precision (g++ -O3 -march=native), as multiples of a
calibration kernel timed in the same rounds: 16 independent expf calls on varying inputs. Efficiency is ESS over cost.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from datetime import date
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

import cuticle
from compiled import ROOT, compiled
from cuticle.cli.tables import ess_text
from cuticle.fitting.costs import MEASURED
from cuticle.sampling.quality import MEASURED_AT, UniformSphere
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.through_strands import through_tables

STRANDS = (0.0, 1.0, 2.0, 4.0, 8.0)
LOBES = (1, 2, 4, 8, 16)
out = Console() if sys.stdout.isatty() else Console(width=110)


def write_input(path: Path, cases: list[tuple[str, Sampler, float]], model: cuticle.DualScattering) -> None:
    """Write what bench.cpp reads: tables of lobes, then the scattering function's tables."""
    with open(path, "wb") as file:

        def integers(*values: int) -> None:
            file.write(np.array(values, np.int32).tobytes())

        def reals(values: object) -> None:
            file.write(np.asarray(values, np.float32).tobytes())

        integers(len(cases))
        for label, sampler, strands in cases:
            rows, theta_nodes, _, lobes = sampler.nodes.shape
            integers(lobes, rows, theta_nodes, int(sampler.even))
            reals(sampler.nodes)
            reals(sampler.energy)
            reals(sampler.strands)
            reals(strands)
            text = label.encode()
            integers(len(text))
            file.write(text)
        tables, fibre = model.single.tables, model.fibre
        rows, columns, _, channels = tables.direct.shape
        through = through_tables(fibre)
        integers(rows, columns, channels, *(t.shape[2] for t in through[:3]), through.azimuth.shape[3])
        for table in (tables.direct, *through[:4], fibre.alpha, fibre.beta):
            reals(table)
        reals([through.limit, fibre.d_f, fibre.d_b])


def costs(
    cases: list[tuple[str, Sampler, float]], model: cuticle.DualScattering, rounds: int, family: str = "NormalLobes"
) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        program, data = (
            compiled("bench", folder, "-march=native", "-pthread", f"-DBENCH_FAMILY={family}"),
            Path(folder) / "input",
        )
        write_input(data, cases, model)
        done = subprocess.run([str(program), str(data), str(rounds)], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def write_costs(found: dict[str, float]) -> None:
    """Write what `cuticle.fitting.costs` reads: samples of direct light, with where they were measured."""
    unit = found["calibration"]
    version = subprocess.run(["g++", "-dumpfullversion"], capture_output=True, text=True, check=False).stdout.strip()
    kept = {
        "origin": f"benchmarks/bench.py, single precision, one thread, g++ {version} -O3 -march=native, {date.today()}",
        "uniform": round(found["uniform sphere sample"] / unit, 3),
        "lobes": {str(k): round(found[f"K={k}, direct sample"] / unit, 3) for k in LOBES},
    }
    path = ROOT / "src/cuticle/fitting" / MEASURED
    path.write_text(json.dumps(kept, indent=1) + "\n")
    out.print(f"wrote {path.relative_to(ROOT)}")


def mean_ess(sampler: object, model: cuticle.DualScattering, strands: float) -> tuple[float, float, float]:
    own = model.with_strands(strands)
    ess = np.array([cuticle.measure(sampler, own, float(t), strands).ess for t in MEASURED_AT])  # type: ignore[arg-type]
    inner = np.abs(MEASURED_AT) <= np.radians(75.01)
    return float(ess[inner].mean()), float(ess[inner].min()), float(ess[~inner].min())


def python_sample(sampler: Sampler, count: int = 10_000_000) -> float:
    """Nanoseconds a sample of one Python call over arrays, best of five."""
    rng = np.random.default_rng(1)
    theta_r, u = rng.uniform(-1.5, 1.5, 4096).astype(np.float32), rng.random((count, 3), np.float32)
    theta_r = np.resize(theta_r, count)
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        sampler.sample(theta_r, u, 2)
        best = min(best, time.perf_counter() - start)
    return best / count * 1e9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fibre", default="document", help="a preset")
    parser.add_argument("--rounds", type=int, default=301)
    parser.add_argument("--write", action="store_true", help="keep the costs of samples as the package's own")
    arguments = parser.parse_args()
    fibre = cuticle.Fibre.preset(arguments.fibre)
    model = cuticle.DualScattering(fibre)
    cuticle.fit(model, 1)  # tables are made once a fibre: not part of a fit's time
    fits = {k: cuticle.fit(model, k, strands=STRANDS) for k in LOBES}
    document = cuticle.fit(model, form="document", strands=STRANDS)

    cases = [(f"K={k}, {label}", fits[k].sampler, n) for k in LOBES for label, n in (("direct", 0.0), ("n=3", 3.0))]
    cases.append(("K=4, n=0.5", fits[4].sampler, 0.5))  # where two mixtures are blended
    cases.append(("document, direct", document.sampler, 0.0))
    found = costs(cases, cuticle.DualScattering(fibre, formulation="exact"), arguments.rounds)
    unit = found["calibration"]
    table = Table(
        box=box.SIMPLE_HEAD,
        title=f"Cost in calibration kernels ({unit:.1f} ns here): float, one thread; n=3 lies between two rows",
    )
    for column in ("", "pdf", "sample with pdf", "pdf, lobes prepared"):
        table.add_column(column, justify="left" if not column else "right")
    for label, *_ in cases:
        row = [found[f"{label} {what}"] / unit for what in ("pdf", "sample", "pdf, prepared")]
        table.add_row(label, *(f"{x:.2f}" for x in row))
    table.add_row("uniform sphere", "0.00", f"{found['uniform sphere sample'] / unit:.2f}", "")
    out.print(table)
    if arguments.write:
        write_costs(found)
    for name in ("eval, direct", "eval, 2 strands"):
        out.print(f"{name}, exact transport: {found[name] / unit:.2f}")

    table = Table(
        box=box.SIMPLE_HEAD,
        title=f"ESS for the {arguments.fibre} fibre: mean over |theta_r| ≤ 75°, worst there, worst at ±85°",
    )
    table.add_column("sampler")
    for n in STRANDS:
        table.add_column(f"{n:g} strands", justify="right")
    table.add_column("direct ESS/cost", justify="right")
    table.add_column("fit, s", justify="right")
    samplers: list[tuple[str, object, float, str]] = [
        ("uniform sphere", UniformSphere(), found["uniform sphere sample"], "")
    ]
    samplers.append(("document's form", document.sampler, found["document, direct sample"], f"{document.seconds:.2f}"))
    samplers += [(f"{k} lobes", f.sampler, found[f"K={k}, direct sample"], f"{f.seconds:.2f}") for k, f in fits.items()]
    for name, sampler, nanoseconds, seconds in samplers:
        ess = [mean_ess(sampler, model, n) for n in STRANDS]
        efficiency = ess[0][0] / (nanoseconds / unit)
        table.add_row(
            name,
            *(" ".join(map(ess_text, e)) for e in ess),
            f"{efficiency:.2f}",
            seconds,
        )
    out.print(table)
    python = python_sample(fits[4].sampler)
    loops = found["all cores, sample"]
    out.print(f"Python sample of 1e7, K = 4: {100 * loops / python:.0f} % of what all cores' C++ loops give")


if __name__ == "__main__":
    main()
