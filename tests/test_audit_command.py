"""The audit of Mitsuba's own hair, and the command."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import run
from cuticle import audit
from test_audit import BASE, failed, write

needs_mitsuba = pytest.mark.skipif(importlib.util.find_spec("mitsuba") is None, reason="Mitsuba 3 is not installed")


# ---- Mitsuba's own


@needs_mitsuba
@pytest.mark.slow  # test_the_command_audits_a_plugin finds the same fault
@pytest.mark.parametrize(("beta_m", "melanin"), [(0.25, 0.3), (0.3, 1.3)])
def test_mitsubas_hair_is_flagged_at_theta_0(beta_m: float, melanin: float) -> None:
    hair = cuticle.from_mitsuba("hair", h=0, longitudinal_roughness=beta_m, azimuthal_roughness=0.3, eumelanin=melanin)
    report = audit(hair, theta_r=np.radians([-75, 0, 75]), samples=100_000)
    assert "samples follow the pdf" in failed(report), report
    region = report.worst.region
    assert region is not None
    assert region.theta[0] < 0 < region.theta[1]
    assert region.theta[1] - region.theta[0] < 0.1
    assert region.drawn > 2 * region.expected
    assert abs(report.worst.repeated[0].angle) < 1e-3
    assert not failed(report) & {"weight of a sample", "pdf of a sample", "reach", "valid samples"}


@needs_mitsuba
@pytest.mark.parametrize("theta_r", [[-60], pytest.param([0, 85], marks=pytest.mark.slow)])
def test_mitsubas_hair_passes_where_it_is_rough(theta_r: list[float]) -> None:
    hair = cuticle.from_mitsuba("hair", h=0, longitudinal_roughness=0.8, azimuthal_roughness=0.8)
    report = audit(hair, theta_r=np.radians(theta_r), samples=100_000)
    assert report.ok, report


# ---- the command


def test_the_command(tmp_path: Path) -> None:
    BASE.save(tmp_path / "hair.toml")
    done = run("audit", "hair.toml", "--h", "0.3", "--samples", "20000", "--theta-r=-60,0", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "passes" in done.stdout
    assert (tmp_path / "out/audit.png").exists()
    assert json.loads((tmp_path / "out/audit.json").read_text())["ok"] is True
    s = BASE.near(0.1).sample(0.3, np.random.default_rng(1).random((20_000, 3)))
    write(tmp_path / "d.npz", s.theta_i, s.phi, 1.3 * s.pdf)
    done = run("audit", "d.npz", "--json", cwd=tmp_path)
    assert done.returncode == 1
    assert json.loads(done.stdout)["ok"] is False
    for arguments, message in (
        (("audit", "nothing"), "an audit needs"),
        (("audit", "hair.toml", "x=1"), "key=value parameters go with mitsuba:PLUGIN"),
        (("audit", "hair.toml", "--theta-r", "90"), "--theta-r must be in"),
        (("audit", "hair.toml", "--h", "2"), "--h must be in"),
        (("audit", "missing.npz"), "cannot read samples"),
    ):
        done = run(*arguments, cwd=tmp_path)
        assert done.returncode == 2, done
        assert message in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1


def test_the_commands_level_seed_and_reciprocity_are_the_audits(tmp_path: Path) -> None:
    BASE.save(tmp_path / "hair.toml")

    def said(*options: str) -> dict[str, Any]:
        given = ("audit", "hair.toml", "--h", "0.3", "--samples", "20000", "--theta-r=-60", "--json")
        return json.loads(run(*given, *options, cwd=tmp_path).stdout)  # type: ignore[no-any-return]

    def verdicts(report: dict[str, Any]) -> set[str]:
        return {v["name"] for v in report["verdicts"]}

    plain = said()
    assert plain["cases"] == said()["cases"]
    assert plain["cases"] != said("--seed", "2")["cases"]
    limits = [{v["name"]: v["limit"] for v in report["verdicts"]} for report in (plain, said("--level", "0.01"))]
    assert limits[1]["samples follow the pdf"] > 9 * limits[0]["samples follow the pdf"]
    reciprocal = said("--reciprocity")
    assert verdicts(reciprocal) - verdicts(plain) == {"reciprocity"}
    assert plain["ok"]
    assert not reciprocal["ok"]  # scales are tilted


@needs_mitsuba
def test_the_command_audits_a_plugin(tmp_path: Path) -> None:
    given = ("longitudinal_roughness=.25", "azimuthal_roughness=.3", "eumelanin=.3")
    done = run("audit", "mitsuba:hair", *given, "--samples", "20000", "--theta-r=-75", "--json", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    plain = json.loads(done.stdout)
    assert plain["cases"][0]["repeated"][0][:2] == ["theta_i", 0.0]
    done = run("audit", "mitsuba:hair", "gloss=1", cwd=tmp_path)
    assert done.returncode == 2
    assert "Mitsuba refuses" in done.stderr
    done = run("audit", "mitsuba:dielectric", cwd=tmp_path)
    assert "single directions only" in done.stderr
