"""CUDA's compiler, where there is one."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path


def nvcc() -> str | None:
    """CUDA's compiler: on the path, or from the package nvidia-cuda-nvcc."""
    found = shutil.which("nvcc")
    packaged = sorted(Path(sys.prefix).glob("lib/python*/site-packages/nvidia/cu*/bin/nvcc"))
    return found or (str(packaged[-1]) if packaged else os.environ.get("CUDACXX"))


def has_gpu() -> bool:
    """Whether what nvcc makes can be run."""
    return shutil.which("nvidia-smi") is not None


def nvcc_command(compiler: str) -> list[str]:
    """CUDA's compiler with warnings as errors, for the GPU at hand where there is one."""
    command = [compiler, "-x", "cu", "-std=c++17", "-O3", "-Xcompiler", "-Wall,-Wextra", "--Werror", "all-warnings"]
    libraries = [f"-L{folder}" for folder in sorted(Path(compiler).parents[1].glob("lib*"))]
    return command + libraries + (["-arch=native"] if has_gpu() else [])
