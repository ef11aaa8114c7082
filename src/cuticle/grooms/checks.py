"""What the points, radii and strands of a groom may be, and what is left out of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FARTHEST = 1e9  # the largest coordinate and radius: single precision squares lengths up to 1.8e19, and cubes of cells less
_CLOSEST = 1e-18  # the square of a shorter step is 0 in single precision, and so is its direction


def check_points(points: NDArray[np.float32]) -> None:
    """Raise ValueError unless all points are finite and near enough."""
    right = (np.abs(points) <= FARTHEST).all(axis=1)
    if not right.all():
        at = int(np.argmin(right))
        said = "scale the groom" if np.isfinite(points[at]).all() else "mend or leave out its strand"
        raise ValueError(f"points must be finite numbers within ±{FARTHEST:g}, point {at} is {points[at].tolist()}; {said}")


def check_counts(counts: NDArray[np.int64], points: int) -> None:
    """Raise ValueError unless the strands' numbers of points sum to all points."""
    # Each is looked at before their sum: a sum beyond int64 wraps round, and NumPy repeats by it without a check.
    if not len(counts) or counts.min() < 0 or counts.max() > points or counts.sum() != points:
        most = f", {int(counts.max())} for one strand" if len(counts) else ""
        raise ValueError(f"its strands must have the {points} points that it holds, they have {sum(counts.tolist())}{most}")


def check_radius(radius: NDArray) -> None:
    """Raise ValueError unless all radii are finite, at least 0 and small enough."""
    right = (radius >= 0) & (radius <= FARTHEST)
    if not right.all():
        at = int(np.argmin(right))
        raise ValueError(
            f"radius must be finite and at least 0 everywhere, and at most {FARTHEST:g}; point {at} has {radius[at]:g}"
        )


def kept_bend(bend: NDArray[np.float32], counts: NDArray[np.int64], kept: NDArray[np.int64]) -> NDArray[np.float32]:
    """The bend of the strands that are kept. One that loses points has other knots, for which it does not hold."""
    return np.where((kept == counts)[:, None, None], bend, 0)[kept > 0]


def distinct_points(
    points: NDArray[np.float32], counts: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.int64], str]:
    """Return which points differ from the one before them on their strand, and what is left without the others.

    Returns
    -------
    keep
        The points to keep, shape (N,).
    kept
        The number of points that each strand keeps, shape (strands,): 0 for a strand of no length.
    left_out
        What is left out, in words; empty where all is kept.

    Raises
    ------
    ValueError
        No strand has a length.
    """
    strand = np.repeat(np.arange(len(counts)), counts)
    step = np.abs(np.diff(points, axis=0)).max(axis=1, initial=0)
    size = np.abs(points).max(axis=1, initial=0)
    least = np.maximum(np.finfo(np.float32).eps * np.maximum(size[1:], size[:-1]), _CLOSEST)
    keep = np.ones(len(points), bool)
    keep[1:] = (step > least) | (strand[1:] != strand[:-1])
    kept = np.bincount(strand[keep], minlength=len(counts))
    short = kept == 1
    if (kept < 2).all():
        raise ValueError("no strand has 2 points that differ")
    repeated, pointlike = int((counts - kept)[~short].sum()), int(short.sum())
    keep &= ~short[strand]
    said = [
        f"{n:,} {what}{'s' * (n > 1)}{rest}"
        for n, what, rest in ((repeated, "repeated point", ""), (pointlike, "strand", " of no length"))
        if n
    ]
    return keep, np.where(short, 0, kept), " and ".join(said)
