"""What is fuzzed: a reader each, with small valid files to damage. A new reader is one more row in `targets`."""

from __future__ import annotations

import importlib.util
import io
import json
import os
import re
import signal
import struct
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import cuticle
from cuticle.checking.sample_file import LEAST_ROWS
from cuticle.draft.printed import Printed
from cuticle.fitting.result import fit_summary
from cuticle.grooms.groom import Groom, read_groom
from cuticle.report.page import write_report
from cuticle.scattering.by_name import model_of, read_parameters_or_model

N = 4
POINTS = np.array([[k % 3, k, -k / 2] for k in range(2 * N)], np.float32)


class Target(NamedTuple):
    """A reader.

    Attributes
    ----------
    name
        Its file's name, whose ending selects the reader; a folder before it where a reader takes a folder.
    make
        Returns valid files; called only where they are damaged, since some take seconds.
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
    make: Callable[[], list[bytes]]
    read: Callable[[Path], Any]
    check: Callable[[Any], None]
    pack: Callable[[bytes], bytes] = bytes
    share: float = 1.0

    @property
    def seeds(self) -> list[bytes]:
        """Valid files, made once."""
        return _made(self.make)


@cache
def _made(make: Callable[[], list[bytes]]) -> list[bytes]:
    return make()


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


def _arrays(save: Callable[..., None], **arrays: Any) -> bytes:
    buffer = io.BytesIO()
    save(buffer, **arrays)
    return buffer.getvalue()


def _npz() -> list[bytes]:
    given = {"points": POINTS, "counts": np.array([N, N]), "radius": np.array(0.1)}
    return [_arrays(save, **given) for save in (np.savez, np.savez_compressed)]


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


@cache
def _dump() -> tuple[bytes, bytes]:
    """As few uniform directions as an audit takes, with pdf, weight and viewer: compressed, and as text."""
    rng = np.random.default_rng(1)
    y, phi, n = rng.uniform(-1, 1, LEAST_ROWS), rng.uniform(-np.pi, np.pi, LEAST_ROWS), LEAST_ROWS
    r = np.sqrt(1 - y**2)
    rows = np.column_stack([r * np.cos(phi), y, r * np.sin(phi), np.full(n, 1 / (4 * np.pi)), np.ones(n), np.zeros(n)])
    buffer = io.BytesIO()
    np.savez(buffer, direction=rows[:, :3], pdf=rows[:, 3], weight=rows[:, 4], viewer=rows[:, 5])
    return buffer.getvalue(), b"x,y,z,pdf,weight,viewer\n" + b"\n".join(b",".join(b"%.6g" % v for v in row) for row in rows)


def fit_is_whole(fit: cuticle.Fit) -> None:
    """A fit measured what it says, and its sampler is whole."""
    assert np.isfinite(fit.ess).all()
    assert np.isfinite(fit.theta_r).all()
    pdf_is_whole(fit.sampler)


def page_is_whole(texts: tuple[str, str]) -> None:
    """A page shows no number that is none; words of the result itself it may quote."""
    result, page = texts
    quoted = re.findall(r'"[^"]*"', result)
    for word in ("nan", "inf"):
        assert any(word in text for text in quoted) or not re.search(rf">[^<]*\b{word}\b", page)


def tables_are_whole(printed: Printed) -> None:
    """Rows of finite numbers."""
    for rows in (printed.table_1, printed.table_2, printed.table_3):
        assert np.isfinite([(*key, *value) for key, value in rows.items()]).all()


@cache
def _fits() -> list[cuticle.Fit]:
    """The draft's own form for two strand counts, and one lobe for functions of two kinds."""
    model = cuticle.DualScattering(cuticle.Fibre.preset("brown"))
    return [
        cuticle.fit(model, strands=(0, 2), form="document"),
        cuticle.fit(cuticle.Marschner(model.fibre), lobes=1),
        cuticle.fit(cuticle.Chiang(eumelanin=1.3), lobes=1),
    ]


def _samplers() -> list[bytes]:
    return [fit.sampler.to_json().encode() for fit in _fits()]


def _function_of(path: Path) -> Any:
    """Return the function that a sampler's record names."""
    sampler = cuticle.Sampler.load(path)
    try:
        return model_of(sampler)
    except ValueError as error:  # it speaks of "this sampler", which a caller has in hand
        raise ValueError(f"{path}: {error}") from None


def _written(write: Callable[[Path], object], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder))
        return (Path(folder) / name).read_bytes()


def _saved() -> list[bytes]:
    return [_written(lambda folder, fit=fit: fit.save(folder / "fit.json"), "fit.json") for fit in _fits()]


def _summaries() -> list[bytes]:
    return [json.dumps(fit_summary(fit)).encode() for fit in _fits()]


def _checked() -> list[bytes]:
    fit = _fits()[2]
    return [cuticle.check(fit.sampler, cuticle.Chiang(eumelanin=1.3), samples=10_000).to_json().encode()]


def _documented() -> list[bytes]:
    """Without figures: a page without them is whole."""
    text = _written(cuticle.document(cuticle.Chiang(eumelanin=1.3)).save, "document.json")
    return [json.dumps(json.loads(text) | {"figures": {}}).encode()]


PRINTED = {
    "table1.csv": b"phi_r_deg,theta_r_deg,peak_theta_i_deg,peak_phi_i_deg\n0,-30,30,180\n0,0,4.5,180\n",
    "table2.csv": b"theta_r_deg,s_V,sigma_V_rad,mu_shift_V_deg,s_H,sigma_H_rad,mu_shift_H_deg\n"
    b"-30,.1,.9,0,.2,.1,4\n0,.1,.8,0,.2,.1,5\n",
    "table3.csv": b"strands,theta_r_deg,s,sigma_rad,mu_shift_deg\n1,-30,.1,.3,4\n2,0,.05,.4,5\n",
}


def _tables(path: Path) -> Printed:
    for name, text in PRINTED.items():
        if name != path.name:
            (path.parent / name).write_bytes(text)
    return Printed.load(path.parent)


def _page(path: Path) -> tuple[str, str]:
    """Return the result's text and the page's."""
    page = write_report(path.parent)
    return path.read_text(encoding="utf-8-sig"), page.read_text()


TABLE = b"theta_r_deg,theta_i_deg,phi_deg,f\n" + b"".join(
    b"%d,%d,%d,0.5\n" % (r, i, p) for r in (-20, 0, 20) for i in range(-90, 91, 30) for p in range(-180, 181, 30)
)


NODES = {
    "theta_r": np.radians([-20, 0, 20]),
    "theta_i": np.radians(range(-90, 91, 30)),
    "phi": np.radians(range(-180, 181, 30)),
}
FIBRE = b"[fibre]\nalpha_R = -7.5\nbeta_R = 7.5\neta = 1.55\nsigma_a = [0.2, 0.3, 0.8]\n"
CHIANG = b"[chiang]\nbeta_m = 0.3\nbeta_n = 0.25\nalpha = 2.0\neta = 1.55\nsigma_a = [0.2, 0.3, 0.8]\n"


def _function(path: Path) -> Any:
    """Return the function of a TOML file; a fibre's is that of one strand, which is made faster than the one among many."""
    found = read_parameters_or_model(str(path))
    return cuticle.Marschner(found) if isinstance(found, cuticle.Fibre) else found


def _table_arrays() -> list[bytes]:
    shape = tuple(map(len, NODES.values()))
    return [_arrays(save, f=np.full((*shape, 3), 0.5), **NODES) for save in (np.savez, np.savez_compressed)]


@cache
def targets() -> list[Target]:
    """Return every target, those of absent libraries left out."""
    grooms = [
        Target("a.hair", _cyhair, read_groom, groom_is_whole),
        Target("a.data", lambda: [_usc()], read_groom, groom_is_whole),
        Target("a.tfx", _tressfx, read_groom, groom_is_whole),
        Target("a.txt", _lines, read_groom, groom_is_whole),
        Target("a.ply", _ply, read_groom, groom_is_whole),
        Target("a.npz", _npz, read_groom, groom_is_whole),
        Target("packed.npz", lambda: [_npy(POINTS.reshape(2, N, 3))], read_groom, groom_is_whole, _packed),
        Target("a.csv", lambda: [TABLE], cuticle.Tabulated.load, f_is_whole, share=0.2),
        Target("dump.npz", lambda: [_dump()[0]], cuticle.audit_dump, report_is_whole, share=0.02),
        Target("dump.csv", lambda: [_dump()[1]], cuticle.audit_dump, report_is_whole, share=0.02),
        Target("sampler.json", _samplers, cuticle.Sampler.load, pdf_is_whole, share=0.2),
        Target("record.json", _samplers, _function_of, f_is_whole, share=0.02),
        Target("saved.json", _saved, cuticle.Fit.load, fit_is_whole, share=0.2),
        Target("a.toml", lambda: [FIBRE, CHIANG], _function, f_is_whole, share=0.2),
        Target("table.npz", _table_arrays, cuticle.Tabulated.load, f_is_whole, share=0.2),
        *(Target(f"printed/{name}", partial(list, [text]), _tables, tables_are_whole) for name, text in PRINTED.items()),
        Target("fitted/fit.json", _summaries, _page, page_is_whole, share=0.02),
        Target("checked/check.json", _checked, _page, page_is_whole, share=0.02),
        Target("documented/document.json", _documented, _page, page_is_whole, share=0.02),
    ]
    if importlib.util.find_spec("pxr") is not None:
        grooms += [
            Target("a.usda", lambda: [USDA], read_groom, groom_is_whole, share=0.002),
            Target("a.usdc", _usdc, read_groom, groom_is_whole, share=0.002),
        ]
    if importlib.util.find_spec("alembic3d") is not None:
        grooms.append(Target("a.abc", _abc, read_groom, groom_is_whole, share=0.002))
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

    return [Target(read.__name__, lambda: [b"valid"], read, finite) for read in (crash, hang, fill, leak, nan, mute)]
