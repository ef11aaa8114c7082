"""Audit any sampler on the sphere: does it draw what its pdf claims, and if not, where?"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cuticle._support.extras import needed
from cuticle._support.files import write_bytes
from cuticle._support.progress import Progress, silent
from cuticle.checking.audit_viewer import MEAN_CELLS, measure_viewer
from cuticle.checking.foreign_sampler import foreign_sampler
from cuticle.checking.measurements import AuditMeasurement, Reciprocity
from cuticle.checking.tests import ATOM, TESTS
from cuticle.checking.verdicts import Judge, Judged, Test, Thresholds, Verdict, deviations, sidak, viewers

SAMPLES = 200_000
LEVEL = 1e-4
_NOTED = 1e-3  # share of samples, or of the pdf, from which on a note says so


@dataclass(frozen=True, eq=False)
class Audit(Judged):
    """The result of an audit."""

    name: str
    cases: tuple[AuditMeasurement, ...]  # one per viewer
    verdicts: tuple[Verdict, ...]
    notes: tuple[str, ...]  # observations that are no failure
    samples: int  # per viewer
    level: float  # false-positive rate
    seconds: float = field(compare=False)

    @property
    def worst(self) -> AuditMeasurement:
        """The viewer where samples differ from the density most clearly."""
        return min(self.cases, key=lambda m: (m.p_value, -m.excess_variation))

    def __repr__(self) -> str:
        return self._summary(f"{self.name}; {len(self.cases)} viewers, {self.samples:,} samples each, level {self.level:g}")

    def figure(self, path: str | os.PathLike[str] | None = None, theta_r: float | None = None) -> bytes:
        """Return a PNG of the claimed density, the drawn one and their difference, and write it to `path` if given.

        It shows the worst viewer, or the one nearest to `theta_r` (radians).
        """
        with needed("a picture"):
            from cuticle.checking.audit_figure import audit_figure

        shown = self.worst if theta_r is None else min(self.cases, key=lambda m: abs(m.theta_r - theta_r))
        data = audit_figure(shown, name=self.name, ok=self.ok, samples=self.samples)
        if path is not None:
            write_bytes(Path(path), data)
        return data


def audit(
    sample: Any,
    pdf: Callable[..., Any] | None = None,
    eval: Callable[..., Any] | None = None,
    *,
    theta_r: ArrayLike | None = None,
    samples: int = SAMPLES,
    level: float = LEVEL,
    seed: int = 1,
    dimensions: int = 3,
    strands: float | None = None,
    lobes: tuple[Sequence[str], Callable[..., Any]] | None = None,
    reciprocity: bool = False,
    energy: bool = False,
    extra: Sequence[Test] = (),
    name: str | None = None,
    progress: Progress | None = None,
) -> Audit:
    """Audit a sampler: compare what it draws with what its pdf claims, viewer by viewer.

    Parameters
    ----------
    sample
        sample(theta_r, u) -> (theta_i, phi[, pdf[, weight]]). theta_r is one number, u is (n, dimensions) uniform in [0, 1),
        angles are radians. pdf is per steradian; 0 means that the sample has no direction. weight is f·cos(theta_i)/pdf,
        one value or one per channel. Or an object with `sample`, `pdf` and, if known, `eval`: a `cuticle.Sampler`,
        `cuticle.Chiang(...).near(h)`, `cuticle.from_mitsuba(..., h=0)`.
    pdf
        pdf(theta_i, theta_r, phi) -> density per steradian, for arrays, or (slower) for single numbers.
    eval
        eval(theta_i, theta_r, phi) -> f in 1/sr without a cosine, one value or one per channel. Without it there are no
        tests of weights, and no ESS.
    theta_r
        Viewers, radians; default ±{0, 30, 60, 75, 85}°.
    samples
        Samples per viewer, 10,000 to 100 million.
    level
        False-positive rate of the whole audit. One half goes to the density tests of all viewers, the other to the mean
        weights (Šidák).
    seed
        Seed of the random numbers.
    dimensions
        Random numbers per sample.
    strands
        Strand count, for a `cuticle.Sampler` with several.
    lobes
        Names, and a function lobes(theta_i, theta_r, phi) -> (lobes, n) with each lobe's part of the pdf. The audit then
        names the lobe behind a failing region.
    reciprocity, energy
        Also test that f(theta_i, theta_r, phi) = f(theta_r, theta_i, -phi), and that ∫ f cos is at most 1.
    extra
        Tests of your own; see docs/extending/verdict.md. `level` does not cover them.
    name
        Name of the sampler in the report.
    progress
        progress(phase, fraction), with a fraction from 0 to 1.

    Returns
    -------
    Audit
        Verdicts, and where they fail: `audit.ok`, `audit.to_dict()`, `audit.figure()`.

    Raises
    ------
    ValueError
        A function raises or returns a wrong shape, or a parameter is out of range.

    Examples
    --------
    >>> import cuticle
    >>> near = cuticle.Chiang(eumelanin=1.3).near(0.3)
    >>> cuticle.audit(near, samples=20_000, theta_r=[0.5]).ok
    True
    """
    sampler = foreign_sampler(sample, pdf, eval, dimensions=dimensions, strands=strands, lobes=lobes, name=name)
    angles = viewers(theta_r, samples, level, seed)
    if (reciprocity or energy) and sampler.eval is None:
        raise ValueError("reciprocity and energy test f: give eval")
    report = progress or silent
    start = time.perf_counter()
    means = deviations(sidak(level / 2, len(angles) * MEAN_CELLS**2))
    limits = Thresholds(p_value=sidak(level / 2, len(angles)), deviations=means)
    options = {"eval": sampler.eval is not None, "energy": energy}
    judge = Judge((*TESTS, *extra), limits, [k for k, asked in options.items() if asked])
    cases = []
    for i, t in enumerate(angles):
        report(f"theta_r {np.degrees(t):.3g}°", i / len(angles))
        measured = measure_viewer(sampler, float(t), samples, limits.p_value, np.random.default_rng([seed, i]))
        cases.append(judge.examine(measured))
    report("done", 1.0)
    if reciprocity:
        judge.examine(Reciprocity(sampler.reciprocity_error(np.random.default_rng([seed, len(angles)]))))
    seconds = time.perf_counter() - start
    return Audit(sampler.name, tuple(cases), judge.verdicts(), tuple(_notes(cases)), samples, level, seconds)


def _notes(cases: Sequence[AuditMeasurement]) -> list[str]:
    notes = []
    if np.isfinite(cases[0].ess) and not any(np.isfinite(m.mean_z) for m in cases):
        notes.append(
            "the mean weight could not be tested: in no cell are there enough samples beside the largest weight; draw more"
        )
    few = [(r, m) for m in cases for r in m.repeated if r.share <= ATOM]
    if few:
        repeated, at = max(few, key=lambda x: x[0].hits)
        notes.append(f"{repeated.text()}, {at.place}: too few to fail, but no density has them")
    wasteful = max(cases, key=lambda m: m.wasted)
    if wasteful.wasted > _NOTED:
        notes.append(f"{100 * wasteful.wasted:.2g} % of the pdf lies where f is 0, {wasteful.place}: wasted, not wrong")
    dropping = max(cases, key=lambda m: m.dropped)
    if dropping.dropped > _NOTED:
        notes.append(f"{100 * dropping.dropped:.2g} % of samples give no direction, {dropping.place}")
    return notes
