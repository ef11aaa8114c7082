"""A reproduction as plain values for JSON: ours beside the printed, with differences and their rms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from cuticle._support.version import __version__
from cuticle.draft.findings import Findings
from cuticle.draft.functions import Choice
from cuticle.draft.gaussians import Gaussian
from cuticle.fitting.closed_forms import ClosedForm
from cuticle.scattering.by_name import provenance

FORMAT, VERSION = "cuticle-document", 1  # what the report reads
Cell = dict[str, float | None]


def as_values(d: Findings) -> dict[str, Any]:
    """Return the findings as plain values that JSON can hold."""
    found, of = d.found, provenance(d.model)
    return {
        "format": FORMAT,
        "version": VERSION,
        "cuticle": __version__,
        "name": d.name,
        "fibre": of["fibre"] if "fibre" in of else of.get("chiang", {}),
        "model": repr(d.model),
        "formulation": of.get("formulation"),
        "highlight_phi_deg": math.degrees(d.axis),
        "table_1": _table_1(d),
        "table_2": _table_2(d),
        "table_3": _table_3(d),
        "claims": [{"quote": c.quote, "verdict": c.verdict, "finding": c.finding, "numbers": c.numbers} for c in d.claims],
        "functions": {name: _choice(name, c) for name, c in found.choices.items()} if found is not None else None,
        "no_functions_because": d.reason or None,
        "shader": None if found is None else dict(zip(("direct", "strands"), found.functions.code(), strict=True)),
        "functions_from_printed": {name: _choice(name, c) for name, c in d.printed_choices.items()} or None,
        "lobes": d.fits["lobes"].sampler.lobes,
        "quality": d.quality,
        "combined": [
            {"strands": m.strands, "shares": m.shares, "weights": m.weights, "ess": m.ess, "best_possible": m.best}
            for m in d.mixing
        ],
    }


def cell(ours: float | None, printed: float | None, *, turn: float | None = None) -> Cell:
    """Return ours, printed and their difference; `turn` is the period of an angle."""
    difference = None
    if ours is not None and printed is not None:
        difference = ours - printed
        if turn is not None:
            difference = (difference + turn / 2) % turn - turn / 2
    return {"ours": ours, "printed": printed, "difference": difference}


def rms(cells: Sequence[Cell]) -> float | None:
    """Return the rms of the differences that there are."""
    d = [c["difference"] for c in cells if c["difference"] is not None]
    return math.sqrt(sum(x * x for x in d) / len(d)) if d else None


def _degrees(x: float | None) -> float | None:
    return None if x is None else math.degrees(x)


def _scale_and_sigma(g: Gaussian | None) -> tuple[float | None, float | None]:
    return (None, None) if g is None else (g.scale, g.sigma)


def _residual(g: Gaussian | None) -> float | None:
    return None if g is None else g.residual


def _note(holds: bool, *gaussians: Gaussian | None) -> str:
    """Say where no Gaussian describes a row, and by how much."""
    if holds:
        return ""
    known = [100 * g.residual for g in gaussians if g is not None]
    return f"no Gaussian: residual {max(known):.1f} % of the peak" if known else "no Gaussian fits"


def _table_1(d: Findings) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    for r in d.table_1:
        key = (round(math.degrees(r.phi_r)), round(math.degrees(r.theta_r)))
        printed = d.printed.table_1.get((float(key[0]), float(key[1]))) if d.printed else None
        phi = math.degrees(r.phi_i)
        if printed is not None:  # f is even in phi: of the two maxima, the one that the draft took
            phi = min((phi, math.degrees(r.mirror)), key=lambda x: abs((x - printed[1] + 180) % 360 - 180))
        rows.append(
            {
                "phi_r_deg": key[0],
                "theta_r_deg": key[1],
                "theta_i_deg": cell(math.degrees(r.theta_i), printed[0] if printed else None),
                "phi_i_deg": cell(phi, printed[1] if printed else None, turn=360.0),
            }
        )
    inner = [r for r in rows if abs(r["theta_r_deg"]) <= 60]
    return {"rows": rows, "rms_within_60_deg": {k: rms([r[k] for r in inner]) for k in ("theta_i_deg", "phi_i_deg")}}


def _table_2(d: Findings) -> dict[str, Any]:
    names = ("s_V", "sigma_V", "shift_V_deg", "s_H", "sigma_H", "shift_H_deg")
    rows: list[dict[str, Any]] = []
    for r in d.table_2:
        degrees = round(math.degrees(r.theta_r))
        printed = d.printed.table_2.get((float(degrees),)) if d.printed else None
        v, h = r.vertical, r.horizontal
        ours = (*_scale_and_sigma(v), 0.0 if v else None, *_scale_and_sigma(h), _degrees(r.shift))
        row: dict[str, Any] = {"theta_r_deg": degrees}
        row |= {name: cell(o, printed[i] if printed else None) for i, (name, o) in enumerate(zip(names, ours, strict=True))}
        row |= {"holds": r.holds, "residual_V": _residual(v), "residual_H": _residual(h), "note": _note(r.holds, v, h)}
        row["peak_offset_deg"] = math.degrees(r.peak_offset)
        rows.append(row)
    return {"rows": rows, "rms": {k: rms([r[k] for r in rows]) for k in names}}


def _table_3(d: Findings) -> dict[str, Any]:
    names = ("s", "sigma", "shift_deg")
    rows: list[dict[str, Any]] = []
    for r in d.table_3:
        degrees = round(math.degrees(r.theta_r))
        printed = d.printed.table_3.get((r.strands, float(degrees))) if d.printed else None
        g = r.gaussian
        ours = (*_scale_and_sigma(g), _degrees(r.shift))
        row: dict[str, Any] = {"strands": r.strands, "theta_r_deg": degrees}
        row |= {name: cell(o, printed[i] if printed else None) for i, (name, o) in enumerate(zip(names, ours, strict=True))}
        row |= {"holds": r.holds, "residual": _residual(g), "note": _note(r.holds, g)}
        rows.append(row)
    inner = [r for r in rows if abs(r["theta_r_deg"]) <= 60]
    by_count = {
        f"{n:g}": {k: rms([r[k] for r in inner if r["strands"] == n]) for k in names}
        for n in dict.fromkeys(r["strands"] for r in rows)
    }
    return {"rows": rows, "rms_within_60_deg": {k: rms([r[k] for r in inner]) for k in names}, "rms_by_strands": by_count}


def _form(name: str, form: ClosedForm) -> dict[str, Any]:
    return {
        "text": form.text(degrees=name.startswith("mu")),
        "code": form.code(),
        "coefficients": [{"value": t.coefficient, "theta_r": t.theta, "strands": t.strands or None} for t in form.terms],
        "parameter": form.parameter if any(t.strands in ("n^p", "n/(n+c)") for t in form.terms) else None,
        "rms": form.rms,
        "criterion": form.criterion,
    }


def _choice(name: str, choice: Choice) -> dict[str, Any]:
    return {"best": _form(name, choice.best), "runners_up": [_form(name, c) for c in choice.others]}
