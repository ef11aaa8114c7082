"""Integrals of a Gaussian lobe over one inclination and over the fibre's width, in ball arithmetic, with proven errors.

The directional albedo of Marschner's Gaussian form and the averages of dual scattering are such integrals: at an inclination
`here`, over the other inclination x, with half = (here + x)/2 and theta_d = (here - x)/2, of

    g(half - alpha_p; beta_p) c(x)/cos² theta_d · ½ ∫ A_p(theta_d, h) share(h) dh.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cuticle.reference.balls import Ball, Integrand, flint
from cuticle.reference.proven import LOBES, CrossSection, Row, absorptions, gaussian, radians
from cuticle.reference.rectangles import integrate_over_rectangle

Shares = Callable[[int, Ball, Ball], Sequence[Ball]]  # of lobe, gamma_i, gamma_t
_REACH = 10  # deviations of the Gaussian that are integrated over
_SIZE = 0.02  # about what the lobe's energies are


def over_inclinations(
    row: Row, lobe: int, here: Ball, cosines: Callable[[Ball], Ball], shares: Shares, count: int
) -> list[list[Ball]]:
    """Return the integral of one lobe for each of `count` shares and each channel.

    Parameters
    ----------
    row
        The fibre's parameters: degrees, sigma_a per radius.
    lobe
        0, 1 or 2: R, TT or TRT.
    here
        The inclination that stays, radians.
    cosines
        c(x): a product of two cosines, each of x or of `here`.
    shares
        Of light at offset sin gamma_i: even in gamma, at most 1.
    """
    arb = flint().arb
    eta, sigma_a = arb(row["eta"]), absorptions(row)
    alpha, beta = (radians(row[f"{k}_{LOBES[lobe]}"]) for k in ("alpha", "beta"))
    quarter = arb.pi() / 2
    low = (2 * (alpha - _REACH * beta) - here).max(-quarter)
    high = (2 * (alpha + _REACH * beta) - here).min(quarter)
    # Past the reach: no cosine is over 2 cos theta_d, A_p is at most 1, and dx = 2 d half.
    left_out = 8 * (arb(_REACH) / arb(2).sqrt()).erfc()
    components = range(count * len(sigma_a))
    if not high > low:
        return _by_share([arb(0, 1) * left_out for _ in components], count)
    middle, reach = (low + high) / 2, (high - low) / 2

    def section(t: Ball) -> Integrand:
        x = middle + reach * t
        theta_d = (here - x) / 2
        cosine = theta_d.cos()
        along = reach * quarter * gaussian((here + x) / 2 - alpha, beta) * cosines(x) / (cosine * cosine)
        ray = CrossSection(theta_d, eta, sigma_a)

        def over_width(u: Ball) -> list[Ball]:
            gamma = u * quarter
            sine, cosine = gamma.sin(), gamma.cos()
            light = along * cosine
            passed = [light * s for s in shares(lobe, gamma, ray.refracted(sine, cosine))]
            lobes = ray.attenuations(cosine, lobe, closed=False)
            return [s * a for s in passed for a in lobes]

        return over_width

    one, nothing = arb(1), arb(0)
    found = integrate_over_rectangle(section, (-one, one), (nothing, one), [_SIZE] * len(components))
    return _by_share([x + arb(0, 1) * left_out for x in found], count)


def gaussian_energies(row: Row) -> list[list[Ball]]:
    """Return the integral of each lobe's part of f cos theta_i over directions, [lobe][channel].

    Of Marschner's Gaussian form. Over phi, the integral of N_p is ½ ∫ A_p dh.
    """
    one = flint().arb(1)
    here = flint().arb(row["theta_r"])
    return [over_inclinations(row, p, here, lambda x: x.cos() ** 2, lambda *_: [one], 1)[0] for p in range(len(LOBES))]


def _by_share(flat: list[Ball], count: int) -> list[list[Ball]]:
    channels = len(flat) // count
    return [flat[k * channels : (k + 1) * channels] for k in range(count)]
