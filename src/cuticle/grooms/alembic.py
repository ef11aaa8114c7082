"""Reads curves from Alembic archives, with PyAlembic as the package alembic3d brings it."""

from __future__ import annotations

import importlib.util
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support.files import opened
from cuticle.grooms.apart import read_apart, serve
from cuticle.grooms.scene_curves import Curves, assemble, left_out

_BASES = {"kBezierBasis": "bezier", "kBsplineBasis": "bspline", "kCatmullromBasis": "catmullRom"}
_TYPES = {"kLinear": "linear", "kCubic": "cubic"}
_SCOPES = {"kConstantScope": "constant", "kUniformScope": "uniform", "kVaryingScope": "varying", "kVertexScope": "vertex"}


def read_alembic(path: Path) -> dict[str, NDArray]:
    """Return all visible curves at the file's first time, in world space."""
    with opened(path) as file:
        _check(path, file.read(16), path.stat().st_size)
    if importlib.util.find_spec("alembic3d") is None:
        raise ValueError(f"reading {path} needs the package alembic3d: pip install 'cuticle[alembic]'; or export it as USD")
    return read_apart(__name__, path)


def _check(path: Path, head: bytes, size: int) -> None:
    """Check the header, or raise ValueError: 'Ogawa', a mark that the archive was closed, and the position of its root."""
    if head[:4] == b"\x89HDF":
        raise ValueError(f"{path} is an old Alembic archive in HDF5 (byte 0), write it again as Ogawa: abcconvert -toOgawa")
    if head[:5] != b"Ogawa":
        raise ValueError(f"{path} is not an Alembic archive: bytes 0 to 5 are {head[:5]!r}, not b'Ogawa'")
    if len(head) < 16:
        raise ValueError(f"{path} is cut short: its header needs bytes 0 to 16, the file has {size}")
    if head[5] != 0xFF:
        raise ValueError(f"{path} was not closed by the program that wrote it (byte 5 is {head[5]}, not 255)")
    (root,) = struct.unpack_from("<Q", head, 8)
    if root + 8 > size:
        raise ValueError(f"{path} is cut short: its root group lies at byte {root} (byte 8), the file has {size}")


def _find(path: str) -> dict[str, NDArray]:
    from alembic3d import Abc

    found: list[Curves] = []
    hidden: list[str] = []
    _visit(Abc.IArchive(path).getTop(), np.eye(4), found, hidden)
    notes = left_out("invisible object(s)", hidden)
    if not sum(len(c.vertices) for c in found):
        raise ValueError("; ".join(["it holds no curves", *notes]))
    return assemble(found, notes)


def _visit(parent: Any, world: NDArray[np.float64], found: list[Curves], hidden: list[str]) -> None:
    """Gather the curves below an object that are not hidden, and the names of those that are."""
    from alembic3d import Abc, AbcGeom

    first = Abc.ISampleSelector(0)
    for k in range(parent.getNumChildren()):
        header = parent.getChildHeader(k)
        child = parent.getChild(k)
        if AbcGeom.GetVisibility(child, first) == AbcGeom.ObjectVisibility.kVisibilityHidden:
            hidden.append(header.getFullName())
            continue
        place = world
        if AbcGeom.IXform.matches(header):
            sample = AbcGeom.IXform(parent, header.getName()).getSchema().getValue(first)
            own = np.array([[sample.getMatrix()[i][j] for j in range(4)] for i in range(4)])
            place = own @ world if sample.getInheritsXforms() else own
        elif AbcGeom.ICurves.matches(header):
            schema = AbcGeom.ICurves(parent, header.getName()).getSchema()
            if schema.getNumSamples():
                found.append(_curves(header.getFullName(), schema, first, place))
        _visit(child, place, found, hidden)


def _curves(name: str, schema: Any, first: Any, world: NDArray[np.float64]) -> Curves:
    from alembic3d.AbcGeom import CurvePeriodicity

    value = schema.getValue(first)
    type_, basis = str(value.getType()), str(value.getBasis())
    if type_ not in _TYPES or (type_ == "kCubic" and basis not in _BASES):
        raise ValueError(f"{name} has curves of type {type_}, basis {basis}; {', '.join((*_TYPES, *_BASES))} are read")
    widths, interpolation = None, ""
    if schema.getWidthsParam().valid():
        sample = schema.getWidthsParam().getExpandedValue(first)
        widths, interpolation = np.array(sample.getVals(), np.float64), _SCOPES.get(str(sample.getScope()), "")
    return Curves(
        name,
        np.array([tuple(p) for p in value.getPositions()], np.float64).reshape(-1, 3),
        np.array(value.getCurvesNumVertices(), np.int64),
        _TYPES[type_],
        _BASES.get(basis, "bspline"),
        "periodic" if value.getWrap() == CurvePeriodicity.kPeriodic else "nonperiodic",
        widths,
        interpolation,
        world,
    )


if __name__ == "__main__":
    serve(_find)
