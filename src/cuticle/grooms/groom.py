"""Grooms: strands of hair as points and radii, read from files and written for Mitsuba."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.files import check_size, reading, write_text
from cuticle._support.values import Value
from cuticle.grooms import attributes as named
from cuticle.grooms import interpolation, splines
from cuticle.grooms.checks import FARTHEST, check_counts, check_points, check_radius, distinct_points, kept_bend
from cuticle.scattering.table_files import write_arrays

__all__ = ["Groom", "join_grooms", "read_groom"]

MAX_FOLLOWERS = 1000
MAX_STRANDS = 10_000_000
_POSITION = np.array([1, 1, 1, 0], np.float32)  # of x y z radius


@dataclass(frozen=True, eq=False)
class Groom(Value):
    """Strands of hair, each a row of points from root to tip with a radius at every point.

    The points lie on the strand, at the knots of a uniform cubic spline: that curve, through every point, is what is
    rendered and saved. `bend` sets its ends; without it the spline is the natural one. Points and bend together determine
    the control points and are determined by them, so B-splines are read, held and saved as they are. Polylines are
    rendered as the smooth curve through their points.

    A point that repeats the one before it has no direction, so it is left out, and so is a strand of no length. A warning
    says how many. Two points repeat each other where single precision cannot hold their direction: where they are closer
    than 1.2e-7 times their largest coordinate, or 1e-18.

    Parameters
    ----------
    points
        The points of all strands one after the other, shape (N, 3).
    offsets
        The index of each strand's first point, and N at the end: increasing, shape (strands + 1,). A strand has at least 2
        points.
    radius
        Radius at each point, in the unit of the points: shape (N,), or one number.
    bend
        Second difference P[i-1] - 2 P[i] + P[i+1] of the control points (x y z radius) at each strand's first and last
        point, shape (strands, 2, 4). Default: 0, no curvature at the ends.
    attributes
        Values by name, such as melanin or roughness: one a strand, shape (strands,) or (strands, C), or one a point, (N,) or
        (N, C), with C up to 32. Between two points they run linearly. Held in single precision, read-only.

    Raises
    ------
    ValueError
        Shapes do not fit, a strand has fewer than 2 points, no strand has a length, a coordinate is not finite or beyond
        ±1e9, a radius is negative or above 1e9, or an attribute is not finite or has a name of `points` to `bend`.
    """

    points: NDArray[np.float32]
    offsets: NDArray[np.int64]
    radius: NDArray[np.float32]
    bend: NDArray[np.float32] = None  # type: ignore[assignment]
    attributes: Mapping[str, NDArray[np.float32]] = named.NONE

    def __post_init__(self) -> None:
        points = _single("points", self.points)
        offsets = validate.real("offsets", self.offsets)
        if offsets.dtype.kind == "f":
            raise TypeError(f"offsets must be whole numbers, got an array of {offsets.dtype}")
        offsets = np.array(offsets, np.int64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"points must have shape (N, 3), got {points.shape}")
        ends = offsets.ndim == 1 and len(offsets) > 1 and offsets[0] == 0 and offsets[-1] == len(points)
        if not ends or offsets.min() < 0 or offsets.max() > len(points):  # so that no difference overflows
            raise ValueError(f"offsets must run from 0 to the {len(points)} points, one more than there are strands")
        if (np.diff(offsets) < 2).any():
            short = int(np.argmax(np.diff(offsets) < 2))
            raise ValueError(f"a strand must have at least 2 points, strand {short} has {int(np.diff(offsets)[short])}")
        radius = _single("radius", self.radius)
        if radius.shape not in ((), (1,), (len(points),)):
            raise ValueError(
                f"radius must have shape ({len(points)},), one value a point, or be one number; got {radius.shape}:"
                " np.repeat(radius, counts) gives each point its strand's"
            )
        radius = np.array(np.broadcast_to(radius, len(points)))
        check_points(points)
        strands = len(offsets) - 1
        bend = np.zeros((strands, 2, 4), np.float32) if self.bend is None else _single("bend", self.bend)
        if bend.shape != (strands, 2, 4):
            raise ValueError(f"bend must have shape ({strands}, 2, 4), got {bend.shape}")
        if not (np.abs(bend) <= 4 * FARTHEST).all():
            raise ValueError(f"bend must be finite numbers within ±{4 * FARTHEST:g}, got {np.abs(bend).max():g}")
        check_radius(radius)
        attributes = named.checked(self.attributes, strands, len(points))
        keep, kept, left_out = distinct_points(points, np.diff(offsets))
        if left_out:
            warnings.warn(f"groom: left out {left_out}", stacklevel=3)
            points, radius, offsets = points[keep], radius[keep], np.append(0, np.cumsum(kept[kept > 0]))
            bend = kept_bend(bend, np.diff(self.offsets), kept)
            attributes = named.chosen(attributes, kept > 0, keep)
        for name, value in (("points", points), ("offsets", offsets), ("radius", radius), ("bend", bend)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "attributes", attributes)

    def __repr__(self) -> str:
        low, high = self.bounds
        size = " x ".join(f"{x:.3g}" for x in high - low)
        said = f"{self.strands:,} strands, {len(self.points):,} points, {size}, radius {self.radius.max():.3g}"
        return f"Groom({', '.join([said, *self.attributes])})"

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
        bend = self.bend * _POSITION
        return replace(self, radius=(root + (tip - root) * self.along()).astype(np.float32), bend=bend)

    def with_attributes(self, /, **values: ArrayLike | None) -> Groom:
        """Return the groom with these attributes beside its own; a number is every strand's, None takes a name out.

        >>> from cuticle.grooms.procedural import wavy_lock
        >>> wavy_lock(10).with_attributes(eumelanin=1.3, beta_m=np.linspace(0.2, 0.4, 10)).attributes["eumelanin"].shape
        (10,)
        """
        found: dict[str, Any] = {n: v for n, v in self.attributes.items() if n not in values}
        for name, value in values.items():
            if value is not None:
                found[name] = np.full(self.strands, value) if np.ndim(value) == 0 else value
        return replace(self, attributes=found)

    def on_segments(self, name: str) -> NDArray[np.float32]:
        """Return an attribute at the begin and the end of each curve segment of the file that `save` writes for Mitsuba.

        A row is what `prim_index` of a hit on that file's `bsplinecurve` counts; between its two values they run linearly in
        the segment's parameter. A strand of n points has n - 1 segments. The last row belongs to the strand of radius 0 at
        the file's end, and repeats the last value.

        Returns
        -------
        NDArray
            Shape (N - strands + 1, 2, C), single precision; C is 1 for an attribute with a number a strand or a point.

        Raises
        ------
        ValueError
            The groom has no attribute of this name.
        """
        if name not in self.attributes:
            raise ValueError(f"the groom has no attribute {name!r}; it has {', '.join(self.attributes) or 'none'}")
        own = named.on_segments(self.attributes[name], self.offsets)
        return np.append(own, np.repeat(own[-1:, 1:], 2, axis=1), axis=0)

    def with_followers(self, count: int, spread: float, *, tip_spread: float | None = None, seed: int = 1) -> Groom:
        """Return the groom with `count` copies of each strand beside it, which have its attributes.

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
        rng = validate.random_numbers(seed)
        width = (spread + (tip_spread - spread) * self.along())[:, None]
        parts = [self.points]
        for _ in range(count):
            shift = np.repeat(rng.standard_normal((self.strands, 3)), self.counts, axis=0)
            parts.append((self.points + width * shift).astype(np.float32))
        starts = [self.offsets[:-1] + k * len(self.points) for k in range(count + 1)]
        offsets = np.append(np.concatenate(starts), len(self.points) * (count + 1))
        radius, bend = np.tile(self.radius, count + 1), np.tile(self.bend, (count + 1, 1, 1))
        return Groom(np.concatenate(parts), offsets, radius, bend, named.tiled(self.attributes, count + 1))

    def interpolated(
        self,
        strands: int,
        *,
        points: int | None = None,
        clumping: float = 0.0,
        frizz: float = 0.0,
        length_variation: float = 0.0,
        seed: int = 1,
    ) -> Groom:
        """Return full hair: `strands` strands between the groom's own, which are its guides and are not among them.

        Roots are spread evenly over the surface that the guides' roots span. A strand is the barycentric mean of the three
        guides around its root, point by point at equal shares of their lengths. Across a parting, where guides diverge by
        35° to 70° and more, it follows the nearest alone. Attributes are blended as points are.

        Parameters
        ----------
        strands
            Number of strands, 1 to 10 million.
        points
            Points of each, 2 to 1024, at equal steps along it. Default: those of the guide that has most.
        clumping
            How far a tip is drawn to the nearest guide's, linearly from the root: 0 to 1.
        frizz
            Standard deviation of a tip's offset by smooth noise, in lengths of the strand: 0 to 1.
        length_variation
            Strands are cut by random shares of their length up to this: 0 to 0.9.
        seed
            Seed of everything random.

        Raises
        ------
        ValueError
            The guides' roots span no surface: fewer than three of them differ, or all lie on a line. The hair needs over
            2 GB, without `cuticle.allow_large()`.
        """
        strands = validate.integer("strands", strands, 1, MAX_STRANDS)
        points = min(int(self.counts.max()), 1024) if points is None else validate.integer("points", points, 2, 1024)
        columns = named.columns(self.attributes, self.counts)
        check_size(strands * points * (4 + columns.shape[1]) * 8, f"hair of {strands:,} strands with {points} points each")
        made = interpolation.follow_guides(
            interpolation.resampled(*self.control_points(), points, named.on_segments(columns, self.offsets)),
            strands,
            clumping=validate.number("clumping", clumping, 0, 1),
            frizz=validate.number("frizz", frizz, 0, 1),
            length_variation=validate.number("length_variation", length_variation, 0, 0.9),
            rng=validate.random_numbers(seed),
        )
        shape = made[..., :4].reshape(-1, 4).astype(np.float32)
        attributes = named.of_columns(made[..., 4:], self.attributes, self.strands)
        return Groom(shape[:, :3], np.arange(strands + 1) * points, np.maximum(shape[:, 3], 0), attributes=attributes)

    def control_points(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the control points of uniform cubic B-splines that pass through every point.

        The splines have no curvature at their ends but `bend`.

        Returns
        -------
        control, offsets
            Positions and radii, shape (N + 2 strands, 4), and the index of each strand's first control point.
        """
        control, offsets = splines.to_control(np.column_stack([self.points, self.radius]), self.offsets, self.bend)
        # A radius that swings below 0 between two points would turn the tube inside out.
        control[:, 3] = np.maximum(control[:, 3], 0)
        return control, offsets

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the text file of Mitsuba's `bsplinecurve`: one line `x y z radius` per control point, a blank line between
        strands. `read_groom` reads the same groom back, to single precision, without its attributes. A path that ends in
        .npz gets NumPy arrays instead, all that the groom holds, which are read back bit for bit; one that ends as another
        hair format does is refused.

        The curves pass through the groom's points. A radius whose spline would swing below 0 is cut off there. A strand of
        radius 0, which no ray hits, is added at the end: Mitsuba 3.9 reads out of bounds where a ray hits the tip of the
        last curve. `read_groom` drops that strand.
        """
        if Path(path).suffix.lower() == ".npz":
            own = {n: getattr(self, n) for n in ("points", "offsets", "radius", "bend")}
            names = own.keys() | self.attributes.keys()
            twin = next((n for n in self.attributes if n.endswith(".npy") and n[:-4] in names), None)
            if twin is not None:
                raise ValueError(
                    f"NumPy takes {twin!r} and {twin[:-4]!r} for one name in an .npz file; rename either attribute"
                )
            write_arrays(path, own | dict(self.attributes))
            return
        from cuticle.grooms.readers import TEXT, format_of

        if other := format_of(path, but=TEXT):
            raise ValueError(
                f"{path}: a groom is written as .npz or as Mitsuba's text, not as {other}, which this ending is read as; end"
                f" the name in .npz or {TEXT[0]}"
            )
        control, offsets = self.control_points()
        guard = np.column_stack([np.linspace(control[-2, :3], control[-1, :3], 4), np.zeros(4)])
        control, offsets = np.concatenate([control, guard]), np.append(offsets, len(control) + 4)
        # One format for the whole file: a row at a time takes ten times as long.
        rows = np.full(len(control), "%.9g %.9g %.9g %.9g\n", object)
        rows[offsets[1:-1] - 1] += "\n"
        write_text(path, "".join(rows.tolist()) % tuple(control.ravel().tolist()))


def checked_groom(name: str, value: Any) -> Groom:
    """Return `value` if it is a `Groom`, or raise TypeError."""
    if not isinstance(value, Groom):
        raise TypeError(
            f"{name} must be a cuticle.grooms.groom.Groom, got {type(value).__name__}; read_groom reads one from a file"
        )
    return value


def _single(name: str, value: ArrayLike) -> NDArray[np.float32]:
    """A copy in single precision; what is too large for it becomes infinite, which is refused."""
    with np.errstate(over="ignore"):
        return np.array(validate.real(name, value), np.float32)


def join_grooms(grooms: Sequence[Groom]) -> Groom:
    """Return one groom with the strands of all grooms. Hairstyles often come in several files.

    An attribute that not all have, with as many channels, is left out, and a warning names it: no number stands for a strand
    without a value. `with_attributes` gives the others one before.
    """
    if not grooms:
        raise ValueError("grooms must hold at least one groom, got none")
    for k, groom in enumerate(grooms):
        checked_groom(f"grooms[{k}]", groom)
    starts = np.cumsum([0, *(len(g.points) for g in grooms)])
    offsets = np.append(np.concatenate([g.offsets[:-1] + s for g, s in zip(grooms, starts, strict=False)]), starts[-1])
    points, radius, bend = (np.concatenate([getattr(g, name) for g in grooms]) for name in ("points", "radius", "bend"))
    names = [f"groom {k}" for k in range(len(grooms))]
    attributes, lost = named.joined([g.attributes for g in grooms], [g.counts for g in grooms], names)
    if lost:
        warnings.warn(f"join_grooms: {named.note(lost)[0]}; with_attributes gives it to all", stacklevel=2)
    return Groom(points, offsets, radius, bend, attributes)


def read_groom(path: str | os.PathLike[str], *, radius: float | None = None, frame: float | None = None) -> Groom:
    """Read a hair file; the file's ending selects the reader in `cuticle.grooms.readers.READERS`.

    Repeated points, strands of no length and strands of no width are left out. A warning says how many, and names what of
    the file's attributes a groom cannot carry.

    Parameters
    ----------
    path
        The file.
    radius
        Radius of all strands, in the file's unit. Overrides the file. A file without radii gets 1/4000 of the diagonal of
        its bounding box.
    frame
        The time to read a scene's file at: USD at a time code, between its samples; Alembic in seconds, the sample nearest
        to it. Default: the first.

    Raises
    ------
    ValueError
        An unknown ending; a file that cannot be read, is cut short, or contradicts its own header. The message names the
        byte and the reason.
    """
    from cuticle.grooms import readers

    if radius is not None:
        radius = validate.number("radius", radius, 0, 1e6, above=True)
    if frame is not None:
        frame = validate.number("frame", frame, -1e9, 1e9)
    with reading(path, "groom"):
        points, counts, found, bend, notes, given = readers.read(path, frame)
        check_counts(counts, len(points))
        attributes, lost = named.readable(given, len(counts), len(points))
        with np.errstate(over="ignore"):  # what is too large for single precision is refused
            points = points.astype(np.float32)
        if radius is not None:
            found = None
        if found is not None:
            check_radius(found)
        check_points(points)
        keep, kept, left_out = distinct_points(points, counts)
        bend = kept_bend(np.zeros((len(counts), 2, 4), np.float32) if bend is None else bend, counts, kept)
        points, counts, attributes = points[keep], kept[kept > 0], named.chosen(attributes, kept > 0, keep)
        if found is not None:
            found = found[keep]
            wide = np.maximum.reduceat(found, np.cumsum(counts) - counts) > 0
            if not wide.any():
                raise ValueError("no strand has a radius above 0")
            if not wide.all():
                left_out = " and ".join(filter(None, [left_out, f"{(~wide).sum():,} strand(s) of no width"]))
            keep = np.repeat(wide, counts)
            attributes = named.chosen(attributes, wide, keep)
            points, found, counts, bend = points[keep], found[keep], counts[wide], bend[wide]
        if found is None:
            found = np.float32(default_radius(points) if radius is None else radius)
            bend = bend * _POSITION
        groom = Groom(points, np.append(0, np.cumsum(counts)), found, bend, attributes)
    notes = (*notes, *named.note(lost), *[f"left out {left_out}"] * bool(left_out))
    if notes:
        warnings.warn(f"{path}: {'; '.join(notes)}", stacklevel=2)
    return groom


def default_radius(points: NDArray) -> float:
    """Return the radius of strands whose file has none: 1/4000 of the diagonal of the box around their points."""
    return float(np.linalg.norm(points.max(axis=0).astype(np.float64) - points.min(axis=0))) / 4000
