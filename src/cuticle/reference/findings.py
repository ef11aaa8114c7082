"""What a check finds: verdicts, worst cases and a diagnosis, in words and as plain values."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from cuticle._support.plain_values import plain
from cuticle._support.values import Value
from cuticle.reference.scans import Leads
from cuticle.reference.search import Hypothesis
from cuticle.reference.tolerance import EXPLAINED

_WORST_REGIONS = 6


@dataclass(frozen=True)
class Worst:
    """The worst value of a lobe or a region: how many there are, the share outside the tolerance, and the worst case."""

    name: str
    values: int
    outside: float
    case: int
    channel: str
    given: float
    right: float
    where: str

    @property
    def difference(self) -> float:
        """Return the relative difference of the worst value."""
        return self.given / self.right - 1 if self.right else float("inf")


@dataclass(frozen=True)
class Checked:
    """What is said of one quantity, f or the density.

    Attributes
    ----------
    name, values
        "f" or "pdf", and how many values there are.
    verdict
        "right", "right but for an approximation" or "wrong".
    outside
        The share of values outside the tolerance.
    tolerance
        In words.
    lobes, regions
        The worst case of each.
    best
        The hypothesis that explains the values, or explains most; None where they are right.
    alternatives, singles
        Others that explain them as well; single slips by misfit, best first.
    leads
        Where to look, where no hypothesis explains the values.
    strays
        Cases that are off where all others are right, or where they are few.
    numberless
        How many cases have a value that is no number, and what they have in common.
    """

    name: str
    values: int
    verdict: str
    outside: float
    tolerance: str
    lobes: tuple[Worst, ...]
    regions: tuple[Worst, ...]
    best: Hypothesis | None = None
    alternatives: tuple[Hypothesis, ...] = ()
    singles: tuple[Hypothesis, ...] = ()
    leads: Leads | None = None
    strays: tuple[int, ...] = ()
    numberless: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the values are right, or off by an approximation that is known."""
        return self.verdict != "wrong"


@dataclass(frozen=True, eq=False)
class Findings(Value):
    """The result of a check: `ok`, and for f and for the density the verdict, the worst cases and the diagnosis.

    Attributes
    ----------
    name, about, cases
        The file, the model, and the number of cases.
    precision
        "single" or "double", and how that was chosen.
    checked
        One `Checked` for each quantity that has values.
    notes
        What else was noticed.
    """

    name: str
    about: str
    cases: int
    precision: str
    checked: tuple[Checked, ...]
    wrong: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether all is right."""
        return not self.wrong and all(c.ok for c in self.checked)

    @property
    def slips(self) -> tuple[str, ...]:
        """Names of the slips that explain the values; empty where none is needed, or none explains them."""
        found = [c.best for c in self.checked if c.best is not None and c.best.explains]
        return tuple(dict.fromkeys(s.name for h in found for s in h.slips))

    def to_dict(self) -> dict[str, Any]:
        """Return the findings as plain values that JSON can hold."""
        return plain(_as_dict(self))

    def __str__(self) -> str:
        return _as_text(self)

    __repr__ = __str__


def _as_text(found: Findings) -> str:
    """Return the findings as text for a terminal."""
    lines = [f"{found.name}: {found.about}, {found.cases:,} cases; precision {found.precision}"]
    for text in found.wrong[:5]:
        lines.append(f"NOT A NUMBER: {text}")
    if len(found.wrong) > 5:
        lines.append(f"… and {len(found.wrong) - 5} more values that are no numbers")
    for c in found.checked:
        lines += ["", *_checked(c)]
    lines += ["", *(f"note: {n}" for n in found.notes)]
    lines.append(f"verdict: {'right' if found.ok else 'WRONG'}" + _summary(found))
    return "\n".join(lines)


def _summary(found: Findings) -> str:
    parts = []
    for c in found.checked:
        if c.best is None:
            continue
        what = _one_change(c) or "no known slip explains it"
        if c.best.explains:
            what = c.best.name + (", and some values are far off" if c.best.strays else "") if c.best.slips else _all_but(c)
        parts.append(f"{c.name}: {what}")
    return f" ({'; '.join(parts)})" if parts else ""


def _all_but(c: Checked) -> str:
    return f"all cases but {len(c.strays)} are right"


def _one_change(c: Checked) -> str:
    """Return the change that explains the values, on top of the known slips, if one does."""
    if c.best is None or c.leads is None or not c.leads.explain:
        return ""
    return " + ".join([s.name for s in c.best.slips] + [c.leads.clues[0].words])


def _checked(c: Checked) -> list[str]:
    title = f"{c.name}: {c.verdict.upper() if not c.ok else c.verdict}"
    lines = [f"{title}; {c.values:,} values, {_percent(c.outside)} of them off by more than {c.tolerance}"]
    lines += [f"  {text}" for text in c.numberless]
    if c.verdict == "right" or (c.best is None and not c.outside):
        worst = max(c.lobes, key=lambda w: abs(w.difference))
        return [*lines, f"  the largest difference is {worst.difference:+.2g} of the value, in case {worst.case}"]
    lines += _table("by lobe that dominates", c.lobes)
    regions = sorted(c.regions, key=lambda w: -w.outside)[:_WORST_REGIONS]
    lines += _table("by region, the worst", regions)
    if c.best is None:  # every value is 0, which a note says
        return lines
    return lines + (_explained(c) if c.best.explains else _unexplained(c))


def _table(title: str, rows: Any) -> list[str]:
    lines = [f"  {title:<44}{'values':>8}{'off':>8}{'worst':>10}  case, given, right"]
    for w in rows:
        lines.append(f"    {w.name:<42}{w.values:>8,}{_percent(w.outside):>8} {_difference(w):>9}  {w.case}{_of(w)}")
    worst = max(rows, key=lambda w: w.outside)
    return [*lines, f"    the inputs of case {worst.case}: {worst.where}"] if title.startswith("by lobe") else lines


def _of(w: Worst) -> str:
    channel = f" {w.channel}" if w.channel else ""
    return f"{channel}: {w.given:.6g}, {w.right:.6g}"


def _difference(w: Worst) -> str:
    d = w.difference
    return f"{100 * d:+.2g} %" if abs(d) < 0.995 else f"× {w.given / w.right:.3g}" if w.right else "–"


def _percent(share: float) -> str:
    return "100 %" if share == 1 else f"{100 * share:.1f} %" if share >= 0.995 else f"{100 * share:.2g} %"


def _explained(c: Checked) -> list[str]:
    best = c.best
    assert best is not None
    if not best.slips:
        return [f"  diagnosis: {_all_but(c)}, and no known slip explains those; see what is particular to case {_strays(c)}"]
    lines = [f"  diagnosis: {best.name}; with {_them(best)}, {_percent(best.outside)} of the values are off"]
    if best.strays:
        lines.append("    some of these are so far off that it is not all that is wrong")
    lines += _slips(best)
    for h in c.alternatives:
        lines.append(f"    these values do not tell it from: {h.name} ({_percent(h.outside)} off)")
    others = [h for h in c.singles if h.slips and h.slips != best.slips and h.outside < 0.5 * c.outside][:3]
    if others:
        tail = "; ".join(f"{h.name} {_percent(h.outside)}" for h in others)
        lines.append(f"    single slips, and what each leaves off (of the cases searched): {tail}")
    return lines


def _strays(c: Checked) -> str:
    return ", ".join(map(str, c.strays[:12])) + (" …" if len(c.strays) > 12 else "")


def _them(h: Hypothesis) -> str:
    return "it" if len(h.slips) == 1 else f"these {len(h.slips)} together"


def _slips(h: Hypothesis) -> list[str]:
    lines = []
    for s in h.slips:
        lines += [f"    {s.name}: {s.meaning}", f"      right: {s.right}", f"      here:  {s.wrong}"]
    return lines


def _unexplained(c: Checked) -> list[str]:
    best = c.best
    assert best is not None
    change = _one_change(c)
    lines = ["  diagnosis: none of the known slips explains it; one at a time, other numbers and exponents were tried"]
    if change:
        lines = [f"  diagnosis: {change}; found among other numbers and exponents, which were tried one at a time"]
    if best.slips:
        lines.append(
            f"    nearest: {best.name}, which leaves {_percent(best.outside)} off (median difference {best.median:.2g})"
        )
        lines += [f"      {s.name}: {s.meaning}" for s in best.slips]
    if c.strays and not change:
        lines.append(f"    only these cases are off: {_strays(c)}")
    if c.leads is None:
        return lines
    on_top = " on top of that" if best.slips else ""
    for clue in c.leads.clues:
        does = "explains it" if clue.outside <= EXPLAINED else "would help"
        lines.append(f"    {does}{on_top}: {clue.words} ({_percent(clue.outside)} of the cases searched left off)")
    if change:
        return lines
    if c.leads.lobes:
        lines.append(f"    by channel, value and lobe{on_top}:")
        lines += [f"      {text}" for text in c.leads.lobes]
    lines += [f"    {text}" for text in c.leads.inputs]
    return lines


def _as_dict(found: Findings) -> dict[str, Any]:
    """Return the findings as dictionaries and lists."""
    return {
        "name": found.name, "about": found.about, "cases": found.cases, "precision": found.precision, "ok": found.ok,
        "slips": list(found.slips), "not_numbers": list(found.wrong), "notes": list(found.notes),
        "checked": [_checked_dict(c) for c in found.checked],
    }  # fmt: skip


def _checked_dict(c: Checked) -> dict[str, Any]:
    return {
        "quantity": c.name, "values": c.values, "verdict": c.verdict, "outside": c.outside, "tolerance": c.tolerance,
        "lobes": [asdict(w) for w in c.lobes], "regions": [asdict(w) for w in c.regions],
        "diagnosis": None if c.best is None else _hypothesis(c.best),
        "alternatives": [_hypothesis(h) for h in c.alternatives], "singles": [_hypothesis(h) for h in c.singles],
        "leads": None if c.leads is None else asdict(c.leads), "strays": list(c.strays),
        "without_a_number": list(c.numberless),
    }  # fmt: skip


def _hypothesis(h: Hypothesis) -> dict[str, Any]:
    slips = [{"name": s.name, "meaning": s.meaning, "right": s.right, "here": s.wrong} for s in h.slips]
    return {"slips": slips, "outside": h.outside, "median_difference": h.median, "explains": h.explains}
