"""The draft's tables as they are shown: titles, columns, digits; for the terminal and the report alike."""

from __future__ import annotations

from typing import Any, NamedTuple

from cuticle._support.plain_values import number


class Column(NamedTuple):
    """A column of a table: its key in the values, its header, its digits and its unit in a sentence."""

    key: str
    header: str
    digits: int
    unit: str = ""


class Layout(NamedTuple):
    """How one of the tables is shown; `rms` names its rms differences, `within` the part of the table they are of."""

    values: str
    title: str
    about: str
    keys: tuple[Column, ...]
    columns: tuple[Column, ...]
    rms: str
    within: str


class Cell(NamedTuple):
    """Ours, the draft's and the difference, as text; a dash for what is not there."""

    ours: str
    printed: str
    difference: str


class Row(NamedTuple):
    """A row: what tells it from others, its cells, and what has to be said of it."""

    keys: list[str]
    cells: list[Cell]
    note: str


class Shown(NamedTuple):
    """A table of text: `printed` says whether the draft's values are beside ours, `rms` how far they are apart."""

    title: str
    about: str
    keys: list[str]
    columns: list[str]
    rows: list[Row]
    printed: bool
    rms: str


_THETA = Column("theta_r_deg", "θᵣ", 0, "°")
LAYOUTS = (
    Layout(
        "table_1",
        "Table 1: where the distribution is largest",
        "Degrees. At θᵣ = ±90° the azimuth has no meaning, and f·cos no bound.",
        (Column("phi_r_deg", "ϕᵣ", 0, "°"), _THETA),
        (Column("theta_i_deg", "θᵢ", 1, "°"), Column("phi_i_deg", "ϕᵢ", 1, "°")),
        "rms_within_60_deg",
        "Within 60°",
    ),
    Layout(
        "table_2",
        "Table 2: Gaussians through the highlight, direct light",
        "σ in radians, shifts in degrees, s in units of f·cos times radians.",
        (_THETA,),
        (
            Column("s_V", "s_V", 2), Column("sigma_V", "σ_V", 3, " rad"), Column("shift_V_deg", "shift V", 1, "°"),
            Column("s_H", "s_H", 2), Column("sigma_H", "σ_H", 3, " rad"), Column("shift_H_deg", "shift H", 1, "°"),
        ),
        "rms",
        "In all",
    ),
    Layout(
        "table_3",
        "Table 3: one Gaussian through n strands",
        "Of f·cos² θᵢ, the mean over all azimuths: a density of θᵢ. σ in radians, shift in degrees.",
        (Column("strands", "n", 0), _THETA),
        (Column("s", "s", 4), Column("sigma", "σ", 3, " rad"), Column("shift_deg", "shift", 1, "°")),
        "rms_within_60_deg",
        "Within 60°",
    ),
)  # fmt: skip


def shown_tables(values: dict[str, Any]) -> list[Shown]:
    """Return the three tables as text, from a document's plain values."""
    return [_shown(layout, values[layout.values]) for layout in LAYOUTS]


def _shown(layout: Layout, table: dict[str, Any]) -> Shown:
    rows = [
        Row(
            [number(row[k.key], k.digits) + k.unit for k in layout.keys],
            [
                Cell(
                    number(row[c.key]["ours"], c.digits),
                    number(row[c.key]["printed"], c.digits),
                    number(row[c.key]["difference"], c.digits, sign=True),
                )
                for c in layout.columns
            ],
            row.get("note", ""),
        )
        for row in table["rows"]
    ]
    rms = _differences(layout, table[layout.rms])
    if rms:
        by_strands = [f"n = {n}: {_differences(layout, x)}" for n, x in table.get("rms_by_strands", {}).items()]
        rms = f"{layout.within} the rms difference is {rms}" + "".join(f"; {x}" for x in by_strands) + "."
    return Shown(
        layout.title, layout.about, [k.header for k in layout.keys], [c.header for c in layout.columns], rows,
        any(row[c.key]["printed"] is not None for row in table["rows"] for c in layout.columns), rms,
    )  # fmt: skip


def _differences(layout: Layout, rms: dict[str, Any]) -> str:
    known = [(c, rms[c.key]) for c in layout.columns if rms[c.key] is not None]
    return ", ".join(f"{number(x, max(c.digits, 2))}{c.unit} in {c.header}" for c, x in known)
