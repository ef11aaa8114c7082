"""Compilers of the hosts."""

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
