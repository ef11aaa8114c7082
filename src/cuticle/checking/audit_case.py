"""One viewer: what is claimed by quadrature, what is drawn, and how far the two are apart."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, pdtr, pdtrc

from cuticle.checking.audit_cells import integrate, place
from cuticle.checking.chi_square import chi_square
from cuticle.checking.foreign_sampler import Drawn, Subject, bright
from cuticle.checking.regions import Region, Repeated, repeated_angles, worst_region

Array = NDArray[np.float64]
PILOT = 20_000  # samples that only place the cells
_EVEN = 61  # even cells along each axis: odd, so that 0 lies within one
_LIKE = 36  # cells of like probability along each axis
_TOLERANCE = 1e-3  # of ∫ pdf over all cells
_NARROW = 1e-5
_MIDDLE = (12, 8)  # fewer, for what is small but everywhere
_MEANS = (6, 6)  # cells for the mean weight
_HEAVY = 0.04  # a weight's share of the mean's deviation beyond which that is not normal
_TESTS = 6
NOTHING = 1e-12  # 1/sr: a density this small is none


@dataclass(frozen=True)
class Maps:
    """Densities over the fine cells: their edges, and the probability drawn and claimed in each, for a picture."""

    theta: Array
    phi: Array
    drawn: Array
    claimed: Array


@dataclass(frozen=True)
class Case:
    """One viewer.

    `integral`, `integral_error`: ∫ pdf over the sphere and how far the quadrature may be off. `dropped`: share of samples
    that gave no direction. `chi2`, `dof`: over even cells; `p_value`: of six tests (even cells, cells of like
    probability, fewer of those, theta alone, phi alone, the worst even band), six times the least. `total_variation`:
    ½ Σ |drawn - claimed| over some hundred cells of like probability; `noise_floor`: what a right sampler has there on
    average. `region`: where the two differ most clearly; `lobe`: what is known of the lobes there. `repeated`: angles that
    samples share exactly. `mean_z`: the largest deviation of the mean weight from ∫ f cos within a cell, standard errors
    (NaN: not to be tested), at `mean_where`. `weight_mismatch`, `pdf_mismatch`: share of samples whose weight, or pdf, is
    not eval/pdf, or pdf, asked afterwards. `lost`: share of ∫ f cos where the pdf is 0; `wasted`: share of the pdf where f
    is 0. `invalid`, `outside`, `biased`: shares of samples that are NaN, off the sphere, or have a weight but no
    direction; `bad_density`: densities asked for that are NaN or negative, `bad_values` likewise of f.
    """

    theta_r: float
    integral: float
    integral_error: float
    dropped: float
    chi2: float
    dof: int
    p_value: float
    total_variation: float
    noise_floor: float
    mean_z: float
    mean_where: str
    means_left_out: int
    weight_mismatch: float
    pdf_mismatch: float
    ess: float
    ess_channels: tuple[float, ...]
    largest_weight: float
    energy: tuple[float, ...]
    lost: float
    wasted: float
    invalid: float
    outside: float
    biased: float
    bad_density: int
    bad_values: int
    region: Region | None
    lobe: str
    repeated: tuple[Repeated, ...]
    maps: Maps | None = field(repr=False, default=None)


class _Asked:
    """Asks the subject for densities and values, and counts what neither may be."""

    def __init__(self, subject: Subject, theta_r: float) -> None:
        self.subject, self.theta_r = subject, theta_r
        self.bad_density, self.bad_values, self.channels = 0, 0, 0

    def __call__(self, theta: Array, phi: Array) -> Array:
        p, f = self.subject.values(theta, self.theta_r, phi)
        wrong = ~(np.isfinite(p) & (p >= 0))
        self.bad_density += int(wrong.sum())
        p = np.where(wrong, 0, p)
        if f is None:
            return p[:, None]
        wrong = ~(np.isfinite(f) & (f >= 0))
        self.bad_values += int(wrong.any(axis=1).sum())
        f = np.where(wrong, 0, f)
        self.channels = f.shape[1]
        every = np.column_stack([bright(f), f])
        nothing = p <= NOTHING
        second = every**2 / np.where(nothing, 1, p)[:, None] * ~nothing[:, None]
        lost, wasted = every[:, 0] * nothing, p * (every[:, 0] <= 0)
        weight = np.where(nothing, 0, every[:, 0] / np.where(nothing, 1, p))
        return np.column_stack([p, lost, wasted, weight, every, second])


_FIRST = 4  # columns before f


def examine(subject: Subject, theta_r: float, samples: int, critical: float, rng: np.random.Generator) -> Case:
    """Draw and integrate for one viewer; `critical` p-values are looked at closer."""
    pilot = subject.draw(theta_r, PILOT, rng)
    theta, phi = _edges(pilot.theta, np.pi / 2), _edges(pilot.phi, np.pi)
    asked = _Asked(subject, theta_r)
    seen = pilot.theta, pilot.phi, np.nan_to_num(subject.density(pilot.theta, theta_r, pilot.phi), posinf=0.0)
    integrals = integrate(asked, theta.fine, phi.fine, _TOLERANCE, seen)
    claimed, error = integrals.value[..., 0], integrals.error[..., 0]
    drawn = subject.draw(theta_r, samples, rng)
    counts = _count(drawn, theta.fine, phi.fine)
    expected, off = claimed * samples, error * samples

    def grouped(x: Array, rows: NDArray, columns: NDArray) -> Array:
        return np.add.reduceat(np.add.reduceat(x, rows, axis=0), columns, axis=1)

    def tested(rows: NDArray, columns: NDArray) -> tuple[float, int, float]:
        return chi_square(*(grouped(x, rows, columns) for x in (counts, expected, off)))

    one = np.zeros(1, np.intp)
    middle = _thinned(theta.like, _MIDDLE[0]), _thinned(phi.like, _MIDDLE[1])
    even = tested(theta.even, phi.even)
    tests = [
        even,
        tested(theta.like, phi.like),
        tested(*middle),
        chi_square(*(grouped(x, theta.like, one)[:, 0] for x in (counts, expected, off))),
        chi_square(*(grouped(x, one, phi.like)[0] for x in (counts, expected, off))),
    ]
    bands = [
        np.concatenate([grouped(x, theta.even, one)[:, 0], grouped(x, one, phi.even)[0]]) for x in (counts, expected, off)
    ]
    p_value = min(1.0, _TESTS * min(*(t[2] for t in tests), _single_band(*bands)))
    share = grouped(claimed, *middle)
    region, lobe = None, ""
    if p_value < critical:
        region = worst_region(counts, expected, off, theta.fine, phi.fine)
        lobe = _lobe(subject, theta_r, region, theta.fine, phi.fine, samples)
    quality = _quality(integrals.value, integrals.largest, asked.channels)
    again = _again(subject, drawn, theta_r)
    mean_z, mean_where, left_out = _means(integrals.value, drawn, again[2], theta, phi, asked.channels)
    n = drawn.asked
    return Case(
        theta_r=theta_r,
        integral=float(claimed.sum()),
        integral_error=float(error.sum()),
        dropped=drawn.dropped / n,
        chi2=even[0],
        dof=even[1],
        p_value=p_value,
        total_variation=0.5 * float(np.abs(grouped(counts, *middle) / n - share).sum()),
        noise_floor=0.5 * float(np.sqrt(2 * share * np.maximum(1 - share, 0) / (np.pi * n)).sum()),
        mean_z=mean_z,
        mean_where=mean_where,
        means_left_out=left_out,
        weight_mismatch=again[0],
        pdf_mismatch=again[1],
        invalid=drawn.invalid / n,
        outside=drawn.outside / n,
        biased=drawn.biased / n,
        bad_density=asked.bad_density,
        bad_values=asked.bad_values,
        region=region,
        lobe=lobe,
        repeated=tuple(repeated_angles(drawn.theta, drawn.phi)),
        maps=Maps(theta.fine, phi.fine, counts / n, claimed),
        **quality,  # type: ignore[arg-type]
    )


def _single_band(counts: Array, expected: Array, off: Array) -> float:
    """The chance of the least likely count among bands, each Poisson's: what sits in one place that should be dark."""
    many = np.where(counts > 0, pdtrc(np.maximum(counts - 1, 0), expected + off), 1.0)
    few = pdtr(counts, np.maximum(expected - off, 0))
    return float(min(1.0, 2 * len(counts) * min(many.min(), few.min())))


@dataclass(frozen=True)
class _Edges:
    """Fine edges along one axis, and where among its cells those of like size and of like probability begin."""

    fine: Array
    even: NDArray[np.intp]
    like: NDArray[np.intp]


def _edges(pilot: Array, end: float) -> _Edges:
    even = np.linspace(-end, end, _EVEN + 1)
    like = np.quantile(pilot, np.linspace(0, 1, _LIKE + 1)[1:-1]) if len(pilot) else np.linspace(-end, end, _LIKE + 1)[1:-1]
    like = np.unique(np.concatenate([[-end], like, [end]]))
    like = like[np.concatenate([[True], np.diff(like) > _NARROW])]
    fine = np.unique(np.concatenate([even, like]))
    fine = fine[np.concatenate([[True], np.diff(fine) > _NARROW])]
    fine[-1] = end

    def begin(edges: Array) -> NDArray[np.intp]:
        return np.unique(np.abs(fine[None, :] - edges[:-1, None]).argmin(axis=1))

    return _Edges(fine, begin(even), begin(like))


def _thinned(begin: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    return begin[:: max(1, -(-len(begin) // count))]


def _count(drawn: Drawn, theta: Array, phi: Array) -> Array:
    cell = place(drawn.theta, theta) * (len(phi) - 1) + place(drawn.phi, phi)
    shape = len(theta) - 1, len(phi) - 1
    return np.bincount(cell, minlength=shape[0] * shape[1]).reshape(shape).astype(np.float64)


def _quality(value: Array, largest: Array, channels: int) -> dict[str, object]:
    if not channels:
        nothing = float("nan")
        return {"ess": nothing, "ess_channels": (), "largest_weight": nothing, "energy": (), "lost": 0.0, "wasted": 0.0}
    total = value.sum(axis=(0, 1))
    f = total[_FIRST : _FIRST + channels + 1]
    second = total[_FIRST + channels + 1 :]
    ess = np.divide(f**2, second, out=np.zeros_like(second), where=second > 0)
    bright_energy = max(float(f[0]), 1e-300)
    # What lies where the pdf is 0 no sample ever sees: it is no part of the ESS, and told as lost.
    return {
        "ess": float(ess[0]),
        "ess_channels": tuple(map(float, ess[1:])),
        "largest_weight": float(largest[3]) / bright_energy,
        "energy": tuple(map(float, f[1:])),
        "lost": float(total[1]) / bright_energy,
        "wasted": float(total[2]) / max(float(total[0]), 1e-300),
    }


def _again(subject: Subject, drawn: Drawn, theta_r: float) -> tuple[float, float, Array | None]:
    """Return the shares of samples whose weight and pdf are not what is asked afterwards, and the samples' weights."""
    count = min(len(drawn.theta), 100_000)
    if not count:
        return 0.0, 0.0, None
    theta, phi = drawn.theta[:count], drawn.phi[:count]
    p, f = subject.values(theta, theta_r, phi)
    pdf_mismatch = 0.0
    if drawn.pdf is not None:
        pdf_mismatch = float((~(np.abs(drawn.pdf[:count] - p) <= 0.02 * np.abs(p))).mean())
    if f is None:
        return 0.0, pdf_mismatch, None
    with np.errstate(divide="ignore", invalid="ignore"):
        asked = bright(f) / (p if drawn.pdf is None else drawn.pdf[:count])
    if drawn.weight is None:
        return 0.0, pdf_mismatch, np.where(np.isfinite(asked), asked, 0)
    came = drawn.weight[:count]
    wrong = ~(np.abs(came - asked) <= 0.02 * np.abs(asked) + 1e-6)
    return float(wrong.mean()), pdf_mismatch, came


def _means(
    value: Array, drawn: Drawn, weight: Array | None, theta: _Edges, phi: _Edges, channels: int
) -> tuple[float, str, int]:
    """Return the mean weight's largest deviation from ∫ f cos within a cell, where, and how many cells cannot be tested."""
    if weight is None or not channels:
        return float("nan"), "", 0
    rows, columns = _thinned(theta.like, _MEANS[0]), _thinned(phi.like, _MEANS[1])

    def grouped(x: Array) -> Array:
        return np.add.reduceat(np.add.reduceat(x, rows, axis=0), columns, axis=1)

    f = grouped(value[..., _FIRST] - value[..., 1])  # without what the pdf never reaches: that is told as lost
    second = grouped(value[..., _FIRST + channels + 1])
    count = len(weight)
    asked = drawn.asked * count / max(len(drawn.theta), 1)  # of all, those that these came from
    at = np.searchsorted(rows, place(drawn.theta[:count], theta.fine), side="right") - 1
    at = at * len(columns) + np.searchsorted(columns, place(drawn.phi[:count], phi.fine), side="right") - 1
    mean = np.bincount(at, weight, f.size) / asked
    top = np.zeros(f.size)
    np.maximum.at(top, at, weight)
    deviation = np.sqrt(np.maximum(second.ravel() - f.ravel() ** 2, 0) * asked)
    # The variance is the quadrature's: one estimated from samples would miss the weights that none of them met.
    usable = (top < _HEAVY * deviation) & (deviation > 0)
    if not usable.any():
        return float("nan"), "", int(f.size)
    z = np.where(usable, (mean - f.ravel()) * asked / np.where(deviation > 0, deviation, 1), 0)
    k = int(np.argmax(np.abs(z)))
    i, j = divmod(k, len(columns))
    ends = np.append(rows, len(theta.fine) - 1), np.append(columns, len(phi.fine) - 1)
    t = np.degrees(theta.fine[[ends[0][i], ends[0][i + 1]]])
    p = np.degrees(phi.fine[[ends[1][j], ends[1][j + 1]]])
    where = f"theta_i {t[0]:.0f}° to {t[1]:.0f}°, phi {p[0]:.0f}° to {p[1]:.0f}°"
    return float(z[k]), where, int((~usable).sum())


def _lobe(subject: Subject, theta_r: float, region: Region, theta: Array, phi: Array, samples: int) -> str:
    """What the lobes tell of a region, where they are known: which one claims it, or has gone there as a whole."""
    if subject.lobe_densities is None or not subject.lobe_names:
        return ""

    def shares(t: Array, p: Array) -> Array:
        tt, pp = (x.ravel() for x in np.meshgrid(0.5 * (t[:-1] + t[1:]), 0.5 * (p[:-1] + p[1:]), indexing="ij"))
        density = np.asarray(subject.lobe_densities(tt, theta_r, pp), np.float64)  # type: ignore[misc]
        return (density * np.cos(tt)) @ np.outer(np.diff(t), np.diff(p)).ravel()

    whole = shares(theta, phi)
    if not whole.sum() > 0:
        return ""
    whole /= whole.sum()
    excess = (region.drawn - region.expected) / samples
    near = np.abs(whole - excess) < 0.15 * whole + 3 * np.sqrt(whole / samples)
    if region.drawn > 2 * region.expected and near.sum() == 1:
        k = int(np.argmax(near))
        return f"as many too many as all of lobe {subject.lobe_names[k]} has ({100 * whole[k]:.2g} %)"
    here = shares(np.linspace(*region.theta, 33), np.linspace(*region.phi, 65))
    if region.drawn > 2 * region.expected or not here.sum() > 0:
        return ""
    k = int(np.argmax(here))
    return f"{100 * here[k] / here.sum():.0f} % of what is claimed there is lobe {subject.lobe_names[k]}"


def critical_z(level: float, cases: int) -> float:
    """Standard errors beyond which a mean weight is wrong, at this level over all cells of all cases."""
    each = 1 - (1 - level) ** (1 / max(cases * _MEANS[0] * _MEANS[1], 1))
    return float(-ndtri(each / 2))
