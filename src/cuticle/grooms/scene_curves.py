"""Curves as USD and Alembic describe them, in objects of a scene, made into one groom."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle.grooms import attributes as named
from cuticle.grooms import splines

ATTRIBUTE = "attribute "  # before an attribute's name, among the arrays that a reader of scenes returns
CONSTANT, UNIFORM, VARYING, VERTEX = "constant", "uniform", "varying", "vertex"


class Curves(NamedTuple):
    """The curves of one object, and values on them by name.

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
    values
        Other values of the file by name, each with its interpolation. They are not moved with the object.
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
    values: Mapping[str, tuple[NDArray, str]]


def check_frame(frame: str, times: list[float]) -> None:
    """Raise ValueError for a frame outside the times of a file's samples; "" is none."""
    if frame and not times:
        raise ValueError(f"it has no time samples, frame must be left out, got {float(frame):g}")
    if frame and not min(times) <= float(frame) <= max(times):
        raise ValueError(f"frame must be in [{min(times):g}, {max(times):g}], got {float(frame):g}")


def assemble(objects: list[Curves], notes: list[str]) -> dict[str, NDArray]:
    """Return points, counts, radius (empty where no object has widths), bend and notes of all objects, in world space, and
    each attribute that all of them have, its name after `ATTRIBUTE`.

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
    some = [(o, m[1]) for o, m in zip(objects, made, strict=True) if len(m[1])]  # an object without curves lacks no value
    each, lost = zip(*(_attributes(o, own) for o, own in some), strict=True)
    attributes, unlike = named.joined(each, [own for _, own in some], [o.name for o, _ in some])
    told = {name: why for own in (unlike, *lost) for name, why in own.items()}
    arrays = {"points": points, "counts": counts, "radius": radius, "bend": bend}
    return (
        arrays
        | {"notes": np.array([*notes, *named.note(told)], str)}
        | {ATTRIBUTE + name: values for name, values in attributes.items()}
    )


def _attributes(o: Curves, made: NDArray[np.int64]) -> tuple[named.Attributes, named.Lost]:
    """One object's values, a strand or a point of what was made of it, and why others are left out."""
    found: dict[str, NDArray] = {}
    lost: named.Lost = {}
    for name, (given, interpolation) in o.values.items():
        try:
            if given.dtype.kind not in "iuf" or given.ndim not in (1, 2):
                raise ValueError("it is no whole list of numbers, colours or vectors")
            kind = _interpolation(o, interpolation, len(given), "values")
            own = _SPREAD[kind](given.reshape(len(given), -1).astype(np.float64), o.counts, made, (o.type, o.basis, o.wrap))
            found[name] = own.reshape(-1, *given.shape[1:])
        except ValueError as error:
            lost[name] = f"{o.name}: {error}"
    kept, wrong = named.readable(found, len(made), int(made.sum()))
    return kept, lost | wrong


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
        given = _interpolation(o, o.interpolation, len(half), "widths") if len(half) else None
        if given == VERTEX:  # widths follow the same basis
            vertices = np.column_stack([vertices, half])
        points, made, bend = splines.to_splines(vertices, counts, *how)
        radius = points[:, 3] if given == VERTEX else None
        if given and radius is None:
            own = _SPREAD[given](half[:, None], counts, made, how)[:, 0]
            radius = np.repeat(own, made) if len(own) == len(made) else own
    except ValueError as error:
        raise ValueError(f"{o.name}: {error}") from None
    linear = np.asarray(o.matrix, np.float64)[:3, :3]
    scale = np.cbrt(abs(np.linalg.det(linear)))
    placed = np.zeros((len(bend), 2, 4))
    placed[..., :3] = bend[..., :3] @ linear
    if given == VERTEX:
        placed[..., 3] = scale * bend[..., 3]
    return points[:, :3] @ linear + o.matrix[3, :3], made, None if radius is None else scale * radius, placed


def _interpolation(o: Curves, said: str, number: int, what: str) -> str:
    """What values are given for: what the file says, if their number fits, else what their number does fit."""
    varying = sum(splines.varying_values(int(c), o.type, o.basis, o.wrap) for c in o.counts)
    sizes = {VERTEX: len(o.vertices), VARYING: varying, UNIFORM: len(o.counts), CONSTANT: 1}
    if said:
        if said not in sizes:
            raise ValueError(f"the interpolation of {what} must be one of {', '.join(sizes)}, got {said!r}")
        sizes = {said: sizes[said]}
    fits = [name for name, size in sizes.items() if size == number]
    if not fits:
        need = ", ".join(f"{size} if {name}" for name, size in sizes.items())
        raise ValueError(f"it has {number} {what}, must have {need}")
    return fits[0]


def _uniform(values: NDArray, counts: NDArray[np.int64], _: NDArray, __: tuple[str, str, str]) -> NDArray:
    return values[counts > 0]


def _constant(values: NDArray, _: NDArray, made: NDArray[np.int64], __: tuple[str, str, str]) -> NDArray:
    return np.repeat(values, len(made), axis=0)


def _varying(values: NDArray, counts: NDArray[np.int64], _: NDArray, how: tuple[str, str, str]) -> NDArray:
    return splines.along_segments(values, counts, *how)


def _vertex(values: NDArray, counts: NDArray[np.int64], _: NDArray, how: tuple[str, str, str]) -> NDArray:
    return splines.to_splines(values, counts, *how)[0]


_SPREAD: dict[str, Callable[..., NDArray]] = {CONSTANT: _constant, UNIFORM: _uniform, VARYING: _varying, VERTEX: _vertex}
