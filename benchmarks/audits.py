"""Audit the materials that Mitsuba ships, as docs/audit.md tells it: a table, and the picture of its `hair`.

python benchmarks/audits.py [--samples N] [--picture FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import cuticle

VIEWERS = np.radians([-75, -30, 0, 60])
HAIR = [
    {"longitudinal_roughness": 0.25, "azimuthal_roughness": 0.3, "eumelanin": 0.3},
    {"longitudinal_roughness": 0.3, "azimuthal_roughness": 0.3, "eumelanin": 1.3},
    {"longitudinal_roughness": 0.3, "azimuthal_roughness": 0.3, "eumelanin": 8.0},
    {"longitudinal_roughness": 0.8, "azimuthal_roughness": 0.8},
    {"longitudinal_roughness": 0.8, "azimuthal_roughness": 0.8, "eumelanin": 0.3},
]
OTHERS: list[dict[str, Any]] = [
    {"type": "diffuse"},
    {"type": "plastic"},
    {"type": "roughplastic", "alpha": 0.2},
    {"type": "roughconductor", "alpha": 0.2},
    {"type": "roughconductor", "alpha_u": 0.05, "alpha_v": 0.3},
    {"type": "roughdielectric", "alpha": 0.2},
    {"type": "principled", "roughness": 0.3, "metallic": 0.4},
    {"type": "principled", "roughness": 0.3, "spec_trans": 0.7, "base_color": (0.8, 0.6, 0.4)},
    {"type": "principledthin", "roughness": 0.3, "spec_trans": 0.4, "diff_trans": 0.6},
]
CUTICLE: list[dict[str, Any]] = [
    {"type": "cuticle", "fibre": "blond"},
    {"type": "cuticle", "fibre": "brown"},
    {"type": "cuticle", "fibre": "black"},
    {"type": "cuticle", "fibre": "brown", "sampling": "lobes"},
    {"type": "cuticle", "fibre": "document", "sampling": "document"},
]


def row(given: dict[str, Any], h: float, samples: int) -> tuple[str, cuticle.Audit | None]:
    words = " ".join(f"{k}={v}" for k, v in given.items() if k != "type")
    name = f"`{given['type']}{' ' if words else ''}{words}`"
    try:
        material = cuticle.from_mitsuba(given, h=h)
    except ValueError as error:
        return f"| {name} | {h:g} | – | | | {error} |", None
    made = cuticle.audit(material, theta_r=VIEWERS, samples=samples, name=name.strip("`"))
    worst = made.worst
    failed = [v.name for v in made.verdicts if not v.passed]
    wrong = ", ".join(failed) if failed else "; ".join(made.notes)
    if worst.region is not None:
        wrong += f". At θ_r {np.degrees(worst.theta_r):.0f}° {worst.region.text()}"
        wrong += "".join(f"; {r.text()}" for r in worst.repeated) + (f"; {worst.lobe}" if worst.lobe else "")
    ess = [c.ess for c in made.cases]
    verdict = "passes" if made.ok else "**fails**"
    return f"| {name} | {h:g} | {verdict} | {worst.p_value:.1g} | {min(ess):.3f} to {max(ess):.3f} | {wrong} |", made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=200_000)
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args()
    print("| material | h | verdict | least p | ESS | what fails, or is noted |\n| --- | --- | --- | --- | --- | --- |")
    for material in [{"type": "hair", **h} for h in HAIR] + OTHERS + CUTICLE:
        text, made = row(material, 0.0, given.samples)
        print(text, flush=True)
        if given.picture is not None and made is not None and material == {"type": "hair", **HAIR[0]}:
            made.figure(given.picture)
    for h in (0.5, 0.9):
        print(row({"type": "hair", **HAIR[1]}, h, given.samples)[0], flush=True)


if __name__ == "__main__":
    main()
