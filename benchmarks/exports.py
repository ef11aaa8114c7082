"""Scattering functions in exports: how large their tables are, how far off f is, and how long a compiler takes.

python benchmarks/exports.py prints the table of docs/export.md.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import cuticle
from cuticle.export import export
from cuticle.scattering.bcsdf import Bcsdf

COUNTS = (0.0, 1.0, 2.0, 4.0, 8.0)
HAIR = cuticle.Chiang(beta_m=0.3, beta_n=0.3, eumelanin=1.3)
PROGRAM = """#include "fibre.h"
int main() {
    float f[fibre::channels];
    fibre::eval(.1f, .2f, 3.f, f, 2);
    return f[0] < 0;
}
"""


def tabulated() -> cuticle.Tabulated:
    """Chiang's function on a grid as goniometers have it: 35 viewers x 91 x 73."""
    viewers, theta, phi = np.radians(np.linspace(-85, 85, 35)), np.linspace(-1.57, 1.57, 91), np.linspace(0, np.pi, 73)
    return cuticle.Tabulated(viewers, theta, phi, HAIR.eval(theta[None, :, None], viewers[:, None, None], phi))


def cases() -> list[tuple[str, Bcsdf, tuple[float, ...] | None]]:
    """Return a name, a function and the strand counts to fit."""
    made: list[tuple[str, Bcsdf, tuple[float, ...] | None]] = [
        ("`DualScattering`, brown", cuticle.DualScattering(cuticle.Fibre.preset("brown")), COUNTS),
        ("`Chiang`, roughness .3/.3", HAIR, None),
        ("`Chiang`, .1/.1", cuticle.Chiang(beta_m=0.1, beta_n=0.1, eumelanin=1.3), None),
        ("`Tabulated`, 35 × 91 × 73 of .3/.3", tabulated(), None),
        ("`from_callable`: .3/.3 as any function", cuticle.from_callable(HAIR.eval, even=True), None),
        ("the same, .1/.1", cuticle.from_callable(made_sharp, even=True), None),
        ("near field at h = .3, not even in φ", HAIR.near(0.3), None),
        ("`Strands` of .3/.3", cuticle.Strands(HAIR), COUNTS),
    ]
    return made


def made_sharp(theta_i: Any, theta_r: Any, phi: Any) -> np.ndarray:
    """Chiang's function of a smooth fibre."""
    return SHARP.eval(theta_i, theta_r, phi)


SHARP = cuticle.Chiang(beta_m=0.1, beta_n=0.1, eumelanin=1.3)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    print("| function | table, bytes | off, % of ∫ f cos | C++ file, MB | page, MB | export, s | g++ -O2, s |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, model, counts in cases():
        sampler = cuticle.fit(model, 4, strands=counts).sampler
        begin = time.perf_counter()
        made = export(sampler, "cpp", name="fibre", with_model=True, model=model)
        seconds = time.perf_counter() - begin
        page = export(sampler, "web", model=model)
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "fibre.h").write_text(made.text)
            (Path(folder) / "main.cpp").write_text(PROGRAM)
            begin = time.perf_counter()
            subprocess.run(["g++", "-std=c++17", "-O2", "main.cpp", "-o", "main"], cwd=folder, check=True)
            compiled = time.perf_counter() - begin
        assert made.model is not None
        print(
            f"| {name} | {made.model.size:,} | {100 * made.model.error:.2g} | {len(made.text) / 1e6:.2f}"
            f" | {len(page.text) / 1e6:.2f} | {seconds:.1f} | {compiled:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
