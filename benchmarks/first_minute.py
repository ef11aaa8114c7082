"""What a new user waits for: installation, import, first samples, first fit, first plugin; two versions side by side.

    python benchmarks/first_minute.py BEFORE NOW [--rounds 5] [--python python3.12]

Each is a wheel, or a folder with the sources, which pip compiles. Packages are downloaded before anything is timed. Steps
run in turn, a process each, in the environment of a user: BLAS may have as many threads as it likes. The table shows medians
on the clock, and of the processor, where other work on the machine counts for less. Ratios are of medians.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

TIMED = "import time; start = time.perf_counter()\n{}\nprint(time.perf_counter() - start)"
STEPS = {  # code whose time it prints itself, or the words of a command
    "import cuticle": TIMED.format("import cuticle"),
    "1,000 samples of any fibre": TIMED.format(
        "import cuticle, numpy as np\n"
        "cuticle.family('chiang').sample(0.3, np.random.default_rng(1).random((1000, 3)), eumelanin=1.3)"
    ),
    "a fit of brown hair, 4 lobes, direct light": TIMED.format(
        "import cuticle\ncuticle.fit(cuticle.Marschner(cuticle.Fibre.preset('brown')), 4)"
    ),
    "cuticle --help": ["--help"],
    "cuticle fit brown --strands 0 -o DIR": ["fit", "brown", "--strands", "0", "-o", "fitted"],
    "cuticle fit brown -o DIR": ["fit", "brown", "-o", "fitted"],
    "cuticle export --family chiang --to cpp": ["export", "--family", "chiang", "--to", "cpp", "-o", "any.h"],
    "mi.load_dict, with import cuticle.mitsuba": "import mitsuba as mi; mi.set_variant('scalar_rgb')\n"
    + TIMED.format("import cuticle.mitsuba\nmi.load_dict({'type': 'cuticle', 'fibre': 'brown'})"),
}
Times = dict[str, list[tuple[float, float]]]  # of each step: on the clock, of a processor


def timed(work: Callable[[], float | None]) -> tuple[float, float]:
    """Return the seconds on the clock, or what the work itself says, and those of its processes."""
    before, start = os.times(), time.perf_counter()
    own = work()
    wall = time.perf_counter() - start
    after = os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return (own, own) if own is not None else (wall, used)


class Version:
    """One version in an environment of its own."""

    def __init__(self, source: Path, folder: Path, python: str) -> None:
        self.folder = folder
        folder.mkdir()
        subprocess.run([python, "-m", "venv", str(folder / "venv")], check=True)
        self.bin = folder / "venv" / "bin"
        pip = [str(self.bin / "python"), "-m", "pip", "-q", "--disable-pip-version-check"]
        whole = f"cuticle[{'cli,' if (source.suffix == '.whl') else ''}mitsuba] @ {source.resolve().as_uri()}"
        packages = folder / "packages"
        self._run([*pip, "download", "-d", str(packages), "numpy>=1.26", "scipy>=1.11", "mitsuba==3.9.1", "jinja2", "rich",
                   "matplotlib", "typer", "pydantic", "lazy_loader"])  # fmt: skip
        links = ["--find-links", str(packages)]
        self.install = timed(lambda: self._run([*pip, "install", *links, whole]))

    def _run(self, command: list[str]) -> float | None:
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "CUTICLE", "VIRTUAL_ENV"))}
        done = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
        return float(done.stdout.split()[-1]) if "-c" in command else None

    def step(self, step: str | list[str]) -> tuple[float, float]:
        """Run one step, and return its times."""
        if isinstance(step, str):
            return timed(lambda: self._run([str(self.bin / "python"), "-c", step]))
        return timed(lambda: self._run([str(self.bin / "cuticle"), *step]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("now", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--python", default=sys.executable)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        versions = [Version(getattr(asked, n), Path(work) / n, asked.python) for n in ("before", "now")]
        found: list[Times] = [{"pip install": [v.install]} for v in versions]
        for _ in range(asked.rounds + 1):
            for name, step in STEPS.items():
                for version, times in zip(versions, found, strict=True):
                    times.setdefault(name, []).append(version.step(step))
        print("| step | before | now | ratio | processor, before | now | ratio |")
        print("|" + " --- |" * 7)
        for name in found[0]:
            # The first run of a step compiles modules to bytecode, and is left out.
            medians = [[statistics.median(x) for x in zip(*(t[name][1:] or t[name]), strict=True)] for t in found]
            (wall, used), (wall_now, used_now) = medians
            print(f"| {name} | {wall:.3g} s | {wall_now:.3g} s | {wall_now / wall:.2f} | {used:.3g} s | {used_now:.3g} s |"
                  f" {used_now / used:.2f} |")  # fmt: skip


if __name__ == "__main__":
    main()
