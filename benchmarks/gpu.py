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
from pathlib import Path

import cuticle
from cuticle.export import export

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from conformance.hosts import nvcc  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fibre", default="brown", help="a preset")
    parser.add_argument("--compile-only", action="store_true", help="do not run")
    arguments = parser.parse_args()
    compiler = nvcc()
    if compiler is None:
        sys.exit("gpu.py needs nvcc; set CUDACXX")
    sampler = cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset(arguments.fibre)), 4, strands=(0, 1, 2, 4, 8)).sampler
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "fibre.h").write_text(export(sampler, "cuda", name="fibre").text)
        program = Path(folder) / "gpu"
        flags = [
            "-std=c++17",
            "-O3",
            "--Werror",
            "all-warnings",
            "-I",
            folder,
            str(ROOT / "benchmarks/gpu.cu"),
            "-o",
            str(program),
        ]
        flags += ["-c"] if arguments.compile_only else [f"-L{lib}" for lib in Path(compiler).parents[1].glob("lib*")]
        subprocess.run([compiler, *flags], check=True)
        if arguments.compile_only:
            print("compiled")
            return
        found = json.loads(subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout)
    print(f"{found['device']}: random numbers alone {found['numbers'] / 1e9:.2f} billion triples a second;")
    for key in ("samples", "samples, two rows"):
        print(f"  {key}: {found[key] / 1e9:.2f} billion a second, {100 * found[key] / found['numbers']:.0f} %")


if __name__ == "__main__":
    main()
