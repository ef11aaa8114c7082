"""Valid files of every kind that the package reads, small: what the fuzzer damages."""

from __future__ import annotations

import importlib.util
import io
import json
import struct
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import cuticle
from cuticle.checking.sample_file import LEAST_ROWS
from cuticle.fitting.result import fit_summary

N = 4
POINTS = np.array([[k % 3, k, -k / 2] for k in range(2 * N)], np.float32)


def cyhair() -> list[bytes]:
    head = struct.pack("<4sIIIIf", b"HAIR", 2, 2 * N, 7, 0, 0.5).ljust(128, b"\0")
    segments = struct.pack("<HH", N - 1, N - 1)
    full = head + segments + POINTS.tobytes() + np.full(2 * N, 0.1, "<f4").tobytes()
    plain = struct.pack("<4sIIIIf", b"HAIR", 2, 2 * N, 2, N - 1, 0.5).ljust(128, b"\0") + POINTS.tobytes()
    colours = struct.pack("<4sIIIIf", b"HAIR", 2, 2 * N, 27, 0, 0.1).ljust(128, b"\0") + segments + POINTS.tobytes()
    colours += np.linspace(0, 1, 8 * N, dtype="<f4").tobytes()
    return [full, plain, colours, struct.pack("<IIHH", 2, 2 * N, N, N) + POINTS.tobytes()]


def usc() -> bytes:
    strand = struct.pack("<i", N)
    return struct.pack("<i", 2) + strand + POINTS[:N].tobytes() + strand + POINTS[N:].tobytes()


def tressfx() -> list[bytes]:
    padded = np.column_stack([POINTS, np.ones(2 * N, np.float32)])
    return [
        struct.pack("<fII", 3.0, 2, N).ljust(296, b"\0") + POINTS.tobytes(),
        struct.pack("<fIII", 4.0, 2, N, 160).ljust(160, b"\0") + padded.tobytes(),
    ]


def _text(rows: np.ndarray) -> bytes:
    return b"\n".join(b" ".join(b"%g" % x for x in r) for r in rows)


def lines() -> list[bytes]:
    rows = np.column_stack([POINTS, np.full(2 * N, 0.1)])
    return [_text(rows[:N]) + b"\n\n" + _text(rows[N:]), _text(rows[:2]) + b"\n\n" + _text(rows[2:5])]


CHAINS = struct.pack(">6i", 0, 1, 1, 2, 3, 4)


def ply() -> list[bytes]:
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
        b"ply\nformat binary_little_endian 1.0\n" + head + b"property double m\n"
        + strands.replace(b"property", b"property uchar dye\nproperty", 1)
        + b"".join(p.tobytes() + struct.pack("<d", k) for k, p in enumerate(POINTS))
        + b"".join(struct.pack("<BB4i", 7, N, *range(a, a + N)) for a in (0, N)),
    ]  # fmt: skip


def npy(value: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, value)
    return buffer.getvalue()


def _arrays(save: Callable[..., None], **arrays: Any) -> bytes:
    buffer = io.BytesIO()
    save(buffer, **arrays)
    return buffer.getvalue()


def npz() -> list[bytes]:
    given = {"points": POINTS, "counts": np.array([N, N]), "radius": np.array(0.1)}
    attributes = {"bend": np.zeros((2, 2, 4)), "m": np.array([1, 2]), "color": np.ones((2 * N, 3))}
    return [_arrays(save, **given, **more) for save, more in ((np.savez, attributes), (np.savez_compressed, {}))]


def packed(points: bytes) -> bytes:
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
        float primvars:eumelanin = 1.3
        color3f[] primvars:dye = [(1, 0, 0), (0, 1, 0)] (interpolation = "uniform")
        int[] primvars:dye:indices = [1, 0]
        half[] primvars:beta_m = [0.1, 0.2, 0.3, 0.4, 0.1, 0.2, 0.3] (interpolation = "vertex")
    }
}
"""


def usdc() -> list[bytes]:
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


def abc() -> list[bytes]:
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
        scope = AbcGeom.GeometryScope.kVertexScope
        parameters = made.getSchema().getArbGeomParams()
        melanin = AbcGeom.OV3fGeomParam(parameters, "melanin", False, scope, 1)
        melanin.set(AbcGeom.OV3fGeomParamSample(positions, scope))
        del melanin, parameters
        del made  # closes the archive
        return [path.read_bytes()]


@cache
def dump() -> tuple[bytes, bytes]:
    """As few uniform directions as an audit takes, with pdf, weight and viewer: compressed, and as text."""
    rng = np.random.default_rng(1)
    y, phi, n = rng.uniform(-1, 1, LEAST_ROWS), rng.uniform(-np.pi, np.pi, LEAST_ROWS), LEAST_ROWS
    r = np.sqrt(1 - y**2)
    rows = np.column_stack([r * np.cos(phi), y, r * np.sin(phi), np.full(n, 1 / (4 * np.pi)), np.ones(n), np.zeros(n)])
    buffer = io.BytesIO()
    np.savez(buffer, direction=rows[:, :3], pdf=rows[:, 3], weight=rows[:, 4], viewer=rows[:, 5])
    return buffer.getvalue(), b"x,y,z,pdf,weight,viewer\n" + b"\n".join(b",".join(b"%.6g" % v for v in row) for row in rows)


@cache
def _fits() -> list[cuticle.Fit]:
    """The draft's own form for two strand counts, and one lobe for functions of two kinds."""
    model = cuticle.DualScattering(cuticle.Fibre.preset("brown"))
    return [
        cuticle.fit(model, strands=(0, 2), form="document"),
        cuticle.fit(cuticle.Marschner(model.fibre), lobes=1),
        cuticle.fit(cuticle.Chiang(eumelanin=1.3), lobes=1),
    ]


def samplers() -> list[bytes]:
    return [fit.sampler.to_json().encode() for fit in _fits()]


def _written(write: Callable[[Path], object], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder))
        return (Path(folder) / name).read_bytes()


def saved() -> list[bytes]:
    return [_written(lambda folder, fit=fit: fit.save(folder / "fit.json"), "fit.json") for fit in _fits()]


def summaries() -> list[bytes]:
    return [json.dumps(fit_summary(fit)).encode() for fit in _fits()]


def checked() -> list[bytes]:
    fit = _fits()[2]
    return [cuticle.check(fit.sampler, cuticle.Chiang(eumelanin=1.3), samples=10_000).to_json().encode()]


def documented() -> list[bytes]:
    """Without figures: a page without them is whole."""
    text = _written(cuticle.document(cuticle.Chiang(eumelanin=1.3)).save, "document.json")
    return [json.dumps(json.loads(text) | {"figures": {}}).encode()]


PRINTED = {
    "table1.csv": b"phi_r_deg,theta_r_deg,peak_theta_i_deg,peak_phi_i_deg\n0,-30,30,180\n0,0,4.5,180\n",
    "table2.csv": b"theta_r_deg,s_V,sigma_V_rad,mu_shift_V_deg,s_H,sigma_H_rad,mu_shift_H_deg\n"
    b"-30,.1,.9,0,.2,.1,4\n0,.1,.8,0,.2,.1,5\n",
    "table3.csv": b"strands,theta_r_deg,s,sigma_rad,mu_shift_deg\n1,-30,.1,.3,4\n2,0,.05,.4,5\n",
}
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


def table_arrays() -> list[bytes]:
    shape = tuple(map(len, NODES.values()))
    return [_arrays(save, f=np.full((*shape, 3), 0.5), **NODES) for save in (np.savez, np.savez_compressed)]
