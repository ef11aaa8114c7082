"""A share of `make fuzz`: damaged files of every format, and readers that are wrong, each of which it must find."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

# Those that the test's own libraries read; the results of `check` and `document` take too long to make here.
LIBRARIES = [
    name
    for module, names in {"pxr": ("a.usda", "a.usdc"), "alembic3d": ("a.abc",)}.items()
    for name in names
    if find_spec(module) is not None
]
RUN = Path(__file__).parent / "fuzz" / "run.py"
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has neither alarms nor limits of memory")


def fuzz(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(RUN), "--keep", str(folder), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("count", [16, pytest.param(150, marks=pytest.mark.slow)])
def test_damaged_files_are_refused_or_read_whole(count: int, tmp_path: Path) -> None:
    whole = (
        "a.hair",
        "a.data",
        "a.tfx",
        "a.txt",
        "a.ply",
        "a.npz",
        "packed.npz",
        *(f"printed/table{k}.csv" for k in (1, 2, 3)),
    )
    shares = (
        "a.csv",
        "dump.npz",
        "dump.csv",
        "sampler.json",
        "record.json",
        "saved.json",
        "a.toml",
        "table.npz",
        "fitted/fit.json",
    )
    done = fuzz("--count", str(count), "--seed", "20", *whole, *shares, *LIBRARIES, folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    for name in whole:
        assert f"{name}: {count} inputs, 0 faults" in done.stdout


@pytest.mark.slow
def test_the_fuzzer_finds_readers_that_are_wrong(tmp_path: Path) -> None:
    wrong = {
        "crash": "crash (-11)",
        "hang": "hang",
        "fill": "MemoryError",
        "leak": "KeyError",
        "nan": "AssertionError",
        "mute": "message",
    }
    done = fuzz("--count", "1", "--hang", "1", *wrong, folder=tmp_path)
    assert done.returncode == 1
    found = dict(line.split(": ", 1) for line in done.stdout.splitlines())
    for name, words in wrong.items():
        assert found[name] == "1 inputs, 1 faults"
        assert words in found[str(tmp_path / f"{name}-1-0")]
