"""The headers as a C++ program meets them."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
INCLUDE = ROOT / "include"
FLAGS = ["-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-Werror", f"-I{INCLUDE}"]
HEADERS = sorted(header.relative_to(INCLUDE).as_posix() for header in INCLUDE.glob("cuticle/*/*.h"))
PROGRAM = ROOT / "tests/cpp/instantiate.cpp"
AUDIT = "cuticle/audit.h"  # C, beside the core: what a library gives `cuticle audit`
STANDARD = {"cmath", "cstddef", "cstdint", "cstring", "limits", "stddef.h", "type_traits", "utility"}


def run(*command: str) -> str:
    """Run a program and return what it says, or fail with that."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def program(name: str, compiler: str, folder: Path, *flags: str) -> None:
    """Compile a test without a warning, and run it."""
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    assert run(compiler, *FLAGS, *flags, str(ROOT / f"tests/cpp/{name}.cpp"), "-o", str(folder / name)) == ""
    run(str(folder / name))


# standalone: the core on its own. lanes: through an array type. batch: over arrays of directions. families: of lobes.
# GCC warns of more where it optimises.
@pytest.mark.parametrize(
    "name", ["standalone", "batch", *(pytest.param(n, marks=pytest.mark.slow) for n in ("lanes", "families"))]
)
def test_compiles_without_a_warning_and_runs(name: str, tmp_path: Path) -> None:
    program(name, "g++", tmp_path, "-O1" if name in ("standalone", "batch") else "-O0")


# Every number of lobes in both precisions, with the vectors that every machine has and with this one's.
@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize("name", ["standalone", "lanes", "batch", "batch -march=native", "families -march=native"])
def test_all_that_is_compiled_runs(name: str, compiler: str, tmp_path: Path) -> None:
    name, *flags = name.split()
    program(name, compiler, tmp_path, "-DWHOLE", {"g++": "-O1", "clang++": "-O0"}[compiler], *flags)


# Nothing is assumed of an argument: the bits of a float may be any.
@pytest.mark.slow
def test_any_bits_are_read_within_bounds(tmp_path: Path) -> None:
    checks = "address,undefined,float-cast-overflow"
    program("total", "g++", tmp_path, "-O0", "-DCOUNT=20000", f"-fsanitize={checks}", f"-fno-sanitize-recover={checks}")


# Where the compiler may assume that there is no NaN, too.
@pytest.mark.slow
def test_any_bits_are_read_within_bounds_by_fast_math(tmp_path: Path) -> None:
    program("total", "g++", tmp_path, "-O1", "-ffast-math", "-DCOUNT=20000", "-fsanitize=address")


def drjit_flags() -> list[str]:
    found = importlib.util.find_spec("drjit")
    if found is None or found.submodule_search_locations is None:
        pytest.skip("the package drjit is not installed")
    headers = Path(next(iter(found.submodule_search_locations))) / "include"
    return ["-std=c++17", "-march=native", f"-I{INCLUDE}", f"-I{ROOT / 'plugins/mitsuba'}", f"-isystem{headers}"]


@pytest.mark.slow
def test_goes_through_the_arrays_of_drjit(tmp_path: Path) -> None:
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    flags = [*drjit_flags(), "-O2", str(ROOT / "tests/cpp/drjit_arrays.cpp")]
    run("g++", *flags, "-DTRACED", "-fsyntax-only")
    run("g++", *flags, "-o", str(tmp_path / "packets"))
    run(str(tmp_path / "packets"))


FAMILIES = {
    f"cuticle/sampler/{name}.h": family
    for name, family in re.findall(r'use\("(\w+)", (\w+)\{\}\)', (INCLUDE / "cuticle/sampler/families.h").read_text())
}


def used(header: str) -> str:
    """Return the macro by which instantiate.cpp is told to instantiate a header's templates."""
    return "USE_" + header.removeprefix("cuticle/").removesuffix(".h").replace("/", "_")


def instantiate(headers: list[str], *flags: str) -> list[str]:
    """Compile instantiate.cpp with each header alone; return what was wrong."""
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler on the path")

    def one(header: str) -> str:
        family = [f"-DFAMILY={FAMILIES[header]}"] if header in FAMILIES else []
        command = [compiler, *flags, *family, f'-DHEADER="{header}"', f"-D{used(header)}", "-fsyntax-only", str(PROGRAM)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return "" if done.returncode == 0 else f"{header} alone:\n{done.stderr}"

    with ThreadPoolExecutor(2) as pool:
        return [wrong for wrong in pool.map(one, headers) if wrong]


def test_every_header_stands_alone() -> None:
    """With numbers and packs; config.h and chunk.h, pack.h and lanes.h through what they are for."""
    assert instantiate(HEADERS, *FLAGS) == []
    known = set(re.findall(r"USE_\w+", PROGRAM.read_text(encoding="utf-8")))
    assert set(FAMILIES) <= set(HEADERS), "a family has the name of its header"
    without = {used(header) for header in HEADERS if header not in FAMILIES} - known
    assert without == {"USE_math_config", "USE_simd_chunk", "USE_simd_pack", "USE_simd_lanes"}
    assert known <= {used(header) for header in HEADERS}


@pytest.mark.slow
def test_every_header_alone_takes_the_arrays_of_drjit(tmp_path: Path) -> None:
    flags = [*drjit_flags(), "-DDRJIT"]
    (tmp_path / "drjit.h").write_text(
        "".join(f"#include <drjit/{name}.h>\n" for name in ("autodiff", "jit", "math", "while_loop"))
    )
    run("g++", *flags, "-x", "c++-header", str(tmp_path / "drjit.h"), "-o", str(tmp_path / "drjit.h.gch"))
    assert instantiate(HEADERS, *flags, "-include", str(tmp_path / "drjit.h")) == []


def test_all_headers_take_the_arrays_of_drjit() -> None:
    assert instantiate(["cuticle/cuticle.h"], *drjit_flags(), "-DDRJIT", *(f"-D{used(h)}" for h in HEADERS)) == []


def test_old_names_lead_to_the_headers(tmp_path: Path) -> None:
    names = [header.name for header in INCLUDE.glob("cuticle/*.h")]
    (tmp_path / "main.cpp").write_text("".join(f'#include "cuticle/{name}"\n' for name in names))
    run("c++", *FLAGS, "-fsyntax-only", str(tmp_path / "main.cpp"))


def test_headers_are_short_and_depend_on_the_standard_library_only() -> None:
    for header in INCLUDE.rglob("*.h"):
        lines = header.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= 300, header.name
        for line in lines:
            if line.startswith("#include <"):
                assert line[10:-1].removeprefix("cuda/std/") in STANDARD, line  # for NVRTC, CUDA's own


def test_folders_include_what_stands_before_them_only() -> None:
    """In the order that cuticle.h tells; a header in no folder is cuticle.h, audit.h or an old name, of one line."""
    text = (INCLUDE / "cuticle/cuticle.h").read_text(encoding="utf-8")
    order = re.findall(r"^//   ([a-z]+) ", text, re.MULTILINE)
    assert set(order) == {folder.name for folder in (INCLUDE / "cuticle").iterdir() if folder.is_dir()}
    for header in INCLUDE.rglob("*.h"):
        folder, name = header.parent.name, header.relative_to(INCLUDE).as_posix()
        included = re.findall(r'^#include "cuticle/(.+)\.h"', header.read_text(encoding="utf-8"), re.MULTILINE)
        if folder == "cuticle":
            assert name in ("cuticle/cuticle.h", AUDIT) or (len(included) == 1 and header.read_text().count("\n") == 1), name
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


def test_maths_and_scattering_name_no_pack() -> None:
    for header in HEADERS:
        if header.split("/")[1] in ("math", "scattering"):
            assert not re.search(r"Pack|pack_", (INCLUDE / header).read_text(encoding="utf-8")), header
