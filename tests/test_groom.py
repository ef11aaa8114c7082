"""Grooms: every format reads what was written, a lying file is refused with a reason, splines pass through the points."""

from __future__ import annotations

import importlib.util
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import interpolate

from command import run, run_program
from cuticle.grooms import readers, splines
from cuticle.grooms.groom import Groom, join_grooms, read_groom
from cuticle.grooms.procedural import hair_ball, hair_head, wavy_lock

COUNTS = (2, 5, 3, 4)


@pytest.fixture
def groom() -> Groom:
    rng = np.random.default_rng(2)
    n = sum(COUNTS)
    return Groom(
        rng.normal(size=(n, 3)).astype(np.float32), np.cumsum([0, *COUNTS]), rng.uniform(0.01, 0.02, n).astype(np.float32)
    )


def cyhair(g: Groom, *, segments: bool = True, thickness: bool = False, default: float = 0.0, **change: int) -> bytes:
    flags = 2 | (1 if segments else 0) | (4 if thickness else 0)
    head = {"strands": g.strands, "points": len(g.points), "flags": flags, "segments": int(g.counts[0]) - 1} | change
    data = struct.pack("<4sIIIIfffff88s", b"HAIR", *head.values(), default, 0, 1, 1, 1, b"")
    assert len(data) == 128
    if segments:
        data += (g.counts - 1).astype("<u2").tobytes()
    data += g.points.astype("<f4").tobytes()
    return data + ((2 * g.radius).astype("<f4").tobytes() if thickness else b"")


def usc(g: Groom) -> bytes:
    parts = [struct.pack("<i", g.strands)]
    for a, b in zip(g.offsets[:-1], g.offsets[1:], strict=True):
        parts += [struct.pack("<i", b - a), g.points[a:b].astype("<f4").tobytes()]
    return b"".join(parts)


def tressfx(g: Groom, version: float = 3.0, offset: int = 0) -> bytes:
    head = struct.pack("<fIII", version, g.strands, int(g.counts[0]), offset)
    if version < 4:
        return head.ljust(296, b"\0") + g.points.astype("<f4").tobytes()
    return head.ljust(offset, b"\0") + np.column_stack([g.points, g.radius]).astype("<f4").tobytes()


def even(groom: Groom) -> Groom:
    """The same points as strands of 7."""
    return Groom(groom.points, np.array([0, 7, 14]), groom.radius)


@pytest.mark.parametrize("thickness", [False, True])
def test_cyhair_is_read(groom: Groom, tmp_path: Path, thickness: bool) -> None:
    (tmp_path / "a.hair").write_bytes(cyhair(groom, thickness=thickness))
    found = read_groom(tmp_path / "a.hair")
    np.testing.assert_array_equal(found.points, groom.points)
    np.testing.assert_array_equal(found.offsets, groom.offsets)
    if thickness:
        np.testing.assert_allclose(found.radius, groom.radius, rtol=1e-6)
    else:  # 1/4000 of the box's diagonal
        low, high = groom.bounds
        np.testing.assert_allclose(found.radius, np.linalg.norm(high - low) / 4000, rtol=1e-6)
    (tmp_path / "b.hair").write_bytes(cyhair(even(groom), segments=False))
    assert read_groom(tmp_path / "b.hair", radius=0.5).counts.tolist() == [7, 7]


@pytest.mark.parametrize(
    ("size", "default", "radius"), [(9.0, 2.0, 1.0), (9.0, 0.25, 0.125), (9.0, 1.0, 0.5), (0.5, 1.0, None)]
)
def test_cyhair_thickness_of_the_header(tmp_path: Path, size: float, default: float, radius: float | None) -> None:
    line = Groom(np.array([[0, 0, 0], [0, size, 0]]), np.array([0, 2]), np.zeros(1))
    (tmp_path / "a.hair").write_bytes(cyhair(line, default=default))
    # a strand thicker than the groom is long is the 1 that cyHair's writer leaves: 1/4000 of the size, as without
    np.testing.assert_allclose(read_groom(tmp_path / "a.hair").radius, radius or size / 4000, rtol=1e-6)


def test_usc_is_read(groom: Groom, tmp_path: Path) -> None:
    (tmp_path / "a.data").write_bytes(usc(groom))
    np.testing.assert_array_equal(read_groom(tmp_path / "a.data").points, groom.points)


@pytest.mark.parametrize(("version", "offset"), [(3.0, 0), (4.0, 160), (4.1, 512)])
def test_tressfx_is_read(groom: Groom, tmp_path: Path, version: float, offset: int) -> None:
    (tmp_path / "a.tfx").write_bytes(tressfx(even(groom), version, offset))
    found = read_groom(tmp_path / "a.tfx", radius=0.1)
    np.testing.assert_array_equal(found.points, groom.points)
    assert found.counts.tolist() == [7, 7]
    assert set(found.radius.tolist()) == {np.float32(0.1)}


def test_text_is_read(groom: Groom, tmp_path: Path) -> None:
    rows = np.column_stack([groom.points, groom.radius])
    strands = [
        "\n".join(" ".join(map(repr, map(float, r))) for r in rows[a:b])
        for a, b in zip(groom.offsets, groom.offsets[1:], strict=False)
    ]
    (tmp_path / "a.txt").write_text("\n\n" + "\n\n\n".join(strands) + "\n\n")
    found = read_groom(tmp_path / "a.txt")
    np.testing.assert_array_equal(found.points, groom.points)
    np.testing.assert_array_equal(found.radius, groom.radius)
    assert found.counts.tolist() == list(COUNTS)


def test_alembic_says_what_it_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    (tmp_path / "a.abc").write_bytes(b"Ogawa\xff\x00\x01" + struct.pack("<QQ", 16, 0))
    with pytest.raises(ValueError, match=r"needs the package alembic3d.*cuticle\[alembic\]"):
        read_groom(tmp_path / "a.abc")


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
    options = ("--integrator", "path", "--spp", "4", "--width", "48", "-o", "a.exr")
    done = run_program("render", str(data / "field" / "zero.hair"), *options, cwd=tmp_path)
    assert done.returncode == 0, done
    assert done.stderr.splitlines() == [f"cuticle: {data / 'field' / 'zero.hair'}: left out 1 strand of no length"]
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("scalar_rgb")
    picture = np.array(mi.Bitmap(str(tmp_path / "a.exr")))
    assert np.isfinite(picture).all()
    assert picture[..., :3].max() > 0


# A file that is cut short or lies.


@pytest.mark.parametrize("make", [cyhair, usc, lambda g: tressfx(even(g)), lambda g: tressfx(even(g), 4.0, 160)])
def test_a_file_cut_anywhere_is_refused(groom: Groom, tmp_path: Path, make: Callable[[Groom], bytes]) -> None:
    data = make(groom)
    ending = {b"HAIR": "hair"}.get(data[:4], "tfx" if data[3:4] == b"\x40" else "data")
    path = tmp_path / f"a.{ending}"
    path.write_bytes(data)
    read_groom(path)
    for size in range(len(data)):
        path.write_bytes(data[:size])
        with pytest.raises(ValueError, match=r"a\.(hair|tfx|data)"):
            read_groom(path)


def test_help_messages_and_docs_know_every_reader(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    page = (Path(__file__).parents[1] / "docs/grooms.md").read_text(encoding="utf-8")
    said = run("render", "picture", "--help").stdout
    for ending in (e for reader in readers.READERS for e in reader.endings):
        assert f"`{ending}`" in page
        assert ending in said
    row = readers.Reader("Nothing", (".nothing",), lambda path: pytest.fail(f"{path} was read"))
    monkeypatch.setattr(readers, "READERS", [*readers.READERS, row])
    with pytest.raises(ValueError, match=r"one of \.hair, .*, \.nothing; got '\.xyz'"):
        read_groom(tmp_path / "a.xyz")


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.hair", lambda g: b"HAIL" + cyhair(g)[4:], "not a cyHair file: bytes 0 to 4 are b'HAIL'"),
        ("a.hair", lambda g: cyhair(g, strands=0), "holds 0 strands"),
        ("a.hair", lambda g: cyhair(g, strands=2**32 - 1), "cut short: the strands' segments needs bytes 128"),
        ("a.hair", lambda g: cyhair(g, points=2**32 - 1), "its header says 4294967295"),
        ("a.hair", lambda g: cyhair(g, flags=1), "it says it holds no points"),
        ("a.hair", lambda g: cyhair(even(g), segments=False, flags=2, strands=2**32 - 1), "are more than the file holds"),
        ("a.hair", lambda g: cyhair(g, default=float("nan")), "radius must be finite"),
        ("a.hair", lambda g: cyhair(g, default=-1.0), "radius must be finite and at least 0"),
        ("a.data", lambda g: struct.pack("<i", -3), "holds -3 strands"),
        ("a.data", lambda g: struct.pack("<i", 2**31 - 1) + usc(g), "it says it holds 2147483647 strands"),
        ("a.data", lambda g: struct.pack("<ii", 1, -5), "strand 0 says it has -5 points"),
        ("a.data", lambda g: struct.pack("<ii", 1, 2**31 - 1), "strand 0's points needs bytes 8"),
        ("a.data", lambda g: usc(g) + b"more", "4 bytes are left"),
        ("a.tfx", lambda g: struct.pack("<fIII", 2.0, 1, 4, 0), "TressFX version 2"),
        ("a.tfx", lambda g: struct.pack("<fIII", float("nan"), 1, 4, 0), "TressFX version nan"),
        ("a.tfx", lambda g: struct.pack("<fIII", 3.0, 2**32 - 1, 2**32 - 1, 0), "would need"),
        ("a.tfx", lambda g: struct.pack("<fIII", 4.0, 1, 4, 8), "inside the header"),
        ("a.txt", lambda g: b"1 2 3\n", "line 1 must be x y z radius, got '1 2 3'"),
        ("a.txt", lambda g: b"1 2 3 4\n1 2 x 4\n", "line 2 must be"),
        ("a.txt", lambda g: b"\n\n", "holds no strand"),
        ("a.txt", lambda g: b"\xff\xfe", "it is not text in UTF-8"),
        ("a.txt", lambda g: b"1 2 3 4\n", "no strand has 2 points"),
        ("a.txt", lambda g: b"1 2 nan 4\n1 2 3 4\n", "point 0 is"),
        ("a.txt", lambda g: b"0 0 0 1\n1e20 0 0 1\n", r"a\.txt: points must be finite numbers within ±1e\+09, point 1 is"),
        ("a.txt", lambda g: b"1 2 3 -4\n1 2 4 4\n", "radius must be finite and at least 0"),
        ("a.abc", lambda g: b"", "is not an Alembic archive: bytes 0 to 5 are b''"),
        ("a.abc", lambda g: b"\x89HDF\r\n\x1a\n" + bytes(16), "in HDF5"),
        ("a.abc", lambda g: b"Ogawa\xff\x00\x01", "its header needs bytes 0 to 16, the file has 8"),
        ("a.abc", lambda g: b"Ogawa\x00\x00\x01" + bytes(8), "was not closed by the program that wrote it"),
        (
            "a.abc",
            lambda g: b"Ogawa\xff\x00\x01" + struct.pack("<Q", 2**63),
            "its root group lies at byte 9223372036854775808",
        ),
        ("a", lambda g: b"", "got 'none'"),
    ],
)
def test_a_lying_file_is_refused(
    groom: Groom, tmp_path: Path, name: str, data: Callable[[Groom], bytes], words: str
) -> None:
    (tmp_path / name).write_bytes(data(groom))
    with pytest.raises(ValueError, match=words):
        read_groom(tmp_path / name)


@given(
    ending=st.sampled_from(["hair", "data", "tfx", "txt"]),
    start=st.sampled_from([b"", b"HAIR", struct.pack("<f", 3), struct.pack("<f", 4), struct.pack("<i", 1)]),
    data=st.binary(max_size=400),
)
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_bytes_do_more_than_raise(tmp_path: Path, ending: str, start: bytes, data: bytes) -> None:
    path = tmp_path / f"a.{ending}"
    path.write_bytes(start + data)
    try:
        found = read_groom(path)
    except ValueError as error:
        assert str(path) in str(error)  # noqa: PT017 - either is right
    else:
        assert np.isfinite(found.points).all()


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="cannot read groom .*: No such file"):
        read_groom(tmp_path / "none.hair")


# Real hair.


def test_one_groom_in_two_formats(data: Path) -> None:
    a, b = (read_groom(data / "hair" / "readers" / f"Bangs_100.{e}") for e in ("data", "hair"))
    assert a.strands == b.strands == 100
    np.testing.assert_array_equal(a.offsets, b.offsets)
    np.testing.assert_allclose(a.points, b.points, atol=1e-4)  # the writers' rounding, of 236 units


def test_real_grooms_are_read(data: Path) -> None:
    parts = [read_groom(p) for p in sorted((data / "hair" / "tressfx").glob("ponytail_*.tfx"))]
    ponytail = join_grooms(parts)
    assert ponytail.strands == 4933
    assert set(ponytail.counts.tolist()) == {16}
    bear = read_groom(data / "hair" / "tressfx" / "bear.tfx")
    assert (bear.strands, len(bear.points)) == (48113, 192452)
    np.testing.assert_allclose(bear.points[0], [-25.9121, 5.2923, -68.1037], atol=1e-4)


# What a groom can do.


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


def test_a_head_of_hair_falls_about_its_skull() -> None:
    g = hair_head(2000)
    np.testing.assert_array_equal(hair_head(2000).points, g.points)
    assert g.strands == 2000
    assert g.counts.min() >= 4
    skull = np.array([0.78, 1.0, 0.92])
    roots = g.points[g.offsets[:-1]]
    np.testing.assert_allclose(np.linalg.norm(roots / skull, axis=1), 1, atol=1e-5)
    assert not ((roots[:, 2] < -0.6) & (roots[:, 1] < 0.3)).any()  # no hair in the face
    outside = np.linalg.norm(g.points / skull, axis=1)
    assert np.quantile(outside[g.along() > 0.2], 0.01) > 0.97  # it rests on the skull
    tips = g.points[g.offsets[1:] - 1]
    assert np.quantile(tips[:, 1], 0.9) < -1.5  # long, down to one hemline
    assert tips[:, 1].std() < 0.45
    assert hair_head(500, length=1.0).bounds[0][1] > -1.2
    assert (hair_head(300, waves=0, frizz=0).lengths > 0.1).all()


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
        (lambda g: read_groom("x.hair", radius=0), "radius must be in"),
    ],
)
def test_bad_input_is_told(groom: Groom, call: Callable[[Groom], Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call(groom)
