"""The proof that a sampler matches its pdf, and its pdf the scattering function it is used for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from cuticle._support import validate
from cuticle._support.quadrature import gauss_legendre
from cuticle.checking.cells import CELLS, Cells, widened
from cuticle.checking.verdicts import Judged, Verdict
from cuticle.sampling.quality import Density, measure
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import Bcsdf, luminance

DEFAULT_ANGLES = np.radians([-85, -75, -60, -30, 0, 30, 60, 75, 85.0])
CHANGE = 0.01  # total variation from which on a control has to be caught
INTEGRAL_DOUBLE, INTEGRAL_SINGLE = 1e-5, 1e-4
_PANELS = np.array([-8, -5.5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5.5, 8.0])[:, None]  # edges about a lobe's mean, in sigmas
_HEAVY = 0.1  # share of Σ w² that one sample may have before the mean's normal error means nothing


@dataclass(frozen=True)
class Case:
    """One viewer and strand count: what was measured.

    `integral`, `integral_single`: ∫ pdf over the sphere in double and single precision. `chi2`, `dof`, `p_value`: of
    the samples against the exact probabilities of the cells. `estimate`, `expected`, `z`: mean of f cos/p, ∫ f cos by
    quadrature (luminance), their difference in standard errors (NaN where one sample dominates). `pdf_mismatch`:
    largest relative difference between the pdf that came with a sample and the pdf asked for afterwards.
    """

    theta_r: float
    strands: float
    integral: float
    integral_single: float
    chi2: float
    dof: int
    p_value: float
    estimate: float
    expected: float
    z: float
    pdf_mismatch: float
    ess: float
    ess_channels: tuple[float, ...]
    largest_weight: float
    total_variation: float


@dataclass(frozen=True)
class Control:
    """A sampler broken on purpose, and whether the check caught it at the sample size it uses.

    `applies` is false where the broken density is all but the right one, within 1 % in total variation: turning phi
    where the density hardly depends on it, widening a lobe that is flat already.
    """

    name: str
    strands: float
    caught: bool
    applies: bool
    evidence: str


@dataclass(frozen=True)
class Report(Judged):
    """All cases, controls and verdicts of a check; `ok` if every verdict holds."""

    cases: tuple[Case, ...]
    controls: tuple[Control, ...]
    verdicts: tuple[Verdict, ...]
    samples: int
    level: float

    def __repr__(self) -> str:
        return self._told(f"{len(self.cases)} cases of {self.samples:,} samples")


def check(
    sampler: Sampler,
    model: Bcsdf,
    *,
    theta_r: ArrayLike | None = None,
    strands: Sequence[float] | None = None,
    samples: int = 1_000_000,
    level: float = 1e-3,
    seed: int = 1,
    progress: Callable[[str, float], None] | None = None,
) -> Report:
    """Check a sampler: its pdf integrates to 1, its samples follow it, and it estimates ∫ f cos without bias.

    Parameters
    ----------
    sampler, model
        The sampler, and the scattering function it is for.
    theta_r
        Viewer inclinations, radians in (-pi/2, pi/2); ±{0, 30, 60, 75, 85}° if left out.
    strands
        Strand counts; the sampler's own if left out.
    samples
        Samples a case, in single precision, as renderers draw them; 10,000 to 100 million.
    level
        Chance that a correct sampler fails any one family of tests (chi-square, mean): Šidák over all cases.
    seed
        Of the random numbers.
    progress
        Called with a phase and a fraction from 0 to 1.

    Returns
    -------
    Report
        Verdicts with numbers; `report.ok`. It carries negative controls: a lobe 5 % too wide, phi shifted by half a
        bin and a pdf scaled by 1 % must be caught at this sample size, else the check itself fails.
    """
    angles = DEFAULT_ANGLES if theta_r is None else validate.angles("theta_r", theta_r, np.pi / 2 * (1 - 1e-6), np.float64)
    counts = sampler.covers if strands is None else validate.strand_counts("strands", strands)
    validate.integer("samples", samples, 10_000, 100_000_000)
    validate.number("level", level, 1e-9, 0.5)
    validate.integer("seed", seed, 0, 2**63 - 1)
    report = progress or (lambda phase, fraction: None)
    pairs = [(float(t), n) for n in counts for t in np.atleast_1d(angles)]
    each = 1 - (1 - level) ** (1 / len(pairs))
    critical = float(-ndtri(each / 2))

    cases = []
    for i, (t, n) in enumerate(pairs):
        report(f"theta_r {np.degrees(t):.3g}°, {n:g} strands", i / (len(pairs) + len(counts)))
        cases.append(_case(sampler, _model_for(model, n), t, n, samples, np.random.default_rng([seed, i])))
    controls: list[Control] = []
    for j, n in enumerate(counts):
        report(f"negative controls, {n:g} strands", (len(pairs) + j) / (len(pairs) + len(counts)))
        controls += _controls(sampler, n, samples, each, np.random.default_rng([seed, len(pairs) + j]))
    report("done", 1.0)
    verdicts = _verdicts(cases, controls, each, critical)
    return Report(tuple(cases), tuple(controls), tuple(verdicts), samples, level)


def integrate_pdf(density: Density, sampler: Sampler, theta_r: float, strands: float, dtype: Any = np.float64) -> float:
    """Return ∫ pdf d omega over the sphere, by Gauss-Legendre panels as wide as `sampler`'s lobes are."""
    lobes = sampler.mixture(theta_r, strands)
    theta = lobes.mean_theta + _PANELS * lobes.sigma_theta
    phi = lobes.mean_phi + _PANELS * np.minimum(lobes.sigma_phi, np.pi)
    if sampler.even:
        phi = np.concatenate([phi, -phi])
    else:  # with the kink where a lobe's period ends; then all within one turn
        phi = np.concatenate([phi, lobes.mean_phi[None] + np.pi])
        phi = np.mod(phi + np.pi, 2 * np.pi) - np.pi
    order = 10 if len(lobes.weight) <= 4 else 6
    x, wx = gauss_legendre(_edges(theta, np.pi / 2), order)
    y, wy = gauss_legendre(_edges(phi, np.pi), order)
    xs, ys = x.astype(dtype), y.astype(dtype)
    p = density.pdf(xs[:, None], np.asarray(theta_r, dtype), ys[None, :], strands).astype(np.float64)
    return float((wx * np.cos(xs.astype(np.float64))) @ p @ wy)


def _edges(inner: NDArray[np.float64], end: float) -> NDArray[np.float64]:
    return np.unique(np.concatenate([inner.ravel(), np.linspace(-end, end, 9)]).clip(-end, end))


def _model_for(model: Bcsdf, strands: float) -> Bcsdf:
    if strands == getattr(model, "strands", strands):
        return model
    if not callable(getattr(model, "with_strands", None)):
        raise TypeError(
            f"{type(model).__name__} knows no strands: give a model with with_strands(n) to check at {strands:g}"
        )
    return model.with_strands(strands)  # type: ignore[attr-defined]


def _draw(sampler: Sampler, theta_r: float, strands: float, samples: int, rng: np.random.Generator) -> tuple[NDArray, ...]:
    u = rng.random((samples, 3), np.float32)
    return tuple(sampler.sample(np.float32(theta_r), u, strands))


def _case(sampler: Sampler, model: Bcsdf, theta_r: float, strands: float, samples: int, rng: np.random.Generator) -> Case:
    theta, phi, p = _draw(sampler, theta_r, strands, samples, rng)
    chi2, dof, p_value = Cells(sampler, theta_r, strands).test(theta, phi)
    quality = measure(sampler, model, theta_r, strands)
    count = min(samples, 100_000)
    ti = theta[:count].astype(np.float64)
    f = luminance(np.asarray(model.eval(ti, theta_r, phi[:count].astype(np.float64)), np.float64)) * np.cos(ti)
    weight = f / p[:count]
    expected = float(luminance(np.array(quality.energy)))
    estimate, deviation = float(weight.mean()), float(weight.std())
    heavy = float((weight**2).max() / (weight**2).sum()) > _HEAVY
    # Quadrature's own error, as far as two rules differ, must not be called a bias.
    error = np.hypot(deviation / np.sqrt(count), quality.energy_error)
    again = sampler.pdf(theta[:count], np.float32(theta_r), phi[:count], strands)
    return Case(
        theta_r=theta_r,
        strands=strands,
        integral=integrate_pdf(sampler, sampler, theta_r, strands),
        integral_single=integrate_pdf(sampler, sampler, theta_r, strands, np.float32),
        chi2=chi2,
        dof=dof,
        p_value=p_value,
        estimate=estimate,
        expected=expected,
        z=float("nan") if heavy else (estimate - expected) / error,
        pdf_mismatch=float(np.max(np.abs(again / p[:count] - 1))),
        ess=quality.ess,
        ess_channels=quality.ess_channels,
        largest_weight=quality.largest_weight,
        total_variation=quality.total_variation,
    )


class _Scaled:
    """A pdf that lies by a factor."""

    def __init__(self, sampler: Sampler, factor: float) -> None:
        self._sampler, self._factor = sampler, factor

    def pdf(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, strands: ArrayLike | None = None) -> NDArray:
        return self._factor * self._sampler.pdf(theta_i, theta_r, phi, strands)


def _controls(sampler: Sampler, strands: float, samples: int, each: float, rng: np.random.Generator) -> list[Control]:
    theta_r = 0.0
    cells = Cells(sampler, theta_r, strands)
    wide = [cells.distance(cells.widened(k)) for k in range(sampler.lobes)]
    lobe, half_bin = int(np.argmax(wide)), np.pi / CELLS
    theta, phi, _ = _draw(widened(sampler, lobe, 1.05), theta_r, strands, samples, rng)
    p_wide = cells.test(theta, phi)[2]
    theta, phi, _ = _draw(sampler, theta_r, strands, samples, rng)
    turned = np.pi - np.mod(np.pi - half_bin - phi.astype(np.float64), 2 * np.pi)  # (-pi, pi]
    p_turned = cells.test(theta, turned.astype(np.float32))[2]
    scaled = abs(integrate_pdf(_Scaled(sampler, 1.01), sampler, theta_r, strands) - 1)
    tv_wide, tv_turned = wide[lobe], cells.distance(cells.turned(half_bin))
    return [
        Control("a lobe 5 % too wide", strands, p_wide < each, tv_wide >= CHANGE, f"p = {p_wide:.2g}, TV {tv_wide:.2g}"),
        Control(
            "phi shifted by half a bin",
            strands,
            p_turned < each,
            tv_turned >= CHANGE,
            f"p = {p_turned:.2g}, TV {tv_turned:.2g}",
        ),
        Control("pdf scaled by 1 %", strands, scaled > INTEGRAL_DOUBLE, True, f"|∫ pdf - 1| = {scaled:.2g}"),
    ]


def _where(case: Case) -> str:
    return f"at theta_r {np.degrees(case.theta_r):.3g}°, {case.strands:g} strands"


def _verdicts(cases: Sequence[Case], controls: Sequence[Control], each: float, critical: float) -> list[Verdict]:
    def worst(key: Callable[[Case], float]) -> Case:
        return max(cases, key=key)

    def small(name: str, key: Callable[[Case], float], limit: float, meaning: str) -> Verdict:
        # A NaN compares false and so fails: every value must be known to be within.
        bad = [c for c in cases if not key(c) <= limit]
        at = bad[0] if bad else worst(key)
        return Verdict(name, not bad, key(at), limit, _where(at), meaning)

    least = min(cases, key=lambda c: c.p_value)
    testable = [c for c in cases if np.isfinite(c.z)]
    verdicts = [
        small("∫ pdf, double", lambda c: abs(c.integral - 1), INTEGRAL_DOUBLE, "the pdf is a density: |∫ pdf - 1|"),
        small("∫ pdf, single", lambda c: abs(c.integral_single - 1), INTEGRAL_SINGLE, "so it is in single precision"),
        Verdict(
            "chi-square",
            all(c.p_value >= each for c in cases),
            least.p_value,
            each,
            _where(least),
            "samples follow the pdf: least p-value over all cases, limit by Šidák",
        ),
        small("pdf of a sample", lambda c: c.pdf_mismatch, 1e-3, "sample and pdf tell one density: relative difference"),
    ]
    mean = "mean of f cos/p"
    if testable:
        far = max(testable, key=lambda c: abs(c.z))
        left = len(cases) - len(testable)
        meaning = "the estimate has no bias: standard errors from ∫ f cos"
        if left:
            meaning += f"; {left} cases left out, where one sample dominates"
        verdicts.append(Verdict(mean, abs(far.z) <= critical, abs(far.z), critical, _where(far), meaning))
    else:
        meaning = "weights have no bound: one sample dominates every case"
        verdicts.append(Verdict(mean, False, float("nan"), critical, "everywhere", meaning))
    missed = [c for c in controls if c.applies and not c.caught]
    idle = sum(not c.applies and not c.caught for c in controls)
    where = f"{sum(c.caught for c in controls)} of {len(controls)} caught"
    if missed:
        where += f"; missed: {missed[0].name}, {missed[0].strands:g} strands"
    if idle:
        where += f"; {idle} hardly change the density"
    meaning = "samplers broken on purpose are caught at this sample size"
    verdicts.append(Verdict("negative controls", not missed, len(missed), 0, where, meaning))
    return verdicts
