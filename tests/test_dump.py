"""Files of samples: right ones pass, broken ones fail, and what the docs show writes one."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from command import run
from cuticle import Chiang, audit_dump
from cuticle.checking.measurements import ViewerOfFile
from cuticle.checking.patches import follows
from cuticle.checking.tests import TESTS
from cuticle.checking.verdicts import Judge, Thresholds
from test_audit import BASE, Hemisphere, write


@pytest.mark.parametrize("count", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_a_right_dump_passes(count: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for i in range(count):
        near = Chiang(beta_m=rng.uniform(0.1, 0.9), beta_n=rng.uniform(0.1, 0.9), eumelanin=1.3).near(rng.uniform(-0.9, 0.9))
        s = near.sample(rng.uniform(-1.4, 1.4), rng.random((50_000, 3)))
        report = audit_dump(write(tmp_path / f"{i}.npz", s.theta_i, s.phi, s.pdf))
        assert report.ok, report
        assert report.patches > 20
    surface = Hemisphere().sample(0, rng.random((100_000, 3)))
    report = audit_dump(write(tmp_path / "surface.npz", *surface[:3], weight=surface[3]))
    assert report.ok, report
    assert report.ess == pytest.approx(1)


@pytest.mark.parametrize(
    "broken", ["rougher pdf", "scaled pdf", "uniform pdf", "stuck", "nan", "negative weight", "shuffled", "tiny"]
)
def test_a_broken_dump_fails(broken: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    near = Chiang(beta_m=0.25, beta_n=0.3, eumelanin=0.3).near(0.3)
    theta, phi, pdf = (np.array(x) for x in near.sample(0.8, rng.random((200_000, 3))))
    weight = np.ones(len(pdf))
    if broken == "rougher pdf":
        pdf = Chiang(beta_m=0.26, beta_n=0.3, eumelanin=0.3).near(0.3).pdf(theta, 0.8, phi)
    if broken == "scaled pdf":
        pdf = pdf * 1.03
    if broken == "uniform pdf":
        pdf = np.full_like(pdf, 1 / (4 * np.pi))
    if broken == "stuck":
        theta[:1000] = 0
    if broken == "shuffled":
        pdf = rng.permutation(pdf)
    if broken == "tiny":
        pdf[:] = 1e-310
    if broken == "nan":
        pdf[5] = np.nan
    if broken == "negative weight":
        weight[5] = -1
    report = audit_dump(write(tmp_path / "d.npz", theta, phi, pdf, weight=weight))
    assert not report.ok, report
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False))["ok"] is False


def test_a_dump_as_csv_with_viewers(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    rows = ["x,y,z,pdf,weight,viewer"]
    for viewer in (0, 60):
        s = BASE.near(0.1).sample(np.radians(viewer), rng.random((20_000, 3)))
        x, y, z = np.cos(s.theta_i) * np.cos(s.phi), np.sin(s.theta_i), np.cos(s.theta_i) * np.sin(s.phi)
        rows += [f"{a:.9g},{b:.9g},{c:.9g},{p:.9g},1,{viewer}" for a, b, c, p in zip(x, y, z, s.pdf, strict=True)]
    (tmp_path / "d.csv").write_text("\n".join(rows))
    report = audit_dump(tmp_path / "d.csv")
    assert report.ok, report
    assert report.viewers == 2


def test_columns_of_a_csv_are_known_by_their_names(tmp_path: Path) -> None:
    theta, phi, pdf = uniform(6000, np.random.default_rng(2))
    x, y, z = np.cos(theta) * np.cos(phi), np.sin(theta), np.cos(theta) * np.sin(phi)

    def mean(names: str, *weights: float) -> float:
        columns = np.column_stack([x, y, z, pdf, *(np.full(len(x), w) for w in weights)])
        np.savetxt(tmp_path / "d.csv", columns, delimiter=",", header="X,Y,Z,PDF," + names, comments="")
        return audit_dump(tmp_path / "d.csv").mean_weight

    right = mean("weight_r,weight_g,weight_b", 0.9, 0.5, 0.1)
    assert mean("weight_b,weight_g,weight_r", 0.1, 0.5, 0.9) == right
    assert mean("weight_3,weight_20,weight_1", 0.5, 0.1, 0.9) == right
    assert mean("weight", 0.5) == 0.5
    for names in ("weight_r,weight_g", "weight,weight_sum", "weight_r,weight_g,weight_b,weight"):
        with pytest.raises(ValueError, match="are no channels: they must be weight; or weight_r, weight_g and weight_b"):
            mean(names, *np.ones(names.count(",") + 1))


def test_what_is_not_read_is_said_and_a_channel_below_0_fails(tmp_path: Path) -> None:
    theta, phi, pdf = uniform(6000, np.random.default_rng(2))
    assert any("not read: weights" in n for n in audit_dump(write(tmp_path / "a.npz", theta, phi, pdf, weights=pdf)).notes)
    colour = np.ones((6000, 3))
    colour[7, 2] = -0.1
    report = audit_dump(write(tmp_path / "b.npz", theta, phi, pdf, weight=colour))
    assert {v.name for v in report.verdicts if not v.passed} == {"valid weights"}


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"pdf": np.ones(3)}, "has no direction"),
        ({"direction": np.ones((6000, 2)), "pdf": np.ones(6000)}, "direction has shape"),
        ({"direction": np.ones((60, 3)), "pdf": np.ones(60)}, "at least 5,000 rows"),
        ({"direction": np.ones((6000, 3)), "pdf": np.ones(6000), "weight": np.ones(5)}, "weight has shape"),
    ],
)
def test_a_dump_that_is_none_is_one_line(arrays: dict[str, np.ndarray], message: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "d.npz", **arrays)
    with pytest.raises(ValueError, match=message) as caught:
        audit_dump(tmp_path / "d.npz")
    assert "\n" not in str(caught.value)
    (tmp_path / "cut.npz").write_bytes((tmp_path / "d.npz").read_bytes()[:50])
    with pytest.raises(ValueError, match="cannot read samples"):
        audit_dump(tmp_path / "cut.npz")


@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
def test_the_dump_that_the_docs_show(tmp_path: Path) -> None:
    text = (Path(__file__).parents[1] / "docs/audit.md").read_text(encoding="utf-8")
    code = next(c for c in text.split("```cpp\n") if "void dump(" in c).split("```")[0]
    program = """
#include <cmath>
#include <random>
struct Uniform {
    struct Sample { double x, y, z, pdf, weight; };
    mutable std::mt19937 random;
    Sample sample(int) const {
        std::uniform_real_distribution<double> u(0, 1);
        const double y = 2 * u(random) - 1, a = 6.283185307179586 * u(random), r = std::sqrt(1 - y * y);
        return {r * std::cos(a), y, r * std::sin(a), PDF, 1};
    }
};
int main() { dump(Uniform{}, "dump.csv", 6000); }
"""
    (tmp_path / "dump.cpp").write_text(code + program)
    for pdf, right in (("0.07957747154594767", True), ("0.1", False)):
        flags = ["-std=c++17", "-Wall", "-Wextra", "-Werror", f"-DPDF={pdf}"]
        subprocess.run(["g++", *flags, "dump.cpp", "-o", "dump"], check=True, cwd=tmp_path)
        subprocess.run([str(tmp_path / "dump")], check=True, cwd=tmp_path)
        report = audit_dump(tmp_path / "dump.csv")
        assert report.viewers == 7
        assert report.ok == right, report


@pytest.mark.parametrize(("stripes", "outcome", "code"), [(400, "inconclusive", 3), (4, "pass", 0)])
def test_a_dump_of_which_next_to_nothing_could_be_tested_is_inconclusive(
    stripes: int, outcome: str, code: int, tmp_path: Path
) -> None:
    """Ten times as many samples in every second stripe: finer than the patches, the pdf varies within all of them."""
    rng = np.random.default_rng(5)
    dense = rng.random(6_000) < 10 / 11
    y = 2 * (2 * rng.integers(stripes // 2, size=6_000) + dense + rng.random(6_000)) / stripes - 1
    pdf = np.where(dense, 20 / 11, 2 / 11) / (4 * np.pi)
    path = write(tmp_path / "d.npz", np.arcsin(y), rng.uniform(-np.pi, np.pi, 6_000), pdf)
    report = audit_dump(path)
    assert report.outcome == outcome, report
    assert [v.name for v in report.verdicts if "could be tested" in v.undecided] == ["samples follow the pdf"] * (code == 3)
    done = run("audit", str(path), "--json")
    assert (done.returncode, json.loads(done.stdout)["outcome"]) == (code, outcome)


def uniform(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.arcsin(rng.uniform(-1, 1, n)), rng.uniform(-np.pi, np.pi, n), np.full(n, 1 / (4 * np.pi))


def sharp(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    s = Chiang(beta_m=0.1, beta_n=0.1, eumelanin=1.3).near(0.5).sample(0.3, rng.random((n, 3)))
    return np.array(s.theta_i), np.array(s.phi), np.array(s.pdf)


@pytest.mark.parametrize("n", [2_000, *(pytest.param(n, marks=pytest.mark.slow) for n in (6_000, 60_000))])
def test_right_samples_have_small_p_values_as_seldom_as_they_may(n: int) -> None:
    """Of 200 dumps, p below 0.02 in at most 11: a right test has more with probability 1e-3 at most (Poisson, mean 4)."""
    rng = np.random.default_rng(7)
    small = sum(follows(*draw(n, rng), n, rng).p_value < 0.02 for draw in (uniform, sharp) for _ in range(100))
    assert small <= 11


def test_shuffled_pdfs_of_a_sharp_sampler_are_found_among_few_rows() -> None:
    rng = np.random.default_rng(8)
    for _ in range(20):
        theta, phi, pdf = sharp(5_000, rng)
        assert follows(theta, phi, rng.permutation(pdf), 5_000, rng).p_value < 1e-4


@pytest.mark.parametrize(("tested", "outcome"), [(0.0999, "inconclusive"), (0.1, "pass")])
def test_the_boundary_of_what_is_enough(tested: float, outcome: str) -> None:
    judge = Judge(TESTS, Thresholds(1e-4, 4.0))
    judge.examine(ViewerOfFile("", 0.5, "", 3, 29, tested, ()))
    assert {v.name: v.outcome for v in judge.verdicts()} == {"samples follow the pdf": outcome, "no atom": "pass"}
    judge.examine(ViewerOfFile("", 1e-9, "", 3, 29, 0.0, ()))  # what speaks against it counts, however little was tested
    assert judge.verdicts()[0].outcome == "fail"


def test_a_dump_of_no_direction_is_inconclusive(tmp_path: Path) -> None:
    path = write(tmp_path / "d.npz", np.zeros(6000), np.zeros(6000), np.zeros(6000))
    done = run("audit", str(path))
    assert done.returncode == 3
    assert "is inconclusive" in done.stdout
    np.savez(tmp_path / "n.npz", direction=np.tile([0.0, 1, 0], (6000, 1)), pdf=np.ones(6000), viewer=np.full(6000, np.nan))
    with pytest.raises(ValueError, match="viewer must be a finite number in every row, got nan in row 1"):
        audit_dump(tmp_path / "n.npz")
