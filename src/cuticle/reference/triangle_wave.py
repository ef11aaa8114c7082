"""The share of light that goes on past a strand, in ball arithmetic: a triangle wave smoothed by a normal distribution."""

from __future__ import annotations

from functools import lru_cache
from math import ceil, exp, pi

from cuticle.reference.balls import Ball, flint, series_terms

_TERMS = 24  # of the Taylor series on a panel one deviation wide
_CIRCLE = 6.0  # deviations: the radius of the circle on which the wave is bounded
_FURTHER = 14.0  # deviations past that circle, beyond which a kink is left out


class TriangleWave:
    """|x|/pi for x from -pi to pi, periodic, smoothed by a normal distribution of deviation beta.

    With S(d) = d erf(d) + exp(-d²)/sqrt(pi) it is (sqrt(2) beta/pi) Σ_k (-1)^k S((x - k pi)/(sqrt(2) beta)) less a constant.
    A Taylor polynomial of that is made for each panel that is met.

    The remainder: at x + iy, values are at most exp(y²/(2 beta²)), for the wave lies in [0, 1] and the normal density there
    is that much larger than on the real line. On a circle of radius R this bounds the series' coefficients (Cauchy).
    """

    def __init__(self, beta: Ball) -> None:
        self._beta, self._step = beta, float(beta.mid())
        kinks = ceil(1 + (_CIRCLE + _FURTHER) * self._step / pi) + 1
        self._kinks = kinks + kinks % 2  # an even number of them on either side makes the constant

    def __call__(self, x: Ball) -> Ball:
        """Return the value at a real ball."""
        x = abs(x - 2 * flint().arb.pi() * round(float(x.mid()) / (2 * pi)))
        panel = round(float(x.mid()) / self._step)
        near = x - panel * self._step
        if not abs(near) < self._beta * 0.51:  # too wide a ball
            return flint().arb("0.5", "0.5")
        return self._polynomial(panel, flint().ctx.prec)(near)

    def largest(self, x: Ball) -> Ball:
        """Return a bound of the wave's absolute value, and of 1 less the wave, over a complex ball."""
        return (x.imag.abs_upper() ** 2 / (2 * self._beta * self._beta)).exp().abs_upper()

    @lru_cache(maxsize=4096)  # noqa: B019  (waves are few)
    def _polynomial(self, panel: int, bits: int) -> Ball:
        module = flint()
        arb, series = module.arb, module.arb_series
        root = self._beta * arb(2).sqrt()
        with series_terms(_TERMS):
            total = series([arb(0)])
            for k in range(-self._kinks, self._kinks + 1):
                d = series([(panel * self._step - k * arb.pi()) / root, 1 / root])
                smooth = d * d.erf() + (-(d * d)).exp() / arb.pi().sqrt()
                total = total + smooth if k % 2 == 0 else total - smooth
            found = [c * root / arb.pi() for c in total.coeffs()]
        ratio = 0.51 / _CIRCLE
        left_out = 2 * exp(_CIRCLE**2 / 2) * ratio**_TERMS + 1e-28  # the series' tail, and kinks e^-80 from here
        found[0] += arb(0, 1) * left_out - self._kinks
        return module.arb_poly(found)
