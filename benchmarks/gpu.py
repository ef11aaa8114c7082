"""Samples a second of exported CUDA on a GPU, beside a kernel that only draws and writes as many random numbers.

Needs nvcc (CUDA's toolkit, or the packages nvidia-cuda-nvcc, nvidia-nvvm, nvidia-cuda-crt, nvidia-cuda-runtime) and a GPU;
with --compile-only no GPU.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cuticle
from cuticle.export import export

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from conformance.hosts import nvcc, nvcc_command  # noqa: E402

KEYS = ("pdf", "sample", "sample, two rows", "sample, one viewer", "bounce")
FLAGS = ("", "--use_fast_math")


def build(command: list[str], sampler: cuticle.Sampler, place: Path) -> Path:
    """Export and compile in a folder of its own."""
    place.mkdir()
    (place / "fibre.h").write_text(export(sampler, "cuda", name="fibre", with_model=True).text)
    subprocess.run([*command, "-I", str(place), str(ROOT / "benchmarks/gpu.cu"), "-o", str(place / "gpu")], check=True)
    return place / "gpu"


def report(runs: dict[int, dict[str, Any]]) -> None:
    """Print a row for each number of lobes."""
    fastest = max(run["numbers"]["rate"] for run in runs.values())
    print(f"{fastest / 1e9:.0f} billion triples of random numbers alone a second;")
    print("billions a second, share of that, registers a thread + bytes of local memory:\n")
    print(f"| lobes | {' | '.join(KEYS)} |\n| --- |{' --- |' * len(KEYS)}")
    for lobes, run in runs.items():
        cells = [
            f"{run[key]['rate'] / 1e9:.3g}, {100 * run[key]['rate'] / fastest:.0f} %, {run[key]['registers']}"
            + (f" + {run[key]['local']}" if run[key]["local"] else "")
            for key in KEYS
        ]
        print(f"| {lobes} | {' | '.join(cells)} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fibre", default="brown", choices=sorted(cuticle.presets.PRESETS))
    parser.add_argument("--lobes", type=int, nargs="+", default=[1, 2, 4, 8, 16])
    parser.add_argument("--compile-only", action="store_true", help="do not run")
    arguments = parser.parse_args()
    compiler = nvcc()
    if compiler is None:
        sys.exit("gpu.py needs nvcc; set CUDACXX")
    command = nvcc_command(compiler) + (["-c"] if arguments.compile_only else [])
    model = cuticle.DualScattering(cuticle.Fibre.preset(arguments.fibre))
    lobes = arguments.lobes
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor() as pool:
        samplers = list(pool.map(lambda k: cuticle.fit(model, k, strands=(0, 1, 2, 4, 8)).sampler, lobes))
        jobs = [(k, sampler, flag) for k, sampler in zip(lobes, samplers, strict=True) for flag in FLAGS]
        made = pool.map(lambda j: build(command + j[2].split(), j[1], Path(folder) / f"{j[0]}{j[2]}"), jobs)
        programs = {(k, flag): program for (k, _, flag), program in zip(jobs, made, strict=True)}
        if arguments.compile_only:
            print("compiled")
            return
        runs = {
            job: json.loads(subprocess.run([program], check=True, capture_output=True, text=True).stdout)
            for job, program in programs.items()
        }
    print(f"{next(iter(runs.values()))['device']}, {arguments.fibre}")
    for flag in FLAGS:
        print(f"\n-O3 {flag}".rstrip())
        report({k: runs[k, flag] for k in lobes})


if __name__ == "__main__":
    main()
