"""Formulas with other exponents, multiples or coefficients than the right ones: what a slip of the pen makes of them.

The table of slips names what is known to go wrong. These are tried where it does not explain the values, each alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle.reference.formulas import Formulas, amplitudes, from_outside
from cuticle.reference.slips import fresnel_by, schlick

Array = NDArray[np.float64]
Variant = tuple[str, Formulas]
ROOT, SCALE = (0.726, 0.812, 3.7), (0.265, 1.194, 5.372)  # of v's root and of s, Chiang 2016


def variants(F: Formulas) -> Iterator[Variant]:
    """Return every variant, with what it is in words."""
    if F.back is not None:
        return
    yield from _attenuations(F)
    yield from _offsets(F)
    yield from _azimuths(F)
    yield from _paths(F)
    yield from _fresnel_cosines(F)
    yield from _fresnel_terms(F)
    yield from _inclinations(F)
    yield "f is encoded as sRGB", replace(F, finish=_after(F.finish, _srgb))
    if F.kind == "chiang":
        yield from _densities(F)
        yield from _coefficients(F)


def _srgb(x: Array) -> Array:
    return np.where(x < 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def _attenuations(F: Formulas) -> Iterator[Variant]:
    """A_p = (1 - F)^a F^b T^c of one lobe, and the rest times powers of them."""
    for p, right in enumerate(((0, 1, 0), (2, 0, 1), (2, 1, 2))):
        for n in product(range(3), range(3), range(4)):
            if n != right:
                words = f"A_{F.lobes[p]} = {_product(n)} for {_product(right)}"
                yield words, replace(F, attenuation=_other(F, p, n, right))
    for n in product((-2, -1, 0, 1), (-2, -1, 0, 1), (-2, -1, 0, 1)) if len(F.lobes) == 4 else ():
        if n != (0, 0, 0):
            yield f"A_rest × {_product(n)}", replace(F, attenuation=_other(F, 3, n, (0, 0, 0)))


def _other(F: Formulas, lobe: int, n: tuple[int, ...], right: tuple[int, ...]) -> Any:
    def attenuation(p: int, f: Array, t: Array, closed: bool) -> Array:
        value = F.attenuation(p, f, t, closed)
        a, b, c = (x - y for x, y in zip(n, right, strict=True))
        return np.asarray(value * (1 - f) ** float(a) * f ** float(b) * t ** float(c)) if p == lobe else value

    return attenuation


def _product(n: tuple[int, ...]) -> str:
    words = [name + (f"^{k}" if k != 1 else "") for name, k in zip(("(1 - F)", "F", "T"), n, strict=True) if k]
    return " ".join(words) or "1"


def _offsets(F: Formulas) -> Iterator[Variant]:
    """Other offsets than h."""
    others: dict[str, Any] = {
        "2h - 1": lambda h: np.clip(2 * h - 1, -1, 1), "|h|": np.abs, "√(1 - h²)": lambda h: np.sqrt(1 - h**2),
        "sin h": np.sin, "asin(h) 2/π": lambda h: np.arcsin(h) * 2 / np.pi, "sin(h π/2)": lambda h: np.sin(h * np.pi / 2),
    }  # fmt: skip
    for words, other in others.items():
        yield f"{words} for h", replace(F, offset=_after(F.offset, other))


def _after(right: Any, other: Any) -> Any:
    return lambda *x: other(right(*x))


def _azimuths(F: Formulas) -> Iterator[Variant]:
    """phi_p = a gamma_t + b gamma_i + c pi of every lobe, or of one."""
    for a, b, c, first in product((0, 1, 2), (-2, -1, 0, 1, 2), (0, 1), (0, 1)):
        if (a, b, c, first) != (2, -2, 1, 0):

            def every(lobe: int, ray: Any, n: Any = (a, b, c, first)) -> Array:
                p = lobe + n[3]
                return np.asarray(n[0] * p * ray.gamma_t + n[1] * ray.gamma_i + n[2] * p * np.pi)

            order = "(p + 1)" if first else "p"
            yield f"φ_p = {a} {order} γ_t {b:+d} γ_i{f' + {order} π' if c else ''}", replace(F, azimuth=every)
    yield "φ - φ_p + π", replace(F, azimuth=lambda p, ray: F.azimuth(p, ray) - np.pi)
    yield "φ in degrees", replace(F, azimuth=lambda p, ray: F.azimuth(p, ray) + ray.q.phi - np.degrees(ray.q.phi))
    unprimed = replace(F, azimuth=lambda p, ray: F.azimuth(p, ray) + 2 * p * (_unprimed(ray) - ray.gamma_t))
    yield "in φ_p, sin γ_t = h/η", unprimed
    for p in range(3):
        multiples = sorted({0, p, -p, 2 * p, -2 * p, 4 * p})
        for a, b, c in product(multiples, (-2, -1, 0, 1, 2), (0, 1)):
            if (a, b, c) == (2 * p, -2, p % 2):
                continue

            def azimuth(lobe: int, ray: Any, p: int = p, n: Any = (a, b, c)) -> Array:
                other = n[0] * ray.gamma_t + n[1] * ray.gamma_i + n[2] * np.pi
                return np.asarray(other) if lobe == p else F.azimuth(lobe, ray)

            turned = " + π" if c else ""
            yield f"φ of {F.lobes[p]} = {a} γ_t {b:+d} γ_i{turned} (mod 2π)", replace(F, azimuth=azimuth)


def _paths(F: Formulas) -> Iterator[Variant]:
    """K cos^a gamma_t cos^b gamma_i cos^c theta_t cos^d theta, and cos theta_t from another sine."""
    for k, a, b, c, d in product((0.5, 1, 2), (0, 1, 2), (0, 1), (-2, -1, 0, 1), (-1, 0, 1)):
        if (k, a, b, c, d) == (1, 1, 0, -1, 0):
            continue

        def path(ray: Any, k: float = k, n: Any = (a, b, c, d)) -> Array:
            cosines = np.cos(ray.gamma_t), np.cos(ray.gamma_i), ray.cos_theta_t, np.cos(ray.theta)
            return 2 * k * _powers(cosines, n)

        names = zip(("cos γ_t", "cos γ_i", "cos θ_t", "cos θ"), (a, b, c, d), strict=True)
        words = " ".join(f"{name}^{m}" if m != 1 else name for name, m in names if m)
        yield f"the path is {2 * k:g} {words} for 2 cos γ_t cos θ_t^-1", replace(F, path=path)
    others = {
        "cos θ_t = √(1 - cos²θ/η²)": lambda r: np.sqrt(1 - (np.cos(r.theta) / r.eta) ** 2),
        "cos θ_t = √(1 - sin²θ)/η": lambda r: np.cos(r.theta) / r.eta,
        "cos θ_t = √(1 - η² sin²θ)": lambda r: np.sqrt(np.maximum(1 - (np.sin(r.theta) * r.eta) ** 2, 1e-4)),
        "cos θ_t = √(1 - sin²θ/η)": lambda r: np.sqrt(1 - np.sin(r.theta) ** 2 / r.eta),
        "cos θ_t = √(1 - |sin θ|/η)": lambda r: np.sqrt(1 - np.abs(np.sin(r.theta)) / r.eta),
        "sin θ_t = sin θ/η′": lambda r: np.sqrt(1 - np.minimum(np.sin(r.theta) / r.eta_prime, 0.999) ** 2),
        "cos θ_i for cos θ_t": lambda r: np.cos(r.q.theta_i),
        "θ_t of θ_i": lambda r: np.sqrt(1 - (np.sin(r.q.theta_i) / r.eta) ** 2),
        "θ_t of θ_d": lambda r: np.sqrt(1 - (np.sin((r.q.theta_r - r.q.theta_i) / 2) / r.eta) ** 2),
    }
    for words, cosine in others.items():
        yield f"in the path, {words}", replace(F, path=_path_of(F, cosine))
    chord = replace(F, path=lambda ray: F.path(ray) * np.cos(_unprimed(ray)) / np.cos(ray.gamma_t))
    yield "in the path, sin γ_t = h/η", chord


def _unprimed(ray: Any) -> Array:
    """Return gamma_t of eta for eta'."""
    return np.asarray(np.arcsin(np.sin(ray.gamma_i) / ray.eta))


def _powers(cosines: Sequence[Array], n: Sequence[int]) -> Array:
    """Return the product of powers, over cases and offsets."""
    found = np.ones(np.broadcast_shapes(*(x.shape for x in cosines)))
    for x, m in zip(cosines, n, strict=True):
        found = found * x ** float(m)
    return found


def _path_of(F: Formulas, cosine: Any) -> Any:
    return lambda ray: F.path(ray) * ray.cos_theta_t / cosine(ray)


def _fresnel_cosines(F: Formulas) -> Iterator[Variant]:
    for n in product(range(3), range(3), range(3)):
        if n == (1, 1, 0):
            continue

        def cosine(q: Any, ray: Any, n: Any = n) -> Array:
            factors = np.cos(ray.theta), np.cos(ray.gamma_i), np.cos(ray.gamma_t)
            return _powers(factors, n)

        names = zip(("cos θ", "cos γ_i", "cos γ_t"), n, strict=True)
        words = " ".join(f"{name}^{m}" if m != 1 else name for name, m in names if m) or "1"
        yield f"F at {words} for cos θ cos γ_i", replace(F, fresnel_cosine=cosine)
    others: dict[str, Any] = {"θ_h": lambda q: (q.theta_i + q.theta_r) / 2, "θ_i": lambda q: q.theta_i}
    for words, other in others.items():
        yield (
            f"F at cos {words} cos γ_i for cos θ cos γ_i",
            replace(F, fresnel_cosine=_cosine_at(other)),
        )


def _fresnel_terms(F: Formulas) -> Iterator[Variant]:
    """Fresnel's term of other means of the amplitudes, and Schlick's with other powers."""
    means: dict[str, Any] = {
        "(½ (r_s + r_p))²": lambda s, p: (s + p) ** 2 / 4,
        "½ (|r_s| + |r_p|)": lambda s, p: (np.abs(s) + np.abs(p)) / 2,
        "|r_s r_p|": lambda s, p: np.abs(s * p),
    }
    for words, mean in means.items():
        yield f"F = {words} for ½ (r_s² + r_p²)", replace(F, fresnel=_mean_of(mean))
    in_section = fresnel_by(lambda q, ray: from_outside(F.fresnel_cosine(q, ray), ray.eta_prime))
    yield "F with η′ for η", in_section(F)
    for power in (2, 3, 4, 6):
        yield f"F = F_0 + (1 - F_0)(1 - cos)^{power}", replace(F, fresnel=partial(schlick, power=power))


def _mean_of(mean: Any) -> Any:
    return lambda cosine, eta: mean(*amplitudes(cosine, eta))


def _cosine_at(inclination: Any) -> Any:
    return lambda q, ray: np.cos(inclination(q)) * np.cos(ray.gamma_i)


def _inclinations(F: Formulas) -> Iterator[Variant]:
    """η′ of another inclination or form, and the whole optics at θ_h or the tilted θ_r."""
    forms = {
        "√(η² + sin²θ)/cos θ": lambda t, e: np.sqrt(e**2 + np.sin(t) ** 2) / np.cos(t),
        "√(η² - sin²θ) cos θ": lambda t, e: np.sqrt(e**2 - np.sin(t) ** 2) * np.cos(t),
        "(η² - sin²θ)/cos θ": lambda t, e: (e**2 - np.sin(t) ** 2) / np.cos(t),
        "√(η - sin²θ)/cos θ": lambda t, e: np.sqrt(np.maximum(e - np.sin(t) ** 2, 1e-4)) / np.cos(t),
        "√(η² - sin²θ)/cos²θ": lambda t, e: np.sqrt(e**2 - np.sin(t) ** 2) / np.cos(t) ** 2,
        "√(η² - sin²θ)/√cos θ": lambda t, e: np.sqrt(e**2 - np.sin(t) ** 2) / np.sqrt(np.cos(t)),
        "√(η² - sin²θ)/sin θ": lambda t, e: np.sqrt(e**2 - np.sin(t) ** 2) / np.maximum(np.abs(np.sin(t)), 1e-4),
        "√(η² - 1)/cos θ": lambda t, e: np.sqrt(e**2 - 1) / np.cos(t),
        "η/cos θ": lambda t, e: e / np.cos(t),
        "η cos θ": lambda t, e: e * np.cos(t),
        "1/η": lambda t, e: 1 / e + 0 * t,
        "cos θ/√(η² - sin²θ)": lambda t, e: np.cos(t) / np.sqrt(e**2 - np.sin(t) ** 2),
    }
    for words, form in forms.items():
        yield f"η′ = {words}", replace(F, bravais=form)
    yield "the optics at θ_h", replace(F, inclination=lambda q: (q.theta_i + q.theta_r) / 2)
    yield "the optics at the tilted θ_r of R", replace(F, inclination=lambda q: q.theta_r - F.tilts(q)[0])


def _densities(F: Formulas) -> Iterator[Variant]:
    """Other functions than the trimmed logistic, e = exp(-|x|/s)."""
    others: dict[str, Any] = {
        "D without its 1/s": lambda x, s: s * F.density(x, s),
        "D = e/(s (1 + e)), not squared": lambda x, s: F.density(x, s) * (1 + np.exp(-np.abs(x) / s)),
        "D divided by its integral over ±π/2": lambda x, s: (
            F.density(x, s) * np.tanh(np.pi / 2 / s) / np.tanh(np.pi / 4 / s)
        ),
        "D of x/2": lambda x, s: F.density(x / 2, s),
        "D a Cauchy distribution": lambda x, s: s / (np.pi * (x**2 + s**2)),
    }
    for words, other in others.items():
        yield words, replace(F, density=other)


def _coefficients(F: Formulas) -> Iterator[Variant]:
    """Chiang's polynomials of roughness with other exponents, or without a term."""
    m, n = ROOT, SCALE
    powers = [(1, 2, k) for k in (10, 12, 18, 19, 21, 22, 24)] + [(1, 3, 20), (1, 1, 20), (2, 2, 20), (0, 2, 20)]
    for given in powers:
        v = variances_of(m, given)
        yield f"v = (.726 β^{given[0]} + .812 β^{given[1]} + 3.7 β^{given[2]})²", replace(F, variances=v)
    powers = [(1, 2, k) for k in (10, 12, 18, 20, 21, 23, 24)] + [(1, 3, 22), (1, 1, 22), (2, 2, 22), (0, 2, 22)]
    for given in powers:
        words = f"s = √(π/8) (.265 β^{given[0]} + 1.194 β^{given[1]} + 5.372 β^{given[2]})"
        yield words, replace(F, scale=scale_of(n, given))
    yield "v of the polynomial of s", replace(F, variances=variances_of(n, (1, 2, 22)))
    yield "s of the polynomial of v", replace(F, scale=scale_of(m, (1, 2, 20)))
    for k in range(3):
        cut = tuple(0.0 if j == k else c for j, c in enumerate(m))
        yield f"v without its term {k + 1}", replace(F, variances=variances_of(cut, (1, 2, 20)))
        cut = tuple(0.0 if j == k else c for j, c in enumerate(n))
        yield f"s without its term {k + 1}", replace(F, scale=scale_of(cut, (1, 2, 22)))


def polynomial(coefficients: tuple[float, ...], powers: tuple[int, ...], x: Array) -> Array:
    """Return Σ c x^n."""
    return np.asarray(sum(c * x**n for c, n in zip(coefficients, powers, strict=True)))


def variances_of(c: tuple[float, ...], powers: tuple[int, ...]) -> Any:
    """Return Chiang's v of the lobes, with a polynomial of beta_m."""
    return lambda q: [polynomial(c, powers, q.beta_m) ** 2 * k for k in (1, 0.25, 4, 4)]


def scale_of(c: tuple[float, ...], powers: tuple[int, ...]) -> Any:
    """Return Chiang's s, with a polynomial of beta_n."""
    return lambda q: np.sqrt(np.pi / 8) * polynomial(c, powers, q.beta_n)
