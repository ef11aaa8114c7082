"""The package as it is installed: types, headers, citation, workflows; and the extension that a processor is given."""

from __future__ import annotations

import importlib.metadata
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import cuticle
from cuticle import _core
from cuticle._support.files import tomllib
from cuticle.export.headers import cmake_dir, include_dir

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
FLAGS = "fpu sse2 avx avx2 bmi1 bmi2 f16c fma abm movbe xsave"


def test_types_and_headers_are_installed() -> None:
    package = Path(cuticle.__file__).parent
    beside = Path(_core.__file__).parent  # elsewhere where the sources are what is installed
    assert (package / "py.typed").is_file()
    stub = next(p for p in (package / "_native.pyi", beside / "_native.pyi") if p.is_file()).read_text(encoding="utf-8")
    bound = {name for name in dir(_core) if not name.startswith("_")}
    assert bound == _names(stub)
    for header in ("cuticle.h", "audit.h", "math/erf.h"):
        assert (include_dir() / "cuticle" / header).is_file()
    assert (cmake_dir() / "cuticleConfig.cmake").is_file()


def _names(stub: str) -> set[str]:
    return {a or b for a, b in re.findall(r"^(?:def|class) (\w+)|^(\w+): ", stub, re.MULTILINE)}


def test_the_citation_is_that_of_the_project() -> None:
    values = dict(
        re.findall(r'^([\w-]+): "?([^"\n]*)"?$', (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    )
    assert values["cff-version"] == "1.2.0"
    assert values["version"] == PROJECT["project"]["version"] == importlib.metadata.version("cuticle")
    assert values["license"] == PROJECT["project"]["license"]
    assert values["title"].startswith("Cuticle")


def test_what_the_plugins_load_stays_out_of_the_wheel_wherever_it_is_repaired() -> None:
    in_project = re.findall(r"--exclude '?([\w.*-]+)'?", PROJECT["tool"]["cibuildwheel"]["linux"]["repair-wheel-command"])
    in_make = re.findall(r"--exclude '?([\w.*-]+)'?", (ROOT / "Makefile").read_text(encoding="utf-8"))
    assert in_project == in_make == ["libmitsuba.so", "libdrjit-*.so", "libnanothread.so"]


@pytest.mark.parametrize(
    ("flags", "v3"),
    [(FLAGS, True), (FLAGS.replace("fma", ""), False), (FLAGS.replace("avx2", "avx2x"), False), (None, False)],
)
def test_the_extension_follows_the_processor(flags: str | None, v3: bool, tmp_path: Path) -> None:
    """`_core` replaces itself: its source is read here as a module of another name."""
    place = Path(cuticle.__file__).parent / "_core.py"
    code = place.read_text(encoding="utf-8").split("if TYPE_CHECKING:")[0]
    names: dict[str, object] = {}
    exec(code, names)
    names["_CPU"] = str(tmp_path / "cpuinfo")
    if flags is not None:
        (tmp_path / "cpuinfo").write_text(f"processor\t: 0\nmodel name\t: avx2 fma\nflags\t\t: {flags}\n" + "x" * 10_000)
    assert names["_runs_v3"]() is v3  # type: ignore[operator]


@pytest.mark.slow
def test_a_wheel_that_was_made_works_where_nothing_is_installed() -> None:
    wheels = sorted((ROOT / "dist").glob("*.whl"))
    if not wheels:
        pytest.skip("there is no wheel in dist: `make wheel` makes one, and tries it")
    tag = f"cp{sys.version_info.major}{sys.version_info.minor}"
    fitting = [w for w in wheels if f"-{tag}-" in w.name or "-abi3-" in w.name]
    if not fitting or ("-abi3-" in fitting[0].name and sys.version_info < (3, 12)):
        pytest.skip(f"{wheels[0].name} is for another Python")
    command = [sys.executable, str(ROOT / "tests/try_wheel.py"), str(fitting[0])]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.slow
def test_a_wheel_that_holds_nothing_is_found_out(tmp_path: Path) -> None:
    wheel = tmp_path / "cuticle-0.1.0-py3-none-any.whl"
    info = "cuticle-0.1.0.dist-info"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("cuticle/__init__.py", "")
        archive.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: cuticle\nVersion: 0.1.0\n")
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "")
    command = [sys.executable, str(ROOT / "tests/try_wheel.py"), str(wheel)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 1
    assert "FAILED" in ran.stderr
