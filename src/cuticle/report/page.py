"""The report: one self-contained HTML page from the results of fit, check and document in a folder."""

from __future__ import annotations

import base64
import json
import os
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cuticle._support.extras import needed
from cuticle._support.files import read_bytes, read_text, reading, shown, write_text
from cuticle._support.json_file import read_json
from cuticle._support.plain_values import number
from cuticle._support.version import __version__
from cuticle.draft.as_values import VERSION
from cuticle.draft.layout import shown_tables

with needed("cuticle.report"):
    import jinja2

RESULTS = {
    "fit.json": "cuticle fit PRESET|FILE.toml -o DIR",
    "check.json": "cuticle check DIR -o DIR/check.json",
    "document.json": "cuticle document PRESET|FILE.toml -o DIR",
}
LIMIT = 5_000_000  # bytes of the page


def write_report(folder: str | os.PathLike[str]) -> Path:
    """Write DIR/report.html from what `fit`, `check` and `document` left in DIR, and return its path.

    The page needs no network and no other file. What is missing is named on it, with the command that makes it.

    Raises
    ------
    ValueError
        The folder holds no result, or one that cannot be read, or the page would pass 5 MB.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"{folder} is not a folder; give the one that `cuticle fit -o` or `cuticle document -o` wrote to")
    found = {name: _read(folder / name) for name in RESULTS if (folder / name).exists()}
    if not found:
        raise ValueError(f"{folder} holds none of {', '.join(RESULTS)}; make one with `{RESULTS['document.json']}`")
    views: dict[str, Callable[[Any, Path], dict[str, Any]]] = {
        "fit.json": _fit_view,
        "check.json": _check_view,
        "document.json": _document_view,
    }
    page: dict[str, Any] = {name.removesuffix(".json"): None for name in RESULTS}
    for name, data in found.items():
        with reading(folder / name, "result", remedy=f"it is not what `{RESULTS[name]}` writes, make it again"):
            page[name.removesuffix(".json")] = views[name](data, folder)
    page["name"] = (found.get("document.json") or {}).get("name") or ""
    page["missing"] = [{"name": n, "command": c.replace("DIR", shown(folder))} for n, c in RESULTS.items() if n not in found]
    page["densities"] = _densities(folder)
    with reading(folder, "the fibre in"):
        page["fibre"] = _fibre_rows(_fibre(found, folder))
    page["versions"] = versions()
    with reading(folder, "results in"):
        html = templates().get_template("report.html.j2").render(page)
    if len(html.encode()) > LIMIT:
        raise ValueError(f"the report would have {len(html.encode()) / 1e6:.1f} MB, more than 5; draw smaller figures")
    return write_text(folder / "report.html", html)


def versions() -> list[tuple[str, str]]:
    """Return what made a page, by name."""
    return [
        ("Cuticle", __version__),
        ("Python", platform.python_version()),
        ("NumPy", np.__version__),
        ("machine", f"{platform.system()} {platform.machine()}"),
    ]


def templates() -> jinja2.Environment:
    """Return Jinja's environment of the pages; what results say is escaped."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("cuticle.report"), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip


def _read(path: Path) -> Any:
    with reading(path, "result"):
        try:
            data = read_json(read_text(path, "result"))
        except json.JSONDecodeError as error:
            raise ValueError(f"it is cut short or no JSON ({error})") from None
        if not isinstance(data, dict):
            raise ValueError("it must hold one object")
        return data


def ess_cell(value: float) -> dict[str, str]:
    """Return an ESS as text, and how good it is: the cell's shade says what the digits say."""
    grade = "good" if value >= 0.95 else "fair" if value >= 0.8 else "poor"
    return {"text": f"{value:.3f}", "grade": grade}


_CHANNELS = ("R", "G", "B")


def _fit_view(data: dict[str, Any], _: Path) -> dict[str, Any]:
    ess = np.array(data["ess"])
    worst = data.get("worst")
    return {
        "title": f"{data['lobes']} lobes, {data['form']}, objective {data['objective']}, fitted in {data['seconds']:.2f} s",
        "theta_r": [f"{number(t, 0)}°" for t in data["theta_r_degrees"]],
        "rows": [
            {
                "strands": f"{n:g}",
                "cells": [ess_cell(x) for x in row],
                "channels": [ess_cell(x) for x in np.min(channels, axis=0)],
                "weight": f"{max(w):.3g}",
            }
            for n, row, channels, w in zip(
                data["strands"], data["ess"], data["ess_channels"], data["largest_weight"], strict=True
            )
        ],
        "channels": [f"channel {c}" for c in _CHANNELS[: len(data["ess_channels"][0][0])]]
        if 1 < len(data["ess_channels"][0][0]) <= len(_CHANNELS)
        else [],
        "mean": f"{ess.mean():.3f}",
        "worst": f"{ess.min():.3f}",
        "between": worst
        and f"{worst['ess']:.3f} at θᵣ {np.degrees(worst['theta_r']):.1f}° through {worst['strands']:g} strands",
    }


def _check_view(data: dict[str, Any], _: Path) -> dict[str, Any]:
    return {
        "ok": data["ok"],
        "samples": f"{data['samples']:,}",
        "cases": len(data["cases"]),
        "verdicts": [
            {
                "passed": v["passed"],
                "undecided": v.get("undecided", ""),
                "name": v["name"],
                "value": "–" if v["value"] is None else f"{v['value']:.2g}",
                "limit": f"{v['limit']:.2g}",
                "where": v["where"],
                "meaning": v["meaning"],
            }
            for v in data["verdicts"]
        ],
        "controls": [
            {
                "strands": f"{c['strands']:g}",
                "name": c["name"],
                "caught": "caught" if c["caught"] else "missed" if c["applies"] else "hardly a change",
                "good": c["caught"] or not c["applies"],
                "evidence": c["evidence"],
            }
            for c in data["controls"]
        ],
        "caught": f"{sum(c['caught'] for c in data['controls'])} of {len(data['controls'])}",
    }


_GRADE = {"holds": "good", "holds in part": "fair", "does not hold": "poor"}
_NAMES = {
    "sigma_V": ("σ_V", "direct, along ϕ"),
    "sigma_H": ("σ_H", "direct, along θᵢ"),
    "mu_H": ("μ_H", "direct, shift of the peak from −θᵣ"),
    "sigma": ("σ", "through n strands, along θᵢ"),
    "mu": ("μ", "through n strands, shift of the mean from −θᵣ"),
}


def _document_view(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    if data["version"] > VERSION:
        raise ValueError(f"{folder / 'document.json'} has version {data['version']}, newer than {VERSION}; upgrade cuticle")
    functions = data["functions"]
    return {
        "claims": [
            {"quote": c["quote"], "verdict": c["verdict"], "grade": _GRADE[c["verdict"]], "finding": c["finding"]}
            for c in data["claims"]
        ],
        "functions": None if functions is None else [_function(name, f) for name, f in functions.items()],
        "from_printed": [_function(name, f) for name, f in (data["functions_from_printed"] or {}).items()],
        "reason": data["no_functions_because"],
        "shader": data["shader"],
        "axis": f"{data['highlight_phi_deg']:.0f}°",
        "tables": shown_tables(data),
        "mixing": [_mixing(m, [n for n in data["quality"]["lobes"] if n != "0"]) for m in data["combined"]],
        "quality": _quality(data["quality"], data["lobes"]),
        "figures": [
            {
                "name": name,
                "title": f["title"],
                "caption": f["caption"],
                "alt": f["alt"],
                "source": _image(folder / f["file"]),
            }
            for name, f in data["figures"].items()
        ],
    }


def _function(name: str, f: dict[str, Any]) -> dict[str, Any]:
    symbol, meaning = _NAMES[name]
    unit = 180 / np.pi if name.startswith("mu") else 1.0

    def told(form: dict[str, Any]) -> dict[str, str]:
        return {
            "text": form["text"],
            "rms": "–" if form["rms"] is None else f"{unit * form['rms']:.2g}{'°' if unit != 1 else ' rad'}",
            "criterion": "–" if form["criterion"] is None else number(form["criterion"], 1),
        }

    best = told(f["best"])
    return {"symbol": symbol, "meaning": meaning, "best": best, "others": [told(o) for o in f["runners_up"]]}


def _mixing(m: dict[str, Any], counts: list[str]) -> dict[str, Any]:
    rows = []
    for share, row, best in zip(m["shares"], m["ess"], m["best_possible"], strict=True):
        top = int(np.argmax(row))
        cells = [{"text": f"{x:.3f}", "top": i == top} for i, x in enumerate(row)]
        rows.append({"share": f"{share:g}", "cells": cells, "best": f"{best:.3f}"})
    strands = m["strands"]
    return {
        "title": f"None or an unknown number of strands ({', '.join(counts)} alike)"
        if strands is None
        else f"None or {strands:g} strands",
        "weights": [f"{w:g}" for w in m["weights"]],
        "rows": rows,
    }


_SAMPLERS = {
    "uniform": "uniform sphere",
    "draft": "the draft's form, its printed numbers",
    "found": "the draft's form, functions found here",
    "lobes": "{} fitted lobes",
}


def _quality(quality: dict[str, Any], lobes: int) -> dict[str, Any]:
    counts = list(quality["lobes"])
    return {
        "strands": counts,
        "rows": [
            {
                "name": _SAMPLERS[name].format(lobes),
                "cells": [ess_cell(row[n]["ess"]) | {"tv": f"{row[n]['total_variation']:.3f}"} for n in counts],
            }
            for name, row in quality.items()
        ],
    }


def _image(path: Path) -> str:
    kinds = {".svg": "image/svg+xml", ".png": "image/png"}
    data = base64.b64encode(read_bytes(path, "figure"))
    return f"data:{kinds[path.suffix]};base64,{data.decode()}"


def _densities(folder: Path) -> str | None:
    path = folder / "densities.png"
    return _image(path) if path.is_file() else None


def _fibre(found: dict[str, Any], folder: Path) -> dict[str, Any]:
    if "document.json" in found:
        made = found["document.json"]
        return dict(made.get("fibre") or {"model": made.get("model")}) | {"formulation": made.get("formulation")}
    if (folder / "sampler.json").is_file():
        about = _read(folder / "sampler.json").get("about") or {}
        source = about.get("source") or {}
        return dict(about.get("fibre") or about.get("chiang") or {k: str(v) for k, v in source.items()})
    return {}


_UNITS = {"alpha": "°", "beta": "°", "sigma": " per radius"}


def _fibre_rows(fibre: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, value in fibre.items():
        if value is None:
            continue
        values = value if isinstance(value, list) else [value]
        unit = next((u for prefix, u in _UNITS.items() if name.startswith(prefix)), "")
        rows.append((name, ", ".join(f"{v:g}" if isinstance(v, (int, float)) else str(v) for v in values) + unit))
    return rows
