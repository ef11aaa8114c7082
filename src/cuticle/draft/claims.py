"""The claims of the draft, and whether the numbers support them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cuticle.draft.tables import USED, VIEWERS, PeakRow, SliceRow
from cuticle.fitting.costs import measured_costs, sample_cost, traced_cost
from cuticle.sampling.distribution import tabulate
from cuticle.scattering.bcsdf import Bcsdf

HOLDS, PARTLY, FAILS = "holds", "holds in part", "does not hold"
_PATH = traced_cost(0) - traced_cost(0, path=0.0)  # kernels for the ray behind a sample


@dataclass(frozen=True)
class Claim:
    """One sentence of the draft, the verdict, the finding, and the numbers behind it."""

    quote: str
    verdict: str
    finding: str
    numbers: dict[str, Any]


def shift_claim(rows: Sequence[SliceRow]) -> Claim:
    """Judge the azimuthal shift of 0."""
    inner = [r for r in rows if abs(r.theta_r) <= math.radians(USED + 0.5)]
    offsets = {round(math.degrees(r.theta_r)): math.degrees(r.peak_offset) for r in inner}
    worst = max(offsets, key=lambda t: offsets[t])
    normal = offsets[0]
    maximum = (
        f"The maximum itself lies within {offsets[worst]:.1f}° of the axis."
        if offsets[worst] <= 2
        else f"The maximum itself lies off the axis: by {normal:.1f}° at normal view and {offsets[worst]:.1f}° at theta_r"
        f" {worst}°, because the top of the highlight is flat, or split in two."
    )
    return Claim(
        "The shift in the azimuthal direction ϕ_i remains constant at exactly 0 degrees.",
        HOLDS if offsets[worst] <= 2 else PARTLY,
        "Scattering is symmetric about the axis, so the Gaussian along phi is centred exactly. " + maximum,
        {"peak_offset_deg": offsets},
    )


def width_claim(rows: Sequence[SliceRow]) -> Claim:
    """Judge the constant sigma_H."""
    values = {
        round(math.degrees(r.theta_r)): r.horizontal.sigma
        for r in rows
        if r.horizontal and r.holds and abs(r.theta_r) <= math.radians(USED + 0.5)
    }
    quote = "The standard deviation remains constant for the longitudinal case. (σ_H = 0.29)"
    if not values:
        return Claim(quote, FAILS, "A Gaussian does not describe the highlight of this fibre.", {"sigma_H": values})
    mean, low, high = float(np.mean(list(values.values()))), min(values.values()), max(values.values())
    inner = [v for t, v in values.items() if abs(t) <= 40] or [mean]
    change = (high - low) / mean
    return Claim(
        quote,
        HOLDS if change <= 0.1 else PARTLY if change <= 0.35 else FAILS,
        f"The mean is {mean:.3f} rad here. Over |theta_r| ≤ 70°, sigma_H varies from {low:.3f} to {high:.3f} rad, by"
        f" {100 * change:.0f} %; over |theta_r| ≤ 40°, from {min(inner):.3f} to {max(inner):.3f} rad.",
        {"constant_rad": mean, "sigma_H": values},
    )


def turning_claim(rows: Sequence[PeakRow]) -> Claim:
    """Judge that the peak's theta_i does not depend on phi_r."""
    spread = 0.0
    for t in {r.theta_r for r in rows}:
        values = [r.theta_i for r in rows if r.theta_r == t]
        spread = max(spread, math.degrees(max(values) - min(values)))
    return Claim(
        "Varying ϕ_r does not change the θ_i-angle of the peak.",
        HOLDS if spread <= 0.1 else FAILS,
        f"Over five phi_r, it changes by {spread:.2f}°. The scattering of a circular fibre depends on phi_i - phi_r only, so"
        " the whole pattern turns with the viewer.",
        {"change_deg": spread},
    )


def azimuth_claim(model: Bcsdf, strands: Sequence[float]) -> Claim:
    """Judge that the azimuth has no effect through strands."""
    numbers = {}
    for n in strands:
        own = model.with_strands(n)  # type: ignore[attr-defined]
        loss, varies, variation = [], [], []
        for t in VIEWERS:
            d = tabulate(own, float(t), n_theta=180, n_phi=180)
            mass = d.luminance * np.cos(d.theta_i)[:, None]
            mass /= mass.sum()
            flat = mass.mean(axis=1, keepdims=True)  # the same marginal in theta_i, uniform in phi
            loss.append(1 - 1 / float((mass**2 / np.maximum(flat, 1e-300)).sum()))
            around = mass.sum(axis=0)
            varies.append(float((around.max() - around.min()) / around.mean()))
            variation.append(0.5 * float(np.abs(mass - flat).sum()))
        numbers[f"{n:g}"] = {"ess_lost": max(loss), "varies_by": max(varies), "total_variation": max(variation)}
    worst = max(numbers, key=lambda n: numbers[n]["ess_lost"])
    w, last = numbers[worst], numbers[f"{strands[-1]:g}"]
    return Claim(
        "The azimuthal variation has no impact on the response. (through strands)",
        HOLDS if w["ess_lost"] <= 0.01 else PARTLY if w["ess_lost"] <= 0.1 else FAILS,
        f"Through {worst} strand{'s' if worst != '1' else ''}, the density varies around the fibre by"
        f" {100 * w['varies_by']:.0f} % of its mean (TV distance from a flat azimuth {w['total_variation']:.3f}). A sampler"
        f" that is flat in phi and perfect in theta_i loses {100 * w['ess_lost']:.1f} % of its ESS, and"
        f" {100 * last['ess_lost']:.1f} % through {strands[-1]:g} strands. These are the worst of five viewers up to 60°.",
        numbers,
    )


def match_claim(quality: dict[str, dict[str, dict[str, float]]], count: int) -> Claim:
    """Judge that the Gaussians match pretty well.

    `quality[sampler][strands]` holds mean "ess" and "total_variation", `count` is the number of fitted lobes.
    """
    own = quality["found"] if "found" in quality else quality["draft"]
    through = {n: q for n, q in own.items() if n != "0"}
    low = min(through, key=lambda n: through[n]["ess"])
    lobes = quality["lobes"]
    source = "the functions found for this fibre" if "found" in quality else "the draft's printed functions"
    misses = ": it holds the highlight and misses the other lobes" if own["0"]["ess"] < 0.9 else ""
    verdict = HOLDS if min(q["ess"] for q in own.values()) >= 0.9 else PARTLY if through[low]["ess"] >= 0.75 else FAILS
    return Claim(
        "The Gaussian functions match pretty well.",
        verdict,
        f"Through strands, with {source}, the worst ESS is {through[low]['ess']:.2f}, with a TV distance of"
        f" {through[low]['total_variation']:.2f} (n = {low}). For direct light, one product of two Gaussians has ESS"
        f" {own['0']['ess']:.2f} and TV distance {own['0']['total_variation']:.2f}{misses}."
        f" {count} fitted lobes have {lobes['0']['ess']:.3f} and {lobes['0']['total_variation']:.3f}. The values are means"
        " over five viewers up to 60°; a tenth of the draft's form is nearly uniform.",
        quality,
    )


def uniform_claim(quality: dict[str, dict[str, dict[str, float]]], lobes: dict[str, int]) -> Claim:
    """Judge that uniform sampling might be more efficient after all.

    `lobes` holds each sampler's number of lobes, 0 for the uniform sphere. Costs are those that `make bench` measured.
    """
    rows: dict[str, dict[str, float]] = {}
    for name, q in quality.items():
        cost = sample_cost(lobes[name])
        rows[name] = {
            "cost": cost,
            **{f"ess_per_sample_cost_{n}": q[n]["ess"] / cost for n in ("0", "2")},
            **{f"ess_per_traced_cost_{n}": q[n]["ess"] / (cost + _PATH) for n in ("0", "2")},
        }
    order = ("uniform", "found" if "found" in rows else "draft", "lobes")

    def three(key: str, scale: float = 1.0) -> str:
        return ", ".join(f"{scale * rows[name][key]:.2f}" for name in order)

    traced = [rows[name]["ess_per_traced_cost_0"] for name in order]
    return Claim(
        "If the function becomes too expensive to evaluate, then uniform sampling might be more efficient after all.",
        HOLDS if traced[0] >= max(traced[1:]) else FAILS,
        f"For the uniform sphere, the draft's form and {lobes['lobes']} fitted lobes a sample costs {three('cost')} kernels"
        f" ({measured_costs()['origin']}). ESS per cost of the sample alone is {three('ess_per_sample_cost_0')} for direct"
        f" light: drawing uniformly is cheap. But a sample is drawn to trace a ray. With {_PATH:.0f} kernels for the ray,"
        f" 100 ESS/cost is {three('ess_per_traced_cost_0', 100)} for direct light and {three('ess_per_traced_cost_2', 100)}"
        " through two strands.",
        rows,
    )
