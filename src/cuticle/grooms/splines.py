"""Cubic curves of other programs as ours: uniform cubic splines, held as points on the curve and the bend at its ends.

A uniform cubic B-spline of n + 2 control points P passes at its knots through the n points (P[i-1] + 4 P[i] + P[i+1])/6.
These and the second differences b = P[i-1] - 2 P[i] + P[i+1] at the first and the last knot determine it. A spline without
bend at its ends is the natural spline through its points.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate

Array = NDArray[np.float64]
Curves = tuple[Array, NDArray[np.int64], Array]  # points (N, d), points of each strand, bend (strands, 2, d)

TYPES = ("linear", "cubic")
BASES = ("bezier", "bspline", "catmullRom")
WRAPS = ("nonperiodic", "periodic", "pinned")
PIECES = 4  # of a Bezier or Catmull-Rom segment: those bend abruptly from one segment to the next, a cubic spline does not


def to_control(points: NDArray, offsets: NDArray[np.int64], bend: NDArray) -> tuple[Array, NDArray[np.int64]]:
    """Return the control points (N + 2 strands, d) of splines, and the index of each strand's first, N + 2 strands last.

    All strands form one tridiagonal system.
    """
    from scipy.linalg import solve_banded

    n, strands = len(points), len(offsets) - 1
    begin, end = offsets[:-1], offsets[1:] - 1
    ends = np.zeros(n, bool)
    ends[begin] = ends[end] = True
    bands = np.zeros((3, n))
    bands[1] = np.where(ends, 1, 4 / 6)
    bands[0, 1:] = np.where(ends[:-1], 0, 1 / 6)  # the upper diagonal: row i, column i + 1
    bands[2, :-1] = np.where(ends[1:], 0, 1 / 6)
    right = points.astype(np.float64)
    right[begin] -= bend[:, 0] / 6
    right[end] -= bend[:, 1] / 6
    control = np.empty((n + 2 * strands, points.shape[1]))
    counts = np.diff(offsets)
    control[np.arange(n) + 2 * np.repeat(np.arange(strands), counts) + 1] = solve_banded((1, 1), bands, right)
    starts = offsets + 2 * np.arange(strands + 1)
    first, last = starts[:-1], starts[1:] - 1
    control[first] = 2 * control[first + 1] - control[first + 2] + bend[:, 0]
    control[last] = 2 * control[last - 1] - control[last - 2] + bend[:, 1]
    return control, starts


def segments(vertices: int, type_: str, basis: str, wrap: str) -> int:
    """Return the number of segments of a curve of that many vertices; raise ValueError where its basis does not allow it."""
    if (type_, basis) == ("cubic", "bezier"):
        found, over = divmod(vertices - (wrap != "periodic"), 3)
        least, rule = 1, "3 k" if wrap == "periodic" else "3 k + 1"
    else:
        less = 0 if wrap == "periodic" else 1 if type_ == "linear" or wrap == "pinned" else 3
        found, over, least = vertices - less, 0, 3 if wrap == "periodic" else 1
        rule = f"at least {least + less}"
    if found < least or over:
        raise ValueError(f"a {wrap} {basis if type_ == 'cubic' else type_} curve must have {rule} vertices, got {vertices}")
    return found


def allowed(counts: NDArray[np.int64], type_: str, basis: str, wrap: str) -> bool:
    """Return whether curves may have these numbers of vertices; 0 and 1 are no curve, and do no harm."""
    try:
        for count in np.unique(counts[counts > 1]):
            segments(int(count), type_, basis, wrap)
    except ValueError:
        return False
    return True


def to_splines(
    vertices: Array, counts: NDArray[np.int64], type_: str, basis: str = "bspline", wrap: str = "nonperiodic"
) -> Curves:
    """Return curves as points on them and the bend at their ends.

    Linear curves and B-splines are exact. A Bezier or Catmull-Rom segment becomes 4 pieces: one segment alone is exact, and
    where two meet the spline rounds off what they change abruptly.

    Parameters
    ----------
    vertices
        The vertices of all curves, shape (N, d).
    counts
        The vertices of each curve, shape (curves,). A curve without vertices is left out, one of a single vertex stays.
    type_, basis, wrap
        As USD and Alembic call them: `TYPES`, `BASES`, `WRAPS`. "pinned" curves begin and end at their outer vertices.

    Raises
    ------
    ValueError
        A curve has a number of vertices that its basis does not allow.
    """
    validate.choice("type", type_, TYPES)
    validate.choice("basis", basis, BASES)
    validate.choice("wrap", wrap, WRAPS)
    counts = counts[counts > 0]
    bend = np.zeros((len(counts), 2, vertices.shape[1]))

    def convert(own: Array, count: int) -> Array:
        if count > 1:
            own, bend[counts == count] = _convert(own, type_, basis, wrap)
        return own

    points, made = _by_length(vertices, counts, counts, convert)
    return points, made, bend


def _by_length(
    values: Array, counts: NDArray[np.int64], given: NDArray[np.int64], convert: Callable[[Array, int], Array]
) -> tuple[Array, NDArray[np.int64]]:
    """Return what `convert` makes of the values of curves, (curves, given, d) for all of one length at once, as one array in
    the curves' order, and how many each has of it.
    """
    starts = np.cumsum(given) - given
    parts: dict[int, Array] = {}
    for count in np.unique(counts):
        at = counts == count
        parts[int(count)] = convert(values[starts[at, None] + np.arange(given[at][0])], int(count))
    made = np.array([parts[int(c)].shape[1] for c in counts], np.int64)
    ends = np.cumsum(made)
    out = np.empty((int(made.sum()), values.shape[1]))
    for count, own in parts.items():
        out[(ends - made)[counts == count, None] + np.arange(own.shape[1])] = own
    return out, made


def _convert(v: Array, type_: str, basis: str, wrap: str) -> tuple[Array, Array]:
    """The same for curves of one length, (curves, vertices, d)."""
    segments(v.shape[1], type_, basis, wrap)
    if type_ == "linear":
        v = np.concatenate([v, v[:, :1]], axis=1) if wrap == "periodic" else v
        return v, np.zeros((len(v), 2, v.shape[2]))
    if basis == "bezier":
        return _sampled(np.concatenate([v, v[:, :1]], axis=1) if wrap == "periodic" else v)
    if wrap == "periodic":
        v = np.concatenate([v[:, -1:], v, v[:, :2]], axis=1)
    elif wrap == "pinned":
        v = np.concatenate([2 * v[:, :1] - v[:, 1:2], v, 2 * v[:, -1:] - v[:, -2:-1]], axis=1)
    a, b, c = v[:, :-2], v[:, 1:-1], v[:, 2:]
    if basis == "bspline":
        bend = a - 2 * b + c
        return (a + 4 * b + c) / 6, bend[:, [0, -1]]
    tangent = (c - a) / 6
    bezier = np.stack([b[:, :-1], b[:, :-1] + tangent[:, :-1], b[:, 1:] - tangent[:, 1:]], axis=2)
    return _sampled(np.concatenate([bezier.reshape(len(v), -1, v.shape[2]), b[:, -1:]], axis=1))


def _sampled(v: Array) -> tuple[Array, Array]:
    """Points on chains of cubic Bezier segments, `PIECES` to a segment, and the bend at their ends."""
    p0, p1, p2, p3 = (v[:, k : v.shape[1] - 3 + k : 3][:, :, None] for k in range(4))
    t = (np.arange(PIECES) / PIECES)[None, None, :, None]
    s = 1 - t
    points = s**3 * p0 + 3 * s * s * t * p1 + 3 * s * t * t * p2 + t**3 * p3
    first = v[:, 0] - 2 * v[:, 1] + v[:, 2]
    last = v[:, -1] - 2 * v[:, -2] + v[:, -3]
    bend = 6 / PIECES**2 * np.stack([first, last], axis=1)
    return np.concatenate([points.reshape(len(v), -1, v.shape[2]), v[:, -1:]], axis=1), bend


def along_segments(values: Array, counts: NDArray[np.int64], type_: str, basis: str, wrap: str) -> Array:
    """Return values given at the ends of segments ("varying"), (n, d), at every point that `to_splines` makes of the curves.

    They run linearly along a segment. A periodic curve's last segment ends with its first value.
    """
    pieces = PIECES if type_ == "cubic" and basis != "bspline" else 1
    t = (np.arange(pieces) / pieces)[:, None]

    def convert(own: Array, count: int) -> Array:
        own = np.concatenate([own, own[:, :1]], axis=1) if wrap == "periodic" and count > 1 else own
        between = own[:, :-1, None] + t * np.diff(own, axis=1)[:, :, None]
        return np.concatenate([between.reshape(len(own), -1, own.shape[2]), own[:, -1:]], axis=1)

    counts = counts[counts > 0]
    given = np.array([varying_values(int(c), type_, basis, wrap) for c in counts], np.int64)
    return _by_length(values, counts, given, convert)[0]


def varying_values(count: int, type_: str, basis: str, wrap: str) -> int:
    """Return how many varying values a curve of that many vertices has."""
    if count < 2:
        return count
    return segments(count, type_, basis, wrap) + (wrap != "periodic")
