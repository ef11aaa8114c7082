"""Check a sampler against its scattering function: does it draw what its pdf claims, and estimate without bias?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.progress import Progress, silent
from cuticle.checking.cell_probabilities import CELLS, CellProbabilities, compare_samples, from_cdfs
from cuticle.checking.measurements import CheckMeasurement, Control, Controls, Drawn
from cuticle.checking.sphere_integrals import integrate_pdf
from cuticle.checking.tests import INTEGRAL_DOUBLE, TESTS
from cuticle.checking.verdicts import Judge, Judged, Test, Thresholds, Verdict, deviations, sidak, viewers
from cuticle.sampling.lobe_table import SIGMA_PHI, SIGMA_THETA
from cuticle.sampling.quality import measure
from cuticle.sampling.sampler import Sampler, fitted
from cuticle.scattering.bcsdf import Bcsdf, check_model, luminance

_DOMINANT = 0.1  # share of Σ w² of one sample beyond which the mean has no normal error
_LEAST_CHANGE = 0.01  # total variation from which on a negative control has to be caught
_WIDER, _SCALED = 1.05, 1.01
_WEIGHED = 100_000  # samples whose weight and pdf are evaluated


@dataclass(frozen=True, eq=False)
class Report(Judged):
    """The result of a check."""

    cases: tuple[CheckMeasurement, ...]
    controls: tuple[Control, ...]
    verdicts: tuple[Verdict, ...]
    samples: int
    level: float

    def __repr__(self) -> str:
        return self._summary(f"{len(self.cases)} cases of {self.samples:,} samples")


def check(
    sampler: Sampler,
    model: Bcsdf,
    *,
    theta_r: ArrayLike | None = None,
    strands: Sequence[float] | None = None,
    samples: int = 1_000_000,
    level: float = 1e-3,
    seed: int = 1,
    extra: Sequence[Test] = (),
    progress: Progress | None = None,
) -> Report:
    """Check a sampler: its pdf integrates to 1, its samples follow the pdf, and it estimates ∫ f cos without bias.

    Parameters
    ----------
    sampler, model
        The sampler, and the scattering function that it is meant for.
    theta_r
        Viewers, radians in (-pi/2, pi/2); default ±{0, 30, 60, 75, 85}°.
    strands
        Strand counts; default: the sampler's own.
    samples
        Samples per viewer and strand count, in single precision, as renderers draw them; 10,000 to 100 million.
    level
        False-positive rate of each family of tests (chi-square, mean) over all viewers and strand counts (Šidák).
    seed
        Seed of the random numbers.
    extra
        Tests of your own; see docs/extending/verdict.md. `level` does not cover them.
    progress
        progress(phase, fraction), with a fraction from 0 to 1.

    Returns
    -------
    Report
        Verdicts; `report.ok`. The check also tests itself with negative controls: it fails unless it catches a lobe 5 % too
        wide, phi shifted by half a bin and a pdf scaled by 1 % at this sample size.
    """
    fitted("sampler", sampler, "cuticle.audit tests any other, a family's or your own")
    check_model(model)
    angles = viewers(theta_r, samples, level, seed)
    counts = sampler.covers if strands is None else validate.strand_counts("strands", strands)
    report = progress or silent
    pairs = [(float(t), n) for n in counts for t in angles]
    each = sidak(level, len(pairs))
    judge = Judge((*TESTS, *extra), Thresholds(each, deviations(each)))
    steps = len(pairs) + len(counts)

    cases = []
    for i, (t, n) in enumerate(pairs):
        report(f"theta_r {np.degrees(t):.3g}°, {n:g} strands", i / steps)
        own, rng = _model_for(model, n), np.random.default_rng([seed, i])
        cases.append(judge.examine(_measure(sampler, own, t, n, samples, rng)))
    controls: tuple[Control, ...] = ()
    for i, n in enumerate(counts, len(pairs)):
        report(f"negative controls, {n:g} strands", i / steps)
        controls += _negative_controls(sampler, n, samples, each, np.random.default_rng([seed, i]))
    judge.examine(Controls(controls))
    report("done", 1.0)
    return Report(tuple(cases), controls, judge.verdicts(), samples, level)


def _model_for(model: Bcsdf, strands: float) -> Bcsdf:
    if strands == getattr(model, "strands", strands):
        return model
    if not callable(getattr(model, "with_strands", None)):
        raise TypeError(
            f"{type(model).__name__} knows no strands: to check at {strands:g}, give a model that has with_strands(n)"
        )
    return model.with_strands(strands)  # type: ignore[attr-defined]


def _measure(
    sampler: Sampler, model: Bcsdf, theta_r: float, strands: float, samples: int, rng: np.random.Generator
) -> CheckMeasurement:
    """Measure one viewer and strand count."""
    theta, phi, p = _draw(sampler, theta_r, strands, samples, rng)
    fit = compare_samples(from_cdfs(sampler, theta_r, strands), theta, phi)
    quality = measure(sampler, model, theta_r, strands)
    some = slice(_WEIGHED)
    theta_i = theta[some].astype(np.float64)
    f = luminance(np.asarray(model.eval(theta_i, theta_r, phi[some].astype(np.float64)), np.float64)) * np.cos(theta_i)
    weight = f / p[some]
    expected = float(luminance(np.array(quality.energy)))
    estimate, deviation = float(weight.mean()), float(weight.std())
    dominated = float((weight**2).max() / (weight**2).sum()) > _DOMINANT
    # The difference of two rules estimates the quadrature's own error, which is no bias of the sampler.
    error = np.hypot(deviation / np.sqrt(len(weight)), quality.energy_error or 0.0)
    again = sampler.pdf(theta[some], np.float32(theta_r), phi[some], strands)
    return CheckMeasurement(
        theta_r=theta_r, strands=strands,
        integral=integrate_pdf(sampler, sampler, theta_r, strands),
        integral_single=integrate_pdf(sampler, sampler, theta_r, strands, np.float32),
        chi2=fit.statistic, dof=fit.dof, p_value=fit.p_value,
        estimate=estimate, expected=expected, z=float("nan") if dominated else (estimate - expected) / error,
        pdf_mismatch=float(np.max(np.abs(again / p[some] - 1))),
        ess=quality.ess, ess_channels=quality.ess_channels, largest_weight=quality.largest_weight,
        total_variation=quality.total_variation, drawn=Drawn(samples, theta, phi, p, weight),
    )  # fmt: skip


def _negative_controls(
    sampler: Sampler, strands: float, samples: int, p_value: float, rng: np.random.Generator
) -> tuple[Control, ...]:
    """Return three controls at theta_r = 0; one that changes samples is caught where their p-value is below `p_value`.

    They are: the lobe that changes the density most 5 % too wide, phi turned by half a cell, the pdf times 1.01.
    """
    theta_r = 0.0
    right = from_cdfs(sampler, theta_r, strands)

    def control(name: str, theta: NDArray, phi: NDArray, changed: NDArray[np.float64]) -> Control:
        p, distance = compare_samples(right, theta, phi).p_value, right.distance(changed)
        return Control(name, strands, p < p_value, distance >= _LEAST_CHANGE, f"p = {p:.2g}, TV {distance:.2g}")

    wide = [
        widened(sampler, k, _WIDER).cell_probabilities(right.theta, right.phi, theta_r, strands)
        for k in range(sampler.lobes)
    ]
    lobe = int(np.argmax([right.distance(p) for p in wide]))
    theta, phi, _ = _draw(widened(sampler, lobe, _WIDER), theta_r, strands, samples, rng)
    too_wide = control("a lobe 5 % too wide", theta, phi, wide[lobe])
    theta, phi, _ = _draw(sampler, theta_r, strands, samples, rng)
    half = np.pi / CELLS
    turned = np.pi - np.mod(np.pi - half - phi.astype(np.float64), 2 * np.pi)  # (-pi, pi]
    shifted = _turned(sampler, right, theta_r, strands, half)
    scaled = SimpleNamespace(pdf=lambda *a: _SCALED * sampler.pdf(*a))
    integral = abs(integrate_pdf(scaled, sampler, theta_r, strands) - 1)
    return (
        too_wide,
        control("phi shifted by half a bin", theta, turned.astype(np.float32), shifted),
        Control("pdf scaled by 1 %", strands, integral > INTEGRAL_DOUBLE, True, f"|∫ pdf - 1| = {integral:.2g}"),
    )


def _draw(sampler: Sampler, theta_r: float, strands: float, samples: int, rng: np.random.Generator) -> tuple[NDArray, ...]:
    """Return theta_i, phi and pdf of samples in single precision, as renderers draw them."""
    u = rng.random((samples, 3), np.float32)
    return tuple(sampler.sample(np.float32(theta_r), u, strands))


def widened(sampler: Sampler, lobe: int, factor: float) -> Sampler:
    """Return a sampler with one lobe's widths scaled."""
    nodes = sampler.nodes.copy()
    nodes[:, :, [SIGMA_THETA, SIGMA_PHI], lobe] *= factor
    return replace(sampler, nodes=nodes)


def _turned(sampler: Sampler, cells: CellProbabilities, theta_r: float, strands: float, shift: float) -> NDArray[np.float64]:
    """Return the cells' probabilities for the same sampler with phi turned by `shift`."""
    at = (cells.phi - shift + np.pi) % (2 * np.pi) - np.pi
    total = np.zeros_like(cells.value)
    for k, weight in enumerate(sampler.mixture(theta_r, strands).weight):
        along_phi = np.diff(sampler.cdf_phi(at, theta_r, k, strands)) % 1.0
        total += weight * np.outer(np.diff(sampler.cdf_theta(cells.theta, theta_r, k, strands)), along_phi)
    return total
