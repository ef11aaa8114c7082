"""The list of tests that `check`, `audit` and `audit_dump` run; a new verdict is one more entry.

The type of measurement that a test is `of` says who runs it: `CheckMeasurement` a check, `AuditMeasurement` an audit,
`Measurement` both, `ViewerOfFile` and `RowsOfFile` an audit of a file. Verdicts come in the order of this list.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cuticle.checking.measurements import AuditMeasurement, CheckMeasurement, Controls, Reciprocity, RowsOfFile, ViewerOfFile
from cuticle.checking.verdicts import Test

INTEGRAL_DOUBLE = 1e-5  # |∫ pdf - 1|
ATOM = 1e-3  # share of samples at exactly one angle
LEAST_DIRECTIONS = 1_000  # of the samples of a viewer: about what a chi-square test over a hundred cells needs
LEAST_TESTED = 0.1  # of a viewer's samples in a file, in patches that are tested on both sides
MISMATCH = 1e-3  # share of samples whose pdf or weight is off by over 2 %
BIAS = 2e-3  # of the estimate by what sample returns; single precision leaves less than a tenth of it


def _integral(m: AuditMeasurement) -> float:
    """How far ∫ pdf and the share of dropped samples are from 1, beyond the errors of both."""
    assert m.drawn is not None
    noise = 4 * np.sqrt(m.dropped * (1 - m.dropped) / m.drawn.asked)
    return max(abs(m.integral + m.dropped - 1) - m.integral_error - noise, 0.0)


def _difference(m: AuditMeasurement) -> str:
    """The viewer, and the region where drawn and expected counts differ."""
    if m.region is None:
        return m.place
    parts = [f"{m.place}: {m.region.text()}", *(r.text() for r in m.repeated if r.within(m.region))][:2]
    if m.lobe:
        parts.append(m.lobe)
    return "; ".join([*parts, f"TV distance {m.total_variation:.3g}, a correct sampler has {m.noise_floor:.3g}"])


def _left_out(meaning: str, count: int, what: str) -> str:
    return f"{meaning}; {count} {what} left out, where one sample dominates" if count else meaning


def _first(wrong: NDArray[np.bool_]) -> str:
    return f"first at row {int(np.argmax(wrong)) + 1:,}" if wrong.any() else ""


def _few_directions(m: AuditMeasurement) -> str:
    """Why samples cannot show that they do not follow the pdf: there are next to none."""
    assert m.drawn is not None
    directions = len(m.drawn.theta)
    if directions >= LEAST_DIRECTIONS:
        return ""
    return f"{directions:,} of {m.drawn.asked:,} samples gave a direction, a test needs {LEAST_DIRECTIONS:,}"


def _few_patches(m: ViewerOfFile) -> str:
    """Why a file's samples cannot show that they do not follow the pdf: too few of them lie in patches that are tested."""
    if m.tested >= LEAST_TESTED:
        return ""
    return (
        f"{m.patches} patches with {100 * m.tested:.2g} % of the samples could be tested, a test needs"
        f" {100 * LEAST_TESTED:g} %: the pdf varies too much within the others; more rows make smaller patches"
    )


FOLLOWS_PDF = Test(
    "samples follow the pdf", "smallest p-value of the samples' counts against the pdf (limit: Šidák)",
    lambda t: t.p_value, lambda m: m.p_value,
    of=AuditMeasurement, at_least=True, place=_difference, tie=lambda m: m.excess_variation, too_little=_few_directions,
)  # fmt: skip
NO_ATOM = Test(
    "no atom", "largest share of samples at exactly one angle", ATOM,
    lambda m: max((r.share for r in m.repeated), default=0.0),
    of=AuditMeasurement, place=lambda m: "; ".join([m.place, *(r.text() for r in m.repeated)]),
)  # fmt: skip

TESTS: tuple[Test, ...] = (
    # Samples and densities are numbers.
    Test("valid samples", "share of samples that are not finite or not on the sphere", 0,
         lambda m: m.invalid + m.outside, of=AuditMeasurement),
    Test("valid density", "values of pdf and f that are not finite or negative", 0,
         lambda m: m.bad_density + m.bad_values, of=AuditMeasurement),
    Test("valid rows", "share of rows whose direction has not length 1 or whose pdf is not a number ≥ 0", 0.0,
         lambda rows: float(rows.bad.mean()), of=RowsOfFile, place=lambda rows: _first(rows.bad)),
    # The pdf integrates to 1.
    Test("∫ pdf, double", "|∫ pdf - 1| in double precision", INTEGRAL_DOUBLE,
         lambda m: abs(m.integral - 1), of=CheckMeasurement),
    Test("∫ pdf, single", "|∫ pdf - 1| in single precision", 1e-4,
         lambda m: abs(m.integral_single - 1), of=CheckMeasurement),
    Test("∫ pdf", "|∫ pdf + share of dropped samples - 1| beyond the quadrature's error", 2e-3,
         _integral, of=AuditMeasurement, place=lambda m: f"{m.place}: ∫ pdf {m.integral:.5g}, dropped {m.dropped:.3g}"),
    # Samples follow the pdf.
    replace(FOLLOWS_PDF, name="chi-square", of=CheckMeasurement, place=Test.place, tie=Test.tie,
            too_little=Test.too_little),
    FOLLOWS_PDF,
    replace(FOLLOWS_PDF, meaning="smallest p-value of the samples' counts in patches of the sphere (limit: Šidák)",
            of=ViewerOfFile, place=Test.place, tie=Test.tie, too_little=_few_patches),
    NO_ATOM,
    replace(NO_ATOM, of=ViewerOfFile, place=lambda m: next((m.name + r.text() for r in m.repeated), "")),
    # What `sample` returns agrees with pdf and eval at that direction.
    Test("pdf of a sample", "largest relative difference between the pdf that sample returns and pdf there", 1e-3,
         lambda m: m.pdf_mismatch, of=CheckMeasurement),
    Test("pdf of a sample", "share of samples whose returned pdf is off pdf there by over 2 %", MISMATCH,
         lambda m: m.pdf_mismatch, of=AuditMeasurement),
    Test("weight of a sample", "share of samples whose returned weight is off f·cos/pdf by over 2 %", MISMATCH,
         lambda m: m.weight_mismatch, of=AuditMeasurement, option="eval"),
    Test("estimate", "relative difference of the mean by what sample returns and by pdf and eval there, a channel's", BIAS,
         lambda m: m.estimate_mismatch, of=AuditMeasurement),
    Test("valid weights", "share of weights that are not a number ≥ 0", 0.0,
         lambda rows: float(rows.bad_weight.mean()), of=RowsOfFile, option="weight",
         place=lambda rows: _first(rows.bad_weight)),
    Test("no weight without a direction", "share of samples that have pdf 0 and a weight", 0.0,
         lambda rows: float(rows.biased.mean()), of=RowsOfFile, option="weight",
         place=lambda rows: _first(rows.biased)),
    # The estimate has no bias.
    Test("reach", "share of ∫ f cos that is never drawn: pdf 0 where f is not", 1e-4,
         lambda m: m.lost + m.biased, of=AuditMeasurement, option="eval",
         too_little=lambda m: "" if max(m.energy, default=0.0) > 0 else "f is 0 in all directions"),
    Test("mean of f cos/p", lambda cases: _left_out("largest deviation of the mean from ∫ f cos, standard errors",
                                                    sum(np.isnan(m.z) for m in cases), "cases"),
         lambda t: t.deviations, lambda m: abs(m.z),
         of=CheckMeasurement, unknown="left out"),
    Test("mean weight", lambda cases: _left_out("largest deviation of a cell's mean weight from ∫ f cos, standard errors",
                                                sum(m.means_left_out for m in cases), "cells"),
         lambda t: t.deviations, lambda m: abs(m.mean_z), of=AuditMeasurement,
         place=lambda m: f"{m.place}, {m.mean_where}", option="eval", unknown="no verdict"),
    # The scattering function is physical.
    Test("energy", "largest ∫ f cos: more than 1 creates energy", 1.01,
         lambda m: max(m.energy, default=0.0), of=AuditMeasurement, option="energy"),
    Test("reciprocity", "mean |f(i, r) - f(r, i)| over mean f", 0.02,
         lambda r: r.error, of=Reciprocity),
    # The tests detect errors of the size that they should.
    Test("negative controls", "samplers broken on purpose that the check did not catch", 0,
         lambda c: len(c.missed), of=Controls),
)  # fmt: skip
