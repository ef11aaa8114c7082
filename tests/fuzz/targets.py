"""What is fuzzed: a reader each, with small valid files to damage. A new reader is one more row in `targets`."""

from __future__ import annotations

import importlib.util
import io
import json
import os
import signal
import struct
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import cuticle
from cuticle.checking.sample_file import LEAST_ROWS
from cuticle.grooms.groom import Groom, read_groom

N = 4
POINTS = np.array([[k % 3, k, -k / 2] for k in range(2 * N)], np.float32)


class Target(NamedTuple):
    """A reader.

    Attributes
    ----------
    name
        Its file's name, whose ending selects the reader.
    seeds
        Valid files.
    read
        Takes the path; returns what it reads or raises ValueError with the path.
    check
        Raises AssertionError where what was read is not whole.
    pack
        Makes the file of the damaged bytes.
    share
        Of the inputs that other targets get: less where a read is slow.
    """

    name: str
    seeds: list[bytes]
    read: Callable[[Path], Any]
    check: Callable[[Any], None]
    pack: Callable[[bytes], bytes] = bytes
    share: float = 1.0


def groom_is_whole(groom: Groom) -> None:
    """Everything finite, counts that add up, every step of some length."""
    assert np.isfinite(groom.points).all()
    assert np.isfinite(groom.radius).all()
    assert (groom.radius >= 0).all()
    assert np.isfinite(groom.bend).all()
    assert len(groom.points) == groom.counts.sum() == len(groom.radius)
    assert (groom.counts >= 2).all()
    assert (groom.lengths > 0).all()
    assert np.isfinite(groom.control_points()[0]).all()


def f_is_whole(model: Any) -> None:
    """A model gives finite values."""
    f = model.eval(0.1, 0.2, 0.3)
    assert np.isfinite(f).all()
    assert (np.asarray(f) >= 0).all()


def pdf_is_whole(sampler: Any) -> None:
    """A sampler draws directions of a finite density above 0, for every strand count."""
    for n in sampler.covers:
        theta_i, phi, p = sampler.sample(0.2, [0.3, 0.4, 0.6], n)
        assert np.isfinite([theta_i, phi, p]).all()
        assert p > 0
        assert np.isfinite(sampler.pdf(0.1, 0.2, 0.3, n))


def _cyhair() -> list[bytes]:
    head = struct.pack("<4sIIIIf", b"HAIR", 2, 2 * N, 7, 0, 0.5).ljust(128, b"\0")
    segments = struct.pack("<HH", N - 1, N - 1)
    full = head + segments + POINTS.tobytes() + np.full(2 * N, 0.1, "<f4").tobytes()
    plain = struct.pack("<4sIIIIf", b"HAIR", 2, 2 * N, 2, N - 1, 0.5).ljust(128, b"\0") + POINTS.tobytes()
    return [full, plain, struct.pack("<IIHH", 2, 2 * N, N, N) + POINTS.tobytes()]


def _usc() -> bytes:
    strand = struct.pack("<i", N)
    return struct.pack("<i", 2) + strand + POINTS[:N].tobytes() + strand + POINTS[N:].tobytes()


def _tressfx() -> list[bytes]:
    padded = np.column_stack([POINTS, np.ones(2 * N, np.float32)])
    return [
        struct.pack("<fII", 3.0, 2, N).ljust(296, b"\0") + POINTS.tobytes(),
        struct.pack("<fIII", 4.0, 2, N, 160).ljust(160, b"\0") + padded.tobytes(),
    ]


def _text(rows: np.ndarray) -> bytes:
    return b"\n".join(b" ".join(b"%g" % x for x in r) for r in rows)


def _lines() -> list[bytes]:
    rows = np.column_stack([POINTS, np.full(2 * N, 0.1)])
    return [_text(rows[:N]) + b"\n\n" + _text(rows[N:]), _text(rows[:2]) + b"\n\n" + _text(rows[2:5])]


CHAINS = struct.pack(">6i", 0, 1, 1, 2, 3, 4)


def _ply() -> list[bytes]:
    head = b"element vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
    strands = b"element strand 2\nproperty list uchar int vertex_indices\nend_header\n"
    edges = b"element edge 3\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    lists = b"".join(struct.pack("<B4i", N, *range(a, a + N)) for a in (0, N))
    return [
        b"ply\nformat ascii 1.0\n" + head + strands + _text(POINTS) + b"\n4 0 1 2 3\n4 4 5 6 7\n",
        b"ply\nformat binary_little_endian 1.0\n" + head + strands + POINTS.tobytes() + lists,
        b"ply\nformat binary_big_endian 1.0\n" + head + edges + POINTS.astype(">f4").tobytes() + CHAINS,
        b"ply\nformat ascii 1.0\n" + head + b"property int strand\nend_header\n"
        + _text(np.column_stack([POINTS, np.arange(2 * N) // N])),
    ]  # fmt: skip


def _npy(value: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, value)
    return buffer.getvalue()


def _npz() -> list[bytes]:
    out = []
    for save in (np.savez, np.savez_compressed):
        buffer = io.BytesIO()
        save(buffer, points=POINTS, counts=np.array([N, N]), radius=np.array(0.1))
        out.append(buffer.getvalue())
    return out


def _packed(points: bytes) -> bytes:
    """An archive that is whole about an array that is not."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", points)
    return buffer.getvalue()


USDA = b"""#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Z"
)
def Xform "head"
{
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def BasisCurves "hair"
    {
        uniform token type = "cubic"
        uniform token basis = "bspline"
        uniform token wrap = "pinned"
        int[] curveVertexCounts = [4, 3]
        point3f[] points = [(0,0,0), (0,1,0), (1,2,0), (1,3,0), (5,0,0), (5,1,0), (5,2,1)]
        float[] widths = [0.1, 0.1, 0.1, 0.1, 0.2, 0.2, 0.1] (interpolation = "varying")
    }
}
"""


def _usdc() -> list[bytes]:
    """The same in USD's binary form."""
    if importlib.util.find_spec("pxr") is None:
        return []
    import tempfile

    from pxr import Sdf

    with tempfile.TemporaryDirectory() as folder:
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.ImportFromString(USDA.decode())
        path = Path(folder) / "a.usdc"
        layer.Export(str(path))
        return [path.read_bytes()]


def _abc() -> list[bytes]:
    """Two linear curves, written by Alembic's own library."""
    import tempfile

    import imath
    from alembic3d import Abc, AbcGeom

    positions, counts, widths = imath.V3fArray(2 * N), imath.IntArray(2), imath.FloatArray(1)
    for k, p in enumerate(POINTS):
        positions[k] = imath.V3f(*map(float, p))
    counts[0] = counts[1] = N
    widths[0] = 0.1
    how = AbcGeom.CurveType.kLinear, AbcGeom.CurvePeriodicity.kNonPeriodic
    given = AbcGeom.OFloatGeomParamSample(widths, AbcGeom.GeometryScope.kConstantScope)
    rest = AbcGeom.OV2fGeomParamSample(), AbcGeom.ON3fGeomParamSample(), AbcGeom.BasisType.kNoBasis
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.abc"
        made = AbcGeom.OCurves(Abc.OArchive(str(path)).getTop(), "hair")
        made.getSchema().set(AbcGeom.OCurvesSchemaSample(positions, counts, *how, given, *rest))
        del made  # closes the archive
        return [path.read_bytes()]


def report_is_whole(report: Any) -> None:
    """A report is JSON without NaN, and its outcome follows from its verdicts."""
    assert json.loads(report.to_json())["ok"] == (report.outcome == "pass")


def _dump() -> tuple[bytes, bytes]:
    """As few uniform directions as an audit takes, with pdf, weight and viewer: compressed, and as text."""
    rng = np.random.default_rng(1)
    y, phi, n = rng.uniform(-1, 1, LEAST_ROWS), rng.uniform(-np.pi, np.pi, LEAST_ROWS), LEAST_ROWS
    r = np.sqrt(1 - y**2)
    rows = np.column_stack([r * np.cos(phi), y, r * np.sin(phi), np.full(n, 1 / (4 * np.pi)), np.ones(n), np.zeros(n)])
    buffer = io.BytesIO()
    np.savez(buffer, direction=rows[:, :3], pdf=rows[:, 3], weight=rows[:, 4], viewer=rows[:, 5])
    return buffer.getvalue(), b"x,y,z,pdf,weight,viewer\n" + b"\n".join(b",".join(b"%.6g" % v for v in row) for row in rows)


def _sampler() -> list[bytes]:
    """The draft's own form for two strand counts, and one lobe."""
    model = cuticle.DualScattering(cuticle.Fibre.preset("brown"))
    made = cuticle.fit(model, strands=(0, 2), form="document"), cuticle.fit(cuticle.Marschner(model.fibre), lobes=1)
    return [fit.sampler.to_json().encode() for fit in made]


TABLE = b"theta_r_deg,theta_i_deg,phi_deg,f\n" + b"".join(
    b"%d,%d,%d,0.5\n" % (r, i, p) for r in (-20, 0, 20) for i in range(-90, 91, 30) for p in range(-180, 181, 30)
)
FIBRE = b"[fibre]\nalpha_R = -7.5\nbeta_R = 7.5\neta = 1.55\nsigma_a = [0.2, 0.3, 0.8]\n"


@cache
def targets() -> list[Target]:
    """Return every target, those of absent libraries left out."""
    grooms = [
        Target("a.hair", _cyhair(), read_groom, groom_is_whole),
        Target("a.data", [_usc()], read_groom, groom_is_whole),
        Target("a.tfx", _tressfx(), read_groom, groom_is_whole),
        Target("a.txt", _lines(), read_groom, groom_is_whole),
        Target("a.ply", _ply(), read_groom, groom_is_whole),
        Target("a.npz", _npz(), read_groom, groom_is_whole),
        Target("packed.npz", [_npy(POINTS.reshape(2, N, 3))], read_groom, groom_is_whole, _packed),
        Target("a.csv", [TABLE], cuticle.Tabulated.load, f_is_whole, share=0.2),
        Target("dump.npz", [_dump()[0]], cuticle.audit_dump, report_is_whole, share=0.02),
        Target("dump.csv", [_dump()[1]], cuticle.audit_dump, report_is_whole, share=0.02),
        Target("sampler.json", _sampler(), cuticle.Sampler.load, pdf_is_whole, share=0.2),
        Target("a.toml", [FIBRE], lambda path: cuticle.Marschner(cuticle.Fibre.load(path)), f_is_whole, share=0.2),
    ]
    if importlib.util.find_spec("pxr") is not None:
        grooms += [
            Target("a.usda", [USDA], read_groom, groom_is_whole, share=0.002),
            Target("a.usdc", _usdc(), read_groom, groom_is_whole, share=0.002),
        ]
    if importlib.util.find_spec("alembic3d") is not None:
        grooms.append(Target("a.abc", _abc(), read_groom, groom_is_whole, share=0.002))
    return grooms


def controls() -> list[Target]:
    """Return readers that do what none may: the fuzzer has to find each."""

    def crash(path: Path) -> None:
        if path.read_bytes() != b"valid":
            os.kill(os.getpid(), signal.SIGSEGV)

    def hang(path: Path) -> None:
        while path.read_bytes() != b"valid":
            pass

    def fill(path: Path) -> bytes:
        return b"" if path.read_bytes() == b"valid" else bytes(1 << 33)

    def leak(path: Path) -> None:
        if path.read_bytes() != b"valid":
            raise KeyError("what a decoder raises")

    def nan(path: Path) -> float:
        return 0.0 if path.read_bytes() == b"valid" else np.nan

    def mute(path: Path) -> None:
        if path.read_bytes() != b"valid":
            raise ValueError("it is damaged")

    def finite(value: Any) -> None:
        assert value is None or isinstance(value, bytes) or np.isfinite(value)

    return [Target(read.__name__, [b"valid"], read, finite) for read in (crash, hang, fill, leak, nan, mute)]
