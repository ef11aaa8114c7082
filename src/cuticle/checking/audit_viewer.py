"""Measure a foreign sampler at one viewer: what its pdf claims, by quadrature, and what it draws."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle.checking.cell_probabilities import CellProbabilities, Groups
from cuticle.checking.foreign_sampler import ForeignSampler
from cuticle.checking.measurements import AuditMeasurement, Drawn, Maps
from cuticle.checking.regions import repeated_angles, worst_region
from cuticle.checking.sphere_integrals import Integrals, cell_index, integrate
from cuticle.sampling.quality import effective_sample_size
from cuticle.scattering.bcsdf import luminance

Array = NDArray[np.float64]
MEAN_CELLS = 6  # cells along each axis for the mean weight
_PILOT = 20_000  # samples that only place the cells
_EVEN = 61  # cells of one size along each axis: an odd number, so that 0 lies within one
_LIKE = 36  # cells of like probability along each axis
_COARSE = (12, 8)  # fewer of those, for differences that are small but everywhere
_TOLERANCE = 1e-3  # of ∫ pdf over all cells
_NARROWEST = 1e-5  # radians
_SHARP = 100.0  # 1/sr: a lobe of such a pdf may be narrower than the cells
_ACROSS = 1e-9  # radians beyond an edge
_DOMINANT = 0.04  # a weight's share of the mean's deviation beyond which the mean is not normal
_COMPARED = 100_000  # samples whose pdf and weight are evaluated again
NOTHING = 1e-12  # 1/sr: a smaller density counts as 0


def measure_viewer(
    sampler: ForeignSampler, theta_r: float, samples: int, critical: float, rng: np.random.Generator
) -> AuditMeasurement:
    """Measure one viewer; where the p-value is below `critical`, find the region that differs."""
    pilot = sampler.draw(theta_r, _PILOT, rng)
    theta, phi = _Axis.adapted(pilot.theta, np.pi / 2), _Axis.adapted(pilot.phi, np.pi)
    integrand = _Integrand(sampler, theta_r)
    peaks = _peaks(sampler, pilot, theta_r, theta.edges, phi.edges)
    claimed = _Claimed(integrate(integrand, theta.edges, phi.edges, _TOLERANCE, peaks), integrand.channels)
    cells = CellProbabilities(theta.edges, phi.edges, claimed.pdf, claimed.pdf_error)
    drawn = sampler.draw(theta_r, samples, rng)
    counts = cells.count(drawn.theta, drawn.phi)
    assert counts is not None  # `draw` keeps what lies on the sphere
    coarse = Groups(_thinned(theta.like, _COARSE[0]), _thinned(phi.like, _COARSE[1]))
    along = Groups(theta.like, None), Groups(None, phi.like)
    fit = cells.test(
        counts, samples, (Groups(theta.even, phi.even), Groups(theta.like, phi.like), coarse, *along),
        bands=(Groups(theta.even, None), Groups(None, phi.even)),
    )  # fmt: skip
    region, lobe = None, ""
    if fit.p_value < critical:
        region = worst_region(counts, claimed.pdf * samples, claimed.pdf_error * samples, theta.edges, phi.edges)
        lobe = sampler.lobe_behind(region, theta_r, theta.edges, phi.edges, samples)
    share = coarse.sums(claimed.pdf)
    again = _compare_again(sampler, drawn, theta_r)
    mean_z, mean_where, left_out = _mean_weights(claimed, drawn, again.weights, theta, phi)
    n = samples
    return AuditMeasurement(
        theta_r=theta_r, integral=float(claimed.pdf.sum()), integral_error=float(claimed.pdf_error.sum()),
        chi2=fit.statistic, dof=fit.dof, p_value=fit.p_value,
        total_variation=0.5 * float(np.abs(coarse.sums(counts) / n - share).sum()),
        noise_floor=0.5 * float(np.sqrt(2 * share * np.maximum(1 - share, 0) / (np.pi * n)).sum()),
        mean_z=mean_z, mean_where=mean_where, means_left_out=left_out,
        pdf_mismatch=again.pdf, weight_mismatch=again.weight, estimate_mismatch=again.estimate,
        dropped=drawn.dropped / n, invalid=drawn.invalid / n, outside=drawn.outside / n, biased=drawn.biased / n,
        bad_density=integrand.bad_density, bad_values=integrand.bad_values,
        region=region, lobe=lobe, repeated=tuple(repeated_angles(drawn.theta, drawn.phi)),
        maps=Maps(theta.edges, phi.edges, counts / n, claimed.pdf), drawn=replace(drawn, weight=again.weights),
        **claimed.quality(),
    )  # fmt: skip


def _peaks(sampler: ForeignSampler, pilot: Drawn, theta_r: float, theta: Array, phi: Array) -> tuple[Array, Array, Array]:
    """Return where the pdf may be large, and its value there: a pilot sample, and what lies across the edges of its cells.

    Of a peak narrower than a cell, what reaches into the next cells lies at their very edge, where the nodes of no rule are,
    and may have drawn no sample of the pilot.
    """

    def value(t: Array, p: Array) -> Array:
        return np.nan_to_num(sampler.density(t, theta_r, p), posinf=0.0) if len(t) else t

    def across(x: Array, edges: Array) -> tuple[Array, Array, Array]:
        at = cell_index(x, edges)
        return x, np.maximum(edges[at] - _ACROSS, edges[0]), np.minimum(edges[at + 1] + _ACROSS, edges[-1])

    seen = value(pilot.theta, pilot.phi)
    sharp = seen > _SHARP
    pairs = list(product(across(pilot.theta[sharp], theta), across(pilot.phi[sharp], phi)))[1:]
    t, p = (np.concatenate(x) for x in zip(*pairs, strict=True))
    return np.append(pilot.theta, t), np.append(pilot.phi, p), np.append(seen, value(t, p))


@dataclass(frozen=True)
class _Axis:
    """Edges of the fine cells along one axis, and the first of them in each cell of one size and of like probability."""

    edges: Array
    even: NDArray[np.intp]
    like: NDArray[np.intp]

    @classmethod
    def adapted(cls, pilot: Array, end: float) -> _Axis:
        """Return the axis from -end to end whose cells of like probability follow a pilot sample."""
        even = np.linspace(-end, end, _EVEN + 1)
        inner = np.linspace(0, 1, _LIKE + 1)[1:-1]
        like = np.quantile(pilot, inner) if len(pilot) else np.linspace(-end, end, _LIKE + 1)[1:-1]
        like = _apart(np.unique(np.concatenate([[-end], like, [end]])))
        edges = _apart(np.unique(np.concatenate([even, like])))
        edges[-1] = end
        first = (np.unique(np.abs(edges[None, :] - e[:-1, None]).argmin(axis=1)) for e in (even, like))
        return cls(edges, *first)


def _apart(edges: Array) -> Array:
    return edges[np.concatenate([[True], np.diff(edges) > _NARROWEST])]


def _thinned(first: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    return first[:: max(1, -(-len(first) // count))]


class _Integrand:
    """pdf and moments of f·cos as columns; it counts the values that are not finite or negative, and takes them as 0."""

    def __init__(self, sampler: ForeignSampler, theta_r: float) -> None:
        self._sampler, self._theta_r = sampler, theta_r
        self.bad_density, self.bad_values, self.channels = 0, 0, 0

    def __call__(self, theta: Array, phi: Array) -> Array:
        p, f = self._sampler.values(theta, self._theta_r, phi)
        wrong = ~(np.isfinite(p) & (p >= 0))
        self.bad_density += int(wrong.sum())
        p = np.where(wrong, 0, p)
        if f is None:
            return p[:, None]
        wrong = ~(np.isfinite(f) & (f >= 0))
        self.bad_values += int(wrong.any(axis=1).sum())
        f = np.where(wrong, 0, f)
        self.channels = f.shape[1]
        f = np.column_stack([luminance(f), f])
        reached = p > NOTHING
        divisor = np.where(reached, p, 1)
        second = f**2 / divisor[:, None] * reached[:, None]
        lost, wasted = f[:, 0] * ~reached, p * (f[:, 0] <= 0)
        weight = np.where(reached, f[:, 0] / divisor, 0)
        return np.column_stack([p, lost, wasted, weight, f, second])


class _Claimed:
    """The integrals over cells, by name; `f`, ∫ f cos, and `second`, ∫ (f cos)²/p: the luminance, then the channels."""

    def __init__(self, integrals: Integrals, channels: int) -> None:
        value, self._has_f = integrals.value, channels > 0
        self.pdf, self.pdf_error = value[..., 0], integrals.error[..., 0]
        if self._has_f:
            self.lost, self.wasted, self.largest_weight = value[..., 1], value[..., 2], float(integrals.largest[3])
            self.f, self.second = np.split(value[..., 4:], 2, axis=-1)

    def quality(self) -> dict[str, Any]:
        """Return ESS, weights and energy. What lies where the pdf is 0 is no part of the ESS: it is `lost`."""
        if not self._has_f:
            return dict(ess=np.nan, ess_channels=(), largest_weight=np.nan, energy=(), lost=0.0, wasted=0.0)
        f, second = self.f.sum(axis=(0, 1)), self.second.sum(axis=(0, 1))
        ess = effective_sample_size(f, second)
        energy = max(float(f[0]), 1e-300)
        return dict(
            ess=float(ess[0]), ess_channels=tuple(map(float, ess[1:])), largest_weight=self.largest_weight / energy,
            energy=tuple(map(float, f[1:])), lost=float(self.lost.sum()) / energy,
            wasted=float(self.wasted.sum()) / max(float(self.pdf.sum()), 1e-300),
        )  # fmt: skip


class _Again(NamedTuple):
    """What `sample` returned beside what is evaluated at its directions; without f, a weight is 1."""

    pdf: float = 0.0  # share of samples that differ
    weight: float = 0.0  # the same
    estimate: float = 0.0  # relative difference of the means, the worst channel's
    weights: Array | None = None  # the samples', luminance; None without f


def _compare_again(sampler: ForeignSampler, drawn: Drawn, theta_r: float) -> _Again:
    theta, phi = drawn.theta[:_COMPARED], drawn.phi[:_COMPARED]
    count = len(theta)
    if not count:
        return _Again()
    p, f = sampler.values(theta, theta_r, phi)
    returned = p if drawn.pdf is None else drawn.pdf[:count]
    with np.errstate(divide="ignore", invalid="ignore"):
        there, came = (np.nan_to_num((p[:, None] if f is None else f) / x[:, None], posinf=0.0) for x in (p, returned))
    pdf_mismatch, weight_mismatch = float((~(np.abs(returned - p) <= 0.02 * np.abs(p))).mean()), 0.0
    if f is not None and drawn.weight is not None:
        weight = drawn.weight[:count]
        if weight.shape[1] != came.shape[1]:  # a luminance
            weight, came, there = (luminance(x)[:, None] for x in (weight, came, there))
        differs = ~(np.abs(weight - came) <= 0.02 * np.abs(came) + 1e-6)
        weight_mismatch, came = float(differs.any(axis=1).mean()), weight
    # Where either is taken they are the same numbers, but for rounding: no variance hides what differs, however rare.
    total, error = there.sum(axis=0), np.abs((came - there).sum(axis=0))
    estimate = float(np.max(error / np.where(total > 0, total, 1), where=total > 0, initial=0.0))
    return _Again(pdf_mismatch, weight_mismatch, estimate, None if f is None else luminance(came))


def _mean_weights(claimed: _Claimed, drawn: Drawn, weight: Array | None, theta: _Axis, phi: _Axis) -> tuple[float, str, int]:
    """Return the mean weight's largest deviation from ∫ f cos within a cell, where, and how many cells cannot be tested."""
    if weight is None:
        return float("nan"), "", 0
    first = _thinned(theta.like, MEAN_CELLS), _thinned(phi.like, MEAN_CELLS)
    cells = Groups(*first)
    f = cells.sums(claimed.f[..., 0] - claimed.lost).ravel()  # what the pdf never reaches is reported as lost
    second = cells.sums(claimed.second[..., 0]).ravel()
    count = len(weight)
    asked = drawn.asked * count / len(drawn.theta)  # the share of all samples that these directions came from
    inside = (cell_index(drawn.theta[:count], theta.edges), cell_index(drawn.phi[:count], phi.edges))
    row, column = (np.searchsorted(k, i, side="right") - 1 for k, i in zip(first, inside, strict=True))
    at = row * len(first[1]) + column
    mean = np.bincount(at, weight, f.size) / asked
    largest = np.zeros(f.size)
    np.maximum.at(largest, at, weight)
    # The variance is the quadrature's: one estimated from samples would miss the weights that none of them met.
    deviation = np.sqrt(np.maximum(second - f**2, 0) * asked)
    usable = (largest < _DOMINANT * deviation) & (deviation > 0)
    if not usable.any():
        return float("nan"), "", int(f.size)
    z = np.where(usable, (mean - f) * asked / np.where(deviation > 0, deviation, 1), 0)
    worst = int(np.argmax(np.abs(z)))
    (t0, t1), (p0, p1) = (
        np.degrees(axis.edges[np.append(k, len(axis.edges) - 1)[i : i + 2]])
        for axis, k, i in zip((theta, phi), first, divmod(worst, len(first[1])), strict=True)
    )
    where = f"theta_i {t0:.0f}° to {t1:.0f}°, phi {p0:.0f}° to {p1:.0f}°"
    return float(z[worst]), where, int((~usable).sum())
