"""Grooms: splines pass through the points, saving and reading gives the same groom, what has no direction is left out."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import interpolate

from command import run_program
from cuticle.grooms import splines
from cuticle.grooms.bust import Bust
from cuticle.grooms.density_grid import DensityGrid
from cuticle.grooms.groom import Groom, join_grooms, read_groom
from cuticle.grooms.procedural import hair_ball, hair_head, head_bust, wavy_lock
from cuticle.grooms.variation import vary

COUNTS = (2, 5, 3, 4)


def curve(control: np.ndarray, t: float) -> np.ndarray:
    """The B-spline's point at knot i + t from its four control points."""
    w = np.array([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6
    return w @ control


def test_splines_pass_through_the_points(groom: Groom) -> None:
    control, offsets = groom.control_points()
    for k in range(groom.strands):
        own = control[offsets[k] : offsets[k + 1]]
        points = groom.points[groom.offsets[k] : groom.offsets[k + 1]]
        assert len(own) == len(points) + 2
        for i in range(len(points) - 1):
            np.testing.assert_allclose(curve(own[i : i + 4], 0.0)[:3], points[i], atol=1e-6)  # single precision in
            np.testing.assert_allclose(curve(own[i : i + 4], 1.0)[:3], points[i + 1], atol=1e-6)
    assert (control[:, 3] >= 0).all()


def test_a_straight_strand_stays_straight_with_its_taper(tmp_path: Path) -> None:
    line = Groom(np.outer(np.arange(5), [0, 1, 0]).astype(np.float32), np.array([0, 5]), np.zeros(1, np.float32))
    line = line.with_thickness(0.2, 0.0)
    line.save(tmp_path / "line.txt")
    strand, guard = (tmp_path / "line.txt").read_text().split("\n\n")
    rows = [list(map(float, r.split())) for r in strand.splitlines()]
    np.testing.assert_allclose([r[1] for r in rows], np.arange(-1, 6), atol=1e-6)
    np.testing.assert_allclose([r[3] for r in rows], [0.25, 0.2, 0.15, 0.1, 0.05, 0, 0], atol=1e-6)
    # Mitsuba reads past its memory at the tip of the last curve: no ray meets that one, and reading drops it.
    assert [float(r.split()[3]) for r in guard.splitlines()] == [0] * 4
    assert read_groom(tmp_path / "line.txt").strands == 1


def test_saving_and_reading_gives_the_same_groom(groom: Groom, tmp_path: Path) -> None:
    first = back = groom
    for _ in range(3):
        back.save(tmp_path / "g.txt")
        back = read_groom(tmp_path / "g.txt")
        assert back.counts.tolist() == list(COUNTS)
        np.testing.assert_allclose(back.points, first.points, atol=1e-6)  # single precision, of coordinates about 1
        np.testing.assert_allclose(back.control_points()[0], first.control_points()[0], atol=2e-6)


def test_mitsuba_text_is_its_own_curves(tmp_path: Path, use_variant: Callable[[str], Any]) -> None:
    rng = np.random.default_rng(4)
    control = [np.column_stack([rng.normal(size=(n, 3)), rng.uniform(0.1, 0.2, n)]) for n in (4, 5, 9)]
    path = tmp_path / "g.txt"
    path.write_text("\n\n".join("\n".join(" ".join(map(repr, map(float, r))) for r in c) for c in control))
    found = read_groom(path)
    assert found.counts.tolist() == [2, 3, 7]
    np.testing.assert_allclose(found.points[0], curve(control[0], 0.0)[:3], atol=1e-6)
    np.testing.assert_allclose(found.points[1], curve(control[0], 1.0)[:3], atol=1e-6)
    found.save(tmp_path / "saved.txt")
    mi = use_variant("scalar_rgb")
    sizes = [
        mi.load_dict({"type": "bsplinecurve", "filename": str(p), "to_world": mi.ScalarTransform4f()}).bbox()
        for p in (path, tmp_path / "saved.txt")
    ]
    np.testing.assert_allclose(sizes[1].min, sizes[0].min, atol=1e-5)
    np.testing.assert_allclose(sizes[1].max, sizes[0].max, atol=1e-5)
    np.testing.assert_allclose(found.control_points()[0], np.concatenate(control), atol=1e-5)


@pytest.mark.parametrize("basis", ["bezier", "catmullRom"])
@pytest.mark.parametrize("wrap", splines.WRAPS)
def test_curves_of_other_bases_keep_their_shape(basis: str, wrap: str) -> None:
    # SciPy knows piecewise polynomials of its own: it draws the curve that was given.
    v = np.array([[0, 0, 0], [0, 1, 0.2], [0.3, 2, 0], [0.2, 3, -0.3], [0, 4, 0], [-0.2, 5, 0.4], [0, 6, 0]])
    v = v[:6] if wrap == "periodic" else v
    points, counts, bend = splines.to_splines(v, np.array([len(v)]), "cubic", basis, wrap)
    own, _ = splines.to_control(points, np.array([0, counts[0]]), bend)
    closed = {"nonperiodic": v, "pinned": v, "periodic": np.concatenate([v, v[:1]])}[wrap]
    longest = np.linalg.norm(np.diff(closed, axis=0), axis=1).max() * (3 if basis == "bezier" else 1)
    if basis == "bezier":
        true = [interpolate.BPoly(closed[k : k + 4, None], [0, 1]) for k in range(0, len(closed) - 3, 3)]
    else:
        ends = {
            "nonperiodic": v,
            "pinned": np.concatenate([[2 * v[0] - v[1]], v, [2 * v[-1] - v[-2]]]),
            "periodic": np.concatenate([v[-1:], v, v[:2]]),
        }[wrap]
        slope = (ends[2:] - ends[:-2]) / 2
        true = [interpolate.CubicHermiteSpline([0, 1], ends[k + 1 : k + 3], slope[k : k + 2]) for k in range(len(ends) - 3)]
    assert counts.tolist() == [splines.PIECES * len(true) + 1]
    for k, segment in enumerate(true):
        for t in np.linspace(0, 1, 9):
            i, u = divmod(min(t, 1 - 1e-12) * splines.PIECES, 1)
            at = k * splines.PIECES + int(i)
            error = np.abs(curve(own[at : at + 4], u) - segment(t)).max()
            # of the longest segment, in 4 pieces: where the curvature jumps .3 %, at a corner 3 %
            assert error <= (0.03 if basis == "bezier" else 3e-3) * longest


def test_lengths_and_thickness(groom: Groom) -> None:
    for k, length in enumerate(groom.lengths):
        p = groom.points[groom.offsets[k] : groom.offsets[k + 1]].astype(float)
        assert length == pytest.approx(float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()), rel=1e-6)
    tapered = groom.with_thickness(0.3, 0.1)
    np.testing.assert_allclose(tapered.radius[groom.offsets[:-1]], 0.3, rtol=1e-6)
    np.testing.assert_allclose(tapered.radius[groom.offsets[1:] - 1], 0.1, rtol=1e-6)
    assert set(groom.with_thickness(0.5).radius.tolist()) == {0.5}


def test_followers_stay_beside_their_strand() -> None:
    ball = hair_ball(200, points=5)
    many = ball.with_followers(20, 0.01, tip_spread=0.05)
    assert many.strands == 21 * 200
    np.testing.assert_array_equal(many.points[: len(ball.points)], ball.points)
    apart = (many.points.reshape(21, 200, 5, 3)[1:] - ball.points.reshape(200, 5, 3)).std(axis=(0, 1, 3))
    np.testing.assert_allclose(apart, np.linspace(0.01, 0.05, 5), rtol=0.05)  # 12,000 values: 3 errors are 2 %
    np.testing.assert_array_equal(many.with_followers(0, 1).points, many.points)


@pytest.mark.parametrize("make", [hair_ball, wavy_lock])
def test_procedural_grooms_need_no_file(make: Callable[..., Groom]) -> None:
    g = make(500, points=10)
    assert (g.strands, set(g.counts.tolist())) == (500, {10})
    assert (g.radius > 0).all()
    np.testing.assert_array_equal(make(500, points=10).points, g.points)  # the same every time
    assert not np.array_equal(make(500, points=10, seed=2).points, g.points)
    assert "500 strands" in repr(g)
    np.testing.assert_allclose(
        make(100, length=2.0, **({"curl": 0.0} if make is hair_ball else {"width": 1e-3})).lengths, 2.0, rtol=0.02
    )


def test_a_head_of_hair_falls_about_its_bust() -> None:
    g = hair_head(2000)
    np.testing.assert_array_equal(hair_head(2000).points, g.points)
    assert g.strands == 2000
    skull = np.array([0.78, 1.0, 0.92])
    roots = g.points[g.offsets[:-1]]
    grown = np.linalg.norm(roots / skull, axis=1)
    assert grown.max() <= 1 + 1e-5
    assert grown.min() >= 0.98  # triangles between guides sag
    assert not ((roots[:, 2] < -0.6) & (roots[:, 1] < 0.3)).any()  # no hair in the face
    outside = head_bust().distance(g.points.astype(np.float64))[g.along() > 0.2]
    assert np.quantile(outside, 0.01) >= 0  # it rests on head, neck and shoulders
    tips = g.points[g.offsets[1:] - 1]
    above = tips[:, 1] - (1 - 2.6 - 0.12 * tips[:, 2])  # one hemline
    assert np.quantile(above, 0.95) <= 0.3  # strands are cut by up to 8 % of their length, .2
    assert np.quantile(above, 0.05) >= -0.1
    assert hair_head(500, length=1.0).bounds[0][1] > -1.2
    assert (hair_head(300, waves=0, frizz=0).lengths > 0.1).all()


@pytest.mark.parametrize("facing", [1, -1])
def test_a_bust_is_an_ellipsoid_above_and_a_closed_surface(facing: int) -> None:
    """The skull's surface is known; below, the mesh lies where the distance is 0, and its triangles look outward."""
    radii = np.array([0.8, 1.0, 0.9])
    bust = Bust(np.array([1.0, 2.0, 3.0]), radii, facing=facing)
    vertices, normals, triangles = bust.mesh(60, 48)
    assert np.abs(bust.distance(vertices)).max() <= 1e-6
    above = vertices[:, 1] > 2.5
    np.testing.assert_allclose(np.linalg.norm((vertices[above] - bust.centre) / radii, axis=1), 1, atol=1e-6)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    seen = np.linalg.norm(across, axis=1) > 1e-9
    assert ((across * normals[triangles[:, 0]]).sum(axis=1)[seen] > 0).all()
    face = vertices[np.abs(vertices[:, 1] - 1.4) < 0.05]  # the jaw is before the neck
    assert np.sign(np.abs(face[:, 2] - 3 - 0.3).max() - np.abs(face[:, 2] - 3 + 0.3).max()) == -facing
    lifted = bust.kept_out(np.array([[1.0, 2.9, 3.0], [1.0, 4.0, 3.0]]), 0.1)
    np.testing.assert_allclose(bust.distance(lifted[0]), 0.1, atol=2e-3)
    assert lifted[1].tolist() == [1, 4, 3]  # what is outside stays


def test_a_fitted_bust_passes_through_the_roots(data: Path) -> None:
    groom = read_groom(data / "hair" / "sintel" / "sintel.tfx")
    away = np.abs(Bust.fitted(groom).distance(groom.points[groom.offsets[:-1]].astype(np.float64)))
    assert (np.quantile(away, [0.5, 0.99]) <= [4e-4, 2e-3]).all()  # metres; the head is .17 wide
    with pytest.raises(ValueError, match="roots about a head"):
        Bust.fitted(wavy_lock(50, waves=0))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda g: Groom(g.points[:, :2], g.offsets, g.radius), r"points must have shape \(N, 3\), got \(14, 2\)"),
        (lambda g: Groom(g.points, g.offsets[:-1], g.radius), "offsets must run from 0 to the 14 points"),
        (lambda g: Groom(g.points, np.array([0, 1, 14]), g.radius), "strand 0 has 1"),
        (lambda g: Groom(g.points * np.nan, g.offsets, g.radius), "point 0 is"),
        (lambda g: Groom(g.points * 0, g.offsets, g.radius), "no strand has 2 points that differ"),
        (lambda g: Groom(g.points * 1e20, g.offsets, g.radius), r"within ±1e\+09, point 0 is \[.*e\+19.*; scale the groom"),
        (lambda g: Groom(g.points, g.offsets, g.radius * 1e20), r"at most 1e\+09; point 0 has .*e\+18"),
        (lambda g: Groom(g.points, g.offsets, -g.radius), "radius must be finite and at least 0"),
        (lambda g: g.with_thickness(-1), "root must be in"),
        (lambda g: g.with_followers(-1, 1), "count must be in"),
        (lambda g: g.with_followers(1, float("nan")), "spread must be in"),
        (lambda g: hair_ball(0), "strands must be in"),
        (lambda g: hair_ball(10, points=1), "points must be in"),
        (lambda g: wavy_lock(10, length=0), "length must be in"),
        (lambda g: hair_head(10, points=4), "points must be in"),
        (lambda g: hair_head(10, frizz=-1), "frizz must be in"),
        (lambda g: join_grooms([]), "at least one groom"),
        (
            lambda g: Groom(g.points, g.offsets, [0.1, 0.2]),
            r"radius must have shape \(.*one value a point, or be one number",
        ),
        (lambda g: Groom(g.points, g.offsets, np.ones((len(g.points), 1))), "radius must have shape"),
        (lambda g: Groom(g.points, g.offsets, 1e39), "radius must be finite"),
        (lambda g: Groom(g.points * np.float64(1e39), g.offsets, 1), "points must be finite"),
        (lambda g: Groom(g.points, g.offsets, 1, g.bend + np.float64(1e39)), "bend must be finite numbers within"),
        (lambda g: Groom(g.points, g.offsets, 1, g.bend[1:]), "bend must have shape"),
        (lambda g: read_groom("x.hair", radius=0), "radius must be in"),
    ],
)
def test_bad_input_is_told(groom: Groom, call: Callable[[Groom], Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call(groom)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (vary, "groom must be a cuticle.grooms.groom.Groom, got ndarray; read_groom reads one"),
        (DensityGrid.build, "groom must be .*got ndarray"),
        (Bust.fitted, "groom must be .*got ndarray"),
        (lambda points: join_grooms([hair_ball(10), points]), r"grooms\[1\] must be .*got ndarray"),
        (lambda points: DensityGrid.build(hair_ball(10)).strands("a", [0, 0, 1]), "origin must be an array of numbers"),
    ],
)
def test_what_is_no_groom_is_told(call: Callable[[Any], Any], words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        call(np.zeros((4, 3)))


# Strands: one point; four points without length; a root and a tip given twice, steps that single precision loses; whole.
DEGENERATE = [
    [[0, 0, 0]],
    [[1, 1, 1]] * 4,
    [[0, 0, 0], [0, 0, 0], [0, 1, 0], [3000, 1, 0], [3000, 1, 1e-4], [3000, 1, 1e-4]],
    [[0, 0, 0], [0, 1e-30, 0], [0, 1e-30, 0]],
    [[0, 0, 0], [0, 2, 0], [0, 1, 0], [0, 2, 0]],
]


@pytest.mark.parametrize("source", ["file", "array"])
def test_repeated_points_and_strands_of_no_length_are_left_out(tmp_path: Path, source: str) -> None:
    strands = [np.array(s, np.float32) for s in (DEGENERATE if source == "file" else DEGENERATE[1:])]
    points, counts = np.concatenate(strands), [len(s) for s in strands]
    lost = len(strands) - 2
    parts = [struct.pack("<i", len(s)) + s.astype("<f4").tobytes() for s in strands]
    (tmp_path / "a.data").write_bytes(struct.pack("<i", len(strands)) + b"".join(parts))
    offsets, radius = np.cumsum([0, *counts]), np.arange(len(points))
    with pytest.warns(UserWarning, match=rf"left out 3 repeated points and {lost} strands of no length$") as told:
        found = read_groom(tmp_path / "a.data") if source == "file" else Groom(points, offsets, radius)
    assert len(told) == 1
    assert found.counts.tolist() == [3, 4]
    np.testing.assert_array_equal(found.points, [[0, 0, 0], [0, 1, 0], [3000, 1, 0], *DEGENERATE[-1]])
    if source == "array":  # the radius stays with its point
        assert found.radius.tolist() == [4, 6, 7, 13, 14, 15, 16]
    assert (np.linalg.norm(np.diff(found.points, axis=0), axis=1) > 0).all()


def test_a_groom_with_a_strand_of_no_length_renders(data: Path, tmp_path: Path) -> None:
    options = (
        "--fibre",
        "document",
        "--sampling",
        "uniform",
        "--integrator",
        "path",
        "--spp",
        "4",
        "--width",
        "48",
        "-o",
        "a.exr",
    )
    done = run_program("render", str(data / "field" / "zero.hair"), *options, cwd=tmp_path)
    assert done.returncode == 0, done
    assert done.stderr.splitlines() == [f"cuticle: {data / 'field' / 'zero.hair'}: left out 1 strand of no length"]
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("scalar_rgb")
    picture = np.array(mi.Bitmap(str(tmp_path / "a.exr")))
    assert np.isfinite(picture).all()
    assert picture[..., :3].max() > 0
