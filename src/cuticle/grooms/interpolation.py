"""Full hair from guides: roots over the surface that the guides' roots span, strands blended from the guides around them.

The roots are triangulated where they are: two neighbours and a root make a triangle where no other root lies in its
circumcircle within the tangent plane (Gopi et al. 2000, localised Delaunay triangulation). No parametrisation of the whole
surface is needed, so a scalp, a patch and an animal are alike.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

__all__ = ["cut", "follow_guides", "resampled", "stray", "triangulated"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_NEIGHBOURS = 20  # of a root, among which its triangles are sought
_PIECES = 4  # of a segment, straight, along which length is measured
_ALIKE, _APART = (
    0.35,
    0.65,
)  # RMS distance between two guides from their roots on, in lengths: 35° and 70° between straight ones
_CHUNK = 4096


def resampled(control: Array, offsets: Indices, points: int, linear: NDArray) -> Array:
    """Return `points` points on each cubic B-spline, at equal steps of its length: (strands, points, d + C).

    `control` and `offsets` are as `splines.to_control` returns them; the first three columns are the position. `linear`
    holds what runs linearly along each segment, at its begin and its end: (segments, 2, C), the last columns of the result.
    """
    counts = np.diff(offsets)
    segments = counts - 3
    first = np.repeat(offsets[:-1] - np.cumsum(segments) + segments, segments) + np.arange(segments.sum())
    t = (np.arange(_PIECES) / _PIECES)[:, None]
    weights = (
        np.concatenate([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 3 * (1 - t) ** 3 - 6 * (1 - t) ** 2 + 4, t**3], axis=1) / 6
    )
    fine = np.einsum("tk,ikd->itd", weights, control[first[:, None] + np.arange(4)])
    fine = np.concatenate([fine, (1 - t) * linear[:, :1] + t * linear[:, 1:]], axis=2)
    ends = (control[offsets[1:] - 3] + 4 * control[offsets[1:] - 2] + control[offsets[1:] - 1]) / 6
    ends = np.concatenate([ends, linear[np.cumsum(segments) - 1, 1]], axis=1)
    stops = np.cumsum(_PIECES * segments)
    fine = np.insert(fine.reshape(-1, fine.shape[2]), stops, ends, axis=0)
    starts = np.append(0, stops[:-1] + np.arange(1, len(stops)))
    step = np.linalg.norm(np.diff(fine[:, :3], axis=0, prepend=fine[:1, :3]), axis=1)
    step[starts] = 0
    # One rising function over all strands, with a step of one unit from strand to strand.
    along = np.cumsum(step) + np.repeat(np.arange(len(starts)), _PIECES * segments + 1)
    last = np.append(starts[1:], len(fine)) - 1
    wanted = along[starts, None] + (along[last] - along[starts])[:, None] * np.linspace(0, 1, points)
    return np.stack([np.interp(wanted, along, column) for column in fine.T], axis=2)


def triangulated(roots: Array) -> Indices:
    """Return triangles over the surface that points lie on, shape (triangles, 3), corners ascending.

    A triangle is kept where most of those of its corners find it that have the others among their nearest 20 points.
    """
    from scipy.spatial import cKDTree

    count = min(_NEIGHBOURS + 1, len(roots))
    distance, near = cKDTree(roots).query(roots, count)
    pair = np.array(list(combinations(range(1, count), 2)))
    if not len(pair):
        return np.empty((0, 3), np.int64)
    # Points on a grid have four on a circle, and both diagonals: all corners see them moved the same little way.
    moved = roots + 1e-4 * np.random.default_rng(1).standard_normal(roots.shape) * distance[:, 1:2]
    found = []
    for start in range(0, len(roots), _CHUNK):
        own = near[start : start + _CHUNK]
        around = moved[own] - moved[own[:, :1]]
        _, _, axes = np.linalg.svd(around, full_matrices=False)
        p = around @ axes[:, :2].transpose(0, 2, 1)
        square = (p**2).sum(axis=2)
        (a, b), (a2, b2) = (p[:, k] for k in pair.T), (square[:, k] for k in pair.T)
        area = 2 * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
        flat = np.abs(area) < 1e-3 * (a2 + b2)  # more than the moves make of corners on a line
        area = np.where(flat, 1, area)
        x = (b[..., 1] * a2 - a[..., 1] * b2) / area  # the circumcentre
        y = (a[..., 0] * b2 - b[..., 0] * a2) / area
        # Negative where a point is nearer to the centre than the corner in the origin; 0 for the corners themselves.
        margin = square[:, None] - 2 * (x[..., None] * p[:, None, :, 0] + y[..., None] * p[:, None, :, 1])
        empty = (margin >= -1e-9 * square.max(axis=1)[:, None, None]).all(axis=2) & ~flat
        which, at = np.nonzero(empty)
        found.append(np.stack([own[which, 0], own[which, pair[at, 0]], own[which, pair[at, 1]]], axis=1))
    unique, seen = np.unique(np.sort(np.concatenate(found), axis=1), axis=0, return_counts=True)
    others = unique[:, [[1, 2], [0, 2], [0, 1]]]
    could = (near[unique][:, :, None, :] == others[..., None]).any(axis=3).all(axis=2).sum(axis=1)
    return unique[2 * seen > could]


def _spread(roots: Array, triangles: Indices, count: int, rng: np.random.Generator) -> tuple[Indices, Array]:
    """Points evenly over triangles: the triangle of each, and barycentric weights (count, 3).

    Triangles in an order in which neighbours follow each other are stepped through by equal areas, and a sequence of low
    discrepancy (Roberts's R2) places the points within them.
    """
    from scipy.spatial import cKDTree

    corner = roots[triangles]
    order = cKDTree(corner.mean(axis=1)).indices
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)[order]
    total = np.cumsum(area)
    taken = np.searchsorted(total, (np.arange(count) + rng.random()) / count * total[-1], side="right")
    uv = (rng.random(2) + np.arange(count)[:, None] * [0.7548776662466927, 0.5698402909980532]) % 1
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
    return order[np.minimum(taken, len(area) - 1)], np.column_stack([1 - uv.sum(axis=1), uv])


def follow_guides(
    guides: Array, strands: int, *, clumping: float, frizz: float, length_variation: float, rng: np.random.Generator
) -> Array:
    """Return strands among guides, (strands, points, d); the parameters are those of `Groom.interpolated`.

    Guides have shape (guides, points, d): position, then what is blended along with it.
    """
    _, distinct = np.unique(guides[:, 0, :3], axis=0, return_index=True)
    guides = guides[distinct]
    roots = guides[:, 0, :3]
    triangles = triangulated(roots)
    if not len(triangles):
        raise ValueError(
            f"guides must have roots that span a surface, got {len(roots)} different roots that make no triangle; "
            "with_followers puts copies beside each strand"
        )
    which, weights = _spread(roots, triangles, strands, rng)
    corners = triangles[which]
    shapes = guides.copy()
    shapes[..., :3] -= roots[:, None]
    own = np.einsum("sk,skd->sd", weights, roots[corners])
    nearest = weights.argmax(axis=1)
    weights = weights * _alike(shapes[..., :3], triangles)[which, nearest]
    weights /= weights.sum(axis=1, keepdims=True)
    points = guides.shape[1]
    out = sum(weights[:, k, None, None] * shapes[corners[:, k]] for k in range(3))
    out[..., :3] += own[:, None]
    s = np.linspace(0, 1, points)[None, :, None]
    if clumping:
        guide = guides[corners[np.arange(strands), nearest], :, :3]
        out[..., :3] += clumping * s * (guide - out[..., :3])
    if frizz:
        length = np.linalg.norm(np.diff(out[..., :3], axis=1), axis=2).sum(axis=1)
        out[..., :3] += frizz * length[:, None, None] * stray(strands, points, rng)
    return cut(out, 1 - length_variation * rng.random(strands)) if length_variation else out


def _alike(shapes: Array, triangles: Indices) -> Array:
    """How far two corners of a triangle may be blended, (triangles, 3, 3): 1 for guides alike, 0 across a parting."""
    length = np.linalg.norm(np.diff(shapes, axis=1), axis=2).sum(axis=1)
    out = np.ones((len(triangles), 3, 3))
    for j, k in combinations(range(3), 2):
        a, b = triangles[:, j], triangles[:, k]
        apart = np.sqrt(((shapes[a] - shapes[b]) ** 2).sum(axis=2).mean(axis=1)) / np.maximum(length[a], length[b])
        t = np.clip((_APART - apart) / (_APART - _ALIKE), 0, 1)
        out[:, j, k] = out[:, k, j] = t * t * (3 - 2 * t)
    return out


def stray(strands: int, points: int, rng: np.random.Generator) -> Array:
    """Smooth noise along each strand, 0 at its root, of standard deviation 1 at its tip: (strands, points, 3)."""
    s = np.linspace(0, 1, points)[None, :, None]
    out = rng.standard_normal((strands, 1, 3)) * s
    for k in range(1, 4):
        out += rng.standard_normal((strands, 1, 3)) * np.sin(np.pi * k * s) / k
    return out


def cut(strands: Array, kept: Array) -> Array:
    """Return strands without their ends beyond the share `kept`, (strands,), with as many points."""
    points = strands.shape[1]
    at = np.minimum(kept[:, None] * np.arange(points), points - 1)
    before = np.minimum(at.astype(np.int64), points - 2)
    t = (at - before)[..., None]
    row = np.arange(len(strands))[:, None]
    return (1 - t) * strands[row, before] + t * strands[row, before + 1]
