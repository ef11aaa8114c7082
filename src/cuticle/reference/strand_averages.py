"""What a strand does to light on average, as dual scattering has it: averages of its own lobes, in double precision."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cuticle._support.quadrature import gauss_legendre
from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import Formulas, along, arguments, optics, unchanged
from cuticle.scattering.bcsdf import luminance_weights

Array = NDArray[np.float64]
_REACH = 9.5  # deviations of a Gaussian that are integrated over
_PANELS, _ORDER = (4, 8, 12), 6  # over that reach, by the level of detail
_ENDS = ((), (1e-4, 1e-3, 0.01, 0.06), (1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.08))  # shares of it, toward a pole at its end
_WIDEST, _OFFSET_ORDERS = 1.5, (6, 8, 10)  # panel of the width, in deviations of D; order in each
_CHUNK = 1 << 19  # values in one temporary array
_OTHERS = ("phi", "strands", "d_f", "d_b")  # what averages do not depend on
_NODES = (40, 96, 160)  # of an interpolation over the inclination


class Averages(NamedTuple):
    """What a fibre does to light on average, (n, channels): energies on and back, their mean shifts and widths."""

    a_f: Array
    a_b: Array
    alpha_f: Array
    alpha_b: Array
    beta_f: Array
    beta_b: Array


def triangle(x: Array, beta: Array) -> Array:
    """Return |x|/pi, periodic, smoothed by a normal distribution of deviation beta: the share of light that goes on."""
    x = np.abs(x - 2 * np.pi * np.rint(x / (2 * np.pi)))
    total, reach = x + 0 * beta, ceil(_REACH * float(np.max(beta)) / np.pi)
    for k in range(-reach, reach + 2):  # each kink within reach is rounded
        d = np.abs(x - k * np.pi) / (beta * np.sqrt(2))
        rounding = beta * np.sqrt(2) * (np.exp(-d * d) / np.sqrt(np.pi) - d * special.erfc(d))
        total = total + (-1) ** k * rounding
    return np.asarray(total / np.pi)


def averages(F: Formulas, inputs: Inputs, detail: int = 1) -> Averages:
    """Return the averages at theta_d of each case, by quadrature over the other inclination and the width.

    `detail`, 0, 1 or 2, says how many nodes the quadratures have.
    """
    return _kept(_own(F), inputs, detail)


def averages_by_fibre(F: Formulas, inputs: Inputs, detail: int = 1) -> Averages:
    """Return the same, interpolated over the inclination: for many cases of one fibre."""
    count = _NODES[detail]
    first, back = _distinct(inputs, np.zeros(len(inputs)))
    u = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    here = np.pi / 2 * np.sin(np.pi / 2 * u)  # denser toward the poles, where averages vanish like x log x
    fibres = inputs.take(np.repeat(first, count))
    known = _at(_own(F), fibres, np.tile(here, len(first)), detail)
    theta_d = (inputs.columns["theta_r"] - inputs.columns["theta_i"]) / 2
    at = np.arcsin(np.clip(theta_d / (np.pi / 2), -1, 1)) * 2 / np.pi
    weights = (-1.0) ** np.arange(count) * np.sin(np.pi * (np.arange(count) + 0.5) / count)
    with np.errstate(all="ignore"):
        terms = weights / (at[:, None] - u)
    hit = np.isinf(terms).any(axis=1)
    terms[hit] = np.isinf(terms[hit])
    terms /= terms.sum(axis=1, keepdims=True)
    tables = (x.reshape(len(first), count, -1) for x in known)
    return Averages(*(np.einsum("nk,nkc->nc", terms, x[back]) for x in tables))


@lru_cache(maxsize=64)
def _kept(F: Formulas, inputs: Inputs, detail: int) -> Averages:
    twice = inputs.columns["theta_r"] - inputs.columns["theta_i"]
    first, back = _distinct(inputs, twice)
    return Averages(*(x[back] for x in _at(F, inputs.take(first), twice[first] / 2, detail)))


def _own(F: Formulas) -> Formulas:
    """Return the formulas of the fibre itself: equal for equal averages."""
    return replace(F, back=None, finish=unchanged, finish_pdf=unchanged, pdf_weights=luminance_weights)


def _distinct(inputs: Inputs, twice: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of distinct fibres and angles, and which of them each case has."""
    names = [n for n in inputs.columns if n not in (*_OTHERS, "theta_i", "theta_r")]
    key = np.column_stack([twice, *(inputs.columns[n] for n in names), inputs.sigma_a])
    _, first, back = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return first, back.ravel()


def _at(F: Formulas, inputs: Inputs, here: Array, detail: int) -> Averages:
    """Return the averages of light that comes at inclination `here` (n,)."""
    arrived = replace(inputs, columns={**inputs.columns, "theta_i": here})
    beta = F.scale(arguments(arrived, 1))
    panels = min(max(3, ceil(np.pi / 2 / (_WIDEST * max(float(np.min(beta)), 0.01)))), 96)
    offsets = gauss_legendre(np.linspace(0, np.pi / 2, panels + 1), _OFFSET_ORDERS[detail])
    ends = 1 - np.array(_ENDS[detail])
    z, w = gauss_legendre(np.sort(np.concatenate([np.linspace(-1, 1, _PANELS[detail] + 1), ends, -ends])), _ORDER)
    step = max(1, _CHUNK // (len(z) * len(offsets[0]) * inputs.channels))
    pieces = [_some(F, arrived.take(slice(i, i + step)), (z, w), offsets) for i in range(0, len(inputs), step)]
    energies = np.concatenate(pieces, axis=2)  # on or back, lobe, case, channel
    q = arguments(arrived, 1)
    on, back = (_moments(F, q, e) for e in energies)
    return Averages(on[0], back[0], on[1], back[1], on[2], back[2])


def _some(F: Formulas, inputs: Inputs, reach: tuple[Array, Array], offsets: tuple[Array, Array]) -> Array:
    """Return each lobe's energy on and back: (2, lobes, n, channels)."""
    n, (z, weight), (gamma, across) = len(inputs), reach, offsets
    here, q = inputs.columns["theta_i"][:, None], arguments(inputs, 1)
    found = np.zeros((2, len(F.lobes), n, inputs.channels))
    for p, (alpha, variance) in enumerate(zip(F.tilts(q), F.variances(q), strict=True)):
        low = np.maximum(2 * (alpha - _REACH * np.sqrt(variance)) - here, -np.pi / 2)
        high = np.minimum(2 * (alpha + _REACH * np.sqrt(variance)) - here, np.pi / 2)
        half = np.maximum(high - low, 0) / 2
        other = (low + high) / 2 + half * z
        rows = inputs.take(np.repeat(np.arange(n), len(z)))
        rows = replace(rows, columns={**rows.columns, "theta_r": other.ravel()})
        lit = arguments(rows, 1)
        lit.h = np.sin(gamma)[None, :]
        (attenuation,), ray = optics(F, lit, (p,))
        light = attenuation * (across * np.cos(gamma))[None, :, None]
        on = triangle(F.azimuth(p, ray), F.scale(lit))[..., None]
        density = along(F, lit)[p] * np.cos(lit.theta_i) * np.cos(lit.theta_r)
        whole, forward = density * light.sum(axis=1), density * (light * on).sum(axis=1)
        for k, x in enumerate((forward, whole - forward)):
            found[k, p] = ((half * weight)[..., None] * x.reshape(n, len(z), -1)).sum(axis=1)
    return found


def _moments(F: Formulas, q: Any, energy: Array) -> tuple[Array, Array, Array]:
    total = np.maximum(energy.sum(axis=0), 1e-30)
    shift = sum(e * t for e, t in zip(energy, F.tilts(q), strict=True)) / total
    width = sum(e * np.sqrt(v) for e, v in zip(energy, F.variances(q), strict=True)) / total
    return np.asarray(total), np.asarray(shift), np.asarray(width)
