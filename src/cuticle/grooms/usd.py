"""Reads BasisCurves from USD."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support.files import opened
from cuticle.grooms import splines
from cuticle.grooms.apart import read_apart, serve
from cuticle.grooms.scene_curves import Curves, assemble, check_frame, left_out

_GEOMETRY = ("widths", "normals")  # primvars that are no attributes
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # (x, y, z) to (x, z, -y)


def read_usd(path: Path, frame: float | None) -> dict[str, NDArray]:
    """Return all visible BasisCurves in world space, y up, in metres where the file says its unit.

    `frame` is a time of the file's own samples; by default each object's first.
    """
    if importlib.util.find_spec("pxr") is None:
        raise ValueError(f"reading {path} needs the package usd-core: pip install 'cuticle[usd]'")
    with opened(path):  # checks its size; USD's own message for a missing file is longer
        pass
    return read_apart(__name__, path, "" if frame is None else repr(float(frame)))


def _find(path: str, frame: str) -> dict[str, NDArray]:
    from pxr import Tf, Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        said = (str(getattr(e, "commentary", e)).strip() for e in error.args)
        raise ValueError(next(filter(None, said), "USD gives no reason")) from None
    time = Usd.TimeCode(float(frame)) if frame else Usd.TimeCode.EarliestTime()
    found: list[Curves] = []
    hidden: dict[str, list[str]] = {"invisible": [], "guide": [], "proxy": [], "of a kind that is not read": []}
    places = UsdGeom.XformCache(time)
    times: list[float] = []
    for prim, inverse, instances in _drawn(stage, places, time):
        name = str(prim.GetPath())
        if not prim.IsA(UsdGeom.BasisCurves):
            hidden["of a kind that is not read"].append(f"{name} ({prim.GetTypeName()})")
            continue
        thing = UsdGeom.Imageable(prim)
        purpose = str(thing.ComputePurpose())
        if thing.ComputeVisibility(time) == UsdGeom.Tokens.invisible:
            hidden["invisible"].append(name)
        elif purpose in hidden:
            hidden[purpose].append(name)
        else:
            curves = _curves(prim, time, times, places.GetLocalToWorldTransform(prim))
            found += [curves._replace(matrix=curves.matrix @ inverse @ m) for m in instances]
    notes = [n for reason, names in hidden.items() for n in left_out(f"{reason} prim(s)", names)]
    broken = [str(e) for e in getattr(stage, "GetCompositionErrors", list)()]  # new in USD 24; else USD prints them
    notes += left_out("what USD cannot find", broken)
    if stage.HasAuthoredTimeCodeRange():
        times += [stage.GetStartTimeCode(), stage.GetEndTimeCode()]
    check_frame(frame, times)
    if not sum(len(c.vertices) for c in found):
        raise ValueError("; ".join(["it holds no BasisCurves", *notes]))
    unit = UsdGeom.GetStageMetersPerUnit(stage) if stage.HasAuthoredMetadata("metersPerUnit") else 1.0
    whole = np.diag([unit, unit, unit, 1.0]) @ (_Y_UP if UsdGeom.GetStageUpAxis(stage) == "Z" else np.eye(4))
    return assemble([c._replace(matrix=c.matrix @ whole) for c in found], notes)


def _drawn(stage: Any, places: Any, time: Any) -> Any:
    """Every prim with curves; what to undo of its place, and its instances' matrices. Prototypes of point instancers, which
    are drawn at the instances alone, are among them as often as they are drawn.
    """
    from pxr import Usd, UsdGeom

    every = Usd.TraverseInstanceProxies()
    prototypes: dict[Any, list[NDArray]] = {}
    for prim in Usd.PrimRange.Stage(stage, every):
        if prim.IsA(UsdGeom.PointInstancer):
            instancer = UsdGeom.PointInstancer(prim)
            world = np.array(places.GetLocalToWorldTransform(prim))
            targets = instancer.GetPrototypesRel().GetForwardedTargets()
            for root in targets:
                prototypes.setdefault(root, [])
            if UsdGeom.Imageable(prim).ComputeVisibility(time) == UsdGeom.Tokens.invisible:
                continue
            matrices = instancer.ComputeInstanceTransformsAtTime(time, time)
            indices = instancer.GetProtoIndicesAttr().Get(time) or []
            mask = instancer.ComputeMaskAtTime(time) or [True] * len(indices)
            kept = [k for k, drawn in zip(indices, mask, strict=True) if drawn]
            for k, m in zip(kept, matrices, strict=True):
                prototypes[targets[k]].append(np.array(m) @ world)
    for prim in Usd.PrimRange.Stage(stage, every):
        if prim.IsA(UsdGeom.Curves):
            root = next((p for p in prim.GetPath().GetPrefixes() if p in prototypes), None)
            if root is None:
                yield prim, np.eye(4), [np.eye(4)]
            else:  # the instance's matrix holds the prototype's own
                inverse = np.linalg.inv(np.array(places.GetLocalToWorldTransform(stage.GetPrimAtPath(root))))
                yield prim, inverse, prototypes[root]


def _curves(prim: Any, time: Any, times: list[float], matrix: Any) -> Curves:
    from pxr import UsdGeom

    curves = UsdGeom.BasisCurves(prim)
    counts = np.array(curves.GetCurveVertexCountsAttr().Get(time) or [], np.int64)
    vertices = np.array(curves.GetPointsAttr().Get(time) or [], np.float64).reshape(-1, 3)
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("widths")
    if primvar.HasAuthoredValue():
        attribute, values = primvar.GetAttr(), primvar.ComputeFlattened(time)
        if values is None:
            raise ValueError(f"{prim.GetPath()}: primvars:widths:indices go beyond the values of primvars:widths")
    else:
        attribute = curves.GetWidthsAttr()
        values = attribute.Get(time)
    own = [p for p in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance() if p.GetPrimvarName() not in _GEOMETRY]
    for a in (curves.GetPointsAttr(), attribute, *own):
        times += a.GetTimeSamples()
    type_, basis, wrap = (str(a.Get()) for a in (curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr()))
    if not curves.GetTypeAttr().HasAuthoredValue() and not splines.allowed(counts, type_, basis, wrap):
        type_ = "linear"  # USD says cubic where the file says nothing, which these cannot be
    return Curves(
        str(prim.GetPath()),
        vertices,
        counts,
        type_,
        basis,
        wrap,
        None if values is None else np.atleast_1d(np.array(values, np.float64)),
        attribute.GetMetadata("interpolation") or "",
        np.array(matrix),
        {str(p.GetPrimvarName()): _values(p, time) for p in own if p.HasAuthoredValue()},
    )


def _values(primvar: Any, time: Any) -> tuple[NDArray, str]:
    """A primvar's values, one a row, and its interpolation. Those that no array of numbers holds are left out later."""
    values = np.array(primvar.ComputeFlattened(time))  # of type object where its indices go beyond its values
    size = primvar.GetElementSize()
    if not primvar.GetTypeName().isArray:
        values = values[None]
    elif size > 1 and values.ndim == 1 and len(values) % size == 0:
        values = values.reshape(-1, size)
    # USD gives the corners of a face values of their own; curves have none but the ends of segments.
    return values, str(primvar.GetInterpolation()).replace("faceVarying", "varying")


if __name__ == "__main__":
    serve(_find)
