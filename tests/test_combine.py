"""Two PDFs combined: the exact mixture, a sampler like any other, and its ESS where the light is not known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import cuticle
from cuticle.sampling.combining import mixed_ess
from cuticle.sampling.quality import UniformSphere

Point = tuple[np.ndarray, np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def points() -> Point:
    a, b, c = np.random.default_rng(0).uniform(-1.5, 1.5, (3, 200))
    return a, b, 2 * c


@pytest.mark.parametrize(("strands", "counts"), [(2.0, [2.0]), (3.0, [3.0]), (None, [1.0, 2.0, 4.0, 8.0])])
def test_the_density_is_the_mixture(
    document_fit: cuticle.Fit, points: Point, strands: float | None, counts: list[float]
) -> None:
    s = document_fit.sampler
    both = cuticle.combine(s, s, 0.3, strands=strands)
    expected = 0.3 * s.pdf(*points, 0) + 0.7 * np.mean([s.pdf(*points, n) for n in counts], axis=0)
    for n in (None, 0, 2, 100):  # one row: whatever the host turns out to find
        np.testing.assert_allclose(both.pdf(*points, n), expected, rtol=1e-12)
    assert both.covers == (0.0, *counts)


def test_tables_of_different_nodes_combine_exactly(
    document_model: cuticle.DualScattering, document_fit: cuticle.Fit, points: Point
) -> None:
    draft = cuticle.fit(document_model, form="document", strands=[0, 2]).sampler
    both = cuticle.combine(draft, document_fit.sampler, 0.6, strands=2)
    assert both.nodes.shape[1] == 121  # 61 and 25 nodes have this refinement
    expected = 0.6 * draft.pdf(*points, 0) + 0.4 * document_fit.sampler.pdf(*points, 2)
    np.testing.assert_allclose(both.pdf(*points), expected, rtol=1e-12)


@pytest.mark.parametrize("strands", [2.0, pytest.param(None, marks=pytest.mark.slow)])
def test_it_passes_the_check_and_survives_a_file(
    document_model: cuticle.DualScattering, document_fit: cuticle.Fit, tmp_path: Path, strands: float | None
) -> None:
    both = cuticle.combine(document_fit.sampler, document_fit.sampler, 0.5, strands=strands)
    both.save(tmp_path / "both.json")
    loaded = cuticle.Sampler.load(tmp_path / "both.json")
    np.testing.assert_array_equal(loaded.nodes, both.nodes)
    assert loaded.covers == both.covers
    report = cuticle.check(loaded, document_model, theta_r=np.radians([-60, 0, 85]), samples=200_000)
    assert report.ok, report
    assert {c.strands for c in report.cases} == set(both.covers)  # unbiased for every number of strands


def test_a_row_alone_is_the_row(document_fit: cuticle.Fit, points: Point) -> None:
    for n in (0.0, 1.0, 1.7, 3.0, 8.0, 20.0):
        row = document_fit.sampler.row(n)
        assert row.strands == (n,)
        np.testing.assert_allclose(row.pdf(*points), document_fit.sampler.pdf(*points, n), rtol=1e-12)
    with pytest.raises(ValueError, match="strands must be 0 or at least 1 for one row, got 0.5"):
        document_fit.sampler.row(0.5)


def test_mixed_ess_has_the_known_ends(document_model: cuticle.DualScattering, document_fit: cuticle.Fit) -> None:
    s, through = document_fit.sampler, document_model.with_strands(2)
    for share, own, n in ((1.0, document_model, 0.0), (0.0, through, 2.0)):
        ess, best = mixed_ess(s.row(n), document_model, through, share, 0.4)
        assert ess == pytest.approx(cuticle.measure(s, own, 0.4, n).ess, abs=1e-3)  # two quadratures
        assert best == pytest.approx(1, abs=1e-6)
    # Lit or black, by a coin: E f = f/2, E f² = f²/2, so no density passes ½.

    class Black:
        even = True

        def eval(self, theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray) -> np.ndarray:
            return np.zeros((*np.broadcast_shapes(np.shape(theta_i), np.shape(phi)), 1))

    ess, best = mixed_ess(s.row(0), document_model, Black(), 0.5, 0.0)
    assert best == pytest.approx(0.5, abs=1e-9)
    assert ess == pytest.approx(0.5 * cuticle.measure(s, document_model, 0.0, 0).ess, abs=1e-3)


def test_mixed_ess_is_what_a_simulation_gives(document_model: cuticle.DualScattering, document_fit: cuticle.Fit) -> None:
    through, share = document_model.with_strands(2), 0.25
    both = cuticle.combine(document_fit.sampler, document_fit.sampler, 0.5, strands=2)
    rng = np.random.default_rng(5)
    count = 400_000
    theta_i, phi, p = both.sample(0.3, rng.random((count, 3)))
    lit = rng.random(count) < share
    f = np.where(lit, document_model.eval(theta_i, 0.3, phi)[:, 0], through.eval(theta_i, 0.3, phi)[:, 0])
    weight = f * np.cos(theta_i) / p
    simulated = weight.mean() ** 2 / (weight**2).mean()
    assert mixed_ess(both, document_model, through, share, 0.3)[0] == pytest.approx(simulated, abs=0.005)  # four errors


def test_a_better_weight_is_worth_more_than_none(document_model: cuticle.DualScattering, document_fit: cuticle.Fit) -> None:
    through = document_model.with_strands(2)
    s = document_fit.sampler
    best = max(
        mixed_ess(cuticle.combine(s, s, w, strands=2), document_model, through, 0.1, 0.0)[0] for w in (0.25, 0.5, 0.75)
    )
    alone = [mixed_ess(s.row(n), document_model, through, 0.1, 0.0)[0] for n in (0, 2)]
    uniform = mixed_ess(UniformSphere(), document_model, through, 0.1, 0.0)[0]
    assert best > max(*alone, uniform)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: cuticle.combine(s, s, 0), r"weight must be in \(0, 1\], got 0"),
        (lambda s: cuticle.combine(s, s, 1), r"weight must be in \(0, 1\), got 1"),
        (lambda s: cuticle.combine(s, s, float("nan")), "weight must be in"),
        (lambda s: cuticle.combine(s, s, 0.5, strands=0), "strands must be in"),
        (lambda s: cuticle.combine(s, s, 0.5, strands=0.5), "strands must be 0 or at least 1"),
        (lambda s: cuticle.combine(s, "x", 0.5), "multiple must be a cuticle.Sampler, got str"),
        (
            lambda s: cuticle.combine(cuticle.combine(s, s, 0.5), cuticle.combine(s, s, 0.5), 0.5),
            "at most 32 lobes together, got 40",
        ),
    ],
)
def test_bad_input_is_told(document_fit: cuticle.Fit, call: Callable[[cuticle.Sampler], object], words: str) -> None:
    with pytest.raises((ValueError, TypeError), match=words):
        call(document_fit.sampler)
