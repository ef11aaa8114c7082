"""What an audit says: verdicts, where they fail, notes, a table and a picture."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cuticle._support.files import write_bytes
from cuticle.checking.audit_case import Case
from cuticle.checking.verdicts import Judged, Verdict

INTEGRAL = 2e-3  # |∫ pdf + dropped - 1|
MISMATCH = 1e-3  # share of samples whose pdf or weight is another afterwards
LOST = 1e-4  # share of ∫ f cos where the pdf is 0
ATOM = 1e-3  # share of samples at exactly one angle
RECIPROCITY, ENERGY = 0.02, 1.01


@dataclass(frozen=True)
class Audit(Judged):
    """All viewers and verdicts of an audit.

    Attributes
    ----------
    name
        What was audited.
    cases
        One a viewer.
    verdicts
        Claims that hold or not; `ok` if all do.
    notes
        What is no failure but ought to be known.
    samples, level
        Samples a viewer, and the chance that a right sampler fails.
    seconds
        How long it took.
    """

    name: str
    cases: tuple[Case, ...]
    verdicts: tuple[Verdict, ...]
    notes: tuple[str, ...]
    samples: int
    level: float
    seconds: float = field(compare=False)

    @property
    def worst(self) -> Case:
        """The viewer whose samples differ from the density the most clearly."""
        return min(self.cases, key=lambda c: (c.p_value, -(c.total_variation - c.noise_floor)))

    def __repr__(self) -> str:
        return self._told(f"{self.name}; {len(self.cases)} viewers, {self.samples:,} samples each, level {self.level:g}")

    def to_dict(self) -> dict[str, Any]:
        """Return the audit as plain values that JSON can hold (NaN as None), without the pictures' densities."""
        whole = super().to_dict()
        for case in whole["cases"]:
            case.pop("maps")
        return whole

    def figure(self, path: str | os.PathLike[str] | None = None, theta_r: float | None = None) -> bytes:
        """Return a PNG of the densities claimed and drawn and their difference; written to `path`, too, if one is given.

        It shows the worst viewer, or the one nearest to `theta_r` (radians).
        """
        from cuticle.checking.audit_figure import audit_figure

        case = self.worst if theta_r is None else min(self.cases, key=lambda c: abs(c.theta_r - theta_r))
        data = audit_figure(case, name=self.name, ok=self.ok, samples=self.samples)
        if path is not None:
            write_bytes(Path(path), data)
        return data


def judge(
    cases: Sequence[Case], each: float, critical: float, samples: int, asymmetry: float | None, energy: bool
) -> tuple[list[Verdict], list[str]]:
    """Return the verdicts over all viewers, and notes."""

    def small(
        name: str, key: Callable[[Case], float], limit: float, meaning: str, where: Callable[[Case], str] = _at
    ) -> Verdict:
        at = max(cases, key=lambda c: np.nan_to_num(key(c), nan=np.inf))
        return Verdict(name, all(key(c) <= limit for c in cases), key(at), limit, where(at), meaning)

    def integral(c: Case) -> float:
        # Dropped samples carry what the pdf does not; their share has noise of its own.
        noise = 4 * np.sqrt(c.dropped * (1 - c.dropped) / samples)
        return max(abs(c.integral + c.dropped - 1) - c.integral_error - noise, 0.0)

    def atom(c: Case) -> float:
        return max((r.hits / r.of for r in c.repeated), default=0.0)

    least = min(cases, key=lambda c: (c.p_value, -(c.total_variation - c.noise_floor)))
    verdicts = [
        small("valid samples", lambda c: c.invalid + c.outside, 0, "samples are numbers, on the sphere: share that are not"),
        small("valid density", lambda c: c.bad_density + c.bad_values, 0, "pdf and f are numbers ≥ 0: count that are not"),
        small("∫ pdf", integral, INTEGRAL, "|∫ pdf + share dropped - 1|, beyond the quadrature's error", _integral_at),
        Verdict("samples follow the pdf", all(c.p_value >= each for c in cases), least.p_value, each, _told(least),
                "least p-value of all viewers, limit by Šidák"),
        small("no atom", atom, ATOM, "no angle comes again and again: largest share of samples at exactly one", _atoms_at),
        small("pdf of a sample", lambda c: c.pdf_mismatch, MISMATCH, "sample and pdf agree: share off by over 2 %"),
    ]  # fmt: skip
    if np.isfinite(cases[0].ess):
        verdicts += _of_f(cases, critical, small)
    if energy:
        verdicts.append(
            small("energy", lambda c: max(c.energy, default=0.0), ENERGY, "no more light leaves than came: largest ∫ f cos")
        )
    if asymmetry is not None:
        meaning = "f is the same with light and viewer exchanged: mean difference over mean f"
        verdicts.append(Verdict("reciprocity", asymmetry <= RECIPROCITY, asymmetry, RECIPROCITY, "random pairs", meaning))
    return verdicts, _notes(cases)


def _of_f(cases: Sequence[Case], critical: float, small: Callable[..., Verdict]) -> list[Verdict]:
    verdicts = [
        small("weight of a sample", lambda c: c.weight_mismatch, MISMATCH,
              "the weight that comes with a sample is f·cos/pdf: share off by over 2 %"),
        small("reach", lambda c: c.lost + c.biased, LOST, "the pdf is positive where f is: share of ∫ f cos never drawn"),
    ]  # fmt: skip
    testable = [c for c in cases if np.isfinite(c.mean_z)]
    if testable:
        far = max(testable, key=lambda c: abs(c.mean_z))
        left = sum(c.means_left_out for c in cases)
        meaning = "the mean weight is ∫ f cos in every cell: standard errors"
        if left:
            meaning += f"; {left} cells not tested, where single weights dominate"
        verdicts.append(
            Verdict(
                "mean weight",
                abs(far.mean_z) <= critical,
                abs(far.mean_z),
                critical,
                f"{_at(far)}, {far.mean_where}",
                meaning,
            )
        )
    return verdicts


def _notes(cases: Sequence[Case]) -> list[str]:
    notes = []
    if np.isfinite(cases[0].ess) and not any(np.isfinite(c.mean_z) for c in cases):
        notes.append("the mean weight could not be tested: single weights dominate every cell at this many samples")
    shared = [(r, c) for c in cases for r in c.repeated if r.hits / r.of <= ATOM]
    if shared:
        repeated, at = max(shared, key=lambda x: x[0].hits)
        notes.append(f"{repeated.text()}, {_at(at)}: no density has them, but they are few")
    wasteful = max(cases, key=lambda c: c.wasted)
    if wasteful.wasted > 1e-3:
        notes.append(f"{100 * wasteful.wasted:.2g} % of the density lies where f is 0, {_at(wasteful)}: wasted, not wrong")
    dropping = max(cases, key=lambda c: c.dropped)
    if dropping.dropped > 1e-3:
        notes.append(f"{100 * dropping.dropped:.2g} % of samples give no direction, {_at(dropping)}")
    return notes


def _at(case: Case) -> str:
    return f"at theta_r {np.degrees(case.theta_r):.3g}°"


def _integral_at(case: Case) -> str:
    return f"{_at(case)}: ∫ pdf {case.integral:.5g}, dropped {case.dropped:.3g}"


def _atoms_at(case: Case) -> str:
    return "; ".join([_at(case), *(r.text() for r in case.repeated)])


def _told(case: Case) -> str:
    text = _at(case)
    if case.region is not None:
        text += f": {case.region.text()}"
        within = [r for r in case.repeated if _within(r.axis, r.angle, case)]
        if within:
            text += f"; {within[0].text()}"
        text += f"; {case.lobe}" if case.lobe else ""
        text += f"; TV distance {case.total_variation:.3g}, a right sampler has {case.noise_floor:.3g}"
    return text


def _within(axis: str, degrees: float, case: Case) -> bool:
    assert case.region is not None
    low, high = case.region.theta if axis == "theta_i" else case.region.phi
    return low - 1e-6 <= np.radians(degrees) <= high + 1e-6
