"""The programs that time the core, compiled for this machine."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def compiled(name: str, folder: str, *flags: str) -> Path:
    """Compile benchmarks/NAME.cpp with optimisation into a folder; return the program."""
    compiler = os.environ.get("CXX") or shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        sys.exit("this needs a C++ compiler; set CXX")
    program = Path(folder) / name
    source = ROOT / f"benchmarks/{name}.cpp"
    command = [compiler, "-std=c++17", "-O3", *flags, f"-I{ROOT / 'include'}", str(source), "-o", str(program)]
    subprocess.run(command, check=True)
    return program
