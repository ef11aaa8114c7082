"""Grooms: strands of hair as points and radii, read from files and written for Mitsuba."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_banded

from cuticle._support import validate
from cuticle._support.files import reading, write_text

__all__ = ["Groom", "join_grooms", "read_groom"]

MAX_FOLLOWERS = 1000


@dataclass(frozen=True, eq=False)
class Groom:
    """Strands of hair, each a row of points from root to tip with a radius at every point.

    Parameters
    ----------
    points
        The points of all strands one after the other, shape (N, 3).
    offsets
        The index of each strand's first point, and N at the end: increasing, shape (strands + 1,). A strand has at least 2
        points.
    radius
        Radius at each point, in the unit of the points: shape (N,), or one number.

    Raises
    ------
    ValueError
        Shapes do not fit, a strand has fewer than 2 points, a coordinate is not finite, or a radius is negative.
    """

    points: NDArray[np.float32]
    offsets: NDArray[np.int64]
    radius: NDArray[np.float32]

    def __post_init__(self) -> None:
        points = np.array(self.points, np.float32)
        offsets = np.array(self.offsets, np.int64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"points must have shape (N, 3), got {points.shape}")
        if offsets.ndim != 1 or len(offsets) < 2 or offsets[0] != 0 or offsets[-1] != len(points):
            raise ValueError(f"offsets must run from 0 to the {len(points)} points, one more than there are strands")
        if (np.diff(offsets) < 2).any():
            short = int(np.argmax(np.diff(offsets) < 2))
            raise ValueError(f"a strand must have at least 2 points, strand {short} has {int(np.diff(offsets)[short])}")
        radius = np.array(np.broadcast_to(np.asarray(self.radius, np.float32), len(points)))
        if not np.isfinite(points).all():
            at = int(np.argmin(np.isfinite(points).all(axis=1)))
            raise ValueError(f"points must be finite numbers, point {at} is {points[at].tolist()}")
        if not (np.isfinite(radius).all() and (radius >= 0).all()):
            raise ValueError("radius must be finite and at least 0 everywhere")
        for name, value in (("points", points), ("offsets", offsets), ("radius", radius)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        low, high = self.bounds
        size = " x ".join(f"{x:.3g}" for x in high - low)
        return f"Groom({self.strands:,} strands, {len(self.points):,} points, {size}, radius {self.radius.max():.3g})"

    @property
    def strands(self) -> int:
        """Number of strands."""
        return len(self.offsets) - 1

    @property
    def counts(self) -> NDArray[np.int64]:
        """Points of each strand, shape (strands,)."""
        return np.diff(self.offsets)

    @property
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lower and upper corner of the box around all points."""
        return self.points.min(axis=0), self.points.max(axis=0)

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Length of each strand along its points, shape (strands,)."""
        steps = np.linalg.norm(np.diff(self.points.astype(np.float64), axis=0), axis=1)
        within = np.append(steps, 0.0)
        within[self.offsets[1:] - 1] = 0
        return np.add.reduceat(within, self.offsets[:-1])

    def along(self) -> NDArray[np.float64]:
        """Return the position of each point on its strand, by index: 0 at the root, 1 at the tip."""
        index = np.arange(len(self.points)) - np.repeat(self.offsets[:-1], self.counts)
        return index / np.repeat(self.counts - 1, self.counts)

    def with_thickness(self, root: float, tip: float | None = None) -> Groom:
        """Return the groom with radii that vary linearly from `root` to `tip` (default: `root`) along each strand."""
        root = validate.number("root", root, 0, 1e6)
        tip = root if tip is None else validate.number("tip", tip, 0, 1e6)
        return replace(self, radius=(root + (tip - root) * self.along()).astype(np.float32))

    def with_followers(self, count: int, spread: float, *, tip_spread: float | None = None, seed: int = 1) -> Groom:
        """Return the groom with `count` copies of each strand beside it.

        Parameters
        ----------
        count
            Copies of each strand, 0 to 1000.
        spread
            Standard deviation of a copy's offset at the root, in the points' unit.
        tip_spread
            The same at the tip; linear between. Default: `spread`.
        seed
            Seed of the random offsets.
        """
        count = validate.integer("count", count, 0, MAX_FOLLOWERS)
        spread = validate.number("spread", spread, 0, 1e6)
        tip_spread = spread if tip_spread is None else validate.number("tip_spread", tip_spread, 0, 1e6)
        rng = np.random.default_rng(seed)
        width = (spread + (tip_spread - spread) * self.along())[:, None]
        parts = [self.points]
        for _ in range(count):
            shift = np.repeat(rng.standard_normal((self.strands, 3)), self.counts, axis=0)
            parts.append((self.points + width * shift).astype(np.float32))
        starts = [self.offsets[:-1] + k * len(self.points) for k in range(count + 1)]
        offsets = np.append(np.concatenate(starts), len(self.points) * (count + 1))
        return Groom(np.concatenate(parts), offsets, np.tile(self.radius, count + 1))

    def control_points(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the control points of uniform cubic B-splines that pass through every point.

        At its knots, a B-spline with control points P passes through (P[i-1] + 4 P[i] + P[i+1])/6. The ends have no
        curvature. All strands form one tridiagonal system.

        Returns
        -------
        control, offsets
            Positions and radii, shape (N + 2 strands, 4), and the index of each strand's first control point.
        """
        n = len(self.points)
        values = np.column_stack([self.points, self.radius]).astype(np.float64)
        ends = np.zeros(n, bool)
        ends[self.offsets[:-1]] = ends[self.offsets[1:] - 1] = True
        bands = np.zeros((3, n))
        bands[1] = np.where(ends, 1, 4 / 6)
        bands[0, 1:] = np.where(ends[:-1], 0, 1 / 6)  # the upper diagonal: row i, column i + 1
        bands[2, :-1] = np.where(ends[1:], 0, 1 / 6)
        inner = solve_banded((1, 1), bands, values)
        offsets = self.offsets + 2 * np.arange(self.strands + 1)
        control = np.empty((n + 2 * self.strands, 4))
        control[np.arange(n) + 2 * np.repeat(np.arange(self.strands), self.counts) + 1] = inner
        first, last = offsets[:-1], offsets[1:] - 1
        control[first] = 2 * control[first + 1] - control[first + 2]
        control[last] = 2 * control[last - 1] - control[last - 2]
        # A radius that swings below 0 between two points would turn the tube inside out.
        control[:, 3] = np.maximum(control[:, 3], 0)
        return control, offsets

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the text file of Mitsuba's `bsplinecurve`: one line `x y z radius` per point, a blank line between strands.

        The curves pass through the groom's points. A strand of radius 0, which no ray hits, is added at the end: Mitsuba 3.9
        reads out of bounds where a ray hits the tip of the last curve. `read_groom` drops that strand.
        """
        control, offsets = self.control_points()
        guard = np.column_stack([np.linspace(control[-2, :3], control[-1, :3], 4), np.zeros(4)])
        control, offsets = np.concatenate([control, guard]), np.append(offsets, len(control) + 4)
        # One format for the whole file: a row at a time takes ten times as long.
        rows = np.full(len(control), "%.7g %.7g %.7g %.7g\n", object)
        rows[offsets[1:-1] - 1] += "\n"
        write_text(path, "".join(rows.tolist()) % tuple(control.ravel().tolist()))


def join_grooms(grooms: Sequence[Groom]) -> Groom:
    """Return one groom with the strands of all grooms. Hairstyles often come in several files."""
    if not grooms:
        raise ValueError("grooms must hold at least one groom, got none")
    starts = np.cumsum([0, *(len(g.points) for g in grooms)])
    offsets = np.append(np.concatenate([g.offsets[:-1] + s for g, s in zip(grooms, starts, strict=False)]), starts[-1])
    return Groom(np.concatenate([g.points for g in grooms]), offsets, np.concatenate([g.radius for g in grooms]))


def read_groom(path: str | os.PathLike[str], *, radius: float | None = None) -> Groom:
    """Read a hair file; the file's ending selects the reader in `cuticle.grooms.readers.READERS`.

    Strands of one point, and strands without width, are dropped.

    Parameters
    ----------
    path
        The file.
    radius
        Radius of all strands, in the file's unit. Overrides the file. A file without radii gets 1/4000 of the diagonal of
        its bounding box.

    Raises
    ------
    ValueError
        An unknown ending; a file that cannot be read, is cut short, or contradicts its own header. The message names the
        byte and the reason.
    """
    from cuticle.grooms import readers

    if radius is not None:
        radius = validate.number("radius", radius, 0, 1e6, above=True)
    with reading(path, "groom"):
        points, counts, found = readers.read(path)
    keep = counts >= 2  # a strand of one point is no curve
    if not keep.any():
        raise ValueError(f"{path}: no strand has 2 points or more")
    if found is not None:
        keep &= np.maximum.reduceat(found, np.concatenate([[0], np.cumsum(counts)[:-1]])) > 0  # nor is one of no width
        if not keep.any():
            raise ValueError(f"{path}: no strand has a radius above 0")
    kept = np.repeat(keep, counts)
    points, counts = points[kept], counts[keep]
    if not np.isfinite(points).all():
        at = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise ValueError(f"{path}: point {at} is {points[at].tolist()}, not a position")
    values: ArrayLike
    if radius is not None:
        values = radius
    elif found is not None:
        values = found[kept]
    else:
        values = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0))) / 4000
    try:
        return Groom(points, np.concatenate([[0], np.cumsum(counts)]), np.asarray(values, np.float32))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
