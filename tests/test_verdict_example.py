"""The example of a new verdict, run as printed, and where its verdicts appear."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import cuticle
from cuticle.checking.verdicts import Test
from cuticle.cli.tables import check_tables, verdict_table
from cuticle.report.page import write_report
from test_audit import BASE, failed
from test_check import Lying

NAMES = ("largest weight", "both sides alike")


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    text = (Path(__file__).parents[1] / "docs/extending/verdict.md").read_text(encoding="utf-8")
    code = text.split("```python\n")[1].split("```")[0]
    assert len([line for line in code.splitlines() if line.strip()]) <= 40
    names: dict[str, Any] = {}
    exec(code, names)
    return names


def printed(table: Any) -> str:
    console = Console(width=200, file=io.StringIO(), record=True)
    console.print(table)
    return console.export_text()


def test_the_verdicts_appear_everywhere(example: dict[str, Any], tmp_path: Path) -> None:
    report = example["report"]
    assert report.ok, report
    assert [v.name for v in report.verdicts[-2:]] == list(NAMES)
    assert [v["name"] for v in report.to_dict()["verdicts"][-2:]] == list(NAMES)
    assert all(c.drawn is None for c in report.cases)
    assert report.verdicts[-2].value == max(c.largest_weight for c in report.cases)
    (tmp_path / "check.json").write_text(report.to_json())
    page = write_report(tmp_path).read_text()
    for name in NAMES:
        for text in (repr(report), report.to_json(), printed(check_tables(report)[-1]), page):
            assert name in text


def test_they_fail_what_is_broken(example: dict[str, Any]) -> None:
    s, fibre, tests = example["sampler"], example["fibre"], [example["largest_weight"], example["both_sides"]]
    turned = Lying(s.nodes, s.energy, s.strands, s.even, {"lie": "turned"})
    report = cuticle.check(turned, fibre, theta_r=[0.0], samples=50_000, extra=tests)
    assert "both sides alike" in failed(report)
    narrow = np.tile(np.array([1, 0, 0.5, 0.02, 0.02]).reshape(1, 1, 5, 1), (1, 2, 1, 1))
    report = cuticle.check(cuticle.Sampler(narrow, np.ones((1, 2))), fibre, theta_r=[0.0], samples=50_000, extra=tests)
    assert "largest weight" in failed(report)


def test_an_audit_takes_them_too(example: dict[str, Any]) -> None:
    tests = [example["largest_weight"], example["both_sides"]]
    report = cuticle.audit(BASE.near(0.0), theta_r=[0.5], samples=20_000, extra=tests)
    assert report.ok, report
    assert set(NAMES) <= {v.name for v in report.verdicts}
    assert all(name in printed(verdict_table("", report.verdicts)) for name in NAMES)
    offset = cuticle.audit(BASE.near(0.7), theta_r=[0.5], samples=20_000, extra=tests)
    assert failed(offset) == {"both sides alike"}  # off its axis a fibre scatters to one side, and the audit is right


def test_nan_fails_and_is_reported() -> None:
    def measure(m: Any) -> float:
        return float("nan") if m.theta_r > 0.4 else 1.0

    report = cuticle.audit(
        BASE.near(0.0), theta_r=[0.3, 0.5], samples=10_000, extra=[Test("n", "a number", limit=2, measure=measure)]
    )
    assert not report.ok
    assert np.isnan(report.verdicts[-1].value)
    assert report.verdicts[-1].where == "at theta_r 28.6°"


def test_what_is_no_test_is_refused() -> None:
    with pytest.raises(TypeError, match="extra must hold cuticle.checking.verdicts.Test, got str"):
        cuticle.audit(BASE.near(0.0), extra=["largest weight"])  # type: ignore[list-item]
