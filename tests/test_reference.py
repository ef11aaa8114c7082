"""The reference: two derivations agree, each planted slip is named, right values are clean, bad files get one line."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from command import refused, run
from cuticle.reference import balls, check, make
from cuticle.reference.cases import SIGMAS, draw
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.search import applicable
from cuticle.reference.slip_table import SLIPS
from cuticle.reference.slips import attenuation_by
from planted import planted, submission

pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
NEAR = draw("chiang", 300, 1, near=True, longitudinal="")
# Below the tolerance on any case: of single precision; of a quadrature, at the widest beta_N of cases.
SMALL = ("log-i0-first-order", "ln2-4-digits", "normal-one-turn")


@pytest.mark.parametrize("single", [True, False])
def test_the_core_is_found_right(single: bool) -> None:
    some = NEAR.take(slice(0, 240))
    assert check(planted(some, single=single)).ok


F = formulas_of(NEAR)
PLANTED = [s for s in applicable(F, SimpleNamespace(name="f"), True) if s.name not in SMALL]  # type: ignore[arg-type]


@pytest.mark.parametrize("slip", PLANTED, ids=lambda s: s.name)
def test_a_planted_slip_is_named(slip: Any) -> None:
    found = check(submission(NEAR, evaluate(slip.change(F), NEAR).f, single=True))
    assert found.ok == slip.approximation
    assert found.slips == (slip.name,)


OF_DENSITY = [s for s in SLIPS if s.pdf and "chiang" in s.kinds and s.only != "far"]


@pytest.mark.parametrize("slip", OF_DENSITY, ids=lambda s: s.name)
def test_a_planted_slip_of_the_density_is_named(slip: Any) -> None:
    found = check(submission(NEAR, pdf=evaluate(slip.change(F), NEAR, density=True).pdf, single=True))
    assert found.ok == slip.approximation
    assert found.slips == (slip.name,)


MARSCHNER = {
    kind: draw("marschner", 64, 2, near=False, longitudinal=form)
    for kind, form in (("conserving", "energy_conserving"), ("gaussian", "gaussian"))
}
OF_MARSCHNER = [
    pytest.param(kind, s, id=f"{kind}: {s.name}")
    for kind in MARSCHNER
    for s in applicable(formulas_of(MARSCHNER[kind]), SimpleNamespace(name="f"), False)  # type: ignore[arg-type]
    if "chiang" not in s.kinds and s.name not in SMALL
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "slip"), OF_MARSCHNER)
def test_a_planted_slip_of_marschners_is_named(kind: str, slip: Any) -> None:
    cases = MARSCHNER[kind]
    found = check(submission(cases, evaluate(slip.change(formulas_of(cases)), cases).f, single=True))
    assert found.ok == slip.approximation
    assert found.slips == (slip.name,)


@pytest.mark.parametrize("wild", [1e6, -7.0, 0.5])
def test_a_few_wrong_values_are_not_right(wild: float) -> None:
    """What explains all the other values is no slip, and an approximation excuses no value that it does not explain."""
    f = evaluate(F, NEAR).f
    f[[7, 80, 203], [0, 1, 2]] *= wild
    found = check(submission(NEAR, f, single=True))
    assert not found.ok
    assert found.slips == ()
    assert "verdict: WRONG (f: all cases but 3 are right)" in str(found)
    assert "case 8, 81, 204" in str(found)
    approximation = next(s for s in SLIPS if s.name == "log-i0-first-order")
    f = evaluate(approximation.change(F), NEAR).f
    assert check(submission(NEAR, f, single=False)).ok
    f[7, 0] *= wild
    found = check(submission(NEAR, f, single=False))
    assert not found.ok
    assert "verdict: WRONG (f: log-i0-first-order, and some values are far off)" in str(found)


@pytest.mark.parametrize("factor", [3.0, *(pytest.param(x, marks=pytest.mark.slow) for x in (12.0, 1.9, 0.5))])
def test_a_plain_factor_is_named_alone(factor: float) -> None:
    found = check(submission(NEAR, factor * evaluate(F, NEAR).f, single=True))
    assert found.slips == ()
    assert f"verdict: WRONG (f: f × {factor:g})" in str(found)


@pytest.mark.parametrize("lobe", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_a_missing_lobe_is_named(lobe: int) -> None:
    missing = attenuation_by(lobe, lambda a, f, t: 0 * a)(F)
    found = check(submission(NEAR, evaluate(missing, NEAR).f, single=True))
    assert f"verdict: WRONG (f: {F.lobes[lobe]} is missing)" in str(found)


def test_falcors_values_have_the_halved_term(data: Path) -> None:
    found = check(data / "reference" / "pbrt_hair_bsdf.dat")
    assert not found.ok
    assert found.slips == ("log-i0-16x", "i0-10-terms")


def test_check_works_without_the_balls_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "flint", None)
    balls.flint.cache_clear()
    some = NEAR.take(slice(0, 60))
    found = check(submission(some, evaluate(F, some).f, single=True))
    assert found.ok
    assert any("python-flint is not installed" in note for note in found.notes)
    with pytest.raises(
        ImportError, match=r"the reference needs flint, which is not installed: pip install 'cuticle\[reference\]'"
    ):
        make("chiang", 8)


def test_cases_are_written_and_checked(tmp_path: Path) -> None:
    made = run("reference", "chiang", "--cases", "24", "-o", "cases.csv", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    refused("reference", "check", "cases.csv", words="fill in a column f_r", cwd=tmp_path)
    text = (tmp_path / "cases.csv").read_text()
    (tmp_path / "cut.csv").write_text(text[: int(len(text) * 0.7)])
    refused("reference", "check", "cut.csv", words="cells for", cwd=tmp_path)
    head, rows = text[: text.index("case,")], text[text.index("case,") :]
    for name, other, words in (
        ("semicolons", rows.replace(",", ";"), "columns must be separated by commas, not by ';'"),
        ("tabs", rows.replace(",", "\t"), "columns must be separated by commas, not by '\\t'"),
        ("capitals", rows.replace("theta_i", "Theta_i", 1), "has a column 'Theta_i': name it 'theta_i'"),
        ("no_h", rows.replace(",h,", ",offset,", 1), "has no column 'h', though its head says near field"),
        ("underscore", rows.replace("\n1,", "\n1,1_0", 1), "theta_i must be a number, got '1_0"),
    ):
        (tmp_path / f"{name}.csv").write_text(head + other)
        refused("reference", "check", f"{name}.csv", words=words, cwd=tmp_path)


@pytest.mark.parametrize("cell", ["%.3g", "%.6f"])
def test_values_of_few_digits_are_told_of(cell: str, tmp_path: Path) -> None:
    right = evaluate(F, NEAR).f
    header = [*NEAR.columns, *SIGMAS, "f_r", "f_g", "f_b"]
    rows = [[*map(repr, NEAR.row(i).values()), *(cell % x for x in right[i])] for i in range(60)]
    (tmp_path / "mine.csv").write_text("\n".join(map(",".join, [header, *rows])) + "\n")
    assert any("digits: write nine (%.9g)" in note for note in check(tmp_path / "mine.csv", tolerance=0.01).notes)
