"""Scattering functions in ball arithmetic, as published: the lobes' parts of f, their sum, and the density.

Chiang et al. 2016 in the near and the far field, and Marschner 2003 with either longitudinal function. What is written here
is written from the papers, with the errata of docs/models.md; nothing is shared with the C++ core.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, pi

from cuticle.reference.balls import GOAL, Ball, flint, integrate, root, square
from cuticle.scattering.bcsdf import REC709

Row = Mapping[str, float]
CHANNELS = ("r", "g", "b")
LOBES = ("R", "TT", "TRT")
_TINY = 2.0**-90  # of an interval in which an azimuth crosses the cut of a trimmed distribution
_REACH = 14  # deviations: past them a normal distribution is bounded, not summed


@dataclass(frozen=True)
class Values:
    """Balls of one case: the lobes' parts of f for each channel, in the lobes' order, and each lobe's share of the light."""

    parts: list[list[Ball]]  # [lobe][channel], 1/sr, without a cosine
    energies: list[list[Ball]] | None  # [lobe][channel]: ∫ of that part times cos theta_i; None where it is not known
    cosine: Ball  # of theta_i
    lobes: tuple[str, ...] = ("R", "TT", "TRT", "rest")  # of the parts
    albedo: Ball | None = None  # luminance of the integral of f cos theta_i, where the parts' energies are not known

    def f(self, channel: int) -> Ball:
        """Return f of one channel."""
        return sum((p[channel] for p in self.parts), flint().arb(0))

    def pdf(self) -> Ball | None:
        """Return the luminance of f cos theta_i over its integral."""
        if self.energies is None and self.albedo is None:
            return None
        zero, weights = flint().arb(0), luminance_weights(len(self.parts[0]))
        light = sum((w * self.f(c) for c, w in enumerate(weights)), zero)
        whole = self.albedo
        if self.energies is not None:
            whole = sum((w * e[c] for e in self.energies for c, w in enumerate(weights)), zero)
        return self.cosine * light / whole


def luminance_weights(channels: int) -> list[Ball]:
    """Return the weight of each channel in the luminance."""
    arb = flint().arb
    return [arb(str(w)) for w in REC709] if channels == 3 else [arb(1)]


def radians(degrees: float) -> Ball:
    """Return an angle in radians."""
    arb = flint().arb
    return arb(degrees) * arb.pi() / 180


def absorptions(row: Row) -> list[Ball]:
    """Return sigma_a of each channel."""
    arb = flint().arb
    return [arb(row["sigma_a"])] if "sigma_a" in row else [arb(row[f"sigma_a_{c}"]) for c in CHANNELS]


def energy_conserving(theta_i: Ball, cone: Ball, v: Ball) -> Ball:
    """Return d'Eon 2011, Eq. 7: csch(1/v)/(2v) exp(sin theta_i sin cone / v) I0(cos theta_i cos cone / v)."""
    x = abs(theta_i.cos() * cone.cos()) / v
    bessel = x.bessel_i(flint().arb(0), scaled=True) * x.exp()
    return (1 / v).csch() / (2 * v) * (theta_i.sin() * cone.sin() / v).exp() * bessel


def gaussian(x: Ball, deviation: Ball) -> Ball:
    """Return the normal density."""
    return (-(x * x) / (2 * deviation * deviation)).exp() / (deviation * (2 * flint().arb.pi()).sqrt())


def trimmed_logistic(x: Ball, s: Ball) -> Ball:
    """Return Chiang 2016's D: the logistic density over its integral from -pi to pi; x is real or complex."""
    right = float((x if isinstance(x, flint().arb) else x.real).mid()) >= 0  # D is even: take the exponent that decays
    e = (-x / s if right else x / s).exp()
    inside = 1 / (1 + (-flint().arb.pi() / s).exp()) - 1 / (1 + (flint().arb.pi() / s).exp())
    return e / (s * (1 + e) * (1 + e)) / inside


class CrossSection:
    """The optics of the fibre's cross-section at one inclination, for rays at any offset sin(gamma)."""

    def __init__(self, theta: Ball, eta: Ball, sigma_a: Sequence[Ball]) -> None:
        self.theta, self.cosine, self.eta, self.sigma_a = theta, theta.cos(), eta, sigma_a
        self._beyond = eta * eta - 1
        self.bravais = root(self._beyond + square(self.cosine))  # eta' cos theta = eta cos theta_t

    def inner(self, cosine: Ball) -> Ball:
        """Return eta times the cosine between the refracted ray and the normal: eta' cos theta cos gamma_t."""
        return root(self._beyond + square(self.cosine * cosine))

    def refracted(self, sine: Ball, cosine: Ball) -> Ball:
        """Return gamma_t for sin and cos of gamma_i: sin gamma_t = sin gamma_i / eta'."""
        x, arb, acb = sine * self.cosine, flint().arb, flint().acb
        if isinstance(x, arb) and isinstance(self.bravais, arb):
            return (x / self.inner(cosine)).atan()
        # By the mean value theorem from the real axis, of x or of theta: a box's own arc sine is as tall as it is wide.
        x = acb(x / self.bravais)
        box = acb(x.real, x.imag.union(arb(0)))
        tall = (x.imag / root(1 - box * box).abs_lower()).abs_upper()
        if isinstance(sine, arb):
            theta = acb(self.theta.real, self.theta.imag.union(arb(0)))
            bravais = root(self._beyond + square(theta.cos()))
            slope = sine * theta.sin() * self._beyond / (bravais**3 * root(1 - square(sine * theta.cos() / bravais)))
            tall = tall.min((self.theta.imag * slope.abs_upper()).abs_upper())
        return acb(x.asin().real, arb(0, 1) * tall)

    def attenuations(self, cosine: Ball, lobes: Sequence[int], closed: bool) -> list[list[Ball]]:
        """Return A_p, [lobe][channel]: lobes 0 to 2 are R, TT and TRT, 3 is every order past them; `closed` adds it to TRT.

        A_0 = F, A_p = (1 - F)² F^(p-1) T^p. T = exp(-sigma_a 2 cos gamma_t / cos theta_t). F is Fresnel's unpolarised
        reflectance at cos = cos theta cos gamma_i.
        """
        c, inner = self.cosine * cosine, self.inner(cosine)
        r_s, r_p = (c - inner) / (c + inner), (self.eta * self.eta * c - inner) / (self.eta * self.eta * c + inner)
        fresnel = (r_s * r_s + r_p * r_p) / 2
        entered = 1 - fresnel
        chord, left = 2 * self.eta * inner / (self.bravais * self.bravais), entered * entered
        found: list[list[Ball]] = [[] for _ in lobes]
        for s in self.sigma_a:
            t = (-s * chord).exp()
            # (1 - F)²/(1 - F T), which is 0/0 at the fibre's edge where nothing is absorbed.
            closing = entered if s == 0 else left / (1 - fresnel * t)
            for of_lobe, lobe in zip(found, lobes, strict=True):
                if lobe == 0:
                    of_lobe.append(fresnel)
                elif lobe == 1:
                    of_lobe.append(left * t)
                elif lobe == 2:
                    of_lobe.append((closing if closed else left) * fresnel * t * t)
                else:
                    of_lobe.append(closing * (fresnel * t) ** 2 * t)
        return found


def azimuth(lobe: int, gamma_i: Ball, gamma_t: Ball) -> Ball:
    """Return phi_p = 2 p gamma_t - 2 gamma_i + p pi."""
    return 2 * lobe * gamma_t - 2 * gamma_i + lobe * flint().arb.pi()


def chiang_lobes(row: Row) -> tuple[list[Ball], list[Ball], Ball]:
    """Return the variances and tilts of R, TT, TRT and the rest, in theta, and the scale of D (Chiang 2016, Eq. 7 and 8).

    Tilts are -2, 1 and 4 alpha, alpha > 0 leaning toward the root.
    """
    arb = flint().arb
    m, n = arb(row["beta_m"]), arb(row["beta_n"])
    root = arb("0.726") * m + arb("0.812") * m**2 + arb("3.7") * m**20
    scale = (arb.pi() / 8).sqrt() * (arb("0.265") * n + arb("1.194") * n**2 + arb("5.372") * n**22)
    tilt = radians(row["alpha"])
    return [root**2 * k for k in (1, arb("0.25"), 4, 4)], [tilt * k for k in (-2, 1, 4, 0)], scale


def chiang_near(row: Row) -> Values:
    """Return Chiang et al. 2016 at a known offset h."""
    arb = flint().arb
    theta_i, theta_r, phi, h = (arb(row[k]) for k in ("theta_i", "theta_r", "phi", "h"))
    variances, tilts, scale = chiang_lobes(row)
    ray = CrossSection(theta_r, arb(row["eta"]), absorptions(row))
    cosine = (1 - h * h).sqrt()
    gamma_i, gamma_t = h.asin(), ray.refracted(h, cosine)
    parts, energies, passed = [], [], ray.attenuations(cosine, range(4), closed=False)
    for p in range(4):
        m = energy_conserving(theta_i, tilts[p] - theta_r, variances[p])
        around = 1 / (2 * arb.pi())
        if p < 3:
            around = trimmed_logistic(_wrapped(phi - azimuth(p, gamma_i, gamma_t)), scale)
        energies.append(passed[p])
        parts.append([m * around * a / theta_i.cos() for a in energies[-1]])
    return Values(parts, energies, theta_i.cos())


def chiang_far(row: Row, sizes: Sequence[Sequence[float]]) -> Values:
    """Return the mean of the near field over h; `sizes` are about the azimuthal parts, [lobe][channel]."""
    arb = flint().arb
    theta_i, theta_r, phi = (arb(row[k]) for k in ("theta_i", "theta_r", "phi"))
    variances, tilts, scale = chiang_lobes(row)
    ray = CrossSection(theta_r, arb(row["eta"]), absorptions(row))
    energies = _energies(ray, range(4), closed=False)
    parts = []
    for p in range(4):
        m = energy_conserving(theta_i, tilts[p] - theta_r, variances[p]) / theta_i.cos()
        around = [e / (2 * arb.pi()) for e in energies[p]] if p == 3 else _trimmed_over_h(ray, p, phi, scale, sizes[p])
        parts.append([m * x for x in around])
    return Values(parts, energies, theta_i.cos())


def marschner(row: Row, sizes: Sequence[Sequence[float]], conserving: bool) -> Values:
    """Return Marschner 2003 with azimuthal roughness (d'Eon 2011); alpha and beta are degrees of theta_h.

    conserving: M of d'Eon over cos theta_i, N at theta_r, the orders past TRT in TRT. Else a normal density in theta_h over
    cos² theta_d, N at theta_d.
    """
    arb = flint().arb
    theta_i, theta_r, phi = (arb(row[k]) for k in ("theta_i", "theta_r", "phi"))
    half, difference = (theta_i + theta_r) / 2, (theta_r - theta_i) / 2
    ray = CrossSection(theta_r if conserving else difference, arb(row["eta"]), absorptions(row))
    energies = _energies(ray, range(3), closed=True) if conserving else None
    parts = []
    for p, lobe in enumerate(LOBES):
        alpha, beta = radians(row[f"alpha_{lobe}"]), radians(row[f"beta_{lobe}"])
        if conserving:
            m = energy_conserving(theta_i, 2 * alpha - theta_r, 4 * beta * beta) / theta_i.cos()
        else:
            m = gaussian(half - alpha, beta) / difference.cos() ** 2
        parts.append([m * x for x in normal_over_h(ray, p, phi, radians(row["beta_N"]), sizes[p], conserving)])
    return Values(parts, energies, theta_i.cos(), LOBES)


def _wrapped(x: Ball) -> Ball:
    """Return an angle less the nearest whole number of turns; near the cut, a ball around both angles."""
    arb = flint().arb
    turns = arb(round(float(x.mid()) / (2 * pi)))
    near = x - 2 * arb.pi() * turns
    if not abs(near) <= arb.pi():  # or it cannot be told
        near = near.union(near - 2 * arb.pi()) if near > 0 else near.union(near + 2 * arb.pi())
    return near


def over_h(
    value: Callable[[Ball, Ball], Sequence[Ball]], low: Ball, high: Ball, sizes: Sequence[float], goal: float = GOAL
) -> list[Ball]:
    """Return ½ ∫ value(sin gamma, cos gamma) dh over gamma = u pi/2, u from `low` to `high`; dh = cos gamma dgamma."""
    quarter = flint().arb.pi() / 2

    def integrand(u: Ball) -> list[Ball]:
        gamma = u * quarter
        cosine = gamma.cos()
        weight = cosine * quarter / 2
        return [weight * x for x in value(gamma, cosine)]

    return integrate(integrand, low, high, sizes, goal)


def _energies(ray: CrossSection, lobes: Sequence[int], closed: bool) -> list[list[Ball]]:
    """Return ½ ∫ A_p dh, [lobe][channel]: even in h, so twice the half."""
    arb, count = flint().arb, len(ray.sigma_a)

    def all_lobes(gamma: Ball, cosine: Ball) -> list[Ball]:
        return [a for of_lobe in ray.attenuations(cosine, lobes, closed) for a in of_lobe]

    flat = over_h(all_lobes, arb(0), arb(1), [0.05] * (count * len(lobes)))
    return [[2 * x for x in flat[i * count : (i + 1) * count]] for i in range(len(lobes))]


def normal_over_h(ray: CrossSection, lobe: int, phi: Ball, beta: Ball, sizes: Sequence[float], closed: bool) -> list[Ball]:
    """Return N_p = ½ ∫ A_p D(phi - phi_p) dh with D a wrapped normal of deviation beta."""
    arb, turn = flint().arb, 2 * flint().arb.pi()
    ends = [azimuth(lobe, arb(g), arb(t)) for g, t in ((-pi / 2, -pi / 2), (pi / 2, pi / 2), (-pi / 2, 0), (pi / 2, 0))]
    lowest, highest = min(float(e.mid()) for e in ends), max(float(e.mid()) for e in ends)
    reach, at = _REACH * float(beta.mid()), float(phi.mid())
    turns = range(ceil((at - highest - reach) / 6.283) - 1, floor((at - lowest + reach) / 6.283) + 2)

    def value(gamma: Ball, cosine: Ball) -> list[Ball]:
        x = phi - azimuth(lobe, gamma, ray.refracted(gamma.sin(), cosine))
        around = sum((gaussian(x - turn * k, beta) for k in turns), arb(0))
        return [a * around for a in ray.attenuations(cosine, [lobe], closed)[0]]

    # Turns left out lie past the reach on either side: twice a geometric series, and A_p is at most 1.
    left_out = 4 * gaussian(_REACH * beta, beta).abs_upper()
    return [x + arb(0, 1) * left_out for x in over_h(value, arb(-1), arb(1), sizes)]


def _trimmed_over_h(ray: CrossSection, lobe: int, phi: Ball, scale: Ball, sizes: Sequence[float]) -> list[Ball]:
    """The same with D the trimmed logistic, which has a kink at ±pi: the panels end there."""
    arb, turn = flint().arb, 2 * flint().arb.pi()
    cuts = Cuts(ray, lobe, phi)
    total = [arb(0)] * len(ray.sigma_a)
    for low, high, k in cuts.pieces(arb(-1), arb(1)):
        if k is None:  # |phi - phi_p| is pi to 2^-40 there; A_p is at most 1, and dgamma/du pi/2
            most = trimmed_logistic(arb.pi() * (1 - arb(2) ** -40), scale)
            for c in range(len(total)):
                total[c] += arb(0, 1) * ((high - low) * most).abs_upper()
            continue

        def value(gamma: Ball, cosine: Ball, k: int = k) -> list[Ball]:
            around = trimmed_logistic(phi - azimuth(lobe, gamma, ray.refracted(gamma.sin(), cosine)) - turn * k, scale)
            return [a * around for a in ray.attenuations(cosine, [lobe], closed=False)[0]]

        for c, x in enumerate(over_h(value, low, high, sizes)):
            total[c] += x
    return total


class Cuts:
    """Where phi - phi_p(h) passes an odd multiple of pi, for h over the fibre's width; u = 2 asin(h)/pi."""

    def __init__(self, ray: CrossSection, lobe: int, phi: Ball) -> None:
        self._ray, self._lobe, self._phi, self._arb = ray, lobe, phi, flint().arb

    def turns(self, u: Ball) -> Ball:
        """Return (phi - phi_p + pi)/(2 pi), whose whole part is the turn."""
        gamma = u * self._arb.pi() / 2
        x = self._phi - azimuth(self._lobe, gamma, self._ray.refracted(gamma.sin(), gamma.cos()))
        return x / (2 * self._arb.pi()) + self._arb("0.5")

    def slope(self, u: Ball) -> Ball:
        """Return d turns / d u: phi_p' = 2 p gamma_t' - 2, gamma_t' = cos gamma_i / (eta' cos gamma_t)."""
        ray, gamma = self._ray, u * self._arb.pi() / 2
        cosine = gamma.cos()
        return -(2 * self._lobe * cosine * ray.cosine / ray.inner(cosine) - 2) / 4

    def pieces(self, low: Ball, high: Ball) -> list[tuple[Ball, Ball, int | None]]:
        """Return intervals that cover [low, high] with the turn of each; None for tiny ones around a crossing."""
        arb = self._arb
        turn = _whole_part(self.turns(low.union(high)))
        if turn is not None:
            return [(low, high, turn)]
        if high - low < arb(_TINY):  # the turn changes by 2^-50 at most here, its slope being finite
            return [(low, high, None)]
        slope = self.slope(low.union(high))
        if slope.contains(arb(0)) or not slope.is_finite():
            middle = ((low + high) / 2).mid()
            return self.pieces(low, middle) + self.pieces(middle, high)
        first, last = self.turns(low), self.turns(high)
        rising = bool(slope > 0)
        a, b = (first, last) if rising else (last, first)
        crossed = list(range(ceil(float(a.mid()) - 1e-9), floor(float(b.mid()) + 1e-9) + 1))
        found: list[tuple[Ball, Ball, int | None]] = []
        at = low
        for k in crossed if rising else reversed(crossed):
            left, right = self._enclose(k, low, high, rising)
            if right <= at or left >= high:
                continue
            left, right = left.max(at), right.min(high)
            if left > at:
                found.append((at, left, k - 1 if rising else k))
            found.append((left, right, None))
            at = right
        if at < high:
            inside = self.turns(((at + high) / 2).mid())
            found.append((at, high, floor(float(inside.mid()))))
        return found

    def _enclose(self, k: int, low: Ball, high: Ball, rising: bool) -> tuple[Ball, Ball]:
        """Return an interval around the one u in [low, high] at which the turn becomes k, by bisection with a proof."""
        a, b = low, high
        while b - a > self._arb(_TINY):
            middle = ((a + b) / 2).mid()
            value = self.turns(middle) - k
            if value > 0:
                a, b = (a, middle) if rising else (middle, b)
            elif value < 0:
                a, b = (middle, b) if rising else (a, middle)
            else:
                return (middle - (b - a) / 4).mid(), (middle + (b - a) / 4).mid()
        return a, b


def _whole_part(ball: Ball) -> int | None:
    """Return the whole part of a real ball if it is the same for all of it."""
    if not ball.is_finite():
        return None
    lower, upper = ball.lower().floor().unique_fmpz(), ball.upper().floor().unique_fmpz()
    return int(lower) if lower is not None and lower == upper else None
