"""The check passes what is right and fails what is broken."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import cuticle
from cuticle import Sampler, _core, check
from cuticle.checking.check import widened
from cuticle.checking.verdicts import deviations, sidak


@pytest.mark.parametrize("samples", [200_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_a_fitted_sampler_passes(document_model: cuticle.DualScattering, document_fit: cuticle.Fit, samples: int) -> None:
    """The controls that apply are caught by far: of 200,000 samples the largest p is 2e-25, and the limit 2e-5."""
    report = check(document_fit.sampler, document_model, samples=samples)
    assert report.ok, report
    assert len(report.cases) == 45
    assert {c.name for c in report.controls if c.caught} == {
        "a lobe 5 % too wide",
        "phi shifted by half a bin",
        "pdf scaled by 1 %",
    }
    assert all(c.caught for c in report.controls if c.applies)
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False))["ok"] is True
    assert "pass  chi-square" in repr(report)


def test_one_that_reaches_between_the_counts_passes(
    document_model: cuticle.DualScattering, document_fit: cuticle.Fit
) -> None:
    angles = np.radians([-80, 10, 50])
    assert check(document_fit.sampler, document_model, theta_r=angles, strands=[0.5, 3], samples=300_000).ok


class Lying(Sampler):
    """A sampler whose pdf or samples are changed after the fact."""

    def sample(self, theta_r, u, strands=None):
        theta_i, phi, p = super().sample(theta_r, u, strands)
        if self.about["lie"] == "tilted":
            theta_i = np.clip(theta_i + np.float32(0.01), -1.57, 1.57).astype(theta_i.dtype)
        if self.about["lie"] == "turned":
            phi = (np.pi - np.mod(np.pi - 0.05 - phi.astype(float), 2 * np.pi)).astype(phi.dtype)
        if self.about["lie"] == "stuck":
            theta_i = np.where(u[..., 0] < 0.01, np.zeros_like(theta_i), theta_i)
        if self.about["lie"] == "both":
            p = p * p.dtype.type(1.01)
        return cuticle.Sample(theta_i, phi, p)

    def pdf(self, theta_i, theta_r, phi, strands=None):
        p = super().pdf(theta_i, theta_r, phi, strands)
        return p * p.dtype.type(1.01) if self.about["lie"] in ("scaled", "both") else p


@pytest.mark.parametrize(
    ("lie", "verdict"),
    [
        ("tilted", "chi-square"),
        ("turned", "chi-square"),
        ("stuck", "chi-square"),
        ("scaled", "∫ pdf, double"),
        ("both", "mean of f cos/p"),
    ],
)
def test_a_broken_sampler_fails(
    document_model: cuticle.DualScattering, document_fit: cuticle.Fit, lie: str, verdict: str
) -> None:
    s = document_fit.sampler
    lying = Lying(s.nodes, s.energy, s.strands, s.even, {"lie": lie})
    report = check(lying, document_model, theta_r=np.radians([-60, 0, 60]), strands=[0])
    assert not report.ok
    assert verdict in {v.name for v in report.verdicts if not v.passed}


def test_a_sampler_for_another_fibre_is_unbiased_and_poor(document_fit: cuticle.Fit) -> None:
    other = cuticle.DualScattering(cuticle.Fibre.preset("black"))
    report = check(document_fit.sampler, other, theta_r=[0.0], strands=[0])
    assert report.ok, report
    assert report.cases[0].ess < 0.9


def test_weights_without_bound_are_told(document_model: cuticle.DualScattering) -> None:
    nodes = np.tile(np.array([1, 0, 0.5, 0.02, 0.02]).reshape(1, 1, 5, 1), (1, 2, 1, 1))
    report = check(Sampler(nodes, np.ones((1, 2))), document_model, theta_r=[0.0], samples=20_000)
    assert not report.ok
    assert report.cases[0].largest_weight > 1e6


@pytest.mark.parametrize(("runs", "most"), [(10, 6), pytest.param(40, 13, marks=pytest.mark.slow)])
def test_false_alarms_are_as_rare_as_stated(
    document_model: cuticle.DualScattering, document_fit: cuticle.Fit, runs: int, most: int
) -> None:
    """At level 0.05 runs of a correct sampler fail no more often than the level allows (p < 1e-4 else)."""
    failures = 0
    for seed in range(runs):
        report = check(
            document_fit.sampler, document_model, theta_r=[0.2], strands=[0], samples=50_000, level=0.05, seed=seed
        )
        failures += not all(v.passed for v in report.verdicts if v.name in ("chi-square", "mean of f cos/p"))
    assert failures <= most  # two families at 5 %: the binomial tail beyond is 3e-5 of 40 runs, 8e-6 of 10


def test_a_level_is_shared_among_tests_as_sidak_has_it() -> None:
    assert sidak(0.05, 3) == pytest.approx(1 - 0.95 ** (1 / 3), rel=1e-12)
    assert deviations(0.05) == pytest.approx(1.959963985, rel=1e-9)  # of a normal distribution, both sides


def test_widened_scales_one_lobe(document_fit: cuticle.Fit) -> None:
    wide = widened(document_fit.sampler, 1, 1.05)
    np.testing.assert_allclose(wide.nodes[:, :, 3, 1], 1.05 * document_fit.sampler.nodes[:, :, 3, 1])
    np.testing.assert_array_equal(wide.nodes[:, :, :, 0], document_fit.sampler.nodes[:, :, :, 0])
    assert replace(wide, even=wide.even).lobes == 4


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"samples": 10}, "samples must be in [10000, 1e+08], got 10"),
        ({"theta_r": [2.0]}, "theta_r must lie in"),
        ({"theta_r": []}, "theta_r must name at least one viewer, got none"),
        ({"level": 0}, "level must be in"),
        ({"strands": [-1]}, "strands must be in [0, 10000], got -1"),
    ],
)
def test_bad_input(document_model: cuticle.DualScattering, document_fit: cuticle.Fit, arguments: dict, words: str) -> None:
    with pytest.raises(ValueError, match=".") as error:
        check(document_fit.sampler, document_model, **arguments)
    assert words in str(error.value)


def test_a_model_without_strands(document_fit: cuticle.Fit) -> None:
    with pytest.raises(TypeError, match="Marschner knows no strands"):
        check(document_fit.sampler, cuticle.Marschner(cuticle.Fibre.preset("black")), samples=10_000)


@pytest.mark.parametrize("cells", [1, 2, 3, 40, 361])
def test_directions_are_counted_in_their_cells(cells: int) -> None:
    """Against NumPy's own histogram: on the edges, of which the last is within, and with what lies outside or nowhere."""
    rng = np.random.default_rng(cells)
    edges = [np.sort(rng.uniform(-1, 1, cells + 1)) for _ in range(2)]
    at = [np.concatenate([rng.uniform(-1.1, 1.1, 20_000), e]) for e in edges]
    counts = np.zeros((cells, cells), np.int64)
    outside = _core.histogram(*at, *edges, counts)
    np.testing.assert_array_equal(counts, np.histogram2d(*at, bins=edges)[0])
    assert outside == at[0].size - counts.sum() > 0
    assert _core.histogram(np.array([np.nan, np.inf]), np.array([edges[1][0], np.nan]), *edges, counts) == 2
