"""Curves as USD and Alembic describe them, in objects of a scene, made into one groom."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle.grooms import splines

CONSTANT, UNIFORM, VARYING, VERTEX = "constant", "uniform", "varying", "vertex"


class Curves(NamedTuple):
    """The curves of one object.

    Attributes
    ----------
    name
        The object's path, for messages.
    vertices, counts
        Shape (N, 3), and the vertices of each curve, shape (curves,).
    type, basis, wrap
        As in `splines`.
    widths
        Diameters, or None where the object has none.
    interpolation
        What `widths` are given for: "constant": the object, "uniform": each curve, "varying": the ends of each segment,
        "vertex": each vertex. Empty where the file does not say.
    matrix
        From the object to the world, shape (4, 4), for rows of positions on its left.
    """

    name: str
    vertices: NDArray
    counts: NDArray[np.int64]
    type: str
    basis: str
    wrap: str
    widths: NDArray | None
    interpolation: str
    matrix: NDArray[np.float64]


def check_frame(frame: str, times: list[float]) -> None:
    """Raise ValueError for a frame outside the times of a file's samples; "" is none."""
    if frame and not times:
        raise ValueError(f"it has no time samples, frame must be left out, got {float(frame):g}")
    if frame and not min(times) <= float(frame) <= max(times):
        raise ValueError(f"frame must be in [{min(times):g}, {max(times):g}], got {float(frame):g}")


def assemble(objects: list[Curves], notes: list[str]) -> dict[str, NDArray]:
    """Return points, counts, radius (empty where no object has widths), bend and notes of all objects, in world space.

    Objects without widths get the default radius, 1/4000 of the diagonal of the box around all points, where others have
    widths.
    """
    made = [_placed(o) for o in objects]
    points, counts, bend = (np.concatenate([m[k] for m in made]) for k in (0, 1, 3))
    without = [o.name for o, m in zip(objects, made, strict=True) if m[2] is None]
    radius = np.empty(0)
    if len(without) < len(made):
        default = float(np.linalg.norm(np.ptp(points, axis=0))) / 4000
        radius = np.concatenate([np.full(len(m[0]), default) if m[2] is None else m[2] for m in made])
        if without:
            notes = [*notes, f"{_some(without)} without widths: 1/4000 of the groom's size"]
    return {"points": points, "counts": counts, "radius": radius, "bend": bend, "notes": np.array(notes, str)}


def _some(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def left_out(reason: str, names: list[str]) -> list[str]:
    """Return a note that objects were left out, or none where there were none."""
    return [f"left out {len(names)} {reason}: {_some(names)}"] if names else []


def _placed(o: Curves) -> tuple[NDArray, NDArray[np.int64], NDArray | None, NDArray]:
    """Points, points of each strand, radius and bend of one object, in world space."""
    counts = o.counts
    if (counts < 0).any() or counts.sum() != len(o.vertices):
        raise ValueError(f"{o.name} has {len(o.vertices)} points, its curves say {counts.sum()}")
    how = (o.type, o.basis, o.wrap)
    vertices = np.asarray(o.vertices, np.float64).reshape(-1, 3)
    half = 0.5 * np.asarray([] if o.widths is None else o.widths, np.float64)
    try:
        given = _interpolation(o, len(half)) if len(half) else None
        if given == VERTEX:  # widths follow the same basis
            vertices = np.column_stack([vertices, half])
        points, made, bend = splines.to_splines(vertices, counts, *how)
        radius = points[:, 3] if given == VERTEX else _SPREAD[given](half, counts, made, how) if given else None
    except ValueError as error:
        raise ValueError(f"{o.name}: {error}") from None
    linear = np.asarray(o.matrix, np.float64)[:3, :3]
    scale = np.cbrt(abs(np.linalg.det(linear)))
    placed = np.zeros((len(bend), 2, 4))
    placed[..., :3] = bend[..., :3] @ linear
    if given == VERTEX:
        placed[..., 3] = scale * bend[..., 3]
    return points[:, :3] @ linear + o.matrix[3, :3], made, None if radius is None else scale * radius, placed


def _interpolation(o: Curves, widths: int) -> str:
    """What the widths are given for: what the file says, if their number fits, else what their number does fit."""
    varying = sum(splines.varying_values(int(c), o.type, o.basis, o.wrap) for c in o.counts)
    sizes = {VERTEX: len(o.vertices), VARYING: varying, UNIFORM: len(o.counts), CONSTANT: 1}
    if o.interpolation:
        if o.interpolation not in sizes:
            raise ValueError(f"the interpolation of widths must be one of {', '.join(sizes)}, got {o.interpolation!r}")
        sizes = {o.interpolation: sizes[o.interpolation]}
    fits = [name for name, size in sizes.items() if size == widths]
    if not fits:
        need = ", ".join(f"{size} if {name}" for name, size in sizes.items())
        raise ValueError(f"it has {widths} widths, must have {need}")
    return fits[0]


def _uniform(widths: NDArray, counts: NDArray[np.int64], made: NDArray[np.int64], _: tuple[str, str, str]) -> NDArray:
    return np.repeat(widths[counts > 0], made)


def _constant(widths: NDArray, _: NDArray, made: NDArray[np.int64], __: tuple[str, str, str]) -> NDArray:
    return np.full(int(made.sum()), widths[0])


def _varying(widths: NDArray, counts: NDArray[np.int64], _: NDArray, how: tuple[str, str, str]) -> NDArray:
    return splines.along_segments(widths, counts, *how)


_SPREAD: dict[str, Callable[..., NDArray]] = {CONSTANT: _constant, UNIFORM: _uniform, VARYING: _varying}
