"""`check`: someone's values beside the reference, and what is wrong with them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.extras import MissingExtraError
from cuticle._support.progress import Progress, expect, silent
from cuticle.reference.balls import working_precision
from cuticle.reference.cases import REGIONS, Inputs
from cuticle.reference.findings import Checked, Findings, Worst
from cuticle.reference.formulas import Evaluated, Formulas
from cuticle.reference.making import values_of
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.out_of_order import in_order
from cuticle.reference.scans import leads
from cuticle.reference.search import Search, changed, judged, predicted, search
from cuticle.reference.tolerance import AVERAGED, FLOORS, Quantity, quantity
from cuticle.reference.values_file import Submission, read
from cuticle.reference.where_off import where_none_are
from cuticle.scattering.bcsdf import luminance_weights

Array = NDArray[np.float64]
PRECISIONS = ("auto", "single", "double")
_PROVEN_ROWS = {True: 200, False: 12}
_DIGITS = 6  # with fewer, rounding is more than the tolerance at times
_NEARER = 0.9  # of the values off: what slips that do not explain them must leave at most to be named
_FIRST, _PROMISING = 2, 0.97  # of the single slips that leave least of the misfit, on top of which one number is tried
_FEW = 12  # cases that are off, of which each is named
_AGREE = 1e-4  # of a tolerance's share: what double precision may be off from a proven value


def check(
    values: str | os.PathLike[str] | Submission,
    *,
    precision: str = "auto",
    tolerance: float | None = None,
    f_cos: bool = False,
    cases: str | os.PathLike[str] | None = None,
    model: str | None = None,
    progress: Progress | None = None,
) -> Findings:
    """Compare someone's values with the reference, and say which slip they have.

    Parameters
    ----------
    values
        A file, see `read`; or what `read` returns.
    precision
        "single", "double", or "auto": single where no value has over nine digits or all are floats. It decides how much
        rounding is allowed.
    tolerance
        The relative difference that is allowed besides rounding. Default: 1e-3 in single and 1e-5 in double precision for a
        closed form (so that approximations of special functions pass); .01 of the value and of its mean over azimuth for
        the far field, which is someone's quadrature or table.
    f_cos
        Whether the values of f hold the cosine.
    cases, model
        As `read` has them.
    progress
        Called with a phase and a fraction from 0 to 1.

    Returns
    -------
    Findings
        `ok`; print it for the verdicts, worst cases and diagnosis.

    Raises
    ------
    ValueError
        The file is malformed, or an argument out of range.
    """
    validate.choice("precision", precision, PRECISIONS)
    if tolerance is not None:
        validate.number("tolerance", tolerance, 1e-12, 1)
    given = values if isinstance(values, Submission) else read(values, cases=cases, model=model)
    report = progress or silent
    inputs, F = given.inputs, formulas_of(given.inputs)
    expect(progress, len(inputs) * (4e-5 if inputs.near else 2e-3) + (3 if inputs.near else 30))
    if f_cos:
        given = replace(given, f=given.f / np.cos(inputs.columns["theta_i"])[:, None])
    report("the reference", 0.02)
    wanted = bool(np.isfinite(given.pdf).any())
    right = evaluate(F, inputs, density=wanted)
    given, notes = _where_a_density_is(given, right) if wanted else (given, [])
    note, right = _certified(F, inputs, given, right)
    notes = [note, *given.notes, *notes]
    if given.digits < _DIGITS:
        notes.append(f"a quarter of the values have no more than {given.digits} digits: write nine (%.9g), rounding counts")
    report("the reference", 0.1)
    columns = [("f", given.f), ("pdf", given.pdf[:, None])]
    kept = [(n, v) for n, v in columns if np.isfinite(v).any()]
    notes += [f"no value of {name} is a number" for name, v in columns if name in given.failed and not np.isfinite(v).any()]
    notes += [f"every value of {name} is 0" for name, v in kept if not np.nan_to_num(v).any()]
    checked = []
    chosen = {n: precision if precision != "auto" else "single" if given.single[n] else "double" for n, _ in kept}
    for k, (name, v) in enumerate(kept):
        written = given.written.get(name, 0.0)
        q = quantity(name, v, F, inputs, right, chosen[name], tolerance, written)

        def part(phase: str, fraction: float, k: int = k) -> None:
            report(phase, 0.1 + 0.9 * (k + fraction) / len(kept))

        checked.append(_check(F, q, given, right, _tolerance_text(inputs, chosen[name], tolerance, written), part))
        if checked[-1].best is not None and not checked[-1].ok and precision == "auto":
            single = quantity(name, v, F, inputs, right, "single", tolerance, written)
            if single.right(predicted(right, q)):
                notes.append(f"{name} is right in single precision: if that computed it, give --precision single")
    if len(checked) == 2 and checked[0].ok != checked[1].ok:
        notes.append(
            f"{checked[0 if checked[0].ok else 1].name} is right: look at {checked[1 if checked[0].ok else 0].name} alone"
        )
    return Findings(
        given.name, inputs.about, len(inputs), _precision_text(chosen, precision), tuple(checked), given.wrong, tuple(notes)
    )  # fmt: skip


def _precision_text(chosen: Mapping[str, str], asked: str) -> str:
    if len({*chosen.values()}) > 1:
        return ", ".join(f"{p} of {name}" for name, p in chosen.items()) + " (by the values' digits)"
    if not chosen:
        return "not known"
    one = next(iter(chosen.values()))
    by = {"single": "no value has over nine digits, or all are floats", "double": "by the values' digits"}
    why = "as asked" if asked != "auto" else by[one]
    return f"{one} ({why})"


def _tolerance_text(inputs: Inputs, precision: str, tolerance: float | None, written: float) -> str:
    printed = f", and {written:.0e} as they were printed" if written else ""
    if not inputs.near:
        share = f"{tolerance or AVERAGED:g} of the value and of its mean over azimuth"
        return f"{share}, and rounding in {precision} precision{printed}"
    share = f"{tolerance or FLOORS[precision]:g} of the value"
    return f"{share}, and what rounding in {precision} precision makes of the formulas{printed}"


def _where_a_density_is(given: Submission, right: Evaluated) -> tuple[Submission, list[str]]:
    """Leave out densities of cases that have none, and say so."""
    missing = np.isfinite(given.pdf) & ~np.isfinite(right.pdf)
    if not missing.any():
        return given, []
    cases = ", ".join(str(n) for n in given.rows[missing][:5]) + (" …" if missing.sum() > 5 else "")
    note = f"{missing.sum()} densities are not checked: f has no integral over directions in case {cases}"
    return replace(given, pdf=np.where(missing, np.nan, given.pdf)), [note]


def _certified(F: Formulas, inputs: Inputs, given: Submission, right: Evaluated) -> tuple[str, Evaluated]:
    """Compare double precision with proven values, where values are furthest off and at random; return a note on it."""
    wanted = bool(np.isfinite(given.pdf).any())
    count = 2 if F.back is not None else 4 if wanted and not F.normalised else _PROVEN_ROWS[inputs.near]
    with np.errstate(all="ignore"):
        off = np.nanmax(np.nan_to_num(np.abs(given.f / right.f - 1), nan=0.0), axis=1)
    others = np.random.default_rng(2).permutation(len(inputs))
    rows = list(dict.fromkeys([*np.argsort(-off)[: count // 2].tolist(), *others.tolist()]))[:count]
    some, worst, f, pdf = inputs.take(rows), 0.0, right.f.copy(), right.pdf.copy()
    try:
        with working_precision():
            for k, i in enumerate(rows):
                proven = values_of(some, k, right.around[i].tolist(), density=wanted)
                exact, density = np.array([float(proven.f(c).mid()) for c in range(inputs.channels)]), proven.pdf()
                if density is not None:
                    exact = np.append(exact, float(density.mid()))
                double, seen = np.append(f[i], pdf[i])[: len(exact)], exact > 1e-280
                worst = max([worst, *np.abs(double[seen] / exact[seen] - 1)])
                f[i] = exact[: inputs.channels]
                pdf[i] = pdf[i] if density is None else exact[-1]
    except MissingExtraError:
        return "python-flint is not installed: double precision is not compared with proven values", right
    if worst > _AGREE:
        raise ArithmeticError(
            f"the reference in double precision is off by {worst:.1e} from its proven value: please report it"
        )
    note = f"the reference: {len(rows)} cases recomputed as values of proven error; double precision agrees to {worst:.1e}"
    return note, replace(right, f=f, pdf=pdf)


def _check(F: Formulas, q: Quantity, given: Submission, right: Evaluated, tolerance: str, progress: Progress) -> Checked:
    inputs, value = given.inputs, predicted(right, q)
    lobes, regions = _worst(F, q, given, right)
    count = int(np.isfinite(q.given).sum())
    found = Checked(q.name, count, "right", q.outside(value), tolerance, lobes, regions)
    failed = given.failed.get(q.name)
    if failed is not None and failed.any():
        told = f"{failed.sum()} cases have values that are no numbers", *where_none_are(F, inputs, q, right, failed)
        found = replace(found, verdict="wrong", numberless=told)
    if not np.nan_to_num(q.given).any():  # a note says so: no slip makes zeros of all
        return replace(found, verdict="wrong")
    if q.right(value):
        return found
    moved, order = in_order(q, value, inputs, given.rows)
    if order:
        again = _check(F, moved, given, right, tolerance, progress)
        best = again.best or judged((), moved, value)
        best = replace(best, slips=(*order, *best.slips), explains=best.explains)
        same: dict[str, Any] = {"outside": found.outside, "lobes": lobes, "regions": regions, "numberless": found.numberless}
        return replace(again, best=best, verdict="wrong", **same)
    progress(f"slips of {q.name}", 0.0)
    made: Search = search(F, q, inputs, value, lambda x: progress(f"slips of {q.name}", 0.6 * x))
    found = replace(found, best=made.best, alternatives=made.alternatives, singles=made.singles, verdict="wrong")
    best, off = made.best, given.rows[(np.nan_to_num(q.off(value)) > 1).any(axis=1)]
    if best.explains:
        known = best.slips and all(s.approximation for s in best.slips) and not best.strays
        if not best.slips:
            found = replace(found, strays=tuple(int(n) for n in off))
        known = known and not found.numberless
        return replace(found, verdict="right but for an approximation") if known else found
    if len(off) <= _FEW:
        found = replace(found, strays=tuple(int(n) for n in off))
    few, some = q.take(made.rows), inputs.take(made.rows)
    # One number may explain what slips, found one by one, only come near to; of those, the first may be right, and hidden by
    # what the number changes.
    before = few.score(value[made.rows])
    first = (h.slips for h in made.singles[:_FIRST] if h.score < _PROMISING * before)
    bases = dict.fromkeys([(), *first, best.slips])
    near = best.score < 0.6 * before and best.outside < _NEARER * found.outside
    for k, slips in enumerate(bases):

        def part(x: float, k: int = k) -> None:
            progress(f"leads of {q.name}", 0.6 + 0.4 * (k + x) / len(bases))

        where = leads(changed(F, slips), few, some, part)
        if where.explain or not slips or (near and slips == best.slips):
            found = replace(found, best=replace(best, slips=slips), leads=where)
        if where.explain:
            break
    return found


def _worst(F: Formulas, q: Quantity, given: Submission, right: Evaluated) -> tuple[tuple[Worst, ...], tuple[Worst, ...]]:
    value, inputs = predicted(right, q), given.inputs
    off = q.off(value)
    light = right.parts @ luminance_weights(inputs.channels)
    first = np.argmax(np.nan_to_num(light), axis=1)
    by_lobe = [(lobe, first == p) for p, lobe in enumerate(F.names)]
    by_region = [(r.name, r.holds(inputs)) for r in REGIONS]

    def rows(groups: list[tuple[str, Any]]) -> tuple[Worst, ...]:
        return tuple(w for name, mask in groups if (w := _worst_of(name, mask, q, value, off, given)) is not None)

    return rows(by_lobe), rows(by_region)


def _worst_of(name: str, mask: Array, q: Quantity, value: Array, off: Array, given: Submission) -> Worst | None:
    some = np.where(mask[:, None], off, np.nan)
    known = some[~np.isnan(some)]
    if not known.size:
        return None
    i, c = divmod(int(np.nanargmax(some)), some.shape[1])
    channel = "" if q.given.shape[1] == 1 else "rgb"[c]
    row = given.inputs.row(i)
    where = ", ".join(f"{k} {v:.4g}" for k, v in row.items() if not k.startswith("sigma_a"))
    where += f", sigma_a {given.inputs.sigma_a[i, min(c, given.inputs.channels - 1)]:.4g}"
    outside, case = float((known > 1).mean()), int(given.rows[i])
    return Worst(name, int(known.size), outside, case, channel, float(q.given[i, c]), float(value[i, c]), where)
