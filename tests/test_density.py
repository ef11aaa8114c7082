"""The density grid: exact where strands are parallel, additive along a ray, right on the mean against counted strands."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cuticle.grooms.density_grid import DensityGrid
from cuticle.grooms.groom import Groom, read_groom
from cuticle.grooms.procedural import hair_ball, wavy_lock


def straight(count: int, direction: int, seed: int = 3) -> Groom:
    """Straight strands through the unit cube, all along one axis."""
    rng = np.random.default_rng(seed)
    ends = rng.random((count, 2, 3))
    ends[:, 1] = ends[:, 0]
    ends[:, 0, direction], ends[:, 1, direction] = 0, 1
    return Groom(ends.reshape(-1, 3).astype(np.float32), 2 * np.arange(count + 1), np.full(2 * count, 0.001, np.float32))


def counted(groom: Groom, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Pieces of strand within their radius of each ray: the slow reference."""
    inner = np.ones(len(groom.points) - 1, bool)
    inner[groom.offsets[1:-1] - 1] = False
    a, b = (groom.points[s][inner].astype(float) for s in (slice(None, -1), slice(1, None)))
    r = groom.radius[:-1][inner]
    total = np.zeros(len(origin))
    for k, (o, d) in enumerate(zip(origin, direction, strict=True)):
        u, w = b - a, a - o
        uu, ud, uw, wd = (u * u).sum(1), u @ d, (u * w).sum(1), w @ d
        for_t = np.clip((ud * wd - uw) / np.maximum(uu - ud**2, 1e-20), 0, 1)
        s = np.maximum(for_t * ud + wd, 0)
        t = np.clip((s * ud - uw) / np.maximum(uu, 1e-20), 0, 1)
        s = np.maximum(t * ud + wd, 0)
        total[k] = (np.linalg.norm(w + u * t[:, None] - s[:, None] * d, axis=1) < r).sum()
    return total


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_parallel_strands_are_counted_exactly_on_the_mean(axis: int) -> None:
    count, radius = 4000, 0.001
    grid = DensityGrid.build(straight(count, axis), 16)
    across, other = np.eye(3)[(axis + 1) % 3], np.eye(3)[axis]
    rng = np.random.default_rng(0)
    origin = rng.random((20000, 3))
    origin[:, (axis + 1) % 3] = -1
    # A ray across the unit cube meets as many strands as cross its shadow's width 2 r: count · 2 r.
    assert grid.strands(origin, across).mean() == pytest.approx(count * 2 * radius, rel=0.01)
    assert float(grid.strands(origin[:100] * 0 + 0.5, other).max()) <= 1e-3  # along the strands there is nothing to cross
    # At an angle the strands' shadow is narrower by its sine. Some 1,500 strands are in reach: four errors are 10 %.
    for degrees in (90, 45, 20):
        slanted = math.sin(math.radians(degrees)) * across + math.cos(math.radians(degrees)) * other
        inside = grid.strands(0.3 + 0.4 * rng.random((20000, 3)), slanted, 0.2)
        assert inside.mean() == pytest.approx(count * 2 * radius * 0.2 * math.sin(math.radians(degrees)), rel=0.1)


@pytest.mark.parametrize(
    "make", [lambda: hair_ball(2000, points=6).with_thickness(0.01), lambda: wavy_lock(400, points=16).with_thickness(0.004)]
)
def test_the_mean_is_that_of_counted_strands(make: Callable[[], Groom]) -> None:
    groom = make()
    grid = DensityGrid.build(groom, 48)
    rng = np.random.default_rng(1)
    low, high = groom.bounds
    origin = low + rng.random((600, 3)) * (high - low)
    direction = rng.standard_normal((600, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    exact, found = counted(groom, origin, direction), grid.strands(origin, direction)
    # Counts scatter like a Poisson variable about the grid's expectation: four errors of the mean, and 10 % for joints.
    assert abs(exact.mean() - found.mean()) <= 4 * np.sqrt(exact.mean() / 600) + 0.1 * exact.mean()
    assert np.corrcoef(exact, found)[0, 1] >= 0.75


@pytest.mark.parametrize(
    ("tensor", "counted_share", "too_high"),
    [
        ((1, 0, 0), 0.0, None),  # all along the ray
        ((0, 1, 0), 1.0, 0.0),  # all across it
        ((1 / 3, 1 / 3, 1 / 3), math.pi / 4, 0.04),  # everywhere alike: the mean of |sin|
        ((0.5, 0.5, 0), 0.5, 0.41),  # half along, half across
    ],
)
def test_the_rate_is_as_high_as_the_header_says(
    tensor: tuple[float, ...], counted_share: float, too_high: float | None
) -> None:
    cells = np.array([*tensor, 0, 0, 0], np.float32).reshape(1, 1, 1, 6)
    grid = DensityGrid(cells, np.zeros(3, np.float32), np.ones(3, np.float32))
    found = float(grid.strands([-1, 0.5, 0.5], [1, 0, 0]))
    if too_high is None:
        assert found <= 1e-6
    else:
        assert found / counted_share - 1 == pytest.approx(too_high, abs=0.005)  # two digits are told


def test_counts_add_up_along_a_ray() -> None:
    groom = wavy_lock(500)
    grid = DensityGrid.build(groom)
    rng = np.random.default_rng(2)
    origin = np.array([0, -0.5, 0]) + 0.3 * rng.standard_normal((2000, 3))
    direction = rng.standard_normal((2000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    middle = rng.random(2000)
    first = grid.strands(origin, direction, middle)
    rest = grid.strands(origin + middle[:, None] * direction, direction)
    whole = grid.strands(origin, direction)
    np.testing.assert_allclose(first + rest, whole, rtol=2e-3, atol=2e-3 * whole.max())  # single precision at cell borders
    # And the same both ways.
    far = origin + 10 * direction
    np.testing.assert_allclose(grid.strands(far, -direction, 10), whole, rtol=2e-3, atol=2e-3 * whole.max())
    assert (first >= 0).all()


def test_rays_that_miss_and_rays_along_faces() -> None:
    grid = DensityGrid.build(hair_ball(100), 8)
    for origin, direction in (
        ([10, 0, 0], [1, 0, 0]),
        ([0, 10, 0], [1, 0, 0]),
        ([10, 10, 10], [0, 0, 1]),
    ):
        assert float(grid.strands(origin, direction)) == 0
    assert float(grid.strands([0, 0, 0], [1, 0, 0], 0)) == 0
    lower, cell = grid.lower.astype(float), grid.cell.astype(float)
    for axis in range(3):  # through corners and along the borders of cells: finite, and no endless walk
        d = np.eye(3)[axis]
        for k in range(9):
            n = grid.strands(lower + k * cell - 5 * d, d)
            assert np.isfinite(n)
            assert n >= 0
    assert np.isfinite(grid.strands(lower - 1, np.full(3, 3**-0.5)))


def test_the_grid_is_quick_and_holds_all_hair(data: Path) -> None:
    groom = read_groom(data / "hair" / "tressfx" / "bear.tfx")
    grid = DensityGrid.build(groom)
    volume = float(np.prod(grid.cell))
    shadow = float(grid.cells[..., :3].sum(axis=-1, dtype=float).sum()) * volume
    steps = np.linalg.norm(np.diff(groom.points.astype(float), axis=0), axis=1)
    steps[groom.offsets[1:-1] - 1] = 0
    assert shadow == pytest.approx(float((2 * groom.radius[:-1] * steps).sum()), rel=1e-4)  # nothing lost at the walls
    assert max(grid.cells.shape[:3]) == 64
    assert "with hair" in repr(grid)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda g: DensityGrid.build(hair_ball(10), 0), "resolution must be in"),
        (lambda g: g.strands([0, 0], [1, 0, 0]), r"origin must have shape \(..., 3\), got \(2,\)"),
        (lambda g: g.strands([0, 0, math.nan], [1, 0, 0]), "origin must be finite"),
        (lambda g: g.strands([0, 0, 0], [1, 1, 0]), "direction must be unit vectors, got one of length 1.414"),
        (lambda g: g.strands([0, 0, 0], [1, 0, 0], -1), "distance must be at least 0, got -1"),
        (lambda g: g.strands(np.zeros((2, 3)), np.tile([1.0, 0, 0], (3, 1))), "broadcast"),
    ],
)
def test_bad_input_is_told(call: Callable[[DensityGrid], Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call(DensityGrid.build(hair_ball(10), 4))
