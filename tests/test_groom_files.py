"""Grooms: every format reads what was written, a lying file is refused with a reason and none does more."""

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

import cuticle
from command import run
from cuticle.grooms import readers
from cuticle.grooms.groom import Groom, join_grooms, read_groom
from cuticle.scattering.table_files import read_rows

COUNTS = (2, 5, 3, 4)


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
    if thickness:  # whatever the file's own are
        radii = groom.radius.copy()
        radii[:2] = 0
        for own in (0 * radii, -radii, radii):
            bad = Groom(groom.points, groom.offsets, groom.radius)
            object.__setattr__(bad, "radius", own.astype(np.float32))
            (tmp_path / "c.hair").write_bytes(cyhair(bad))
            assert len(read_groom(tmp_path / "c.hair", radius=0.5).counts) == len(groom.counts)


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


MONO = struct.pack("<IIHH12f", 2, 4, 2, 2, *range(12))
PLY_POINTS = "element vertex {n}\nproperty float x\nproperty float y\nproperty float z\nproperty double width\n"
PLY_LISTS = "element strand 2\nproperty uchar id\nproperty list uchar int vertex_indices\n"
PLY_EDGES = "element edge 3\nproperty int vertex1\nproperty int vertex2\n"


def ply(order: str, kind: str) -> bytes:
    """Two strands over five points, out of order in the file: 3 1 0 and 4 2; or as they come where vertices name them."""
    sign = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[order]
    text = f"ply\nformat {order} 1.0\ncomment strands\n" + PLY_POINTS.format(n=5)
    text += {"lists": PLY_LISTS, "edges": PLY_EDGES, "runs": "property int strand\n"}[kind] + "end_header\n"
    rows = [[k, k * k, -k, 0.1 * (k + 1)] for k in range(5)]
    strands = {"lists": [(7, 3, 3, 1, 0), (8, 2, 4, 2)], "edges": [(1, 0), (4, 2), (3, 1)], "runs": []}[kind]
    if kind == "runs":
        rows = [[*r, k > 2] for k, r in enumerate(rows)]
    if not sign:
        return (text + "\n".join(" ".join(f"{float(x):g}" for x in r) for r in [*rows, *strands])).encode()
    body = b"".join(struct.pack(f"{sign}fffd{'i' * (kind == 'runs')}", *r) for r in rows)
    form = {"lists": "BB{n}i", "edges": "{m}i", "runs": ""}[kind]
    return text.encode() + body + b"".join(struct.pack(sign + form.format(n=len(s) - 2, m=len(s)), *s) for s in strands)


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("kind", ["lists", "edges", "runs"])
def test_ply_is_read(tmp_path: Path, order: str, kind: str) -> None:
    (tmp_path / "a.ply").write_bytes(ply(order, kind))
    found = read_groom(tmp_path / "a.ply")
    which = np.array([0, 1, 2, 3, 4] if kind == "runs" else [3, 1, 0, 4, 2])
    assert found.counts.tolist() == [3, 2]
    np.testing.assert_array_equal(found.points, np.stack([which, which**2, -which], axis=1))
    np.testing.assert_allclose(found.radius, 0.05 * (which + 1), rtol=1e-6)


def test_monohair_is_read(data: Path, tmp_path: Path) -> None:
    found = read_groom(data / "field" / "mono.hair")
    assert found.points.tolist() == [[0, 0, 0], [0, 1, 0], [0, 2, 0]]
    (tmp_path / "a.hair").write_bytes(MONO)
    found = read_groom(tmp_path / "a.hair")
    assert found.counts.tolist() == [2, 2]
    np.testing.assert_array_equal(found.points.ravel(), np.arange(12))


@pytest.mark.parametrize("layout", ["dense", "counts", "offsets"])
@pytest.mark.parametrize("radius", [None, "point", "strand", "one"])
def test_npz_is_read(tmp_path: Path, layout: str, radius: str | None) -> None:
    points = np.arange(18.0).reshape(2, 3, 3)
    arrays: dict[str, Any] = {
        "dense": {"points": points},
        "counts": {"points": points.reshape(-1, 3), "counts": np.array([4, 2])},
        "offsets": {"points": points.reshape(-1, 3), "offsets": np.array([0, 4, 6])},
    }[layout]
    counts = [3, 3] if layout == "dense" else [4, 2]
    given = {None: None, "point": np.linspace(1, 2, 6), "strand": np.array([1.0, 2.0]), "one": np.array(3.0)}[radius]
    np.savez(tmp_path / "a.npz", **arrays, **({} if given is None else {"radius": given}))
    found = read_groom(tmp_path / "a.npz")
    assert found.counts.tolist() == counts
    np.testing.assert_array_equal(found.points, points.reshape(-1, 3))
    expected = {None: np.linalg.norm([15] * 3) / 4000, "strand": np.repeat([1, 2], counts)}.get(radius, given)
    np.testing.assert_allclose(found.radius, expected, rtol=1e-6)


def test_text_may_begin_with_a_byte_order_mark(data: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("[fibre]\neta = 1.6\nsigma_a = 0.2\n", encoding="utf-8-sig")
    assert cuticle.Fibre.load(tmp_path / "a.toml").eta == 1.6
    (tmp_path / "a.csv").write_text("f,phi\n1,2\n", encoding="utf-8-sig")
    assert read_rows(tmp_path / "a.csv", "table")[0] == ["f", "phi"]
    assert read_groom(data / "field" / "bom.txt").points.tolist() == [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]


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
        ("a.hair", lambda g: b"HAIL" + cyhair(g)[4:], "neither a cyHair file, .* nor MonoHair's"),
        ("a.hair", lambda g: MONO[:8] + b"\x03" + MONO[9:], "its strands have 5 points, it says 4"),
        ("a.ply", lambda g: b"plx\n", "not a PLY file: bytes 0 to 3 are b'plx'"),
        ("a.ply", lambda g: b"ply\nformat ascii 1.0\n", "no end_header"),
        (
            "a.ply",
            lambda g: ply("ascii", "lists").replace(b"double", b"triple"),
            "line 8 of its header is none that PLY has",
        ),
        ("a.ply", lambda g: ply("ascii", "lists").replace(b"vertex 5", b"vertex 4000000000"), "need 16000000000 numbers"),
        (
            "a.ply",
            lambda g: ply("binary_little_endian", "edges").replace(b"vertex 5", b"vertex 4000000000"),
            "4000000000 of vertex need 80000000000 bytes",
        ),
        ("a.ply", lambda g: ply("ascii", "lists").replace(b"3 3 1 0", b"3 3 1 9"), "names vertex 9, the file has 5"),
        ("a.ply", lambda g: ply("ascii", "edges").replace(b"4 2\n3 1", b"4 2\n3 2"), "more than one edge ends at vertex 2"),
        ("a.ply", lambda g: ply("ascii", "edges").replace(b"1 0\n4 2", b"1 3\n4 2"), "form a ring"),
        ("a.ply", lambda g: ply("ascii", "runs").replace(b"strand\n", b"other\n"), "it has no strands"),
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


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"radius": [1.0]}, "must hold points"),
        ({"points": [[0.0, 0, 0]]}, r"points of shape \(1, 3\) need counts or offsets"),
        ({"points": np.zeros((2, 4, 2))}, r"got \(2, 4, 2\)"),
        ({"points": np.zeros((4, 3)), "counts": [2, 3]}, "the 4 points that it holds, they have 5"),
        ({"points": np.zeros((4, 3)), "counts": [5, -1]}, "the 4 points that it holds, they have 4, 5 for one strand"),
        # sums and differences that wrap round to 4 in 64 bits
        ({"points": np.zeros((4, 3)), "counts": [2**62] * 4 + [4]}, "they have 18446744073709551620"),
        ({"points": np.zeros((4, 3)), "offsets": [0, 2**62, -(2**63), -(2**62), 4]}, "4611686018427387908 for one strand"),
        ({"points": np.zeros((4, 3)), "offsets": [3, 5, 7]}, "offsets must begin at 0, got"),
        ({"points": np.zeros((4, 3)), "counts": [2.5, 1.5]}, "counts must be whole numbers, got an array of float64"),
        ({"points": np.zeros((4, 3), complex), "counts": [4]}, "points must be numbers, got an array of complex128"),
        ({"points": np.zeros((4, 3)), "counts": [4], "name": np.array(["a", None])}, "array 'name' .*Object.*leave it out"),
        ({"points": np.arange(12.0).reshape(4, 3), "counts": [4], "radius": [1, 2]}, "radius must have 4 values"),
    ],
)
def test_a_wrong_npz_is_refused(arrays: dict[str, Any], words: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(ValueError, match=rf"cannot read groom .*a\.npz: .*{words}"):
        read_groom(tmp_path / "a.npz")


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
