"""Attributes: they stay with their strands and points through everything that makes a groom of another."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cuticle.grooms.groom import Groom, join_grooms
from cuticle.grooms.procedural import wavy_lock


@pytest.fixture
def named(groom: Groom) -> Groom:
    """Four strands: their numbers and colours, and at each point its height and its place."""
    return groom.with_attributes(
        number=np.arange(4),
        colour=np.arange(12).reshape(4, 3) / 12,
        height=groom.points[:, 1],
        place=groom.points,
    )


def in_place(groom: Groom) -> None:
    """What the points say of `height` and `place` is what these hold."""
    np.testing.assert_allclose(groom.attributes["height"], groom.points[:, 1], atol=1e-5)
    np.testing.assert_allclose(groom.attributes["place"], groom.points, atol=1e-5)


def test_attributes_are_held_in_single_precision_and_follow_the_groom(named: Groom) -> None:
    assert {n: v.shape for n, v in named.attributes.items()} == {
        "number": (4,), "colour": (4, 3), "height": (14,), "place": (14, 3),
    }  # fmt: skip
    assert all(v.dtype == np.float32 and not v.flags.writeable for v in named.attributes.values())
    with pytest.raises(TypeError):
        named.attributes["number"] = np.zeros(4)  # type: ignore[index]
    thick = named.with_thickness(0.5)
    assert thick.attributes == named.attributes
    assert thick.attributes["place"] is named.attributes["place"]  # no copy of what is read-only
    assert list(named.with_attributes(colour=None, alpha=2).attributes) == ["number", "height", "place", "alpha"]
    assert named.with_attributes(alpha=2).attributes["alpha"].tolist() == [2, 2, 2, 2]
    many = named.with_followers(2, 0.0)
    in_place(many)
    assert many.attributes["number"].tolist() == 3 * [0, 1, 2, 3]
    np.testing.assert_array_equal(many.attributes["colour"][4:8], named.attributes["colour"])
    assert named.with_attributes(**{"self": 1, "hair:tip": 2}).attributes["self"].tolist() == [1] * 4
    assert "number, colour, height, place)" in repr(named)


def test_a_groom_with_attributes_is_a_value(named: Groom) -> None:
    for same in (pickle.loads(pickle.dumps(named)), copy.copy(named), copy.deepcopy(named), replace(named)):
        assert same == named
        assert hash(same) == hash(named)
        assert not any(v.flags.writeable for v in same.attributes.values())
    assert named.with_attributes(number=np.arange(4) + 1) != named
    assert named.with_attributes(number=None) != named


def test_values_of_what_is_left_out_are_left_out() -> None:
    points = [[0, 0, 0], [0, 0, 0], [0, 1, 0], [5, 5, 5], [5, 5, 5], [1, 0, 0], [1, 2, 0]]
    with pytest.warns(UserWarning, match="left out 1 repeated point and 1 strand of no length"):
        found = Groom(points, [0, 3, 5, 7], 0.1, attributes={"a": [1, 2, 3], "b": np.arange(7)})
    assert found.attributes["a"].tolist() == [1, 3]
    assert found.attributes["b"].tolist() == [0, 2, 5, 6]


def test_interpolated_values_are_blended_as_points_are() -> None:
    """A linear function of position at the guides' points is that function at the points between, on straight guides."""
    roots = np.array([[x, 0, z] for x in (0, 1, 2) for z in (0, 1, 2)], float)
    points = roots[:, None] + np.array([[0, y, 0] for y in (0, 0.3, 0.6, 0.9)])
    guides = Groom(points.reshape(-1, 3), np.arange(10) * 4, 0.01).with_attributes(x=roots[:, 0], one=1, root=roots[:, ::2])
    guides = guides.with_attributes(place=guides.points, height=guides.points[:, 1])
    full = guides.interpolated(300, points=7, length_variation=0.5)
    in_place(full)
    at_root = full.points[full.offsets[:-1]]
    np.testing.assert_allclose(full.attributes["x"], at_root[:, 0], atol=1e-5)
    np.testing.assert_allclose(full.attributes["root"], at_root[:, ::2], atol=1e-5)
    np.testing.assert_allclose(full.attributes["one"], 1, rtol=1e-6)


def test_joined_grooms_keep_what_all_have(named: Groom) -> None:
    other = named.with_attributes(number=np.repeat(9, 14), colour=np.zeros(4), height=None)
    with pytest.warns(UserWarning, match="left out") as told:
        both = join_grooms([named, other])
    (warning,) = told
    assert str(warning.message) == (
        "join_grooms: left out attribute colour (its values have 1 or 3 channels), height (groom 1 does not have it);"
        " with_attributes gives it to all"
    )
    assert list(both.attributes) == ["number", "place"]
    assert both.attributes["number"].tolist() == [*np.repeat(np.arange(4), named.counts), *[9] * 14]
    np.testing.assert_array_equal(both.attributes["place"], both.points)
    assert join_grooms([named, named]).attributes["number"].tolist() == 2 * [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        (
            {"m": np.zeros(5)},
            ValueError,
            r"'m' must have shape \(4,\) or \(4, C\), one value a strand, or \(14,\) .* \(5,\)",
        ),
        ({"m": np.zeros((4, 3, 3))}, ValueError, r"got \(4, 3, 3\)"),
        ({"m": np.zeros((4, 33))}, ValueError, r"C from 1 to 32; got \(4, 33\)"),
        ({"m": np.zeros((4, 0))}, ValueError, r"got \(4, 0\)"),
        ({"m": [0, 1, 2, np.nan]}, ValueError, "'m' must be finite numbers in single precision, strand 3 has nan"),
        ({"m": np.append(np.zeros(13), 1e39)}, ValueError, "point 13 has inf"),
        ({"m": ["a"] * 4}, TypeError, "attribute 'm' must be an array of numbers, got list"),
        ({"m": np.zeros(4, complex)}, TypeError, "got an array of complex128"),
        ({"radius": np.zeros(4)}, ValueError, "cannot be called 'radius': points, counts, offsets, radius, bend are"),
        ({"": np.zeros(4)}, ValueError, "1 to 200 printable characters, got ''"),
        ({"a\nb": np.zeros(4)}, ValueError, r"printable characters, got 'a\\nb'"),
        ([1, 2], TypeError, "attributes must be a mapping from names to arrays, got list"),
    ],
)
def test_wrong_attributes_are_told(groom: Groom, given: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        replace(groom, attributes=given)


def test_values_on_segments(named: Groom) -> None:
    place = named.on_segments("place")
    assert place.shape == (11, 2, 3)  # 1 + 4 + 2 + 3 segments, and the strand that saving adds
    np.testing.assert_array_equal(place[1:5], np.stack([named.points[2:6], named.points[3:7]], axis=1))
    np.testing.assert_array_equal(place[10], [named.points[-1]] * 2)
    assert named.on_segments("number")[..., 0].tolist() == [[k, k] for k in (0, 1, 1, 1, 1, 2, 2, 3, 3, 3, 3)]
    with pytest.raises(ValueError, match="no attribute 'melanin'; it has number, colour, height, place"):
        named.on_segments("melanin")


def test_rows_of_segments_are_mitsubas(tmp_path: Path, use_variant: Callable[[str], Any]) -> None:
    """A hit's `prim_index` and v find the value of the strand and the place that SciPy's splines are nearest to."""
    mi = use_variant("scalar_rgb")
    rng = np.random.default_rng(3)
    counts = rng.integers(2, 7, 25)
    strand = np.repeat(np.arange(25), counts)
    knot = np.concatenate([np.arange(n) for n in counts])
    # Strands stand on a grid, wider apart than they are bent.
    points = np.stack([strand % 5, 0.4 * knot, strand // 5], axis=1) + rng.uniform(-0.12, 0.12, (len(strand), 3))
    groom = Groom(points, np.append(0, np.cumsum(counts)), 0.05)
    groom = groom.with_attributes(strand=np.arange(25), knot=knot)
    groom.save(tmp_path / "a.txt")
    shape = mi.load_dict({"type": "scene", "hair": {"type": "bsplinecurve", "filename": str(tmp_path / "a.txt")}})
    splines = [CubicSpline(np.arange(n), groom.points[a : a + n].astype(float), bc_type="natural")
               for a, n in zip(groom.offsets, counts, strict=False)]  # fmt: skip
    t = [np.linspace(0, n - 1, 400 * (n - 1) + 1) for n in counts]
    fine, of = np.concatenate([s(x) for s, x in zip(splines, t, strict=True)]), np.repeat(np.arange(25), [len(x) for x in t])
    t = np.concatenate(t)
    assert shape.shapes()[0].primitive_count() == len(groom.on_segments("knot"))
    rows = {name: groom.on_segments(name)[..., 0] for name in ("strand", "knot")}
    found = []
    for _ in range(2000):
        target = points[rng.integers(len(points))] + rng.normal(0, 0.1, 3)
        direction = rng.normal(size=3)
        hit = shape.ray_intersect(mi.Ray3f(list(target - 9 * direction), list(direction / np.linalg.norm(direction))))
        if hit.is_valid():
            nearest = np.argmin(((fine - np.array(hit.p)) ** 2).sum(axis=1))
            along = hit.uv[1] * len(rows["knot"]) - hit.prim_index
            begin, end = rows["knot"][hit.prim_index]
            found.append([of[nearest], rows["strand"][hit.prim_index, 0], t[nearest], begin + along * (end - begin)])
    hits = np.array(found)
    assert len(hits) >= 500
    assert len(np.unique(hits[:, 0])) == 25
    np.testing.assert_array_equal(hits[:, 1], hits[:, 0])
    away = np.abs(hits[:, 3] - hits[:, 2])
    assert np.quantile(away, 0.99) <= 0.01  # of a segment: four steps of the search
    assert away.max() <= 0.3  # at the ends Mitsuba's tube is cut off flat, and the nearest point is the end


def test_a_groom_without_attributes_holds_none() -> None:
    lock = wavy_lock(20)
    assert dict(lock.attributes) == {}
    assert join_grooms([lock, lock]).interpolated(5).attributes is lock.with_thickness(1).attributes
