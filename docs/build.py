"""Render docs/document.md and its pictures: every number in it comes from the program.

Reads the draft's printed tables from $CUTICLE_DATA/document, which it compares with.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

import cuticle
from cuticle._support.plots import figure_bytes
from cuticle.draft.figures import figures
from cuticle.draft.functions import Choice, find_functions
from cuticle.draft.gaussians import fit_gaussian
from cuticle.draft.printed import Printed
from cuticle.draft.tables import THETA_R_2, around, near_pole, table_2, table_3

HERE = Path(__file__).parent
PICTURES = ("functions", "comparison", "figure1")
SYMBOLS = {"sigma_V": "σ_V", "sigma_H": "σ_H", "mu_H": "μ_H", "sigma": "σ", "mu": "μ"}
NAMES = {
    "uniform": "uniform sphere",
    "draft": "the draft's form, printed numbers",
    "found": "the draft's form, functions found",
    "lobes": "four fitted lobes",
}


def functions(choices: dict[str, Choice]) -> list[dict[str, str]]:
    rows = []
    for name, choice in choices.items():
        degrees = name.startswith("mu")
        rms = choice.best.rms or 0.0
        rows.append(
            {
                "symbol": SYMBOLS[name],
                "text": choice.best.text(degrees=degrees),
                "rms": f"{math.degrees(rms):.2f}°" if degrees else f"{rms:.3f} rad",
                "next": choice.others[0].text(degrees=degrees) if choice.others else "",
            }
        )
    return rows


def signed(x: float, digits: int) -> str:
    return f"{x:.{digits}f}".replace("-", "−")


def table_3_row(model: cuticle.DualScattering, theta_r: float, cosines: int = 2) -> tuple[float, float, float]:
    """Return sigma (rad), shift (degrees) and scale of the Gaussian along theta_i; theta_r in degrees."""
    t = near_pole(theta_r)
    g = fit_gaussian(around(model, t, cosines), -math.pi / 2, math.pi / 2, window=0.0)
    assert g is not None
    return g.sigma, math.degrees(g.mean + t), g.scale


def table_3_differences(model: cuticle.DualScattering, printed: Printed, strands: float, cosines: int) -> np.ndarray:
    """Return rms of sigma (rad) and shift (degrees), and the median ratio of scales, to the printed rows up to 60°."""
    own, rows = model.with_strands(strands), []
    for (n, theta_r), (scale, sigma, shift) in printed.table_3.items():
        if n != strands or abs(theta_r) > 60:
            continue
        row = table_3_row(own, theta_r, cosines)
        rows.append((row[0] - sigma, row[1] - shift, row[2] / scale))
    d = np.array(rows)
    return np.array([*np.sqrt(np.mean(d[:, :2] ** 2, axis=0)), np.median(d[:, 2])])


def table_3_study(model: cuticle.DualScattering, printed: Printed) -> dict[str, Any]:
    """Return what other numbers of cosines, and a backscatter without the factor pi, make of table 3."""
    weaker = cuticle.DualScattering(model.fibre.replace(d_b=model.fibre.d_b / math.pi))
    rows = []
    for n in (1.0, 2.0, 4.0, 8.0):
        by_power = [table_3_differences(model, printed, n, p) for p in (1, 2, 3, 4)]
        best = int(np.argmin([d[0] for d in by_power]))
        cells = [f"**{d[0]:.3f}**" if i == best else f"{d[0]:.3f}" for i, d in enumerate(by_power)]
        without = table_3_differences(weaker, printed, n, 2)
        cells += [f"{by_power[1][1]:.1f}°", f"{without[1]:.1f}°", f"{by_power[1][2]:.2f}", f"{without[2]:.2f}"]
        rows.append({"n": f"{n:g}", "cells": cells})
    low = np.array([[table_3_differences(model, printed, n, p) for n in (1.0, 2.0)] for p in (1, 2)])
    one, two = np.sqrt((low[:, :, :2] ** 2).mean(axis=1))
    return {
        "rows": rows,
        "one": {"sigma": f"{one[0]:.3f}", "shift": f"{one[1]:.1f}"},
        "two": {"sigma": f"{two[0]:.3f}", "shift": f"{two[1]:.1f}"},
    }


def transported(d: cuticle.Document, printed: Printed) -> dict[str, Any]:
    """Return table 3 of light that is followed through strands at its true angles, beside the printed one and ours."""
    models = (d.model, cuticle.DualScattering(d.model.fibre.replace(formulation="exact")))
    rows = []
    for strands in (1.0, 2.0, 4.0, 8.0):
        through = [m.with_strands(strands) for m in models]
        f = np.array(
            [
                [(sigma, shift, scale), *(table_3_row(m, theta_r) for m in through)]
                for (n, theta_r), (scale, sigma, shift) in printed.table_3.items()
                if n == strands and abs(theta_r) <= 60
            ]
        )
        sigmas, slopes = f[:, :, 0].mean(axis=0), np.ptp(f[:, :, 1], axis=0)
        cells = [*(f"{x:.2f}" for x in sigmas), *(f"{x:.0f}°" for x in slopes), f"{np.median(f[:, 2, 2] / f[:, 0, 2]):.2g}"]
        rows.append({"n": f"{strands:g}", "cells": cells})
    found = find_functions(d.table_2, table_3(models[1], theta_r=THETA_R_2), d.axis)
    return {"rows": rows, "functions": [f for f in functions(found.choices) if f["symbol"] in ("σ", "μ")]}


def context(d: cuticle.Document, printed: Printed) -> dict[str, Any]:
    data = d.to_dict()
    assert d.found is not None
    rows_2 = [r for r in data["table_2"]["rows"] if r["sigma_V"]["printed"] is not None]
    rows_3 = [r for r in data["table_3"]["rows"] if r["sigma"]["printed"] is not None]
    inner_1 = [r for r in data["table_1"]["rows"] if abs(r["theta_r_deg"]) <= 60]
    draft = printed.draft_forms()
    beside = []
    for per in ("steradian", "radian"):
        found = find_functions(table_2(d.model, axis=d.axis, per=per), d.table_3, d.axis)
        fit = cuticle.fit(d.model, form="document", strands=[0], functions=found.functions)
        _, mean, _, beyond = fit.summary[0]
        beside.append({"mean": f"{mean:.2f}", "beyond": f"{beyond:.2f}"})
    counts = list(data["quality"]["lobes"])
    mixing = data["combined"][0]

    return {
        "f": d.model.fibre,
        "claims": data["claims"],
        "t1": {k: f"{v:.1f}" for k, v in data["table_1"]["rms_within_60_deg"].items()},
        "t1_worst": f"{max(abs(r['theta_i_deg']['difference']) for r in inner_1):.1f}",
        "t2": {k: f"{v:.3f}" if k.startswith("sigma") else f"{v:.2f}" for k, v in data["table_2"]["rms"].items()},
        "t2_rows": [
            {
                "t": signed(r["theta_r_deg"], 0),
                "sv": f"{r['sigma_V']['ours']:.2f}",
                "psv": f"{r['sigma_V']['printed']:.2f}",
                "sh": f"{r['sigma_H']['ours']:.2f}",
                "psh": f"{r['sigma_H']['printed']:.2f}",
                "mu": signed(r["shift_H_deg"]["ours"], 1),
                "pmu": signed(r["shift_H_deg"]["printed"], 1),
            }
            for r in rows_2
        ],
        "residual_80": f"{100 * max(r['residual_V'] for r in data['table_2']['rows'] if abs(r['theta_r_deg']) == 80):.1f}",
        "printed_functions": functions(d.printed_choices),
        "own_functions": functions(d.found.choices),
        "line": draft["mu_H"].text(degrees=True),
        "quartic": draft["sigma_V"].text(),
        "shader": data["shader"],
        "steradian": beside[0],
        "radian": beside[1],
        "study": table_3_study(d.model, printed),
        "transported": transported(d, printed),
        "sigma_mean": f"{np.mean([r['sigma']['ours'] for r in rows_3 if abs(r['theta_r_deg']) <= 60]):.2f}",
        "counts": counts,
        "quality": [
            {"name": NAMES[k], "cells": [f"{row[n]['ess']:.3f} ({row[n]['total_variation']:.3f})" for n in counts]}
            for k, row in data["quality"].items()
        ],
        "mixing": {
            "weights": [f"{w:g}" for w in mixing["weights"]],
            "rows": [
                [f"{v:g}", *(f"**{x:.3f}**" if x == max(row) else f"{x:.3f}" for x in row), f"{best:.3f}"]
                for v, row, best in zip(mixing["shares"], mixing["ess"], mixing["best_possible"], strict=True)
            ],
        },
    }


def main() -> None:
    printed = Printed.find()
    if printed is None:
        sys.exit("the draft's printed tables are not at hand; set CUTICLE_DATA")
    d = cuticle.document("document", printed=printed)
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string((HERE / "document.md.j2").read_text(encoding="utf-8"))
    (HERE / "document.md").write_text(template.render(context(d, printed)).lstrip() + "\n", encoding="utf-8")
    drawn = figures(d)
    for name in PICTURES:
        (HERE / "images" / f"{name}.png").write_bytes(figure_bytes(drawn[name][0], "png"))
    print("wrote docs/document.md and", ", ".join(f"docs/images/{n}.png" for n in PICTURES))


if __name__ == "__main__":
    main()
