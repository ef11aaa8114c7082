"""Audit a file of samples: the directions, pdfs and weights that any renderer wrote.

A file has no pdf between its samples, so the test is inverted: if samples are drawn from the pdf, then Σ 1/pdf over those in
a patch of the sphere, over the number of all samples, is on average the patch's solid angle.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, chdtrc, ndtr

from cuticle._support import validate
from cuticle._support.files import reading
from cuticle.checking.measurements import RowsOfFile, ViewerOfFile
from cuticle.checking.regions import repeated_angles
from cuticle.checking.tests import ATOM, TESTS
from cuticle.checking.verdicts import LIMITS, Judge, Judged, Thresholds, Verdict, deviations, sidak
from cuticle.scattering.bcsdf import luminance
from cuticle.scattering.table_files import read_arrays, read_rows

Array = NDArray[np.float64]
LEAST_ROWS = 5_000
_LEAF = 300  # samples of the first half in a patch
_SPREAD = 1.0  # standard deviation of 1/pdf over its mean, beyond which the mean over a patch is not normal
_KEPT = 0.9  # share of a patch's samples, those of larger pdf, that are summed where 1/pdf varies too much
_GROUPS = 12  # bands of patches
_HELP = "it needs direction (n, 3) and pdf (n,), and may have weight (n,) or (n, channels), and viewer (n,)"


@dataclass(frozen=True, eq=False)
class Dump(Judged):
    """The result of the audit of a file of samples."""

    name: str
    rows: int
    viewers: int
    patches: int  # tested
    left_out: int  # patches at the edge of the support, or within which the pdf varies too much
    p_value: float
    mean_weight: float  # over all rows
    error: float  # its standard error
    ess: float  # (Σ w)²/(n Σ w²), an estimate from these rows
    largest_weight: float
    verdicts: tuple[Verdict, ...]
    notes: tuple[str, ...]
    level: float

    def __repr__(self) -> str:
        counts = f"{self.rows:,} rows, {self.viewers} viewers, {self.patches} patches tested, {self.left_out} left out"
        return self._summary(f"{self.name}; {counts}")


def audit_dump(path: str | os.PathLike[str], *, level: float = 1e-4, seed: int = 1) -> Dump:
    """Audit samples in an .npz or CSV file.

    Parameters
    ----------
    path
        An .npz with `direction` (n, 3), all in one frame, and `pdf` (n,) per steradian; optional are `weight`, (n,) or
        (n, channels), and `viewer` (n,), a number per viewer. Or a CSV with columns x, y, z, pdf, weight, viewer. A pdf of 0
        means that the sample has no direction. At least 5,000 rows per viewer.
    level
        False-positive rate.
    seed
        Seed of the split: one half of the rows places the patches, the other half is tested.

    Returns
    -------
    Dump
        Verdicts; `dump.ok`.

    Raises
    ------
    ValueError
        The file cannot be read, or does not hold these columns.
    """
    validate.number("level", level, *LIMITS["level"])
    validate.integer("seed", seed, *LIMITS["seed"])
    with reading(path, "samples"):
        direction, pdf, weight, viewer = _read(path)
    length = np.linalg.norm(direction, axis=1)
    none = pdf == 0
    bad = ~none & (~np.isfinite(direction).all(axis=1) | ~np.isfinite(pdf) | (pdf < 0) | ~(np.abs(length - 1) < 1e-3))
    bad_weight = np.zeros(len(pdf), bool) if weight is None else ~np.isfinite(weight) | (weight < 0)
    biased = np.zeros(len(pdf), bool) if weight is None else none & (weight > 0)
    ids, counts = np.unique(viewer, return_counts=True)
    if counts.min() < LEAST_ROWS:
        raise ValueError(f"{path}: an audit needs at least {LEAST_ROWS:,} rows per viewer, got {counts.min():,} of viewer"
                         f" {ids[np.argmin(counts)]:g}; draw more")  # fmt: skip
    rng = np.random.default_rng(seed)
    each = sidak(level, len(ids))
    judge = Judge(TESTS, Thresholds(each, deviations(each)), () if weight is None else ("weight",))
    judge.examine(RowsOfFile(bad, bad_weight, biased))
    viewers, notes = [], []
    for i in ids:
        rows = np.flatnonzero((viewer == i) & ~bad & ~none)
        theta, phi = _angles(direction[rows])
        name = "" if len(ids) == 1 else f"viewer {i:g}: "
        fit = _test(theta, phi, pdf[rows], int((viewer == i).sum()), rng)
        repeated = sorted(repeated_angles(theta, phi), key=lambda r: -r.share)
        viewers.append(judge.examine(ViewerOfFile(name, *fit, tuple(r for r in repeated if r.share > ATOM))))
        notes += [f"{name}{r.text()}: too few to fail, but no density has them" for r in repeated if r.share <= ATOM]
    patches, left_out = sum(v.patches for v in viewers), sum(v.left_out for v in viewers)
    mean = error = ess = largest = float("nan")
    if weight is not None:
        w = np.where(bad_weight, 0, weight)
        mean, error = float(w.mean()), float(w.std() / np.sqrt(len(w)))
        ess = float(w.sum() ** 2 / max(len(w) * (w**2).sum(), 1e-300))
        largest = float(w.max() / max(mean, 1e-300))
    if none.mean() > 1e-3:
        notes.append(f"{100 * none.mean():.2g} % of rows give no direction")
    return Dump(
        str(path), len(pdf), len(ids), patches, left_out, min(v.p_value for v in viewers), mean, error, ess, largest,
        judge.verdicts(), tuple(notes), level,
    )  # fmt: skip


def _angles(direction: Array) -> tuple[Array, Array]:
    return np.arcsin(np.clip(direction[:, 1], -1, 1)), np.arctan2(direction[:, 2], direction[:, 0])


class _Fit(NamedTuple):
    """The first fields of `ViewerOfFile` behind the name."""

    p_value: float
    difference: str
    patches: int
    left_out: int
    tested: float


def _test(theta: Array, phi: Array, pdf: Array, asked: int, rng: np.random.Generator) -> _Fit:
    """Test the solid angles of patches against Σ 1/pdf over them, and that no pdf is smaller than what can be drawn.

    One half of the samples places the patches, the other is summed. Where 1/pdf varies too much within a patch for a normal
    mean, or the support may end within it, the sum over its larger pdfs is still no more than the solid angle on average.
    """
    smallest = _smallest_pdf(pdf, asked)
    x, y = np.sin(theta), phi  # equal areas are equal solid angles
    inverse = 1 / np.maximum(pdf, 1e-150)  # its square is a number
    first = rng.random(len(x)) < 0.5
    boxes: list[tuple[Array, NDArray[np.intp]]] = []
    _split(np.array([-1.0, 1, -np.pi, np.pi]), np.flatnonzero(first), x, y, boxes)
    second = np.flatnonzero(~first)
    share = asked * len(second) / max(len(x), 1)  # of all samples, those without a direction included
    whole: list[_Patch] = []
    bounded: list[_Patch] = []
    for box, members in boxes:
        here = second[(x[second] >= box[0]) & (x[second] < box[1]) & (y[second] >= box[2]) & (y[second] < box[3])]
        both = inverse[np.concatenate([members, here])]
        varies = not float(both.std()) <= _SPREAD * float(both.mean())
        if varies or _on_edge(box, x[members], y[members], inverse[members]):
            largest = np.quantile(inverse[members], _KEPT)
            summed, both = (np.where(v > largest, 0, v) for v in (inverse[here], both))
            bounded.append(_patch(box, summed, both, share))
        else:
            whole.append(_patch(box, inverse[here], both, share))
    found = [smallest]
    if whole:
        found.append(_both_sides(whole))
    if bounded:
        found.append(_too_large(bounded))
    p, where = min(found)
    tested = sum(patch.summed for patch in whole) / max(len(second), 1)
    return _Fit(min(1.0, len(found) * p), where, len(whole), len(bounded), tested)


class _Patch(NamedTuple):
    """A patch, Σ 1/pdf over the share of samples less its solid angle, the deviation of that, and how many were summed."""

    box: Array
    difference: float
    deviation: float
    summed: int

    def text(self) -> str:
        """Return in words where the patch is, and what is off."""
        solid = (self.box[1] - self.box[0]) * (self.box[3] - self.box[2])
        t, p = np.degrees(np.arcsin(self.box[:2])), np.degrees(self.box[2:])
        many, off = "many" if self.difference > 0 else "few", 100 * abs(self.difference) / solid
        return (
            f"too {many} samples for their pdf, by {off:.2g} %, where asin(y) is {t[0]:.0f}° to"
            f" {t[1]:.0f}° and atan2(z, x) {p[0]:.0f}° to {p[1]:.0f}°"
        )


def _patch(box: Array, here: Array, both: Array, share: float) -> _Patch:
    solid = (box[1] - box[0]) * (box[3] - box[2])
    mean = both.mean() * len(both) / 2 / share
    variance = float((both**2).mean()) * len(both) / 2 / share**2 - mean**2 / share
    return _Patch(box, float(here.sum()) / share - solid, float(np.sqrt(max(variance, 1e-300))), len(here))


def _both_sides(patches: list[_Patch]) -> tuple[float, str]:
    """Return the p-value of patches whose mean is known, alone and in bands, and the least likely in words."""
    difference, deviation = (np.array(v) for v in list(zip(*patches, strict=True))[1:3])
    score = difference / deviation
    bands = []
    for axis in (0, 2):
        order = np.argsort([patch.box[axis] for patch in patches])
        for group in np.array_split(order, min(_GROUPS, len(order))):
            bands.append(difference[group].sum() / np.sqrt((deviation[group] ** 2).sum()))
    return _p_value(score, np.array(bands)), patches[int(np.argmax(np.abs(score)))].text()


def _too_large(patches: list[_Patch]) -> tuple[float, str]:
    """Return the p-value of patches whose mean is at most 0, and the least likely in words."""
    score = np.array([patch.difference / patch.deviation for patch in patches])
    worst = int(np.argmax(score))
    return min(1.0, len(patches) * float(ndtr(-score[worst]))), patches[worst].text()


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


def _split(box: Array, members: NDArray[np.intp], x: Array, y: Array, out: list[Any]) -> None:
    """Halve a box at its samples' median, along the axis of larger spread, until few samples are left."""
    if len(members) < 2 * _LEAF:
        if len(members):
            out.append((box, members))
        return
    spread_x, spread_y = float(np.ptp(x[members])), float(np.ptp(y[members]))
    axis, values = (0, x) if spread_x * np.pi > spread_y else (2, y)
    at = float(np.median(values[members]))
    if not box[axis] < at < box[axis + 1]:
        out.append((box, members))
        return
    below, above = box.copy(), box.copy()
    below[axis + 1] = above[axis] = at
    left = values[members] < at
    _split(below, members[left], x, y, out)
    _split(above, members[~left], x, y, out)


def _on_edge(box: Array, x: Array, y: Array, inverse: Array) -> bool:
    """Whether the support seems to end within a box: some part of it has no sample."""
    parts = 4
    i = np.clip(((x - box[0]) / (box[1] - box[0]) * parts).astype(int), 0, parts - 1)
    j = np.clip(((y - box[2]) / (box[3] - box[2]) * parts).astype(int), 0, parts - 1)
    count = np.bincount(i * parts + j, minlength=parts * parts)
    # The lowest pdf in the box bounds from below how many samples a sixteenth of it should have.
    solid = (box[1] - box[0]) * (box[3] - box[2]) / parts**2
    least = len(x) * solid / inverse.max() / max(float((1 / inverse).mean()) * solid * parts**2, 1e-300)
    return bool((count == 0).any()) or least < 1


def _p_value(score: Array, bands: Array) -> float:
    """Return the p-value of chi-square and of the largest deviation, over patches and over bands of them."""
    tests = []
    for z in (score, bands):
        tests += [chdtrc(len(z), float((z**2).sum())), min(1.0, 2 * len(z) * ndtr(-np.abs(z).max()))]
    return float(min(1.0, len(tests) * min(tests)))


def _read(path: str | os.PathLike[str]) -> tuple[Array, Array, Array | None, Array]:
    if Path(path).suffix.lower() == ".npz":
        columns: dict[str, Any] = dict(read_arrays(path, "samples"))
    else:
        header, rows = read_rows(path, "samples")
        columns = dict(zip(header, rows.T, strict=True))
        if {"x", "y", "z"} <= columns.keys():
            columns["direction"] = np.column_stack([columns[k] for k in "xyz"])
        channels = [columns[k] for k in columns if k.startswith("weight")]
        if channels:
            columns["weight"] = np.column_stack(channels)
    for needed in ("direction", "pdf"):
        if needed not in columns:
            raise ValueError(f"{path} has no {needed}: {_HELP}; it has {', '.join(columns) or 'nothing'}")
    known = ("direction", "pdf", "weight", "viewer")
    arrays = {k: validate.real(k, v).astype(np.float64) for k, v in columns.items() if k in known}
    pdf, direction = arrays["pdf"], arrays["direction"]
    n = len(pdf) if pdf.ndim == 1 else -1
    if n < 1 or direction.shape != (n, 3):
        raise ValueError(f"{path}: direction has shape {direction.shape} and pdf {pdf.shape}; {_HELP}")
    weight = arrays.get("weight")
    if weight is not None:
        if weight.shape[:1] != (n,) or weight.ndim > 2 or 0 in weight.shape:
            raise ValueError(f"{path}: weight has shape {weight.shape} for {n:,} rows; {_HELP}")
        weight = luminance(weight) if weight.ndim == 2 else weight
    viewer = arrays.get("viewer", np.zeros(n))
    if viewer.shape != (n,):
        raise ValueError(f"{path}: viewer has shape {viewer.shape} for {n:,} rows; {_HELP}")
    if not np.isfinite(viewer).all():
        row = int(np.argmin(np.isfinite(viewer)))
        raise ValueError(f"{path}: viewer must be a finite number in every row, got {viewer[row]} in row {row + 1:,}")
    return direction, pdf, weight, viewer
