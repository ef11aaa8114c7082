"""Audit any sampler on the sphere: does it draw what its pdf claims, and where not?"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cuticle._support import validate
from cuticle.checking.audit_case import Case, critical_z, examine
from cuticle.checking.audit_report import Audit, judge
from cuticle.checking.foreign_sampler import MAX_DIMENSIONS, Subject
from cuticle.checking.physics import reciprocity_error
from cuticle.checking.sample_file import Dump, audit_dump
from cuticle.sampling.densities import even_normal, longitudinal_normal, periodic_normal
from cuticle.sampling.sampler import Sampler

__all__ = ["Audit", "Case", "Dump", "audit", "audit_dump"]

DEFAULT_ANGLES = np.radians([-85, -75, -60, -30, 0, 30, 60, 75, 85.0])
SAMPLES = 200_000
LEVEL = 1e-4


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
    name: str | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Audit:
    """Audit a sampler: what it draws against what its pdf claims, viewer by viewer.

    Parameters
    ----------
    sample
        sample(theta_r, u) -> (theta_i, phi), (theta_i, phi, pdf) or (theta_i, phi, pdf, weight): theta_r one number, u
        (n, dimensions) uniform in [0, 1); radians; pdf per steradian, 0 for a sample that gives no direction; weight is
        f·cos(theta_i)/pdf, one value or one a channel. Or an object with `sample` and `pdf`, and `eval` if it has one:
        a `cuticle.Sampler`, `cuticle.Chiang(...).near(h)`, `cuticle.from_mitsuba(..., h=0)`.
    pdf
        pdf(theta_i, theta_r, phi) -> density per steradian, of arrays (of single numbers, slowly).
    eval
        eval(theta_i, theta_r, phi) -> f in 1/sr without a cosine, one value or one a channel. Without it weights and
        ESS are left out.
    theta_r
        Viewers, radians; ±{0, 30, 60, 75, 85}° if left out.
    samples
        Samples a viewer, 10,000 to 100 million.
    level
        Chance that a right sampler fails any test of the whole audit: half of it over the density tests of all
        viewers, half over the mean weights (Šidák).
    seed
        Of the random numbers.
    dimensions
        How many random numbers a sample takes.
    strands
        Of a `cuticle.Sampler` that covers several counts.
    lobes
        Names, and a function lobes(theta_i, theta_r, phi) -> (lobes, n) of each one's part of the pdf: the audit then says
        which lobe claims the region that fails.
    reciprocity, energy
        Whether to ask that f(theta_i, theta_r, phi) = f(theta_r, theta_i, -phi), and that ∫ f cos is at most 1.
    name
        What the sampler is called in the report.
    progress
        Called with a phase and a fraction from 0 to 1.

    Returns
    -------
    Audit
        Verdicts with numbers, and where they fail; `audit.ok`, `audit.to_dict()`, `audit.figure()`.

    Raises
    ------
    ValueError
        A function that raises or returns a wrong shape; a parameter out of range.

    Examples
    --------
    >>> import cuticle
    >>> near = cuticle.Chiang(eumelanin=1.3).near(0.3)
    >>> cuticle.audit(near, samples=20_000, theta_r=[0.5]).ok
    True
    """
    subject = _subject(sample, pdf, eval, dimensions, strands, lobes, name)
    angles = DEFAULT_ANGLES if theta_r is None else validate.angles("theta_r", theta_r, np.pi / 2 * (1 - 1e-6), np.float64)
    angles = np.atleast_1d(angles).ravel()
    if not len(angles):
        raise ValueError("theta_r must name at least one viewer, got none")
    validate.integer("samples", samples, 10_000, 100_000_000)
    validate.number("level", level, 1e-9, 0.5)
    validate.integer("seed", seed, 0, 2**63 - 1)
    if (reciprocity or energy) and subject.eval is None:
        raise ValueError("reciprocity and energy are of f: give eval")
    report = progress or (lambda phase, fraction: None)
    start = time.perf_counter()
    each = 1 - (1 - level / 2) ** (1 / len(angles))
    cases = []
    for i, t in enumerate(angles):
        report(f"theta_r {np.degrees(t):.3g}°", i / len(angles))
        cases.append(examine(subject, float(t), samples, each, np.random.default_rng([seed, i])))
    report("done", 1.0)
    asymmetry = reciprocity_error(subject, np.random.default_rng([seed, len(angles)])) if reciprocity else None
    verdicts, notes = judge(cases, each, critical_z(level / 2, len(angles)), samples, asymmetry, energy)
    return Audit(subject.name, tuple(cases), tuple(verdicts), tuple(notes), samples, level, time.perf_counter() - start)


def _subject(
    sample: Any,
    pdf: Callable[..., Any] | None,
    eval: Callable[..., Any] | None,
    dimensions: int,
    strands: float | None,
    lobes: tuple[Sequence[str], Callable[..., Any]] | None,
    name: str | None,
) -> Subject:
    validate.integer("dimensions", dimensions, 1, MAX_DIMENSIONS)
    names, densities = lobes if lobes is not None else ((), None)
    eval_pdf = None
    draw: Any = sample
    density: Any = pdf
    if isinstance(sample, Sampler):
        n = strands if strands is not None or len(sample.strands) > 1 else sample.strands[0]
        if n is None:
            counts = ", ".join(f"{c:g}" for c in sample.strands)
            raise ValueError(f"strands must be given: this sampler covers {counts}; strands=0 is direct light")
        name = name or repr(sample)
        if densities is None:
            names, densities = tuple(map(str, range(sample.lobes))), partial(_mixture_parts, sample, n)
        draw, density = partial(_with_strands, sample.sample, n), pdf or partial(_with_strands, sample.pdf, n)
    elif hasattr(sample, "sample"):
        if pdf is None and eval is None:
            eval_pdf = getattr(sample, "eval_pdf", None)  # one call for both
        draw, density, eval = sample.sample, pdf or getattr(sample, "pdf", None), eval or getattr(sample, "eval", None)
        name = name or repr(sample)
        if densities is None and getattr(sample, "lobe_names", None):
            names, densities = sample.lobe_names, sample.lobe_densities
    for which, function in (("sample", draw), ("pdf", density), *((("eval", eval),) if eval is not None else ())):
        if not callable(function):
            raise TypeError(f"{which} must be a function, got {type(function).__name__}; see help(cuticle.audit)")
    return Subject(draw, density, eval, name or "sampler", dimensions, names, densities, eval_pdf)


def _with_strands(function: Callable[..., Any], strands: float, *arguments: Any) -> Any:
    return function(*arguments, strands)


def _mixture_parts(sampler: Sampler, strands: float, theta_i: Any, theta_r: float, phi: Any) -> Any:
    """Each lobe's part of a mixture's density, per steradian."""
    azimuthal = even_normal if sampler.even else periodic_normal
    mixture = sampler.mixture(theta_r, strands)
    secant = 1 / np.maximum(np.cos(theta_i), 1e-9)
    parts = [
        weight * longitudinal_normal.pdf(theta_i, mean_t, sigma_t) * azimuthal.pdf(phi, mean_p, sigma_p) * secant
        for weight, mean_t, mean_p, sigma_t, sigma_p in zip(*mixture, strict=True)
    ]
    return np.array(parts)
