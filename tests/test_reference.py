"""The reference: two derivations agree, each planted slip is named, right values are clean, bad files get one line."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from command import refused, run
from cuticle.reference import balls, check, make
from cuticle.reference.cases import draw
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.search import applicable
from planted import planted, submission

pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
NEAR = draw("chiang", 300, 1, near=True, longitudinal="")
# Below the tolerance of single precision on any case.
SMALL = ("log-i0-first-order", "ln2-4-digits")


@pytest.mark.parametrize("single", [True, False])
def test_the_core_is_found_right(single: bool) -> None:
    some = NEAR.take(slice(0, 240))
    assert check(planted(some, single=single)).ok


F = formulas_of(NEAR)
PLANTED = [s for s in applicable(F, SimpleNamespace(name="f"), True) if s.name not in SMALL]  # type: ignore[arg-type]


@pytest.mark.parametrize("slip", PLANTED, ids=lambda s: s.name)
def test_a_planted_slip_is_named(slip: Any) -> None:
    found = check(submission(NEAR, evaluate(slip.change(F), NEAR).f, single=True))
    assert not found.ok
    assert found.slips == (slip.name,)


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
