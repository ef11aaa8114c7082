"""Audit a file of samples: the directions, pdfs and weights that any renderer wrote."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.files import reading, shown
from cuticle.checking.measurements import RowsOfFile, ViewerOfFile
from cuticle.checking.patches import follows
from cuticle.checking.regions import repeated_angles
from cuticle.checking.tests import ATOM, TESTS
from cuticle.checking.verdicts import LIMITS, Judge, Judged, Thresholds, Verdict, deviations, sidak
from cuticle.scattering.bcsdf import luminance
from cuticle.scattering.table_files import channel_columns, read_arrays, read_rows

Array = NDArray[np.float64]
LEAST_ROWS = 5_000
_HELP = (
    "it needs direction (n, 3) and pdf (n,), and may have weight (n,) or (n, channels), and viewer (n,); a CSV has columns"
    " x, y, z, pdf, weight or weight_r, weight_g, weight_b, and viewer"
)


@dataclass(frozen=True, eq=False)
class Dump(Judged):
    """The result of the audit of a file of samples."""

    name: str
    rows: int
    viewers: int
    patches: int  # tested on both sides
    left_out: int  # at the edge of the support, or where the pdf varies too much: tested for too many samples only
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
        An .npz with `direction` (n, 3), all in one frame, and `pdf` (n,) per steradian; optional are `weight`, (n,) or (n,
        channels), and `viewer` (n,), a number per viewer. Or a CSV with columns x, y, z, pdf, weight (or weight_r, weight_g,
        weight_b, or weight_1, weight_2, ...) and viewer, in any case of letters. A pdf of 0 means that the sample has no
        direction. At least 5,000 rows per viewer.
    level
        False-positive rate.
    seed
        Seed of the split, one half of the rows places the patches, the other half is tested, and of which rows are kept.

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
        direction, pdf, weight, viewer, unread = _read(path)
    length = np.linalg.norm(direction, axis=1)
    none = pdf == 0
    bad = ~none & (~np.isfinite(direction).all(axis=1) | ~np.isfinite(pdf) | (pdf < 0) | ~(np.abs(length - 1) < 1e-3))
    weights = np.zeros((len(pdf), 1)) if weight is None else weight
    bad_weight = np.logical_or.reduce(~(np.isfinite(weights) & (weights >= 0)), axis=1)
    biased = none & np.logical_or.reduce(weights > 0, axis=1)
    ids, counts = np.unique(viewer, return_counts=True)
    if counts.min() < LEAST_ROWS:
        raise ValueError(f"{path}: an audit needs at least {LEAST_ROWS:,} rows per viewer, got {counts.min():,} of viewer"
                         f" {ids[np.argmin(counts)]:g}; draw more")  # fmt: skip
    rng = np.random.default_rng(seed)
    each = sidak(level, len(ids))
    judge = Judge(TESTS, Thresholds(each, deviations(each)), () if weight is None else ("weight",))
    judge.examine(RowsOfFile(bad, bad_weight, biased))
    viewers: list[ViewerOfFile] = []
    notes = [f"not read: {', '.join(unread)}; {_HELP}"] if unread else []
    for i in ids:
        rows = np.flatnonzero((viewer == i) & ~bad & ~none)
        theta, phi = _angles(direction[rows])
        name = "" if len(ids) == 1 else f"viewer {i:g}: "
        fit = follows(theta, phi, pdf[rows], int((viewer == i).sum()), rng)
        repeated = sorted(repeated_angles(theta, phi), key=lambda r: -r.share)
        viewers.append(judge.examine(ViewerOfFile(name, *fit, tuple(r for r in repeated if r.share > ATOM))))
        notes += [f"{name}{r.text()}: too few to fail, but no density has them" for r in repeated if r.share <= ATOM]
    patches, left_out = sum(v.patches for v in viewers), sum(v.left_out for v in viewers)
    mean = error = ess = largest = float("nan")
    if weight is not None:
        w = np.where(bad_weight, 0, luminance(weight))
        mean, error = float(w.mean()), float(w.std() / np.sqrt(len(w)))
        ess = float(w.sum() ** 2 / max(len(w) * (w**2).sum(), 1e-300))
        largest = float(w.max() / max(mean, 1e-300))
    if none.mean() > 1e-3:
        notes.append(f"{100 * none.mean():.2g} % of rows give no direction")
    return Dump(
        shown(path), len(pdf), len(ids), patches, left_out, min(v.p_value for v in viewers), mean, error, ess, largest,
        judge.verdicts(), tuple(notes), level,
    )  # fmt: skip


def _angles(direction: Array) -> tuple[Array, Array]:
    return np.arcsin(np.clip(direction[:, 1], -1, 1)), np.arctan2(direction[:, 2], direction[:, 0])


def _read(path: str | os.PathLike[str]) -> tuple[Array, Array, Array | None, Array, list[str]]:
    """Return direction, pdf, weight (n, channels), viewer, and what the file has beside them."""
    if Path(path).suffix.lower() == ".npz":
        columns: dict[str, Any] = dict(read_arrays(path, "samples"))
    else:
        header, rows = read_rows(path, "samples")
        columns = dict(zip(header, rows.T, strict=True))
        if channels := channel_columns("weight", header):
            columns["weight"] = np.column_stack([columns.pop(name) for name in channels])
        if {"x", "y", "z"} <= columns.keys():
            columns["direction"] = np.column_stack([columns.pop(k) for k in "xyz"])
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
        weight = weight.reshape(n, -1)
    viewer = arrays.get("viewer", np.zeros(n))
    if viewer.shape != (n,):
        raise ValueError(f"{path}: viewer has shape {viewer.shape} for {n:,} rows; {_HELP}")
    if not np.isfinite(viewer).all():
        row = int(np.argmin(np.isfinite(viewer)))
        raise ValueError(f"{path}: viewer must be a finite number in every row, got {viewer[row]} in row {row + 1:,}")
    return direction, pdf, weight, viewer, sorted(columns.keys() - set(known))
