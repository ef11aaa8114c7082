"""The known slips of dual scattering, beside what Zinke et al. 2008 print."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from cuticle.reference.formulas import Formulas
from cuticle.reference.slips import DUAL, Array, Change, Slip
from cuticle.reference.strand_averages import Averages


def back(**fields: Any) -> Change:
    """Replace formulas of dual scattering."""
    return lambda F: replace(F, back=replace(F.back, **fields))


def back_by(name: str, of: Any) -> Change:
    """Make another formula of the right one: `of` takes its value and its arguments."""

    def change(F: Formulas) -> Formulas:
        right = getattr(F.back, name)
        return replace(F, back=replace(F.back, **{name: lambda *x: of(right(*x), *x)}))

    return change


def without_density_behind(F: Formulas) -> Formulas:
    """Take d_b as 1 wherever it stands."""
    one = SimpleNamespace(d_b=1.0)
    return back(backward=lambda q: 1.0, deviation=lambda a, q: F.back.deviation(a, one))(F)


def first_order(a: Averages) -> Array:
    """Return A_1."""
    return np.asarray(a.a_b * a.a_f**2 / (1 - a.a_f**2))


def all_orders(a: Averages) -> Array:
    """Return the sum of all orders: R - a_b, R = (B - √(B² - 4 a_b²))/(2 a_b), B = 1 + a_b² - a_f²."""
    b = 1 + a.a_b**2 - a.a_f**2
    return np.asarray((b - np.sqrt(b * b - 4 * a.a_b**2)) / (2 * a.a_b) - a.a_b)


def shift_derived(a: Averages) -> Array:
    """Return Δ_b with the sign of 2u that its derivation has."""
    q = 1 - a.a_f**2
    tail = a.alpha_f * (2 * q**2 + 4 * a.a_f**2 * a.a_b**2) / q**3
    return np.asarray(a.alpha_b * (1 + 2 * a.a_b**2 / q**2) + tail)


AMONG_STRANDS = (
    Slip("back-first-order", "back energy", "light that turns back three times is left out",
         "A_b = A_1 + A_3", "A_1", back(energy=first_order), DUAL),
    Slip("back-all-orders", "back energy", "all orders are summed (a choice: right, but not what is printed)",
         "A_b = A_1 + A_3", "A_1 + A_3 + A_5 + …", back(energy=all_orders), DUAL, approximation=True),
    Slip("back-third-squared", "back energy", "A_3's denominator is squared, not cubed",
         "A_3 = ā_b³ ā_f²/(1 - ā_f²)³", "ā_b³ ā_f²/(1 - ā_f²)²",
         back(energy=lambda a: first_order(a) * (1 + a.a_b**2 / (1 - a.a_f**2))), DUAL),
    Slip("back-shift-sign", "back shift", "2u has the sign of its derivation (a choice: right, but not what is printed)",
         "Δ_b = ᾱ_b (1 - 2u) + …", "ᾱ_b (1 + 2u) + …", back(shift=shift_derived), DUAL, approximation=True),
    Slip("back-shift-missing", "back shift", "the backscatter is not shifted", "Δ_b", "0",
         back_by("shift", lambda x, a: 0 * x), DUAL),
    Slip("back-deviation-no-density", "back deviation", "σ_b lacks its factor 1 + d_b ā_f²", "(1 + d_b ā_f²) …", "…",
         back_by("deviation", lambda x, a, q: x / (1 + q.d_b * a.a_f**2)), DUAL),
    Slip("back-deviation-squared", "back deviation", "σ_b is passed where M takes a variance", "g(σ_b²)", "g(σ_b)",
         back_by("deviation", lambda x, a, q: np.sqrt(x)), DUAL),
    Slip("back-no-pi", "pi behind", "f_back through strands lacks the factor π (a choice: right, but not what is printed)",
         "T_f d_f (f_s + π d_b f_back)", "T_f d_f (f_s + d_b f_back)", back(spread_factor=1.0), DUAL, approximation=True),
    Slip("back-halved", "back factor", "f_back lacks its factor 2", "2 A_b g/(π cos² θ_d)", "A_b g/(π cos² θ_d)",
         back(direct_factor=1 / np.pi), DUAL),
    Slip("back-not-over-pi", "back factor", "f_back is not divided by π", "2 A_b g/(π cos² θ_d)", "2 A_b g/cos² θ_d",
         back(direct_factor=2.0), DUAL),
    Slip("back-no-density", "d_b", "f_back is not multiplied by d_b", "d_b f_back", "f_back",
         back(backward=lambda q: 1.0), DUAL),
    Slip("density-behind-missing", "d_b", "d_b is left out, before f_back and in σ_b", "d_b f_back, (1 + d_b ā_f²) …",
         "f_back, (1 + ā_f²) …", without_density_behind, DUAL),
    Slip("density-once", "d_f", "d_f stands once", "T_f d_f, T_f = d_f Π ā_f", "Π ā_f d_f",
         back(density=lambda q: q.d_f), DUAL),
    Slip("density-missing", "d_f", "d_f is left out", "T_f d_f, T_f = d_f Π ā_f", "Π ā_f",
         back(density=lambda q: 1.0), DUAL),
    Slip("transmittance-once", "transmittance", "light is attenuated by one strand, however many there are", "ā_f^n", "ā_f",
         back(transmittance=lambda a, n: a.a_f), DUAL),
    Slip("spread-once", "spread", "light is widened by one strand, however many there are", "σ_f² = n β̄_f²", "β̄_f²",
         back(spread=lambda a, n: a.beta_f**2), DUAL),
    Slip("spread-deviations-added", "spread", "deviations are added, not variances", "σ_f² = n β̄_f²", "(n β̄_f)²",
         back(spread=lambda a, n: (n * a.beta_f) ** 2), DUAL),
    Slip("spread-missing", "spread", "light through strands is not widened", "β_p² + σ_f²", "β_p²",
         back(spread=lambda a, n: 0 * a.beta_f), DUAL),
    Slip("half-turn-missing", "half turn", "light through strands keeps its azimuth",
         "N^G_p, the mean of N_p over half a turn", "N_p",
         back(half_turn=False), DUAL),
)  # fmt: skip
