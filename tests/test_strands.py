"""Any single strand's function among others, against `DualScattering`, which knows its lobes in closed form."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import cuticle
from command import run
from cuticle import Chiang, DualScattering, Fibre, Strands
from cuticle.scattering.by_name import model_of

THETA = np.linspace(-1.5, 1.5, 160)
PHI = np.linspace(0, np.pi, 60)
CELL = 2 * 3 / 160 * np.pi / 60
GREY = Chiang(sigma_a=(0.13,))  # one channel: a third of the work; eumelanin 0.3 absorbs so little in red
COSINES = np.cos(THETA)[:, None, None] ** 2


def energy(model: object, theta_r: float) -> np.ndarray:
    f = model.eval(THETA[:, None], theta_r, PHI)  # type: ignore[attr-defined]
    return (f * COSINES).sum(axis=(0, 1))


@pytest.fixture(
    scope="module", params=["blond", *(pytest.param(name, marks=pytest.mark.slow) for name in ("brown", "black"))]
)
def pair(request: pytest.FixtureRequest) -> tuple[DualScattering, Strands]:
    dual = DualScattering(Fibre.preset(request.param))
    return dual, Strands(dual.single)


def test_a_fibres_own_function_gives_what_its_lobes_give(pair: tuple[DualScattering, Strands]) -> None:
    dual, ours = pair
    # One keeps the transport's result row by row and node by node, the other four parts of it, each an M times an azimuth.
    for n, limit in ((0, 0.02), (0.5, 0.06), (1, 0.12), (2, 0.12), (4, 0.12), (8, 0.08)):
        for theta_r in np.radians([-45, -20, 0, 30]):
            a, b = (m.with_strands(n).eval(THETA[:, None], theta_r, PHI) for m in (dual, ours))
            if (a * COSINES).sum() * CELL > 1e-3:  # what is darker, through black hair, has two peaks where an M has one
                assert (np.abs(a - b) * COSINES).sum() < limit * (a * COSINES).sum(), (n, np.degrees(theta_r))
    # The energy is one and the same, whatever the inclination.
    for theta_r in np.radians([-75, 0, 80]):
        for n in (1, 8):
            mine, theirs = (energy(m.with_strands(n), theta_r) for m in (ours, dual))
            np.testing.assert_allclose(mine, theirs, rtol=0.01, err_msg=f"{n} strands, {np.degrees(theta_r):g}°")


@pytest.mark.parametrize("counts", [(0, 2), pytest.param((0, 1, 2, 4, 8), marks=pytest.mark.slow)], ids=str)
def test_a_sampler_fitted_to_it_serves_the_closed_form(counts: tuple[float, ...]) -> None:
    dual = DualScattering(Fibre.preset("brown"))
    fitted = cuticle.fit(Strands(dual.single), 4, strands=counts)
    assert all(mean > 0.985 for _, mean, _, _ in fitted.summary)
    for n in counts:
        for theta_r in np.radians([-60, -30, 0, 45]):
            assert cuticle.measure(fitted.sampler, dual.with_strands(n), theta_r, n).ess > 0.94, (n, np.degrees(theta_r))
    again = model_of(fitted.sampler)
    assert isinstance(again, Strands)
    np.testing.assert_allclose(again.with_strands(2).eval(0.1, 0.2, 1), Strands(dual.single, 2).eval(0.1, 0.2, 1))


def test_a_near_field_has_two_sides() -> None:
    model = Strands(GREY.near(0.7), 1)
    assert not model.even
    f = model.eval(THETA[:, None], 0.3, np.array([-2.0, 2.0]))
    assert np.abs(f[:, 0] - f[:, 1]).max() > 0.02 * f.max()
    mirror = Strands(GREY.near(-0.7), 1)
    np.testing.assert_allclose(mirror.eval(0.1, 0.3, -2.0), model.eval(0.1, 0.3, 2.0), rtol=1e-6)


def test_light_is_lost_and_never_made() -> None:
    model = Strands(GREY)
    before = energy(model.with_strands(1), 0.2)
    for n in (1.5, 2, 5, 40):
        now = energy(model.with_strands(n), 0.2)
        assert (now < before).all()
        before = now
    assert np.isfinite(model.with_strands(10_000).eval(0, 0, 0)).all()


def test_bad_input_is_one_line() -> None:
    with pytest.raises(ValueError, match=r"must stay below 1 for strands to be summed, got 1"):
        Strands(Chiang(sigma_a=0.0)).eval(0, 0, 0)
    with pytest.raises(TypeError, match="knows its strands already"):
        Strands(DualScattering(Fibre.preset("brown")))
    with pytest.raises(TypeError, match="model must have eval"):
        Strands(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="strands must be in"):
        Strands(Chiang(eumelanin=1), -1)
    with pytest.raises(ValueError, match="d_f must be in"):
        Strands(Chiang(eumelanin=1), d_f=2)
    with pytest.raises(ValueError, match=r"rows must be in \[9, 361\], got 1; 45 are 4° apart"):
        Strands(Chiang(eumelanin=1), rows=1)


def test_rows_are_kept_and_more_of_them_resolve_narrower_lobes() -> None:
    smooth = Chiang(beta_m=0.05, eumelanin=1.0)
    found = Strands.from_dict(Strands(smooth, 1, rows=91).to_dict()).with_strands(1)
    assert found.rows == found.with_strands(2).rows == 91
    assert repr(found).endswith("d_b=0.7, rows=91)")
    # TT's deviation is 1.1°: rows of 4° widen it to about 1.6°, rows of 2° to 1.2° (uniform in a row: width/sqrt(12)).
    peaks = [model.eval(THETA, 0.3, np.pi).max() for model in (Strands(smooth, 1), found)]
    assert peaks[1] > 1.2 * peaks[0]
    coarse, fine = (energy(m, 0.3) for m in (Strands(smooth, 1), found))
    np.testing.assert_allclose(fine, coarse, rtol=0.02)


def test_the_command_puts_a_function_among_others(tmp_path: Path) -> None:
    Chiang(sigma_a=(0.5,)).save(tmp_path / "hair.toml")
    done = run("fit", "hair.toml", "-o", "out", "--strands", "0,2", "--lobes", "2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert cuticle.Sampler.load(tmp_path / "out/sampler.json").about["among"] == {"d_f": 0.7, "d_b": 0.7}
    done = run("check", "out", "--samples", "100000", "--strands", "0,2", cwd=tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_document_of_a_function_among_others(tmp_path: Path) -> None:
    Chiang(sigma_a=(0.5,)).save(tmp_path / "hair.toml")
    done = run("document", "hair.toml", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    data = json.loads((tmp_path / "out/document.json").read_text())
    assert data["model"].startswith("Strands(Chiang(")
    assert data["fibre"]["sigma_a"] == [0.5]
    done = run("report", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "sigma_a" in (tmp_path / "out/report.html").read_text()
