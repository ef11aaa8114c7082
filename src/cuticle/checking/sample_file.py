"""Audit a file of samples: directions, the pdf that came with each, and weights; from any renderer in any language.

No density can be asked for between the samples, so the test runs the other way round: the mean of 1/pdf over the samples
in a patch of the sphere is the patch's solid angle, if the pdf is the density they were drawn from.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, ndtr

from cuticle._support import validate
from cuticle.checking.audit_report import ATOM
from cuticle.checking.regions import repeated_angles
from cuticle.checking.verdicts import Judged, Verdict
from cuticle.scattering.bcsdf import luminance
from cuticle.scattering.table_files import read_arrays, read_rows

Array = NDArray[np.float64]
LEAST_ROWS = 5_000
_LEAF = 300  # samples of the first half in a patch
_SPREAD = 1.0  # of 1/pdf within a patch, relative to its mean: beyond, a mean of it is not normal
_GROUPS = 12  # bands of patches
_TESTS = 3
_HELP = "it needs direction (n, 3) and pdf (n,), and may have weight (n,) or (n, channels), and viewer (n,)"


@dataclass(frozen=True)
class Dump(Judged):
    """The audit of a file of samples.

    `patches`: tested; `left_out`: those at the edge of what is drawn, or where the pdf varies too much within.
    `mean_weight`, `error`: over all rows, with its standard error. `ess`: (Σ w)²/(n Σ w²), as far as these rows tell.
    """

    name: str
    rows: int
    viewers: int
    patches: int
    left_out: int
    p_value: float
    mean_weight: float
    error: float
    ess: float
    largest_weight: float
    verdicts: tuple[Verdict, ...]
    notes: tuple[str, ...]
    level: float

    def __repr__(self) -> str:
        return self._told(
            f"{self.name}; {self.rows:,} rows, {self.viewers} viewers, {self.patches} patches tested,"
            f" {self.left_out} left out"
        )


@dataclass(frozen=True)
class _Patches:
    """z: deviations from the solid angles; bands: those of sums over bands; where: the worst in words."""

    z: Array
    bands: Array
    where: str
    left_out: int


def audit_dump(path: str | os.PathLike[str], *, level: float = 1e-4, seed: int = 1) -> Dump:
    """Audit samples in an .npz or CSV file.

    Parameters
    ----------
    path
        .npz with `direction` (n, 3) in one frame for all rows, `pdf` (n,) per steradian, and if known `weight` (n,) or
        (n, channels) and `viewer` (n,), a number that tells viewers apart; or CSV with columns x, y, z, pdf, weight, viewer.
        pdf 0 means that the sample gave no direction. At least 5,000 rows a viewer.
    level
        Chance that a right sampler fails.
    seed
        Of the halving: one half places the patches, the other is tested.

    Returns
    -------
    Dump
        Verdicts with numbers; `dump.ok`.

    Raises
    ------
    ValueError
        A file that cannot be read or does not hold that.
    """
    validate.number("level", level, 1e-9, 0.5)
    direction, pdf, weight, viewer = _read(path)
    length = np.linalg.norm(direction, axis=1)
    none = pdf == 0
    bad = ~none & (~np.isfinite(direction).all(axis=1) | ~np.isfinite(pdf) | (pdf < 0) | ~(np.abs(length - 1) < 1e-3))
    bad_weight = np.zeros(len(pdf), bool) if weight is None else ~np.isfinite(weight) | (weight < 0)
    biased = np.zeros(len(pdf), bool) if weight is None else none & (weight > 0)
    ids, counts = np.unique(viewer, return_counts=True)
    if counts.min() < LEAST_ROWS:
        raise ValueError(f"{path}: an audit needs at least {LEAST_ROWS:,} rows a viewer, got {counts.min():,} of viewer"
                         f" {ids[np.argmin(counts)]:g}; draw more")  # fmt: skip
    rng = np.random.default_rng(seed)
    results, notes, atom, atom_at = [], [], 0.0, ""
    for i in ids:
        rows = np.flatnonzero((viewer == i) & ~bad & ~none)
        asked = int((viewer == i).sum())
        theta, phi = _angles(direction[rows])
        where = "" if len(ids) == 1 else f"viewer {i:g}: "
        results.append((where, _test(theta, phi, pdf[rows], asked, rng)))
        for r in repeated_angles(theta, phi):
            if r.hits / r.of > ATOM:
                atom, atom_at = max((atom, atom_at), (r.hits / r.of, f"{where}{r.text()}"))
            else:
                notes.append(f"{where}{r.text()}: no density has them, but they are few")
    each = 1 - (1 - level) ** (1 / len(ids))
    p_values = [_p_value(r) for _, r in results]
    worst = int(np.argmin(p_values))
    place = results[worst][0] + results[worst][1].where
    verdicts = [
        Verdict("valid rows", not bad.any(), float(bad.mean()), 0.0, _first(bad),
                "directions have length 1, pdf is a number and at least 0: share that does not"),
        Verdict("samples follow the pdf", bool(p_values[worst] >= each), p_values[worst], each, place,
                "1/pdf over a patch's samples sums to its solid angle: least p-value, limit by Šidák"),
        Verdict("no atom", not atom, atom, ATOM, atom_at, "no angle is drawn again and again: largest share at exactly one"),
    ]  # fmt: skip
    mean = error = ess = largest = float("nan")
    if weight is not None:
        verdicts += [
            Verdict("valid weights", not bad_weight.any(), float(bad_weight.mean()), 0.0, _first(bad_weight),
                    "weights are numbers, at least 0: share that is not"),
            Verdict("no weight without a direction", not biased.any(), float(biased.mean()), 0.0, _first(biased),
                    "a sample with pdf 0 has weight 0: share that has not"),
        ]  # fmt: skip
        w = np.where(bad_weight, 0, weight)
        mean, error = float(w.mean()), float(w.std() / np.sqrt(len(w)))
        ess = float(w.sum() ** 2 / max(len(w) * (w**2).sum(), 1e-300))
        largest = float(w.max() / max(mean, 1e-300))
    if none.mean() > 1e-3:
        notes.append(f"{100 * none.mean():.2g} % of rows give no direction")
    patches, left = sum(len(r.z) for _, r in results), sum(r.left_out for _, r in results)
    if not patches:
        notes.append("no patch could be tested: the pdf varies too much within each; more rows make smaller patches")
    return Dump(
        str(path), len(pdf), len(ids), patches, left, min(p_values), mean, error, ess, largest, tuple(verdicts),
        tuple(notes), level,
    )  # fmt: skip


def _first(wrong: NDArray[np.bool_]) -> str:
    return f"first at row {int(np.argmax(wrong)) + 1:,}" if wrong.any() else ""


def _angles(direction: Array) -> tuple[Array, Array]:
    return np.arcsin(np.clip(direction[:, 1], -1, 1)), np.arctan2(direction[:, 2], direction[:, 0])


def _test(theta: Array, phi: Array, pdf: Array, asked: int, rng: np.random.Generator) -> _Patches:
    """Compare patches' solid angles with the mean of 1/pdf over the half of the samples that did not place them."""
    x, y, inverse = np.sin(theta), phi, 1 / pdf  # equal areas are equal solid angles
    first = rng.random(len(x)) < 0.5
    boxes: list[tuple[Array, NDArray[np.intp]]] = []
    _split(np.array([-1.0, 1, -np.pi, np.pi]), np.flatnonzero(first), x, y, boxes)
    second = np.flatnonzero(~first)
    share = asked * len(second) / max(len(x), 1)  # of all that were asked for, those this half stands for
    z, area, left, found = [], [], 0, []
    for box, members in boxes:
        here = second[(x[second] >= box[0]) & (x[second] < box[1]) & (y[second] >= box[2]) & (y[second] < box[3])]
        solid = (box[1] - box[0]) * (box[3] - box[2])
        both = np.concatenate([inverse[members], inverse[here]])
        cv = float(both.std() / both.mean())
        if cv > _SPREAD or _on_edge(box, x[members], y[members], inverse[members]):
            left += 1
            continue
        variance = float((both**2).mean()) * len(both) / 2 / share**2 - (both.mean() * len(both) / 2 / share) ** 2 / share
        z.append((float(inverse[here].sum()) / share - solid, np.sqrt(max(variance, 1e-300))))
        area.append(solid)
        found.append((box, len(here), solid))
    if not z:
        return _Patches(np.zeros(0), np.zeros(0), "nothing to test", left)
    difference, deviation = np.array(z).T
    score = difference / deviation
    bands = []
    for axis in (0, 2):
        order = np.argsort([f[0][axis] for f in found])
        for group in np.array_split(order, min(_GROUPS, len(order))):
            bands.append(difference[group].sum() / np.sqrt((deviation[group] ** 2).sum()))
    k = int(np.argmax(np.abs(score)))
    box = found[k][0]
    t, p = np.degrees(np.arcsin(box[:2])), np.degrees(box[2:])
    many, off = "many" if score[k] > 0 else "few", 100 * abs(difference[k]) / found[k][2]
    where = (
        f"too {many} samples for their pdf, by {off:.2g} %, where asin(y) is {t[0]:.0f}° to"
        f" {t[1]:.0f}° and atan2(z, x) {p[0]:.0f}° to {p[1]:.0f}°"
    )
    return _Patches(score, np.array(bands), where, left)


def _split(box: Array, members: NDArray[np.intp], x: Array, y: Array, out: list[Any]) -> None:
    """Halve a box at its samples' median, along the side they spread over more, until few are left."""
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
    """Whether part of a box seems to hold no density at all: the support ends in it."""
    parts = 4
    i = np.clip(((x - box[0]) / (box[1] - box[0]) * parts).astype(int), 0, parts - 1)
    j = np.clip(((y - box[2]) / (box[3] - box[2]) * parts).astype(int), 0, parts - 1)
    count = np.bincount(i * parts + j, minlength=parts * parts)
    # The lowest density met in the box says how many samples a sixteenth of it should have at least.
    solid = (box[1] - box[0]) * (box[3] - box[2]) / parts**2
    least = len(x) * solid / inverse.max() / max(float((1 / inverse).mean()) * solid * parts**2, 1e-300)
    return bool((count == 0).any()) or least < 1


def _p_value(result: _Patches) -> float:
    tests = []
    for z in (result.z, result.bands):
        if len(z):
            tests += [chdtrc(len(z), float((z**2).sum())), min(1.0, 2 * len(z) * ndtr(-np.abs(z).max()))]
    return float(min(1.0, len(tests) * min(tests))) if tests else 1.0


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
    try:
        arrays = {k: np.asarray(v, np.float64) for k, v in columns.items() if k in ("direction", "pdf", "weight", "viewer")}
    except (TypeError, ValueError):
        raise ValueError(f"{path} holds something that is not a number; {_HELP}") from None
    pdf, direction = arrays["pdf"], arrays["direction"]
    n = len(pdf) if pdf.ndim == 1 else -1
    if n < 1 or direction.shape != (n, 3):
        raise ValueError(f"{path}: direction has shape {direction.shape} and pdf {pdf.shape}; {_HELP}")
    weight = arrays.get("weight")
    if weight is not None:
        if weight.shape[:1] != (n,) or weight.ndim > 2:
            raise ValueError(f"{path}: weight has shape {weight.shape} for {n:,} rows; {_HELP}")
        weight = luminance(weight) if weight.ndim == 2 else weight
    viewer = arrays.get("viewer", np.zeros(n))
    if viewer.shape != (n,):
        raise ValueError(f"{path}: viewer has shape {viewer.shape} for {n:,} rows; {_HELP}")
    return direction, pdf, weight, viewer
