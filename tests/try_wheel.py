"""Try a wheel as a new user does: in a fresh environment, outside the repository, with no compiler on the path.

    python tests/try_wheel.py dist/cuticle-….whl

Packages are downloaded first; the installation is timed without that. Each step prints its seconds on the clock and of a
processor, and the first that fails ends the program with exit code 1.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LONGEST_INSTALL = 15.0  # seconds of a processor, NumPy and SciPy included: what a busy machine adds is not ours
PLUGINS = ("linux", "darwin")

LIBRARY = """
import numpy as np
import cuticle
from cuticle import _core
u = np.random.default_rng(1).random((1000, 3))
theta_i, phi, pdf = cuticle.family("chiang").sample(0.3, u, eumelanin=1.3)
assert np.isfinite(pdf).all() and (pdf > 0).all()
there = cuticle.family("chiang").pdf(np.linspace(-1.5, 1.5, 1000), 0.3, np.linspace(-3, 3, 1000), eumelanin=1.3)
print(_core.__name__.rpartition(".")[2], f"{there.sum():.9g}", end="")
"""
BASELINE = "import os; os.environ['CUTICLE_BASELINE'] = '1'\n"
PLUGIN = """
import mitsuba as mi
mi.set_variant("scalar_rgb")
import cuticle.mitsuba
bsdf = mi.load_dict({"type": "cuticle", "fibre": "brown"})
si = mi.SurfaceInteraction3f()
si.wi = mi.Vector3f(0.6, 0.48, 0.64)
sample, weight = bsdf.sample(mi.BSDFContext(), si, 0.3, mi.Point2f(0.4, 0.6))
assert sample.pdf > 0
assert "dual" in str(mi.load_dict({"type": "dual_scattering"})).lower()
"""
PROGRAM = """#include "any.h"
#include <cstdio>

struct Vector3f { float x, y, z; };

int main() {
    const any::Fibre<float> fibre{.3f, .3f, 0.f, 1.55f, {.2f, .3f, .8f}};
    const Vector3f wo{0.6f, 0.48f, 0.64f};
    float pdf, f_cos[any::channels];
    any::sample_direction(any::prepare_direction(wo, fibre), wo, 0.3f, 0.4f, 0.6f, f_cos, &pdf);
    std::printf("%g", f_cos[0] / pdf);
    return pdf > 0 ? 0 : 1;
}
"""


def _of_children() -> float:
    """The processor's seconds of the programs that ended; 0 where the system does not say."""
    times = os.times()
    return times.children_user + times.children_system


class Trial:
    """A fresh environment, and the folder that its programs run in."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        self.folder, self.wheel, self.seconds = folder, wheel, 0.0
        subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
        self.bin = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")

    def run(self, *command: str, code: int = 0, compiler: str | None = None) -> str:
        """Run a program of the environment, or a compiler, and return what it prints; exit if it ends with another code."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "CUTICLE", "VIRTUAL_ENV"))}
        program = compiler or shutil.which(command[0], path=str(self.bin)) or command[0]
        path = os.environ["PATH"] if compiler else str(self.bin)
        done = subprocess.run(
            [program, *command[0 if compiler else 1 :]], cwd=self.folder, env=kept | {"PATH": path}, capture_output=True,
            text=True, encoding="utf-8", check=False,
        )  # fmt: skip
        if done.returncode != code:
            sys.exit(f"FAILED: {' '.join(command)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
        return done.stdout + done.stderr

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step, and print it."""
        start, before = time.perf_counter(), _of_children()
        yield
        wall = time.perf_counter() - start
        self.seconds = _of_children() - before or wall
        print(f"{wall:6.1f} s {self.seconds:6.1f} s  {name}", flush=True)

    def install(self, extras: str) -> None:
        """Download the wheel's dependencies, then install without an index."""
        named = f"cuticle{extras} @ {self.wheel.as_uri()}"
        with self.step(f"downloaded what cuticle{extras} needs"):
            self.run("python", "-m", "pip", "download", "-q", "--only-binary", ":all:", "-d", "packages", named)
        with self.step(f"installed cuticle{extras}"):
            self.run("python", "-m", "pip", "install", "-q", "--no-index", "--find-links", "packages", f"cuticle{extras}")


def try_wheel(wheel: Path) -> None:
    """Install a wheel and use all of it."""
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(Path(folder), wheel)
        (Path(folder) / "packages").mkdir()
        trial.install("")
        if trial.seconds > LONGEST_INSTALL:
            sys.exit(f"FAILED: the installation took {trial.seconds:.1f} s of a processor, more than {LONGEST_INSTALL:g}")
        names = {line.split()[0].lower() for line in trial.run("python", "-m", "pip", "list").splitlines()[2:] if line}
        names -= {"pip", "setuptools", "wheel", "tomli"}
        if names != {"cuticle", "numpy", "scipy"}:
            sys.exit(f"FAILED: it brings {', '.join(sorted(names))}")
        with trial.step("import cuticle, 1,000 samples of any fibre"):
            core, total = trial.run("python", "-c", LIBRARY).split()
        print(f"                   with the extension {core}")
        if trial.run("python", "-c", BASELINE + LIBRARY).split() != ["_native", total]:
            sys.exit("FAILED: CUTICLE_BASELINE=1 does not load the extension for any processor, or its densities are others")
        instructions(trial)
        told = trial.run("cuticle", "--help", code=2)
        if told.count("\n") != 1 or "pip install 'cuticle[cli]'" not in told:
            sys.exit(f"FAILED: without its extra the command line says {told!r}")
        with_plugins = sys.platform.startswith(PLUGINS) and not os.environ.get("CUTICLE_NO_MITSUBA")
        trial.install("[cli,mitsuba]" if with_plugins else "[cli]")
        command_line(trial)
        if with_plugins:
            with trial.step("mi.load_dict of the BSDF, a sample; the integrator"):
                trial.run("python", "-c", PLUGIN)
    print(f"{wheel.name} works")


def instructions(trial: Trial) -> None:
    """Read which registers the extensions use, where that can be done: those of AVX in the second one only."""
    disassembler = shutil.which("objdump")
    if disassembler is None or sys.platform != "linux" or platform.machine() != "x86_64":
        return
    folder = Path(trial.run("python", "-c", "from cuticle import _core; print(_core.__file__)").strip()).parent
    for file in folder.glob("_native*.so"):
        found = subprocess.run([disassembler, "-d", str(file)], capture_output=True, text=True, check=True).stdout
        if ("%ymm" in found) != ("_v3" in file.name):
            sys.exit(f"FAILED: {file.name} {'uses' if '%ymm' in found else 'does not use'} the registers of AVX")


def command_line(trial: Trial) -> None:
    """Fit, audit and export by the command, and compile what it exported where there is a compiler."""
    with trial.step("cuticle --help"):
        trial.run("cuticle", "--help")
    with trial.step("cuticle fit brown --strands 0,1 -o brown"):
        trial.run("cuticle", "fit", "brown", "--strands", "0,1", "-o", "brown")
    with trial.step("cuticle export --family chiang --to cpp -o any.h"):
        trial.run("cuticle", "export", "--family", "chiang", "--to", "cpp", "-o", "any.h")
    headers = Path(trial.run("cuticle", "--include-dir").strip())
    for header in ("cuticle.h", "audit.h"):
        if not (headers / "cuticle" / header).is_file():
            sys.exit(f"FAILED: {headers} holds no cuticle/{header}")
    compiler = shutil.which("c++")
    if compiler is not None and os.name != "nt":
        (trial.folder / "mine.cpp").write_text(PROGRAM, encoding="utf-8")
        flags = ["-std=c++17", "-O2", "-Wall", "-Wextra", "-Werror", "-I", str(headers)]
        with trial.step("compiled the sampler in a program of one's own, and ran it"):
            trial.run(*flags, "mine.cpp", "-o", "mine", compiler=compiler)
            trial.run(str(trial.folder / "mine"))


if __name__ == "__main__":
    try_wheel(Path(sys.argv[1]).resolve())
