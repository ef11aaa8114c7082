"""What comes to a dark floor under a mat of hair, out of what paths bring there: red, green, blue.

python benchmarks/hair_shadows.py [--samples N]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import mitsuba as mi

mi.set_variant("scalar_rgb")
import cuticle.mitsuba  # noqa: E402, F401
from cuticle.render.scene import integrator  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from rendered import floor, mat  # noqa: E402

LIGHTS = {
    "sun": {"type": "directional", "direction": [0.6, 0, -0.8], "irradiance": 1.0},
    "even sky": {"type": "constant"},
}
WAYS = {
    "`direct`": integrator("direct"),
    "`dual_scattering`, grid": integrator("dual", correction_paths=0),
    "`dual_scattering`, trace": integrator("dual", correction_paths=0, counter="trace"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=2048, help="a pixel, of 16 x 16")
    samples = parser.parse_args().samples
    print(f"| hair | light | {' | '.join(WAYS)} |\n|{' --- |' * (len(WAYS) + 2)}")
    with tempfile.TemporaryDirectory() as folder:
        curves = mat(Path(folder) / "mat.txt")
        for fibre in ("blond", "brown", "black"):
            for label, light in LIGHTS.items():
                hair = {"hair": {**curves, "bsdf": {"type": "cuticle", "fibre": fibre}}}
                paths = floor(mi, hair, integrator("path", depth=64), light, 2 * samples)
                cells = [
                    ", ".join(f"{x:.2f}" for x in floor(mi, hair, way, light, samples) / paths) for way in WAYS.values()
                ]
                print(f"| {fibre} | {label} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
