"""Full hair between guides: where roots lie, what strands follow, what partings keep apart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cuticle.grooms.groom import Groom, read_groom
from cuticle.grooms.procedural import hair_ball

SIDE = 12
PLACES = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE), [0.0], indexing="ij"), axis=-1).reshape(-1, 3) / (SIDE - 1)


def straight(direction: NDArray, length: float = 1.0, points: int = 5) -> Groom:
    """Straight guides over the unit square."""
    at = np.linspace(0, length, points)[None, :, None]
    return Groom((PLACES[:, None] + at * direction[:, None]).reshape(-1, 3), np.arange(len(PLACES) + 1) * points, 0.01)


def strands_of(groom: Groom) -> NDArray:
    return groom.points.reshape(groom.strands, -1, 3).astype(np.float64)


def test_what_is_linear_over_the_roots_is_reproduced() -> None:
    """Barycentric weights are exact for it, whatever the triangles: at guides as between them."""

    def linear(root: NDArray) -> NDArray:
        return np.array([0.1, 0.2, 1.0]) + root @ np.array([[0.2, 0.0, 0.3], [0.1, -0.2, 0.1], [0.0, 0.0, 0.0]])

    full = strands_of(straight(linear(PLACES)).interpolated(5000))
    expected = full[:, :1] + np.linspace(0, 1, 5)[None, :, None] * linear(full[:, 0])[:, None]
    assert np.abs(full - expected).max() <= 1e-5  # single precision, and the jitter of ties
    assert np.unique(full[:, 0], axis=0).shape == (5000, 3)


@pytest.mark.parametrize("shape", ["square", "sphere"])
def test_roots_are_spread_evenly(shape: str) -> None:
    count = 40_000
    if shape == "square":
        roots = strands_of(straight(np.tile([0.0, 0.0, 1.0], (len(PLACES), 1))).interpolated(count))[:, 0]
        places = np.floor(roots[:, :2] * 8).astype(int) @ [1, 8]
        assert roots.min() >= 0
        assert roots.max() <= 1
    else:
        roots = strands_of(hair_ball(3000).interpolated(count))[:, 0]
        places = (roots > 0) @ [1, 2, 4]
        distance = np.linalg.norm(roots, axis=1)
        assert distance.max() <= 1 + 1e-6
        assert np.quantile(distance, 0.01) >= 0.99  # triangles of 3000 roots sag by less
    share = np.bincount(places) / count * (places.max() + 1)
    # The cells of the square cut through triangles; the sphere's random roots are triangulated twice in 4 % of the area.
    assert np.abs(share - 1).max() <= 0.06


def test_nothing_is_blended_across_a_parting() -> None:
    left = PLACES[:, 0] < 0.5
    away = np.where(left[:, None], [-1.0, 0.0, 0.2], [1.0, 0.0, 0.2])
    full = strands_of(straight(away).interpolated(5000))
    steps = full[:, -1] - full[:, 0]
    np.testing.assert_allclose(np.abs(steps), np.broadcast_to([1.0, 0.0, 0.2], steps.shape), atol=1e-5)
    gap = np.abs(full[:, 0, 0] - 0.5) < 0.5 / (SIDE - 1)
    assert gap.sum() > 200
    assert ((steps[:, 0] > 0) == (full[:, 0, 0] > 0.5))[~gap].all()


def test_clumps_frizz_and_cuts() -> None:
    guides = straight(np.tile([0.0, 0.0, 1.0], (len(PLACES), 1)), length=2.0)
    clumped = strands_of(guides.interpolated(2000, clumping=1))
    tips = np.unique(clumped[:, -1].round(5), axis=0)
    assert {tuple(t) for t in tips} <= {tuple(t) for t in (PLACES + np.array([0, 0, 2.0])).round(5)}
    cut = guides.interpolated(5000, length_variation=0.3).lengths
    assert (cut <= 2 + 1e-5).all()
    assert (cut >= 1.4 - 1e-5).all()
    assert abs(cut.mean() - 1.7) <= 0.01  # 3 standard errors: .007
    tip = strands_of(guides.interpolated(5000, frizz=0.1))
    away = tip[:, -1] - tip[:, 0] - [0, 0, 2]
    np.testing.assert_allclose(away.std(axis=0), 0.2, rtol=0.04)  # 4 standard errors
    np.testing.assert_array_equal(guides.interpolated(50, frizz=0.1).points, guides.interpolated(50, frizz=0.1).points)
    assert (guides.interpolated(50, seed=2).points != guides.interpolated(50).points).any()


def test_a_real_head_becomes_full(data: Path) -> None:
    guides = read_groom(data / "hair" / "sintel" / "sintel.tfx")
    full = guides.interpolated(50_000)
    low, high = guides.bounds
    assert (full.bounds[0] >= low).all()  # means of strands from roots within
    assert (full.bounds[1] <= high).all()
    assert full.lengths.max() <= guides.lengths.max()
    assert np.quantile(full.lengths, 0.001) >= guides.lengths.min()
    assert abs(full.lengths.mean() / guides.lengths.mean() - 1) <= 0.03


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda g: g.interpolated(0), "strands must be in"),
        (lambda g: g.interpolated(10, points=1), "points must be in"),
        (lambda g: g.interpolated(10, clumping=2), "clumping must be in"),
        (lambda g: g.interpolated(10, frizz=-1), "frizz must be in"),
        (lambda g: g.interpolated(10, length_variation=1), "length_variation must be in"),
        (lambda g: g.interpolated(10, seed=-1), "seed must be in"),
        (lambda g: g.with_followers(1, 0.1, seed=-1), "seed must be in"),
        (lambda g: g.interpolated(10_000_000, points=1024), "10,000,000 strands with 1024 points each needs 328 GB"),
        (lambda g: Groom(g.points[:15], g.offsets[:4], 0.1).interpolated(10), "got 3 different roots that make no triangle"),
        (lambda g: Groom(g.points[:5], g.offsets[:2], 0.1).interpolated(10), "got 1 different roots"),
    ],
)
def test_what_cannot_be_interpolated_is_told(call: Callable[[Groom], Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call(straight(np.tile([0.0, 0.0, 1.0], (len(PLACES), 1))))
