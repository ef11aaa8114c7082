"""Slips: what goes wrong in hair shaders, each as a change of the right formulas; `slip_table.py` lists them.

All are derived from what the papers print and what their readers may take it for; none holds another's code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cuticle.reference.formulas import Formulas, amplitudes

Array = NDArray[np.float64]
Change = Callable[[Formulas], Formulas]
CONSERVING = ("chiang", "conserving")
SINGLE = ("chiang", "conserving", "gaussian")
DUAL = ("dual_scattering",)


@dataclass(frozen=True)
class Slip:
    """A known slip.

    Attributes
    ----------
    name, group
        Its name; slips of one group exclude one another.
    meaning, right, wrong
        In words, and the right formula beside the wrong one.
    change
        Takes the right formulas and returns them with the slip.
    kinds
        The formulas that it applies to: "chiang", "conserving", "gaussian" (Marschner's, and dual scattering, which is made
        of them), "dual_scattering" (that alone).
    pdf
        Whether it is a slip of the density alone.
    approximation
        Whether it is an approximation that some renderers choose, not an error.
    only
        "near" or "far" where it is a slip of that field only, else "".
    """

    name: str
    group: str
    meaning: str
    right: str
    wrong: str
    change: Change
    kinds: tuple[str, ...] = SINGLE
    pdf: bool = False
    approximation: bool = False
    only: str = ""


def having(**fields: Any) -> Change:
    """Replace formulas."""
    return lambda F: replace(F, **fields)


def with_input(formula: str, name: str, other: str) -> Change:
    """Give one formula another input in the place of its own."""

    def change(F: Formulas) -> Formulas:
        right = getattr(F, formula)
        wrong: dict[str, Any] = {formula: lambda q: right(SimpleNamespace(**{**vars(q), name: getattr(q, other)}))}
        return replace(F, **wrong)

    return change


def f_times(by: Callable[[Any], Any]) -> Change:
    """Multiply f by a factor, on top of what is there."""
    return lambda F: replace(F, finish=lambda q, f: F.finish(q, f) * by(q))


def channels_as(order: str) -> Change:
    """Give the channels in another order, where there are three."""
    rows = ["rgb".index(c) for c in order]
    return lambda F: replace(F, finish=lambda q, f: (g := F.finish(q, f))[..., rows if g.shape[-1] == 3 else slice(None)])


def pdf_times(by: Callable[[Any], Any]) -> Change:
    """Multiply the density by a factor, on top of what is there."""
    return lambda F: replace(F, finish_pdf=lambda q, p: F.finish_pdf(q, p) * by(q))


def rounded_to(bits: int, least: int) -> Change:
    """Round f and the density to floats of so many bits; those below 2^(least - 1) lose them one by one."""

    def rounded(x: Array) -> Array:
        unit = 2.0 ** (np.maximum(np.frexp(x)[1], least) - bits)
        return np.asarray(np.rint(x / unit) * unit)

    return lambda F: replace(
        F, finish=lambda q, f: rounded(F.finish(q, f)), finish_pdf=lambda q, p: rounded(F.finish_pdf(q, p))
    )


def tilts_by(of: Callable[[Any, list[Array]], list[Array]]) -> Change:
    """Make other tilts of the inputs and the right ones."""
    return lambda F: replace(F, tilts=lambda q: of(q, F.tilts(q)))


def variances_times(*factors: float) -> Change:
    """Multiply each lobe's variance by a factor; the last holds for the lobes that follow."""
    return lambda F: replace(
        F, variances=lambda q: [v * factors[min(p, len(factors) - 1)] for p, v in enumerate(F.variances(q))]
    )


def tilted_cosine(of: Callable[[Any, Array], Array]) -> Change:
    """Give M another cosine beside the sine of the tilted axis, from (inputs, the axis)."""

    def longitudinal(F: Formulas, q: Any, theta: Array, cone: Array, v: Array) -> Array:
        x = np.cos(theta) * np.abs(of(q, cone)) / v
        return np.asarray(np.exp(np.sin(theta) * np.sin(cone) / v + F.log_i0(x) + F.log_csch(v)))

    return having(longitudinal=longitudinal)


def gaussian_at(of: Callable[[Any, Array], tuple[Array, Any]]) -> Change:
    """Give the normal another variance and a factor, from (inputs, variance)."""

    def change(F: Formulas) -> Formulas:
        def longitudinal(G: Formulas, q: Any, theta: Array, cone: Array, v: Array) -> Array:
            variance, factor = of(q, v)
            return F.longitudinal(G, q, theta, cone, variance) * factor

        return replace(F, longitudinal=longitudinal)

    return change


def directions_exchanged(F: Formulas) -> Formulas:
    """Evaluate the function with the viewer in the light's place and the light in the viewer's."""
    return replace(
        F, inclination=lambda q: q.theta_i, sides=lambda q, tilt: (q.theta_r, tilt - q.theta_i),
        azimuth=lambda p, ray: -F.azimuth(p, ray),
        finish=lambda q, f: F.finish(q, f) * cosine_i(q) / np.cos(q.theta_r),
    )  # fmt: skip


def clamped_widths(F: Formulas) -> Formulas:
    """Clamp to .001 and 1 what is not a roughness: variances, and the logistic's s, whose scale is √(π/8) s."""
    return replace(
        F, variances=lambda q: [np.clip(v, 1e-3, 1) for v in F.variances(q)],
        scale=lambda q: np.sqrt(np.pi / 8) * np.clip(F.scale(q) / np.sqrt(np.pi / 8), 1e-3, 1),
    )  # fmt: skip


def scale_times(by: float) -> Change:
    """Multiply D's scale."""
    return lambda F: replace(F, scale=lambda q: F.scale(q) * by)


def density_times(by: float) -> Change:
    """Multiply D, that of R, TT and TRT."""
    return lambda F: replace(F, density=lambda x, scale: by * F.density(x, scale))


def path_by(of: Callable[[Any, Array], Array]) -> Change:
    """Make another path of the rays and the right one."""
    return lambda F: replace(F, path=lambda ray: of(ray, F.path(ray)))


def eta_at(inclination: Callable[[Any], Array]) -> Change:
    """Take eta' at another inclination, and nothing else."""

    def change(F: Formulas) -> Formulas:
        def seen(q: Any) -> Array:
            bravais.theta = inclination(q)  # type: ignore[attr-defined]
            return F.inclination(q)

        def bravais(theta: Array, eta: Array) -> Array:
            return F.bravais(bravais.theta, eta)  # type: ignore[attr-defined]

        return replace(F, inclination=seen, bravais=bravais)

    return change


def grey_absorption(of: Callable[[Array], Array]) -> Change:
    """Absorb every channel alike, by what is made of their depths."""

    def change(F: Formulas) -> Formulas:
        def attenuation(p: int, f: Array, t: Array, closed: bool) -> Array:
            grey = np.exp(-of(-np.log(np.maximum(t, 1e-300))))[..., None]
            return F.attenuation(p, f, np.broadcast_to(grey, t.shape), closed)

        return replace(F, attenuation=attenuation)

    return change


def channel(c: int) -> Callable[[Array], Array]:
    """Take one channel of an array, the last where there are fewer."""
    return lambda x: x[..., min(c, x.shape[-1] - 1)]


def attenuation_by(lobe: int, of: Callable[[Array, Array, Array], Array]) -> Change:
    """Make another A_p of one lobe, from (right A_p, F, T)."""
    return lambda F: replace(
        F,
        attenuation=lambda p, f, t, closed: (
            of(F.attenuation(p, f, t, closed), f, t) if p == lobe else F.attenuation(p, f, t, closed)
        ),
    )


def log_i0_above_12(above: Callable[[Array], Array]) -> Change:
    """Give log I0 by an expansion past x = 12, where hosts switch to one; `above` is what it has after x - ½ log(2 pi x)."""

    def change(F: Formulas) -> Formulas:
        def log_i0(x: Array) -> Array:
            y = np.maximum(x, 12)
            return np.where(x > 12, y - 0.5 * np.log(2 * np.pi * y) + above(y), F.log_i0(x))

        return replace(F, log_i0=log_i0)

    return change


def i0_series(terms: int) -> Change:
    """Give I0 by the first terms of its series up to x = 12."""

    def change(F: Formulas) -> Formulas:
        def log_i0(x: Array) -> Array:
            y = np.minimum(x, 12)
            cut = sum((y * y / 4) ** i / special.factorial(i) ** 2 for i in range(terms))
            return np.where(x <= 12, np.log(cut), F.log_i0(x))

        return replace(F, log_i0=log_i0)

    return change


def cosine_i(q: Any) -> Array:
    """Return cos theta_i."""
    return np.asarray(np.cos(q.theta_i))


def fresnel_at(of: Callable[[Any, Any], Array]) -> Change:
    """Take Fresnel's term at another cosine, of the inputs and the rays."""
    return having(fresnel_cosine=of)


def fresnel_by(of: Callable[[Any, Any], Array]) -> Change:
    """Take another term for Fresnel's, of the inputs and the rays."""
    return having(fresnel_cosine=of, fresnel=lambda term, eta: term)


def half_vector_cosine(q: Any, ray: Any) -> Array:
    """Return the cosine between the viewer and the half vector: ½ the angle between the two directions."""
    toward = np.sin(q.theta_i) * np.sin(q.theta_r) + np.cos(q.theta_i) * np.cos(q.theta_r) * np.cos(q.phi)
    return np.asarray(np.sqrt(np.clip((1 + toward) / 2, 0, 1)))


def schlick(cosine: Array, eta: Array, power: int = 5) -> Array:
    """Return Schlick's approximation of Fresnel's term."""
    r = ((1 - eta) / (1 + eta)) ** 2
    return np.asarray(r + (1 - r) * (1 - cosine) ** power)


def mean_amplitude(cosine: Array, eta: Array) -> Array:
    """Return the square of the two polarisations' mean amplitude."""
    s, p = amplitudes(cosine, eta)
    return np.asarray(((np.abs(s) + np.abs(p)) / 2) ** 2)


def one_polarisation(cosine: Array, eta: Array) -> Array:
    """Return Fresnel's term of s-polarised light."""
    return amplitudes(cosine, eta)[0] ** 2


def other_polarisation(cosine: Array, eta: Array) -> Array:
    """Return Fresnel's term of p-polarised light."""
    return amplitudes(cosine, eta)[1] ** 2


def from_inside(cosine: Array, eta: Array) -> Array:
    """Return Fresnel's term for light that comes from inside."""
    s, p = amplitudes(cosine, 1 / eta)
    return (s**2 + p**2) / 2


def bravais_fresnel(q: Any, ray: Any) -> Array:
    """Return Fresnel's term with the s part of eta', the p part of eta'' = eta² / eta', at cos gamma_i."""
    cosine, first = np.cos(ray.gamma_i), np.sqrt(ray.eta**2 - np.sin(ray.theta) ** 2) / np.cos(ray.theta)
    return np.asarray((amplitudes(cosine, first)[0] ** 2 + amplitudes(cosine, ray.eta**2 / first)[1] ** 2) / 2)


def cubic_azimuth(p: int, ray: Any) -> Array:
    """Return Marschner's cubic of gamma_i for phi_p."""
    c = np.arcsin(1 / ray.eta_prime)
    return np.asarray((6 * p * c / np.pi - 2) * ray.gamma_i - 8 * p * c / np.pi**3 * ray.gamma_i**3 + p * np.pi)


def wrapped_by(turns: Callable[[Array], Array]) -> Change:
    """Take turns off an angle, from how many it is past ±pi: the right number is that rounded."""
    return having(wrap=lambda x: x - 2 * np.pi * turns(x / (2 * np.pi)))


def swapped_angles(F: Formulas) -> Formulas:
    """Exchange gamma_i and gamma_t in phi_p."""
    return replace(F, azimuth=lambda p, ray: 2 * p * ray.gamma_i - 2 * ray.gamma_t + p * np.pi)


def normal_of_scale(x: Array, s: Array) -> Array:
    """Return a normal density of the logistic's deviation."""
    return unwrapped_normal(x, s * np.pi / np.sqrt(3))


def untrimmed_logistic(x: Array, s: Array) -> Array:
    """Return the logistic density over the whole line."""
    e = np.exp(-np.abs(x) / s)
    return np.asarray(e / (s * (1 + e) ** 2))


def unwrapped_normal(x: Array, s: Array) -> Array:
    """Return the normal density over the whole line."""
    return np.asarray(np.exp(-0.5 * (x / s) ** 2) / (s * np.sqrt(2 * np.pi)))
