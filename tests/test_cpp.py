"""The headers as a C++ program meets them."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLAGS = ["-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-Werror", f"-I{ROOT / 'include'}"]
OPTIMISE = {"g++": "-O1", "clang++": "-O0"}  # GCC warns of more where it optimises; Clang's warnings are the same


# standalone: the core on its own. lanes: the sampler over an array type. batch: over arrays, with the vectors that every
# machine has and with this one's.
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize("name", ["standalone", "lanes", "batch", "batch -march=native"])
def test_compiles_without_a_warning_and_runs(name: str, compiler: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    name, *flags = name.split()
    program = tmp_path / name
    built = subprocess.run(
        [compiler, *FLAGS, OPTIMISE[compiler], *flags, str(ROOT / f"tests/cpp/{name}.cpp"), "-o", str(program)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    assert built.stderr == ""
    ran = subprocess.run([str(program)], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout


def test_goes_through_the_arrays_of_drjit(tmp_path: Path) -> None:
    compiler, found = shutil.which("g++"), importlib.util.find_spec("drjit")
    if compiler is None or found is None or found.submodule_search_locations is None:
        pytest.skip("g++ or the package drjit is not installed")
    headers = Path(next(iter(found.submodule_search_locations))) / "include"
    flags = [
        "-std=c++17",
        "-O2",
        "-march=native",
        f"-I{ROOT / 'include'}",
        f"-I{ROOT / 'plugins/mitsuba'}",
        f"-isystem{headers}",
        str(ROOT / "tests/cpp/drjit_arrays.cpp"),
    ]
    traced = [compiler, *flags, "-DTRACED", "-fsyntax-only"]
    built = subprocess.run(traced, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    subprocess.run([compiler, *flags, "-o", str(tmp_path / "packets")], check=True)
    ran = subprocess.run([str(tmp_path / "packets")], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout


def test_every_header_stands_alone(tmp_path: Path) -> None:
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler on the path")
    for header in sorted((ROOT / "include/cuticle").glob("*.h")):
        source = tmp_path / f"{header.stem}.cpp"
        source.write_text(f'#include "cuticle/{header.name}"\n')
        built = subprocess.run([compiler, *FLAGS, "-fsyntax-only", str(source)], capture_output=True, text=True, check=False)
        assert built.returncode == 0, built.stderr


def test_headers_are_short_and_depend_on_the_standard_library_only() -> None:
    for header in (ROOT / "include/cuticle").glob("*.h"):
        lines = header.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= 300, header.name
        for line in lines:
            if line.startswith("#include <"):
                assert line[10:-1] in {"cmath", "cstddef", "cstdint", "cstring", "limits", "type_traits", "utility"}, line
