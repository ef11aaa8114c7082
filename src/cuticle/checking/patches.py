"""Whether a file's samples follow their pdf, by counting them in patches of the sphere.

A file has no pdf between its samples. But samples that are drawn from a pdf p, and then kept with probability c/p, are
uniform: of n samples, the number kept in a patch of solid angle Ω where p is at least c is binomial with mean n c Ω. Its
tails are exact, however few samples a patch has. Where p may be below c, that mean is an upper bound.

One half of the samples places the patches and chooses each one's c; the other half is counted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtr, bdtrc, betainc

from cuticle.checking.chi_square import chi_square
from cuticle.checking.tests import LEAST_DIRECTIONS

Array = NDArray[np.float64]
_LEAF = 40  # samples of the first half in a patch, up to twice as many
_SPREAD = 0.7  # standard deviation of 1/pdf over its mean, up to which the smallest pdf seen stands for the smallest
_REST = 0.1  # quantile of the pdfs seen that stands for c in other patches
_BANDS = 12
_LEAST_PDF = 1e-150  # 1/sr: its inverse and the square of that are numbers


class Fit(NamedTuple):
    """How well samples follow their pdf: the first fields of `ViewerOfFile` behind the name."""

    p_value: float  # of all tests together
    difference: str  # the least likely one in words
    patches: int  # counted on both sides
    left_out: int  # others: there may only be too many
    tested: float  # share of the samples that lie in the former


class _Patch(NamedTuple):
    expected: float  # samples kept: their mean, or an upper bound of it
    kept: int  # each sample at most once
    counted: int  # those of pdf c/2 twice, and so on: its mean is `expected` wherever p is above 0
    whole: bool  # whether p hardly varies, and is above 0 everywhere
    drawn: int  # samples of the second half


def follows(theta: Array, phi: Array, pdf: Array, asked: int, rng: np.random.Generator) -> Fit:
    """Test directions (radians) against their pdf (1/sr); `asked` counts those that gave no direction, too."""
    smallest = _smallest_pdf(pdf, asked)
    if len(pdf) < LEAST_DIRECTIONS:
        return Fit(*smallest, 0, 0, 0.0)
    x, y = np.sin(theta), phi  # equal areas are equal solid angles
    first, second = np.array_split(rng.permutation(len(pdf)), 2)
    n = len(second)
    tree = _Tree(x, y, np.clip(pdf, _LEAST_PDF, 1 / _LEAST_PDF), n * asked / len(pdf), rng)
    tree.split(np.array([-1.0, 1, -np.pi, np.pi]), first, second, 0)
    expected, kept, counted, whole, drawn = (np.array(column) for column in zip(*tree.patches, strict=True))
    middle = np.array([[(b[0] + b[1]) / 2, (b[2] + b[3]) / 2] for b in tree.boxes])
    bands = [np.array_split(np.argsort(axis), min(_BANDS, len(axis))) for axis in middle.T]
    found = [smallest, tree.least_likely("many", kept, expected, n, bands)]
    if whole.any():
        few = np.where(whole, counted, 0), np.where(whole, expected, 0.0)
        found.append(tree.least_likely("few", *few, n, bands))
        every = (np.append(values[whole], max(n - values.sum(), 1e-9)) for values in few)  # the last: all the rest
        found.append((chi_square(*every).p_value, min(found[1:])[1]))
    p, where = min(found)
    return Fit(min(1.0, len(found) * p), where, int(whole.sum()), int((~whole).sum()), float(drawn[whole].sum()) / n)


class _Tree:
    """The sphere, halved at the median of the first half's samples until few are left in a patch."""

    def __init__(self, x: Array, y: Array, pdf: Array, asked: float, rng: np.random.Generator) -> None:
        self.x, self.y, self.pdf, self.asked, self.rng = x, y, pdf, asked, rng  # asked: in the second half
        self.patches: list[_Patch] = []
        self.boxes: list[Array] = []
        self.nodes: list[tuple[int, int, int, Array]] = []  # depth, its patches' first and last + 1, the box

    def split(self, box: Array, first: NDArray[np.intp], second: NDArray[np.intp], depth: int) -> None:
        """Split a box with these samples of both halves, and gather its patches."""
        start = len(self.patches)
        halves = self._halves(first, second) if len(first) >= 2 * _LEAF else None
        if halves is None:
            self.patches.append(self._patch(box, first, second))
            self.boxes.append(box)
        else:
            axis, at, below = halves
            lower, upper = box.copy(), box.copy()
            lower[axis + 1] = upper[axis] = at
            self.split(lower, first[below[0]], second[below[1]], depth + 1)
            self.split(upper, first[~below[0]], second[~below[1]], depth + 1)
        self.nodes.append((depth, start, len(self.patches), box))

    def _halves(self, first: NDArray[np.intp], second: NDArray[np.intp]) -> tuple[int, float, list[Any]] | None:
        """The axis and the value that halve the first samples, and which of both lie below; None where many are one."""
        axis, values = (0, self.x) if np.ptp(self.x[first]) * np.pi > np.ptp(self.y[first]) else (2, self.y)
        at = float(np.median(values[first]))
        below = [values[part] < at for part in (first, second)]
        return (axis, at, below) if below[0].any() else None

    def _patch(self, box: Array, first: NDArray[np.intp], second: NDArray[np.intp]) -> _Patch:
        inverse = 1 / self.pdf[first]
        whole = bool(inverse.std() <= _SPREAD * inverse.mean()) and _covers(box, self.x[first], self.y[first], inverse)
        least = float(self.pdf[first].min() if whole else np.quantile(self.pdf[first], _REST))
        weight = np.minimum(least / self.pdf[second], 1e9)
        counted = np.floor(weight + self.rng.random(len(second)))
        expected = self.asked * least * float((box[1] - box[0]) * (box[3] - box[2]))
        return _Patch(expected, int((counted > 0).sum()), int(counted.sum()), whole, len(second))

    def least_likely(self, side: str, counts: Array, expected: Array, n: int, bands: list[Any]) -> tuple[float, str]:
        """Return the p-value of the least likely sum of counts, on one side, and it in words.

        The sums are those over each node of the tree and over bands. Depths and axes of bands share the level equally.
        """

        def tail(k: Array, mean: Array) -> Array:
            q = np.minimum(mean / n, 1)
            return np.where(k > 0, bdtrc(k - 1, n, q), 1.0) if side == "many" else bdtr(np.minimum(k, n), n, q)

        sums = [np.concatenate([[0], np.cumsum(values)]) for values in (counts, expected)]
        depth, start, stop = (np.array(column) for column in list(zip(*self.nodes, strict=True))[:3])
        k, mean = (total[stop] - total[start] for total in sums)
        p = tail(k, mean) * np.bincount(depth)[depth]
        worst = int(np.argmin(p))
        smallest = [float(p[worst])]
        for groups in bands:
            of_each = (np.array([values[group].sum() for group in groups]) for values in (counts, expected))
            smallest.append(len(groups) * float(tail(*of_each).min()))
        both = min(1.0, (depth.max() + len(smallest)) * min(smallest))
        return both, _words(self.nodes[worst][3], side, k[worst] / max(mean[worst], 1e-300) - 1)


def _covers(box: Array, x: Array, y: Array, inverse: Array) -> bool:
    """Whether the support seems to go on to all sides of a box, and nothing within it to have been missed."""
    a, b = (x - box[0]) / (box[1] - box[0]), (y - box[2]) / (box[3] - box[2])
    gap = max(a.min(), 1 - a.max(), b.min(), 1 - b.max())
    # Σ 1/pdf is each quarter's area on average; a deviation is about √(3/16 n).
    quarters = np.bincount(2 * (a > 0.5) + (b > 0.5), inverse, 4) / inverse.sum()
    return bool(gap <= 4 / len(x) and quarters.min() > 0.25 - 0.75 / np.sqrt(len(x)))


def _words(box: Array, side: str, off: float) -> str:
    t, p = np.degrees(np.arcsin(box[:2])), np.degrees(box[2:])
    return (
        f"too {side} samples for their pdf, by {100 * abs(off):.2g} %, where asin(y) is {t[0]:.0f}° to"
        f" {t[1]:.0f}° and atan2(z, x) {p[0]:.0f}° to {p[1]:.0f}°"
    )


def _smallest_pdf(pdf: Array, asked: int) -> tuple[float, str]:
    """Return the p-value of the smallest pdfs, and them in words.

    A sample has a pdf of at most t with probability ∫ pdf over where it is, at most 4π t: the k-th smallest of n pdfs times
    4π is, in distribution, no less than the k-th smallest of n uniform numbers.
    """
    ranks = 2 ** np.arange(int(np.log2(max(len(pdf), 1))) + 1)
    ranks = ranks[ranks <= len(pdf)]
    if not len(ranks):
        return 1.0, "nothing to test"
    smallest = np.sort(pdf)[ranks - 1]
    p = len(ranks) * betainc(ranks, asked - ranks + 1, np.minimum(4 * np.pi * smallest, 1))
    worst = int(np.argmin(p))
    return min(
        1.0, float(p[worst])
    ), f"{ranks[worst]:,} of {asked:,} samples have a pdf of at most {smallest[worst]:.2g} 1/sr"
