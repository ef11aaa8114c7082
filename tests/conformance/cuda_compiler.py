"""Compilers of CUDA, where they are: nvcc, NVRTC, which renderers compile with at run time, and AMD's hipcc."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


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


def by_hipcc(text: str, folder: Path) -> tuple[bytes, str]:
    """Return what hipcc makes for the host and a GPU, empty where it refuses, and what it says. Skip the test without it."""
    if shutil.which("hipcc") is None:
        pytest.skip("hipcc is not installed (Debian: apt-get install hipcc libamdhip64-dev rocm-device-libs)")
    (folder / "kernel.cpp").write_text(f"#include <hip/hip_runtime.h>\n{text}")
    command = ["hipcc", "-std=c++17", "-O2", "-Wall", "-Wextra", "--offload-arch=gfx1030", "-c", "kernel.cpp"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return (folder / "kernel.o").read_bytes() if done.returncode == 0 else b"", done.stderr


def by_nvrtc(text: str, folder: Path) -> tuple[bytes, str]:
    """Return the PTX that NVRTC makes, empty where it refuses, and all that it says. Skip the test without it."""
    folders = sorted(Path(sys.prefix).glob("lib/python*/site-packages/nvidia/cu*"))
    path = next((p for folder in folders for p in sorted(folder.glob("lib/libnvrtc.so.*"))), None)
    if path is None:
        pytest.skip("no NVRTC: pip install nvidia-cuda-nvrtc nvidia-cuda-cccl nvidia-cuda-runtime")
    include = path.parents[1] / "include"
    options = ["--std=c++17", "-arch=compute_80", "-default-device", f"-I{include}", f"-I{include / 'cccl'}"]
    library, program = ctypes.CDLL(str(path)), ctypes.c_void_p()
    assert library.nvrtcCreateProgram(ctypes.byref(program), text.encode(), b"kernel.cu", 0, None, None) == 0
    words = (ctypes.c_char_p * len(options))(*(o.encode() for o in options))
    refused = library.nvrtcCompileProgram(program, len(options), words)

    def told(what: str) -> bytes:
        size = ctypes.c_size_t()
        assert library[f"nvrtcGet{what}Size"](program, ctypes.byref(size)) == 0
        held = ctypes.create_string_buffer(size.value)
        assert library[f"nvrtcGet{what}"](program, held) == 0
        return held.value

    made, said = b"" if refused else told("PTX"), told("ProgramLog").decode()
    library.nvrtcDestroyProgram(ctypes.byref(program))
    return made, said
