"""The audit passes what is right, fails what is broken, and says where."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import run
from cuticle import Chiang, audit
from cuticle.checking.chi_square import chi_square
from cuticle.checking.foreign_sampler import foreign_sampler
from cuticle.sampling.families import FAMILIES

BASE = Chiang(beta_m=0.3, beta_n=0.3, alpha=2.0, eumelanin=1.3)


def failed(report: Any) -> set[str]:
    return {v.name for v in report.verdicts if not v.passed}


# ---- what is right


@pytest.mark.slow
@pytest.mark.parametrize(("count", "most"), [(20, 6), (100, 10)])
def test_right_samplers_are_not_flagged(count: int, most: int) -> None:
    rng = np.random.default_rng(7)
    low = 0
    for i in range(count):
        model = Chiang(
            beta_m=rng.uniform(0.05, 1), beta_n=rng.uniform(0.05, 1), alpha=rng.uniform(-5, 5), eumelanin=rng.uniform(0, 8)
        )
        report = audit(model.near(rng.uniform(-0.99, 0.99)), theta_r=[rng.uniform(-1.5, 1.5)], samples=20_000, seed=i)
        assert report.ok, report
        low += report.cases[0].p_value < 0.05
    assert low <= most  # p < 0.05 in at most one of twenty: beyond `most` the binomial tail is 3e-5 of 20, 1 % of 100


slow = pytest.mark.slow


@pytest.mark.parametrize("h", [0.0, pytest.param(0.8, marks=slow)])
@pytest.mark.parametrize(
    ("beta_m", "beta_n", "melanin"),
    [
        pytest.param(0.25, 0.3, 0.3, marks=slow),
        pytest.param(0.3, 0.3, 1.3, marks=slow),
        (0.8, 0.8, 1.3),
        (0.1, 0.1, 0.3),
    ],
)
def test_our_near_field_passes_at_any_roughness(beta_m: float, beta_n: float, melanin: float, h: float) -> None:
    near = Chiang(beta_m=beta_m, beta_n=beta_n, eumelanin=melanin).near(h)
    report = audit(near, theta_r=np.radians([-85, -30, 0, 75]), samples=100_000)
    assert report.ok, report
    assert all(c.ess == pytest.approx(1, abs=1e-4) for c in report.cases)


def test_a_fitted_sampler_passes_with_and_without_its_function(
    document_model: cuticle.DualScattering, document_fit: cuticle.Fit
) -> None:
    viewers = np.radians([-75, 0, 60])
    for strands in (0.0, 2.0):
        own = document_model.with_strands(strands)
        report = audit(document_fit.sampler, eval=own.eval, strands=strands, theta_r=viewers, samples=100_000)
        assert report.ok, report
        assert report.cases[1].ess == pytest.approx(cuticle.measure(document_fit.sampler, own, 0.0, strands).ess, abs=2e-3)
        blind = audit(document_fit.sampler, strands=strands, theta_r=viewers, samples=100_000)
        assert blind.ok, blind
        assert {v.name for v in blind.verdicts} < {v.name for v in report.verdicts}


def write(path: Path, theta: np.ndarray, phi: np.ndarray, pdf: np.ndarray, **others: np.ndarray) -> Path:
    direction = np.column_stack([np.cos(theta) * np.cos(phi), np.sin(theta), np.cos(theta) * np.sin(phi)])
    np.savez(path, direction=direction, pdf=pdf, **others)
    return path


class Hemisphere:
    """Half a sphere by the cosine, in the frame's z: a sampler that gives up for a tenth of its numbers."""

    give_up = 0.0

    def sample(self, theta_r: float, u: np.ndarray) -> tuple[np.ndarray, ...]:
        z, a = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
        r = np.sqrt(1 - z * z)
        theta, phi = np.arcsin(r * np.sin(a)), np.arctan2(z, r * np.cos(a))
        none = u[:, 2] < self.give_up
        pdf = np.where(none, 0, self.pdf(theta, theta_r, phi))
        return theta, phi, pdf, np.where(none, 0, 1 / (1 - self.give_up))

    def pdf(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return (1 - self.give_up) * np.maximum(np.cos(theta_i) * np.sin(phi), 0) / np.pi

    def eval(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return np.maximum(np.sin(phi), 0) / np.pi


def test_a_surface_passes_and_so_does_one_that_drops_samples() -> None:
    report = audit(Hemisphere(), theta_r=[0.3], energy=True)
    assert report.ok, report
    partial = Hemisphere()
    partial.give_up = 0.1
    report = audit(partial, theta_r=[0.3])
    assert report.ok, report
    assert report.cases[0].dropped == pytest.approx(0.1, abs=0.005)
    assert any("give no direction" in n for n in report.notes)


def test_functions_of_single_numbers_will_do() -> None:
    report = audit(
        lambda theta_r, u: (float(np.arcsin(2 * u[0] - 1)), float(2 * np.pi * u[1] - np.pi)),
        lambda theta_i, theta_r, phi: 1 / (4 * np.pi) if isinstance(phi, float) else _refuse(),
        theta_r=[0.0],
        samples=10_000,
        dimensions=2,
    )
    assert report.ok, report


def _refuse() -> float:
    raise TypeError("one at a time")


# ---- what is broken


class Changed:
    """A right sampler, changed."""

    def __init__(self, near: cuticle.ChiangNear, change: str) -> None:
        self.near, self.change = near, change

    def sample(self, theta_r: float, u: np.ndarray) -> tuple[np.ndarray, ...]:
        s = self.near.sample(theta_r, u)
        theta, phi, pdf = s.theta_i.copy(), s.phi, s.pdf
        if self.change == "tilt after":
            flat = Chiang(**{**self.near.model.values(), "alpha": 0.0}).near(self.near.h)
            s = flat.sample(theta_r, u)
            chance = np.array([_energy(flat, theta_r, lobe) for lobe in ("R", "TT", "TRT", "rest")])
            lobe = np.searchsorted(np.cumsum(chance / chance.sum())[:-1], u[:, 0], side="right")
            theta, phi = s.theta_i + self.near.model.tilt[lobe], s.phi
            theta = np.where(theta > np.pi / 2, np.pi - theta, np.where(theta < -np.pi / 2, -np.pi - theta, theta))
            pdf = self.near.pdf(theta, theta_r, phi)
        if self.change == "stuck":
            theta[u[:, 0] < 0.003] = 0.25
            pdf = self.near.pdf(theta, theta_r, phi)
        if self.change == "one":
            pdf = np.ones_like(pdf)
        if self.change == "other pdf":
            pdf = 1.1 * pdf
        weight = self.near.eval(theta, theta_r, phi) * np.cos(theta)[:, None] / pdf[:, None]
        theta[17] = {"nan": np.nan, "off": 2.0}.get(self.change, theta[17])
        return theta, phi, pdf, 1.2 * weight if self.change == "weight" else weight

    def pdf(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        p = self.near.pdf(theta_i, theta_r, phi)
        if self.change == "one":
            return np.ones_like(p)
        if self.change == "scaled":
            return 1.01 * p
        if self.change == "negative":
            return np.where(np.asarray(theta_i) > 1.3, -p, p)
        return p

    def eval(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return self.near.eval(theta_i, theta_r, phi)


def _energy(near: cuticle.ChiangNear, theta_r: float, lobe: str) -> float:
    theta, phi = np.linspace(-1.57, 1.57, 1001), np.linspace(-np.pi, np.pi, 721)
    f = near.eval(theta[:, None], theta_r, phi, lobes=lobe) @ np.array([0.2126, 0.7152, 0.0722])
    return float((f * np.cos(theta)[:, None] ** 2).sum())


@pytest.mark.parametrize(
    ("change", "verdicts"),
    [
        ("nothing", set()),
        ("tilt after", {"samples follow the pdf"}),
        ("stuck", {"no atom", "samples follow the pdf"}),
        ("nan", {"valid samples"}),
        ("off", {"valid samples"}),
        ("one", {"∫ pdf", "samples follow the pdf"}),
        ("other pdf", {"pdf of a sample"}),
        ("weight", {"weight of a sample", "mean weight"}),
        ("scaled", {"∫ pdf"}),
        ("negative", {"valid density"}),
    ],
)
def test_a_broken_sampler_fails_in_the_right_place(change: str, verdicts: set[str]) -> None:
    report = audit(Changed(BASE.near(0.2), change), theta_r=np.radians([-60, 60]), name=change)
    assert verdicts <= failed(report), report
    assert report.ok == (change == "nothing"), report


class Bins:
    """A table of azimuths: 64 bins where samples are drawn, 63 where the pdf is told."""

    weight = 1 + 0.5 * np.cos(np.linspace(0, 2 * np.pi, 64, endpoint=False))

    def __init__(self, told: int) -> None:
        self.told = told

    def sample(self, theta_r: float, u: np.ndarray) -> tuple[np.ndarray, ...]:
        bins = np.searchsorted(np.cumsum(self.weight) / self.weight.sum(), u[:, 0], side="right").clip(0, 63)
        return np.arcsin(2 * u[:, 2] - 1), -np.pi + (bins + u[:, 1]) * 2 * np.pi / 64

    def pdf(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        bins = np.floor((np.asarray(phi) + np.pi) / (2 * np.pi) * self.told).astype(int).clip(0, self.told - 1)
        weight = self.weight[: self.told]
        return weight[bins] / weight.sum() * self.told / (4 * np.pi)


def test_bins_that_do_not_line_up_are_seen_and_those_that_do_pass() -> None:
    right, wrong = (audit(Bins(told), theta_r=[0.0], samples=200_000) for told in (64, 63))
    assert right.ok, right
    assert failed(wrong) == {"samples follow the pdf"}


def test_density_where_f_is_and_is_not() -> None:
    uniform = {"sample": lambda t, u: (np.arcsin(2 * u[:, 0] - 1), 2 * np.pi * u[:, 1] - np.pi)}

    def flat(theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return np.full(np.shape(theta_i), 1 / (4 * np.pi))

    half = audit(uniform["sample"], flat, Hemisphere().eval, theta_r=[0.0])
    assert half.ok, half
    assert half.cases[0].wasted == pytest.approx(0.5, abs=1e-3)
    assert any("wasted" in n for n in half.notes)
    lost = audit(Hemisphere().sample, Hemisphere().pdf, lambda t, r, p: np.full(np.shape(t), 0.1), theta_r=[0.0])
    assert "reach" in failed(lost)
    assert lost.cases[0].lost == pytest.approx(0.5, abs=1e-3)


def test_reciprocity_and_energy_are_asked_for() -> None:
    gaussian = cuticle.Marschner(cuticle.Fibre(alpha_R=-7.5, sigma_a=0.05, beta_N=20.0))
    sampler = cuticle.fit(gaussian, 2).sampler
    report = audit(sampler, eval=gaussian.eval, theta_r=[0.0], reciprocity=True, energy=True)
    verdicts = {v.name: v for v in report.verdicts}
    assert verdicts["reciprocity"].passed  # Marschner's own form is reciprocal and makes light
    assert not verdicts["energy"].passed
    near = audit(BASE.near(0.3), theta_r=[0.0], reciprocity=True, energy=True)
    assert failed(near) == {"reciprocity"}


def test_it_says_where_and_which_lobe() -> None:
    report = audit(Changed(BASE.near(0.2), "stuck"), theta_r=[0.5])
    case = report.worst
    assert case.region is not None
    assert case.region.theta[0] <= 0.25 <= case.region.theta[1]
    assert case.region.drawn > case.region.expected
    assert case.repeated[0].angle == pytest.approx(np.degrees(0.25), abs=1e-4)
    assert "at exactly theta_i = 14.324°" in repr(report)
    plain = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert plain["ok"] is False
    assert "maps" not in plain["cases"][0]


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("strands", [0.0, 0.5, 3.0])
def test_lobes_of_a_sampler_sum_to_its_pdf(document_fit: cuticle.Fit, strands: float, family: str) -> None:
    given = {"dimensions": 3, "strands": strands, "lobes": None, "name": None}
    fitted = document_fit.sampler
    of_family = cuticle.Sampler(fitted.nodes, fitted.energy, fitted.strands, fitted.even, family=family)
    sampler = foreign_sampler(of_family, None, None, **given)
    rng = np.random.default_rng(8)
    theta, phi = rng.uniform(-1.5, 1.5, 500), rng.uniform(-3.1, 3.1, 500)
    assert sampler.lobe_densities is not None
    parts = sampler.lobe_densities(theta, 0.3, phi)
    assert parts.shape == (len(sampler.lobe_names), 500)  # between two rows, too, where each lobe has two parts
    np.testing.assert_allclose(parts.sum(axis=0), sampler.density(theta, 0.3, phi), rtol=1e-12)


def test_the_picture_is_one(tmp_path: Path) -> None:
    report = audit(BASE.near(0.2), theta_r=[0.0, 0.5], samples=20_000)
    data = report.figure(tmp_path / "audit.png", theta_r=0.5)
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert (tmp_path / "audit.png").read_bytes() == data


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: audit(3), "sample must be a function, got int"),
        (lambda: audit(lambda t, u: u, None), "pdf must be a function"),
        (lambda: audit(BASE.near(0), samples=10), r"samples must be in \[10000"),
        (lambda: audit(BASE.near(0), theta_r=[2.0]), "theta_r must lie in"),
        (lambda: audit(BASE.near(0), level=0), "level must be in"),
        (lambda: audit(lambda t, u: (u[:, 0],), lambda *a: 1.0, samples=10_000), "must return theta_i, phi"),
        (lambda: audit(lambda t, u: 1 / 0, lambda *a: 1.0, samples=10_000), "raised ZeroDivisionError"),
        (lambda: audit(BASE.near(0).sample, lambda t, r, p: np.ones((3, 3)), theta_r=[0]), "must return one value"),
        (lambda: audit(BASE.near(0).sample, BASE.near(0).pdf, reciprocity=True), "give eval"),
    ],
)
def test_bad_input_is_one_line(call: Callable[[], Any], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


# ---- its parts


def test_chi_square_is_uniform_where_the_expectation_is_right() -> None:
    rng = np.random.default_rng(5)
    share = rng.dirichlet(np.full(400, 0.3)).reshape(20, 20)
    values = [chi_square(rng.multinomial(5000, share.ravel()).reshape(20, 20), share * 5000).p_value for _ in range(400)]
    assert 0.4 < np.mean(values) < 0.6
    assert np.mean(np.array(values) < 0.05) < 0.09
    moved = np.roll(share, 1)
    assert chi_square(rng.multinomial(5000, moved.ravel()).reshape(20, 20), share * 5000).p_value < 1e-9


@pytest.mark.parametrize(("rows", "outcome"), [(0, "inconclusive"), (900, "inconclusive"), (1100, "pass")])
def test_a_sampler_that_gives_next_to_no_direction_is_inconclusive(rows: int, outcome: str) -> None:
    """A uniform sphere that drops all but `rows` of 100,000 samples, and whose pdf says so."""
    share = rows / 100_000

    def sample(theta_r: float, u: np.ndarray) -> tuple[np.ndarray, ...]:
        kept = np.arange(len(u)) % 100_000 < rows
        return np.arcsin(2 * u[:, 0] - 1), np.pi * (2 * u[:, 1] - 1), np.where(kept, share / (4 * np.pi), 0)

    def pdf(theta: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return np.full(len(theta), share / (4 * np.pi))

    report = audit(sample, pdf, samples=100_000, theta_r=[0.0])
    assert report.outcome == outcome, report
    assert [v.name for v in report.verdicts if v.undecided] == (["samples follow the pdf"] if outcome != "pass" else [])
    if not rows:  # with f = 0, too
        dark = audit(sample, pdf, lambda theta, theta_r, phi: 0 * theta, samples=100_000, theta_r=[0.0])
        assert dark.outcome == "inconclusive"
        assert "f is 0 in all directions" in repr(dark)


def test_a_sampler_of_nan_does_not_pass() -> None:
    def sample(theta_r: float, u: np.ndarray) -> tuple[np.ndarray, ...]:
        return (np.full(len(u), np.nan),) * 3

    assert audit(sample, lambda theta, theta_r, phi: np.full(len(theta), np.nan), theta_r=[0.0]).outcome != "pass"


@pytest.mark.slow  # Mitsuba is asked a direction at a time
def test_a_plugin_without_directions_is_inconclusive(use_variant: Callable[[str], Any]) -> None:
    use_variant("scalar_rgb")
    done = run("audit", "mitsuba:hair", "longitudinal_roughness=nan", "--samples", "10000", "--theta-r", "0")
    assert done.returncode in (1, 3), done
    assert "passes" not in done.stdout
