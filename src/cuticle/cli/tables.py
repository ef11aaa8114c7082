"""Results as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table
from rich.text import Text

from cuticle.draft.layout import shown_tables

if TYPE_CHECKING:  # what a command prints, it has imported
    from cuticle.checking.check import Report
    from cuticle.checking.verdicts import Verdict
    from cuticle.fitting.result import Fit

MARKS = {"pass": Text("pass", "green"), "fail": Text("FAIL", "red"), "inconclusive": Text("inconclusive", "yellow")}
RESULTS = {
    "pass": Text("passes", "green"), "fail": Text("FAILED", "red"), "inconclusive": Text("is inconclusive", "yellow"),
}  # fmt: skip


def table(title: str, caption: str | None = None) -> Table:
    """Return an empty table in our style."""
    return Table(title=title, caption=caption, box=box.SIMPLE_HEAD, pad_edge=False, title_style="bold", title_justify="left")


def ess_text(value: float) -> str:
    """Return an ESS in four characters, so that nine viewers fit a terminal."""
    return f"{value:.2f}" if value >= 0.9995 else f"{value:.3f}"[1:]


def channels_text(channels: NDArray[np.float64]) -> str:
    """Return the ESS of each channel, (viewers, channels), at its worst viewer."""
    return " ".join(ess_text(x) for x in np.atleast_2d(channels).min(axis=0))


def fit_table(result: Fit, whole: float | None = None) -> Table:
    """Return the table of ESS by strand count and viewer; `whole` is the time of all the work in seconds."""
    caption = f"fitted in {result.seconds:.2f} s" + ("" if whole is None else f", {whole:.1f} s in all")
    caption += f"; {result.worst_text}" if result.worst else ""
    if result.candidates:
        caption += f"; {result.sampler.lobes} lobes: the fewest past which ESS per cost of a traced sample stops growing"
    grid = table(f"ESS: {result.form}, {result.sampler.lobes} lobes, objective {result.objective}", caption=caption)
    grid.add_column("strands", justify="right")
    for t in np.degrees(result.theta_r):
        grid.add_column(f"{t:.0f}°", justify="right")
    grid.add_column("channels, worst" if result.ess_channels.shape[2] > 1 else "largest weight", justify="right")
    for n, row, channels, weights in zip(
        result.sampler.strands, result.ess, result.ess_channels, result.largest_weight, strict=True
    ):
        last = channels_text(channels) if channels.shape[1] > 1 else f"{weights.max():.3g}"
        grid.add_row(f"{n:g}", *map(ess_text, row), last)
    return grid


def verdict_table(title: str, verdicts: Iterable[Verdict]) -> Table:
    """Return verdicts as a table."""
    listing = table(title)
    for column in ("", "test", "worst", "limit", "where", "what is measured"):
        listing.add_column(column)
    for v in verdicts:
        listing.add_row(MARKS[v.outcome], v.name, f"{v.value:.2g}", f"{v.limit:.2g}", v.undecided or v.where, v.meaning)
    return listing


def check_tables(report: Report) -> list[Table]:
    """Return the verdicts, the controls and the cases as tables."""
    verdicts = verdict_table(f"Verdicts: {len(report.cases)} cases of {report.samples:,} samples", report.verdicts)
    cases = table("ESS by viewer and strands, largest weight f·cos/(p ∫ f·cos), TV distance (worst viewer)")
    cases.add_column("strands", justify="right")
    angles = list(dict.fromkeys(c.theta_r for c in report.cases))
    for t in angles:
        cases.add_column(f"{np.degrees(t):.3g}°", justify="right")
    coloured = len(report.cases[0].ess_channels) > 1
    if coloured:
        cases.add_column("channels, worst", justify="right")
    cases.add_column("weight", justify="right")
    cases.add_column("TV", justify="right")
    for n in dict.fromkeys(c.strands for c in report.cases):
        row = [c for c in report.cases if c.strands == n]
        worst = f"{max(c.largest_weight for c in row):.3g}", f"{max(c.total_variation for c in row):.3f}"
        channels = [channels_text(np.array([c.ess_channels for c in row]))] if coloured else []
        cases.add_row(f"{n:g}", *(ess_text(c.ess) for c in row), *channels, *worst)
    controls = table("Negative controls: samplers broken on purpose")
    for column in ("strands", "control", "caught", "evidence"):
        controls.add_column(column)
    for c in report.controls:
        caught = "yes" if c.caught else "NO" if c.applies else "hardly a change"
        controls.add_row(f"{c.strands:g}", c.name, caught, c.evidence)
    return [cases, controls, verdicts]


def document_tables(plain: dict[str, Any]) -> list[Table]:
    """Return the draft's three tables, ours beside the printed, the functions and the claims."""
    listings = []
    for shown in shown_tables(plain):
        aside = "; ours, then printed (difference)" if shown.printed else ""
        listing = table(shown.title + aside, shown.rms)
        for header in (*shown.keys, *shown.columns):
            listing.add_column(header, justify="right")
        listing.add_column("")
        for row in shown.rows:
            cells = [
                Text.assemble(c.ours, (f" {c.printed} ({c.difference})" if c.printed != "–" else "", "dim"))
                for c in row.cells
            ]
            listing.add_row(*row.keys, *cells, row.note)
        listings.append(listing)
    functions = table("The general functions: theta = theta_r in radians", plain["no_functions_because"])
    for column in ("", "function", "rms, rad", "next best"):
        functions.add_column(column)
    for name, f in (plain["functions"] or {}).items():
        others = f["runners_up"][0]["text"] if f["runners_up"] else ""
        functions.add_row(name, f["best"]["text"], f"{f['best']['rms']:.2g}", Text(others, "dim"))
    claims = table("What the draft claims")
    for column in ("", "claim", "what was found"):
        claims.add_column(column)
    colours = {"holds": "green", "holds in part": "yellow", "does not hold": "red"}
    for c in plain["claims"]:
        claims.add_row(Text(c["verdict"], colours[c["verdict"]]), f"“{c['quote']}”", c["finding"])
    return [*listings, functions, claims]
