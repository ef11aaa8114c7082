"""The published formulas in double precision, each a field that a slip may replace.

This is the reference again, vectorised over cases, so that a hundred hypotheses about someone's values cost seconds. `check`
compares it with `proven.py` on some of the cases each time it is used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cuticle._support.quadrature import gauss_legendre
from cuticle.reference.cases import Inputs
from cuticle.scattering.bcsdf import luminance_weights

Array = NDArray[np.float64]
_CHUNK = 1 << 19  # values in one temporary array
PANELS, _ORDER = 96, 8  # of the quadrature over gamma, h = sin gamma
ROUGHLY = 40  # panels, to tell hypotheses apart


def _log_i0(x: Array) -> Array:
    return x + np.log(special.i0e(x))


def amplitudes(cosine: Array, eta: Array) -> tuple[Array, Array]:
    """Return the share of the amplitude that is reflected, of s- and of p-polarised light."""
    inner = np.sqrt(np.maximum(eta**2 - 1 + cosine**2, 0))
    return (cosine - inner) / (cosine + inner), (eta**2 * cosine - inner) / (eta**2 * cosine + inner)


def from_outside(cosine: Array, eta: Array) -> Array:
    """Return Fresnel's term of unpolarised light."""
    s, p = amplitudes(cosine, eta)
    return (s**2 + p**2) / 2


def _attenuation(p: int, f: Array, t: Array, closed: bool) -> Array:
    if p == 0:
        return np.broadcast_to(f, t.shape)
    if p == 1:
        return (1 - f) ** 2 * t
    trt = (1 - f) ** 2 * f * t**2
    rest = trt * f * t / np.maximum(1 - f * t, 1e-300)
    return (trt + rest if closed else trt) if p == 2 else rest


def _trimmed_logistic(x: Array, s: Array) -> Array:
    e = np.exp(-np.abs(x) / s)
    return e / (s * (1 + e) ** 2) / np.tanh(np.pi / (2 * s))


def _wrapped_normal(x: Array, beta: Array) -> Array:
    turns = range(-2, 3)
    total = sum(np.exp(-0.5 * ((x + 2 * np.pi * k) / beta) ** 2) for k in turns)
    return np.asarray(total / (beta * np.sqrt(2 * np.pi)))


def _log_csch(v: Array) -> Array:  # of csch(1/v)/(2v)
    return -1 / v - np.log(v) - np.log(-np.expm1(-2 / v))


def _conserving(F: Formulas, q: Any, theta: Array, cone: Array, v: Array) -> Array:
    x = np.abs(np.cos(theta) * np.cos(cone)) / v
    return np.exp(np.sin(theta) * np.sin(cone) / v + F.log_i0(x) + F.log_csch(v))


def _chiang_root(b: Array) -> Array:
    return 0.726 * b + 0.812 * b**2 + 3.7 * b**20


def _chiang_scale(q: Any) -> Array:
    n = q.beta_n
    return np.asarray(np.sqrt(np.pi / 8) * (0.265 * n + 1.194 * n**2 + 5.372 * n**22))


def unchanged(q: Any, value: Array) -> Array:
    """Return a value as it is."""
    return value


@dataclass(frozen=True)
class Formulas:
    """A model's formulas: `q` holds the inputs, arrays of shape (cases, 1), and h (cases, offsets)."""

    tilts: Callable[[Any], list[Array]]  # of each lobe's axis, radians of theta (of theta_h for "gaussian")
    variances: Callable[[Any], list[Array]]  # of M in theta (of theta_h for "gaussian")
    scale: Callable[[Any], Array]  # of D
    density: Callable[[Array, Array], Array]  # D(x; scale) at a wrapped x
    inclination: Callable[[Any], Array]  # at which the optics is evaluated
    longitudinal: Callable[[Formulas, Any, Array, Array, Array], Array]  # M at (theta, cone, v)
    closed: bool  # whether the orders past TRT are in TRT
    lobes: tuple[str, ...]
    over_cosine: bool  # whether f = M N / cos theta_i; else M N
    normalised: bool  # whether the integral of f cos theta_i is that of A, and no other is needed for the pdf
    sides: Callable[[Any, Array], tuple[Array, Array]] = lambda q, tilt: (q.theta_i, tilt - q.theta_r)
    offset: Callable[[Any], Array] = lambda q: q.h
    log_i0: Callable[[Array], Array] = _log_i0
    log_csch: Callable[[Array], Array] = _log_csch
    bravais: Callable[[Array, Array], Array] = lambda theta, eta: np.sqrt(eta**2 - np.sin(theta) ** 2) / np.cos(theta)
    fresnel: Callable[[Array, Array], Array] = from_outside
    fresnel_cosine: Callable[[Any, Any], Array] = lambda q, ray: np.cos(ray.theta) * np.cos(ray.gamma_i)
    path: Callable[[Any], Array] = lambda ray: 2 * np.cos(ray.gamma_t) / ray.cos_theta_t
    transmitted: Callable[[Array], Array] = lambda depth: np.exp(-depth)
    attenuation: Callable[[int, Array, Array, bool], Array] = _attenuation
    azimuth: Callable[[int, Any], Array] = lambda p, ray: 2 * p * ray.gamma_t - 2 * ray.gamma_i + p * np.pi
    wrap: Callable[[Array], Array] = lambda x: x - 2 * np.pi * np.rint(x / (2 * np.pi))
    rest_density: float = 1 / (2 * np.pi)
    rest_azimuth: int | None = None  # p of the phi_p that the orders past TRT lie about; None: evenly
    offset_weight: Callable[[Array], Array] = lambda gamma: np.cos(gamma) / 2
    finish: Callable[[Any, Array], Array] = unchanged
    pdf_weights: Callable[[int], Array] = luminance_weights
    chosen_by: Callable[[Array], Array] | None = None  # in their place, of A_p (…, channels), at one h
    finish_pdf: Callable[[Any, Array], Array] = unchanged
    back: Any = None  # dual scattering: the formulas of among_strands.py

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the parts of f: the lobes, and among strands what those behind send back."""
        return self.lobes if self.back is None else (*self.lobes, "back")

    @property
    def kind(self) -> str:
        """Return "chiang", "conserving", "gaussian" or "dual_scattering"."""
        if self.back is not None:
            return "dual_scattering"
        return "chiang" if len(self.lobes) == 4 else "conserving" if self.normalised else "gaussian"


@dataclass(frozen=True)
class Evaluated:
    """Values of cases: parts (n, lobes, channels) and f (n, channels) in 1/sr; pdf (n,), NaN where there is none."""

    parts: Array
    f: Array
    pdf: Array
    around: Array  # the azimuthal parts alone, (n, lobes, channels)
    mean: Array  # the right f's mean over phi, (n, channels): what a table's error is a share of


def chiang() -> Formulas:
    """Return Chiang et al. 2016; near field where the inputs have h."""
    return Formulas(
        tilts=lambda q: [np.radians(q.alpha) * k for k in (-2, 1, 4, 0)],
        variances=lambda q: [_chiang_root(q.beta_m) ** 2 * k for k in (1, 0.25, 4, 4)],
        scale=_chiang_scale, density=_trimmed_logistic, inclination=lambda q: q.theta_r, longitudinal=_conserving,
        closed=False, lobes=("R", "TT", "TRT", "rest"), over_cosine=True, normalised=True,
    )  # fmt: skip


def marschner(conserving: bool) -> Formulas:
    """Return Marschner 2003 with azimuthal roughness, with either longitudinal function."""
    names, k = ("R", "TT", "TRT"), 2 if conserving else 1
    common = Formulas(
        tilts=lambda q: [k * np.radians(getattr(q, f"alpha_{p}")) for p in names],
        variances=lambda q: [(k * np.radians(getattr(q, f"beta_{p}"))) ** 2 for p in names],
        scale=lambda q: np.radians(q.beta_N), density=_wrapped_normal, inclination=lambda q: q.theta_r,
        longitudinal=_conserving, closed=conserving, lobes=names, over_cosine=True, normalised=True,
    )  # fmt: skip
    if conserving:
        return common
    return replace(common, inclination=theta_d, longitudinal=_gaussian, over_cosine=False, normalised=False)


def theta_d(q: Any) -> Array:
    """Return half the difference of the two inclinations."""
    return np.asarray((q.theta_r - q.theta_i) / 2)


def _gaussian(F: Formulas, q: Any, theta: Array, cone: Array, v: Array) -> Array:
    half = (theta - cone) / 2 - (cone + q.theta_r) / 2  # theta_h - alpha: the cone is alpha - theta_r
    return np.asarray(np.exp(-(half**2) / (2 * v)) / np.sqrt(2 * np.pi * v) / np.cos(theta_d(q)) ** 2)


@lru_cache(maxsize=4)
def _offsets(panels: int) -> tuple[Array, Array]:
    return gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, panels + 1), _ORDER)


def evaluate_fibre(F: Formulas, inputs: Inputs, panels: int = PANELS) -> Evaluated:
    """Return the values of fibres on their own; `panels` of the quadrature over h, in the far field."""
    step = max(1, len(inputs) if inputs.near else _CHUNK // (panels * _ORDER * inputs.channels))
    with np.errstate(all="ignore"):  # a slip may divide by nothing
        found = [_rows(F, inputs.take(slice(i, i + step)), panels) for i in range(0, len(inputs), step)]
    return Evaluated(*(np.concatenate([getattr(x, f.name) for x in found]) for f in fields(Evaluated)))


def arguments(inputs: Inputs, panels: int = PANELS) -> SimpleNamespace:
    """Return what formulas take: each input as a column, absorption (n, 1, channels), and h or its quadrature."""
    q = SimpleNamespace(**{k: v[:, None] for k, v in inputs.columns.items()})
    q.sigma_a, q.near = inputs.sigma_a[:, None, :], inputs.near
    if not inputs.near:
        q.h = np.sin(_offsets(panels)[0])[None, :]
    return q


def _rows(F: Formulas, inputs: Inputs, panels: int) -> Evaluated:
    q = arguments(inputs, panels)
    energies, ray = optics(F, q)
    weight = np.ones((1, 1)) if q.near else (_offsets(panels)[1] * F.offset_weight(_offsets(panels)[0]))[None, :]
    scale, lum = F.scale(q), F.pdf_weights(inputs.channels)
    around, parts, mean = [], [], np.zeros((len(inputs), inputs.channels))
    pdf, whole = np.zeros((len(inputs), 1)), np.zeros((len(inputs), 1))
    for p, m in enumerate(along(F, q)):
        about = F.rest_azimuth if p == 3 else p
        if about is None:
            n = np.full_like(ray.gamma_t, F.rest_density)
        else:
            n = F.density(F.wrap(q.phi - F.azimuth(about, ray)), scale)
        around.append(((n * weight)[..., None] * energies[p]).sum(axis=1))
        parts.append(m * around[-1])
        light = (weight[..., None] * energies[p]).sum(axis=1)
        if F.chosen_by is None:
            drawn, share = (parts[-1] @ lum)[:, None], (light @ lum)[:, None]
        else:
            share = F.chosen_by(energies[p])
            drawn = m * n * share
        pdf, whole = pdf + drawn * np.cos(q.theta_i), whole + share
        mean = mean + light * m / (2 * np.pi)
    stacked = np.stack(parts, axis=1)
    f = F.finish(q, stacked.sum(axis=1))
    q.whole = whole
    density = pdf / whole if F.chosen_by is None else (pdf / whole * weight).sum(axis=1, keepdims=True)  # h drawn evenly
    density = F.finish_pdf(q, density)[:, 0] if F.normalised else np.full(len(inputs), np.nan)
    return Evaluated(stacked, f, density, np.stack(around, axis=1), mean)


def along(F: Formulas, q: Any, tilts: Sequence[Array] = (), variances: Sequence[Array] = ()) -> list[Array]:
    """Return what multiplies each lobe's azimuthal part in f, (cases, 1): M, over cos theta_i where f has it.

    Of the lobes, or about the axes and of the variances given.
    """
    cosine = np.cos(q.theta_i) if F.over_cosine else 1
    sides = [F.sides(q, tilt) for tilt in tilts or F.tilts(q)]
    return [F.longitudinal(F, q, *side, v) / cosine for side, v in zip(sides, variances or F.variances(q), strict=True)]


def optics(F: Formulas, q: Any, lobes: Sequence[int] | None = None) -> tuple[list[Array], SimpleNamespace]:
    """Return A_p (cases, offsets, channels) of each lobe, or of some, and the rays."""
    theta, h = F.inclination(q), F.offset(q)
    ray = SimpleNamespace(theta=theta, eta=q.eta, q=q, gamma_i=np.arcsin(h))
    ray.eta_prime = F.bravais(theta, q.eta)
    ray.gamma_t = np.arcsin(np.clip(h / ray.eta_prime, -1, 1))
    ray.cos_theta_t = np.sqrt(1 - (np.sin(theta) / q.eta) ** 2)
    f = F.fresnel(F.fresnel_cosine(q, ray), q.eta)
    t = F.transmitted(F.path(ray)[..., None] * q.sigma_a)
    ray.fresnel, ray.t = f, t
    return [F.attenuation(p, f[..., None], t, F.closed) for p in (range(len(F.lobes)) if lobes is None else lobes)], ray
