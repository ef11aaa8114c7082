"""Files of values as others write them: precision and digits, columns that are not read, values of other cases."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planted
from command import refused, run
from cuticle.reference import check
from cuticle.reference.cases import SIGMAS, draw
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.values_file import FORMAT

pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
NEAR = draw("chiang", 60, 1, near=True, longitudinal="")
RIGHT = evaluate(formulas_of(NEAR), NEAR, density=True)
INPUTS = [*NEAR.columns, *SIGMAS]
VALUES = ["f_r", "f_g", "f_b", "pdf"]


def write(path: Path, values: np.ndarray, cells: list[str], names: list[str] = VALUES, head: str = "") -> Path:
    rows = [
        [str(i + 1), *map(repr, NEAR.row(i).values()), *(c % x for c, x in zip(cells, row, strict=True))]
        for i, row in enumerate(values)
    ]
    path.write_text(head + "\n".join(",".join(row) for row in [["case", *INPUTS, *names], *rows]) + "\n")
    return path


BOTH = np.column_stack([RIGHT.f, RIGHT.pdf])


@pytest.mark.parametrize("cell", ["%.9f", "%.12f", "%.17g", "%.9g"])
def test_right_values_are_right_however_they_are_printed(cell: str, tmp_path: Path) -> None:
    found = check(write(tmp_path / "mine.csv", BOTH, [cell] * 4))
    assert found.ok, found
    assert not any("digits" in note for note in found.notes)


def test_zeros_are_not_right_within_any_tolerance(tmp_path: Path) -> None:
    assert not check(write(tmp_path / "mine.csv", 0 * BOTH, ["%.9g"] * 4), tolerance=1).ok


def test_zeros_in_two_decimals_are_not_right(tmp_path: Path) -> None:
    """Each might be anything below half a unit. No slip is looked for."""
    found = check(write(tmp_path / "mine.csv", 0 * BOTH, ["%.2f"] * 4))
    assert not any(c.ok for c in found.checked)
    assert {"every value of f is 0", "every value of pdf is 0"} <= set(found.notes)
    assert "diagnosis" not in str(found)


@pytest.mark.slow  # it looks for slips for as long as it may
def test_two_decimals_are_too_few(tmp_path: Path) -> None:
    assert not check(write(tmp_path / "rough.csv", BOTH, ["%.2f"] * 4)).ok


def test_precision_is_that_of_each_quantity(tmp_path: Path) -> None:
    floats = np.column_stack([RIGHT.f.astype(np.float32), RIGHT.pdf])
    found = check(write(tmp_path / "mine.csv", floats, ["%.9g"] * 3 + ["%.17g"]))
    assert found.ok, found
    assert found.precision == "single of f, double of pdf (by the values' digits)"


def test_floats_in_ten_digits_are_told_of(tmp_path: Path) -> None:
    rounded = BOTH * (1 + 1e-4 * np.random.default_rng(1).uniform(-1, 1, BOTH.shape))
    found = check(write(tmp_path / "mine.csv", rounded, ["%.10g"] * 4))
    assert not found.ok
    assert "f is right in single precision: if that computed it, give --precision single" in found.notes


def test_floats_in_fixed_decimals_are_those_of_single_precision(tmp_path: Path) -> None:
    """Of those above 1 more than nine digits are written."""
    floats = BOTH.astype(np.float32).astype(float) * (1 + 3e-5 * (BOTH > 1))
    found = check(write(tmp_path / "mine.csv", floats.astype(np.float32).astype(float), ["%.9f"] * 4))
    assert found.ok, found
    assert found.precision.startswith("single")
    assert not check(write(tmp_path / "mine.csv", floats, ["%.9f"] * 4)).ok  # no floats, and off by more than doubles are


def test_cells_without_a_number_fail_and_what_they_have_in_common_is_told(tmp_path: Path) -> None:
    narrow = NEAR.columns["beta_m"] < np.sort(NEAR.columns["beta_m"])[9]
    without = np.where(narrow[:, None] & (np.arange(4) < 3), np.nan, BOTH)
    found = check(write(tmp_path / "nan.csv", without, ["%.17g"] * 4))
    f, pdf = found.checked
    assert not f.ok
    assert pdf.ok
    assert "9 of the 9 cases without a number have beta_m ≤" in str(found)
    assert "diagnosis" not in str(found)
    text = (tmp_path / "nan.csv").read_text()
    (tmp_path / "blank.csv").write_text(text.replace("nan", ""))  # as pandas writes them
    blank = check(tmp_path / "blank.csv")
    assert blank.ok
    assert any(note.startswith("9 of 60 cases have no f and are not checked: case") for note in blank.notes)
    (tmp_path / "partly.csv").write_text(text.replace("nan,nan,nan", "1,,1"))
    assert "f_g is empty in case" in str(check(tmp_path / "partly.csv"))
    head, *rows = text.splitlines()
    (tmp_path / "none.csv").write_text("\n".join([head, *(re.sub(r"(,[^,]*){4}$", 4 * ",nan", row) for row in rows)]))
    nothing = check(tmp_path / "none.csv")
    assert not nothing.ok
    assert "no value of f is a number" in nothing.notes
    (tmp_path / "few.csv").write_text("\n".join([head, *rows[:5], *(re.sub(r"(,[^,]*){4}$", ",,,,", r) for r in rows[5:])]))
    refused("reference", "check", "few.csv", words="in 5 rows; a check needs at least 20", cwd=tmp_path)


def test_cosines_from_sines_in_single_precision_are_right() -> None:
    """As pbrt has them, √(1 - x²): near the poles they lose digits of f. By formulas of float32."""
    poles = draw("chiang", 400, 7, near=True, longitudinal="")
    F, columns = formulas_of(poles), {k: v.astype(np.float32) for k, v in poles.columns.items()}
    for name in ("theta_i", "theta_r"):  # the inclination whose cosine that is
        sine = np.sin(columns[name])
        cosine = np.sqrt(np.maximum(1 - sine * sine, np.float32(0)))
        columns[name] = np.arctan2(sine.astype(float), np.maximum(cosine.astype(float), 1e-6))
    near = replace(poles, columns={k: v.astype(float) for k, v in columns.items()})
    assert check(planted.submission(poles, evaluate(F, near).f, single=True)).ok


def test_what_would_not_be_looked_at_is_refused(tmp_path: Path) -> None:
    good = write(tmp_path / "good.csv", BOTH, ["%.9g"] * 4, head="# model: chiang\n").read_text()
    for name, text, words in (
        ("dots", good.replace("f_r,f_g,f_b", "f.r,f.g,f.b"), "has a column 'f.r': values are named f_r, f_g, f_b, f, pdf"),
        ("capital", good.replace(",pdf", ",PDF"), "has a column 'PDF'"),
        ("far", good.replace("# model", f"# {FORMAT}: chiang, far field\n# model"), "its head says far field"),
        ("bars", good.replace(",", "|"), "columns must be separated by commas, not by '|'"),
        ("digits", good.replace("\n1,", "\n١,", 1), "case must be a number, got '١'"),
        ("lines", good.replace("\n1,", '\n"1\n",', 1), "has a cell of several lines"),
    ):
        (tmp_path / f"{name}.csv").write_text(text)
        refused("reference", "check", f"{name}.csv", words=words, cwd=tmp_path)
    (tmp_path / "good.csv.gz").write_bytes(b"\x1f\x8b\0")
    refused("reference", "check", "good.csv.gz", words="is packed: unpack it first", cwd=tmp_path)


def test_values_of_other_cases_are_refused(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.csv", BOTH, ["%.9g"] * 4, head="# model: chiang\n")
    other = mine.read_text()
    cells = other.splitlines()[5].split(",")
    cells[INPUTS.index("beta_m") + 1] = "0.77"
    lines = other.splitlines()
    (tmp_path / "other.csv").write_text("\n".join([*lines[:5], ",".join(cells), *lines[6:]]) + "\n")
    assert check(mine, cases=mine).ok
    refused("reference", "check", "mine.csv", "--cases", "other.csv", words="these are values of other cases", cwd=tmp_path)
    (tmp_path / "marschner.csv").write_text(other.replace("# model: chiang", "# model: marschner"))
    refused(
        "reference", "check", "mine.csv", "--cases", "marschner.csv", words="says model: chiang, but marschner.csv model:",
        cwd=tmp_path,
    )  # fmt: skip


ALIKE = {
    "chiang": NEAR,
    "far": draw("chiang", 20, 1, near=False, longitudinal=""),
    "marschner": draw("marschner", 20, 1, near=False, longitudinal="energy_conserving"),
}


@pytest.mark.parametrize("model", ["chiang", *(pytest.param(m, marks=pytest.mark.slow) for m in ("far", "marschner"))])
def test_the_file_of_cases_has_the_cores_values(model: str, tmp_path: Path) -> None:
    """Columns ref_…, which `check` does not read, beside the core."""
    name, field = ("chiang", ["--field", "far"]) if model == "far" else (model, [])
    done = run("reference", name, "--cases", "24", "-o", "cases.csv", *field, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = [line for line in (tmp_path / "cases.csv").read_text().splitlines() if not line.startswith("#")]
    for row in csv.DictReader(lines):
        at = {k: float(row[k]) for k in row if k and not k.startswith("ref_") and row[k]}
        own = planted.function(ALIKE[model], at)
        angles = tuple(at[k] for k in ("theta_i", "theta_r", "phi"))
        f = [float(row[f"ref_f_{c}"]) for c in "rgb"]
        loose = 1e-6 if model == "chiang" else 0.02  # what the core's tables are off by
        np.testing.assert_allclose(f, np.ravel(own.eval(*angles)), rtol=loose, atol=loose * 1e-2)
        lobes = [c for c in ("R", "TT", "TRT", "rest") if f"ref_{c}_r" in row]
        assert len(lobes) == (4 if name == "chiang" else 3)
        for c, whole in zip("rgb", f, strict=True):
            assert sum(float(row[f"ref_{p}_{c}"]) for p in lobes) == pytest.approx(whole, rel=1e-12)


def test_values_with_the_cosine_are_told_from_those_without() -> None:
    with_cosine = RIGHT.f * np.cos(NEAR.columns["theta_i"])[:, None]
    values = planted.submission(NEAR, with_cosine, single=False)
    assert check(values, f_cos=True).ok
    assert check(values).slips == ("cosine-in",)
    off = planted.submission(NEAR, RIGHT.f * 1.005, single=False)
    assert check(off, tolerance=0.01).ok
    assert not check(off).ok
