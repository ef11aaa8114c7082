"""The headers as a C++ program meets them."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
INCLUDE = ROOT / "include"
FLAGS = ["-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-Werror", f"-I{INCLUDE}"]
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
        f"-I{INCLUDE}",
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
    for header in sorted(INCLUDE.rglob("*.h")):
        source = tmp_path / f"{header.stem}.cpp"
        source.write_text(f'#include "{header.relative_to(INCLUDE).as_posix()}"\n')
        built = subprocess.run([compiler, *FLAGS, "-fsyntax-only", str(source)], capture_output=True, text=True, check=False)
        assert built.returncode == 0, built.stderr


def test_headers_are_short_and_depend_on_the_standard_library_only() -> None:
    for header in INCLUDE.rglob("*.h"):
        lines = header.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= 300, header.name
        for line in lines:
            if line.startswith("#include <"):
                assert line[10:-1] in {"cmath", "cstddef", "cstdint", "cstring", "limits", "type_traits", "utility"}, line


def test_folders_include_what_stands_before_them_only() -> None:
    """In the order that cuticle.h tells; a header that stands in no folder is cuticle.h or an old name, of one line."""
    text = (INCLUDE / "cuticle/cuticle.h").read_text(encoding="utf-8")
    order = re.findall(r"^//   ([a-z]+) ", text, re.MULTILINE)
    assert set(order) == {folder.name for folder in (INCLUDE / "cuticle").iterdir() if folder.is_dir()}
    for header in INCLUDE.rglob("*.h"):
        folder, name = header.parent.name, header.relative_to(INCLUDE).as_posix()
        included = re.findall(r'^#include "cuticle/(.+)\.h"', header.read_text(encoding="utf-8"), re.MULTILINE)
        if folder == "cuticle":
            assert name == "cuticle/cuticle.h" or (len(included) == 1 and header.read_text().count("\n") == 1), name
            continue
        for other in included:
            assert "/" in other, f"{name} includes {other} by its old name"
            assert order.index(other.split("/")[0]) <= order.index(folder), f"{name} includes {other}"


def test_headers_include_one_another_in_one_direction() -> None:
    needs = {
        header.relative_to(INCLUDE).as_posix(): re.findall(r'^#include "(.+\.h)"', header.read_text(), re.MULTILINE)
        for header in INCLUDE.rglob("*.h")
    }
    done: set[str] = set()
    while needs:
        free = [name for name, others in needs.items() if done.issuperset(others)]
        assert free, f"in a circle: {sorted(needs)}"
        done.update(free)
        for name in free:
            del needs[name]
