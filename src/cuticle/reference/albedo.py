"""The directional albedo, the integral of f cos theta_i over directions, where lobes are Gaussian; in double precision.

The energy-conserving forms need none of it: their albedo is the sum of the lobes' attenuations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cuticle._support.quadrature import gauss_legendre
from cuticle.reference.among_strands import combined
from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import Formulas, along, arguments, optics
from cuticle.reference.strand_averages import averages_by_fibre

Array = NDArray[np.float64]
_CHUNK = 1 << 19  # values in one temporary array
_ORDERS, _PANELS = (3, 6, 10), (2, 4, 8)  # by the level of detail: on each panel of theta_i; panels of half the width
_AT = (0, 0.5, 1, 1.7, 2.5, 3.5, 4.7, 6, 8)  # deviations from a lobe's axis at which panels end
_UNIFORM = 16  # further panels between the poles
_POLES = (1e-5, 1e-4, 1e-3, 1e-2, 0.05)  # radians from a pole at which panels end: cos theta_i/cos theta_d is steep there


def albedo(F: Formulas, inputs: Inputs, detail: int = 1) -> Array:
    """Return the luminance of the albedo at theta_r, (n,); detail 0, 1 or 2.

    It is NaN where the light behind has no sum at some theta_i: where a fibre sends on all light, or more than it gets.
    """
    found = []
    for i in range(0, len(inputs), 32):
        some = inputs.take(slice(i, i + 32))
        theta_i, weight = _nodes(F, some, _ORDERS[detail])
        rows = some.take(np.repeat(np.arange(len(some)), theta_i.shape[1]))
        rows = replace(rows, columns={**rows.columns, "theta_i": theta_i.ravel()})
        light = over_azimuth(F, rows, detail) @ F.pdf_weights(inputs.channels)
        found.append((light.reshape(theta_i.shape) * np.cos(theta_i) ** 2 * weight).sum(axis=1))
    return np.concatenate(found)


def over_azimuth(F: Formulas, inputs: Inputs, detail: int = 1) -> Array:
    """Return the integral of f over phi, (n, channels)."""
    gamma, across = gauss_legendre(np.linspace(0, np.pi / 2, _PANELS[detail] + 1), 6)
    step = max(1, _CHUNK // (len(gamma) * inputs.channels))
    pieces = []
    for i in range(0, len(inputs), step):
        q = arguments(inputs.take(slice(i, i + step)), 1)
        q.h = np.sin(gamma)[None, :]
        weight = (2 * across * F.offset_weight(gamma))[None, :, None]
        pieces.append(np.stack([(a * weight).sum(axis=1) for a in optics(F, q)[0]]))
    energies = np.concatenate(pieces, axis=1)
    q = arguments(inputs, 1)
    parts = [m * e for m, e in zip(along(F, q), energies, strict=True)]
    if F.back is None:
        return np.asarray(F.finish(q, sum(parts)))
    a = averages_by_fibre(F, inputs, detail)
    stacked = combined(F, inputs, a, parts, list(energies), turn=2 * np.pi)
    diverges = (a.a_f >= 1) & (q.d_b > 0)
    return np.asarray(F.finish(q, np.where(diverges, np.nan, stacked.sum(axis=1))))


def _nodes(F: Formulas, inputs: Inputs, order: int) -> tuple[Array, Array]:
    """Return nodes of theta_i and weights, (n, nodes): panels follow the lobes, and are fine near the poles."""
    q = arguments(inputs, 1)
    top = np.pi / 2
    near = np.array(_POLES)
    common = np.concatenate([np.linspace(-top, top, _UNIFORM + 1), near - top, top - near])
    ends = [np.broadcast_to(common, (len(inputs), len(common)))]
    for alpha, variance in zip(F.tilts(q), F.variances(q), strict=True):
        for side in (-1, 1):
            ends.append(2 * alpha - q.theta_r + side * 2 * np.sqrt(variance) * np.array(_AT))
    edges = np.sort(np.clip(np.concatenate(ends, axis=1), -top, top), axis=1)
    return gauss_legendre(edges, order)
