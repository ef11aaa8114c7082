"""The page of an audit, or of two side by side: one self-contained HTML file."""

from __future__ import annotations

import base64
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from cuticle._support.files import write_text
from cuticle.checking.audit import Audit
from cuticle.checking.compare_audits import Comparison
from cuticle.checking.measurements import AuditMeasurement
from cuticle.checking.sample_file import Dump
from cuticle.checking.verdicts import Outcome, Verdict
from cuticle.report.page import ess_cell, templates, versions

_GRADES: dict[Outcome, str] = {"pass": "good", "inconclusive": "fair", "fail": "poor"}
_RESULTS: dict[Outcome, str] = {"pass": "passes", "inconclusive": "is inconclusive", "fail": "FAILS"}


def write_audit_page(path: str | os.PathLike[str], result: Audit | Dump | Comparison) -> Path:
    """Write an audit, an audit of a file of samples, or two audits side by side as one HTML page; return its path.

    The page needs no network and no other file.
    """
    return write_text(path, audit_page(result))


def audit_page(result: Audit | Dump | Comparison) -> str:
    """Return that page as text."""
    subjects: list[Audit | Dump] = [result.first, result.second] if isinstance(result, Comparison) else [result]
    page = {
        "title": " and ".join(s.name for s in subjects),
        "subjects": [_subject(s) for s in subjects],
        "comparison": _comparison(result) if isinstance(result, Comparison) else None,
        "level": f"{1 / subjects[0].level:,.0f}",
        "versions": versions(),
    }
    return templates().get_template("audit.html.j2").render(page)


def _subject(result: Audit | Dump) -> dict[str, Any]:
    view: dict[str, Any] = {
        "name": result.name,
        "grade": _GRADES[result.outcome],
        "result": _RESULTS[result.outcome],
        "verdicts": [_verdict(v) for v in result.verdicts],
        "notes": result.notes,
        "picture": None,
        "viewers": [],
    }
    if isinstance(result, Dump):
        about = f"{result.rows:,} rows, {result.viewers} viewers, {result.patches} patches tested."
        if math.isfinite(result.mean_weight):
            about += (
                f" Mean weight {result.mean_weight:.5g} ± {result.error:.2g}, ESS {result.ess:.3f}, largest weight"
                f" {result.largest_weight:.3g} of the mean."
            )
        return view | {"about": about}
    worst = result.worst
    return view | {
        "about": f"{len(result.cases)} viewers, {result.samples:,} samples each, {result.seconds:.1f} s.",
        "picture": f"data:image/png;base64,{base64.b64encode(result.figure()).decode()}",
        "difference": f"θᵣ {np.degrees(worst.theta_r):.3g}°, p-value {worst.p_value:.2g}: "
        + (worst.region.text() if worst.region is not None else "samples and density agree"),
        "viewers": [_viewer(m) for m in result.cases],
    }


def _verdict(v: Verdict) -> dict[str, str]:
    return {
        "outcome": "FAIL" if v.outcome == "fail" else v.outcome,
        "grade": _GRADES[v.outcome],
        "name": v.name,
        "value": _number(v.value),
        "limit": _number(v.limit),
        "where": v.undecided or v.where,
        "meaning": v.meaning,
    }


def _viewer(m: AuditMeasurement) -> dict[str, Any]:
    channels = min(m.ess_channels) if m.ess_channels else math.nan
    return {
        "theta_r": f"{np.degrees(m.theta_r):.3g}°",
        "integral": f"{m.integral:.5f}",
        "dropped": f"{m.dropped:.3g}",
        "p_value": f"{m.p_value:.2g}",
        "variation": f"{m.total_variation:.4f}",
        "noise": f"{m.noise_floor:.4f}",
        "ess": [_ess(m.ess), _ess(channels)],
        "weight": _number(m.largest_weight, 3),
    }


def _comparison(c: Comparison) -> dict[str, Any]:
    far, same = c.farthest, c.same_function
    about = f"The two pdfs differ most at θᵣ {np.degrees(far.theta_r):.3g}°, with a TV distance of {far.distance:.3f}."
    if same is False:
        about += " ∫ f cos differs by over 1 %: the two sample different functions, and their ESS are of their own."
    return {
        "about": about,
        "verdicts": [
            {
                "name": pair.name,
                "cells": [_cell(v) for v in (pair.first, pair.second)],
                "limit": _number(known.limit),
                "meaning": known.meaning,
            }
            for pair in c.verdicts
            if (known := pair.first or pair.second) is not None
        ],
        "viewers": [
            {
                "theta_r": f"{np.degrees(v.theta_r):.3g}°",
                "ess": [_ess(x) for x in v.ess],
                "weights": [_number(x, 3) for x in v.largest_weight],
                "energy": [_number(x, 4) for x in v.energy],
                "distance": f"{v.distance:.3f}",
                "where": f"{v.where}: {100 * v.shares[0]:.3g} % against {100 * v.shares[1]:.3g} %",
            }
            for v in c.viewers
        ],
    }


def _cell(v: Verdict | None) -> dict[str, str]:
    if v is None:
        return {"outcome": "not tested", "grade": "", "value": ""}
    return {k: _verdict(v)[k] for k in ("outcome", "grade", "value")}


def _ess(value: float) -> dict[str, str]:
    return ess_cell(value) if math.isfinite(value) else {"text": "–", "grade": ""}


def _number(value: float, digits: int = 2) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else "–"
