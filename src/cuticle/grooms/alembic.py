"""Reads curves from Alembic archives, with PyAlembic as the package alembic3d brings it."""

from __future__ import annotations

import importlib.util
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support.files import opened
from cuticle.grooms.apart import read_apart, serve
from cuticle.grooms.scene_curves import Curves, assemble, check_frame, left_out

_BASES = {"kBezierBasis": "bezier", "kBsplineBasis": "bspline", "kCatmullromBasis": "catmullRom"}
_TYPES = {"kLinear": "linear", "kCubic": "cubic"}
_SCOPES = {
    "kConstantScope": "constant", "kUniformScope": "uniform", "kVaryingScope": "varying", "kVertexScope": "vertex",
    "kFacevaryingScope": "varying",
}  # fmt: skip
# The readers of parameters that are numbers: IFloatGeomParam, IC3fGeomParam, ...
_NUMBERS = re.compile(r"I(?:Float|Half|Double|U?[Cc]har|U?Int\d+|[CNPV][234][a-z])GeomParam")


def read_alembic(path: Path, frame: float | None) -> dict[str, NDArray]:
    """Return all visible curves in world space: of each object the sample nearest to `frame`, seconds, or its first."""
    with opened(path) as file:
        _check(path, file.read(16), path.stat().st_size)
    if importlib.util.find_spec("alembic3d") is None:
        raise ValueError(f"reading {path} needs the package alembic3d: pip install 'cuticle[alembic]'; or export it as USD")
    return read_apart(__name__, path, "" if frame is None else repr(float(frame)))


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


def _find(path: str, frame: str) -> dict[str, NDArray]:
    from alembic3d import Abc

    found: list[Curves] = []
    hidden: list[str] = []
    times: list[float] = []
    when = Abc.ISampleSelector(float(frame)) if frame else Abc.ISampleSelector(0)
    _visit(Abc.IArchive(path).getTop(), np.eye(4), when, found, hidden, times)
    check_frame(frame, times)
    notes = left_out("invisible object(s)", hidden)
    if not sum(len(c.vertices) for c in found):
        raise ValueError("; ".join(["it holds no curves", *notes]))
    return assemble(found, notes)


def _visit(
    parent: Any, world: NDArray[np.float64], when: Any, found: list[Curves], hidden: list[str], times: list[float]
) -> None:
    """Gather the curves below an object that are not hidden, the names of those that are, and the times of samples."""
    from alembic3d import AbcGeom

    for k in range(parent.getNumChildren()):
        header = parent.getChildHeader(k)
        child = parent.getChild(k)
        if AbcGeom.GetVisibility(child, when) == AbcGeom.ObjectVisibility.kVisibilityHidden:
            hidden.append(header.getFullName())
            continue
        place = world
        if AbcGeom.IXform.matches(header):
            schema = AbcGeom.IXform(parent, header.getName()).getSchema()
            times += _times(schema)
            sample = schema.getValue(when)
            own = np.array([[sample.getMatrix()[i][j] for j in range(4)] for i in range(4)])
            place = own @ world if sample.getInheritsXforms() else own
        elif AbcGeom.ICurves.matches(header):
            schema = AbcGeom.ICurves(parent, header.getName()).getSchema()
            times += _times(schema)
            if schema.getNumSamples():
                found.append(_curves(header.getFullName(), schema, when, place, times))
        _visit(child, place, when, found, hidden, times)


def _times(schema: Any) -> list[float]:
    """The first and the last time of what has several samples."""
    last = schema.getNumSamples() - 1
    return [schema.getTimeSampling().getSampleTime(k) for k in (0, last)] if last > 0 else []


def _curves(name: str, schema: Any, when: Any, world: NDArray[np.float64], times: list[float]) -> Curves:
    from alembic3d.AbcGeom import CurvePeriodicity

    value = schema.getValue(when)
    type_, basis = str(value.getType()), str(value.getBasis())
    if type_ not in _TYPES or (type_ == "kCubic" and basis not in _BASES):
        raise ValueError(f"{name} has curves of type {type_}, basis {basis}; {', '.join((*_TYPES, *_BASES))} are read")
    widths, interpolation = None, ""
    if schema.getWidthsParam().valid():
        sample = schema.getWidthsParam().getExpandedValue(when)
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
        _values(schema.getArbGeomParams(), when, times),
    )


def _values(parameters: Any, when: Any, times: list[float]) -> dict[str, tuple[NDArray, str]]:
    """The arbitrary parameters of an object by name. Those that are no numbers are left out later."""
    from alembic3d import AbcGeom

    kinds = [getattr(AbcGeom, name) for name in dir(AbcGeom) if _NUMBERS.fullmatch(name)]
    found: dict[str, tuple[NDArray, str]] = {}
    for k in range(parameters.getNumProperties() if parameters.valid() else 0):
        header = parameters.getPropertyHeader(k)
        name = header.getName()
        kind = next((i for i in kinds if i.matches(header)), None)
        if kind is None:
            found[name] = np.array(None), ""
            continue
        try:
            parameter = kind(parameters, name)
            times += _times(parameter)
            if parameter.getNumSamples():
                scoped = bool(header.getMetaData().get("geoScope"))  # a plain array says none
                found[name] = _expanded(parameter, when, scoped)
        except Exception:  # whatever the library raises for one of them, strands can be read
            found[name] = np.array(None), ""
    return found


def _expanded(parameter: Any, when: Any, scoped: bool) -> tuple[NDArray, str]:
    """A parameter's values, one a row, and its interpolation."""
    sample = parameter.getExpandedValue(when)
    values = np.array(sample.getVals())
    extent = parameter.getArrayExtent()
    if extent > 1 and values.ndim == 1 and len(values) % extent == 0:
        values = values.reshape(-1, extent)
    return values, _SCOPES.get(str(sample.getScope()), "") if scoped else ""


if __name__ == "__main__":
    serve(_find)
