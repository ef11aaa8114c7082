"""What an export carries of a scattering function: its tables, as small as they may be."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cuticle._support.quadrature import gauss_legendre
from cuticle.scattering.bcsdf import Bcsdf
from cuticle.scattering.compact_table import FunctionTable, tabulate_function
from cuticle.scattering.fibre_tables import FibreTables

TOLERANCE = 0.01  # of ∫ f cos
_VIEWERS = np.radians([0, 20, 45, 65, 80])
_COUNTS = (0.0, 0.5, 1.0, 3.0, 10.0)
_STEPS = (1, 2, 3, 4, 5, 6, 9, 10, 12, 15, 18, 20)  # divisors of 180, the rows' steps


def reduce_tables(
    model: Bcsdf,
    counts: Iterable[float] = (0.0,),
    tolerance: float = TOLERANCE,
    progress: Callable[[float], None] | None = None,
) -> FibreTables | FunctionTable:
    """Return the smallest tables that change f by less than `tolerance`.

    A `Fibre`'s and Chiang's functions keep their closed forms, and their tables lose rows and columns; any other becomes a
    table itself, for the strand counts that a sampler covers.

    Raises
    ------
    ValueError
        A function too sharp for a table.
    """
    closed_forms = getattr(model, "host_tables", None)
    if closed_forms is None:
        return tabulate_function(model, counts, tolerance, progress)
    whole: FibreTables = closed_forms()
    columns = whole.direct.shape[1]
    # A column a deviation at least: glints that carry little of the integral are seen all the same.
    least = max(16, np.pi / whole.deviation)
    across = [s for s in (1, 2, 4, 8, 16, 32) if (columns - 1) % s == 0 and (columns - 1) // s >= least]
    exact = _values(whole)
    steps = sorted(
        ((r, c) for r in _STEPS for c in across), key=lambda s: ((180 // s[0] + 1) * ((columns - 1) // s[1] + 1), s)
    )
    for step in steps:
        thin = whole.thinned(*step)
        error = _distance(_values(thin), exact)
        if error <= tolerance or step == (1, 1):
            break
    return replace(thin, error=error)


def _values(tables: FibreTables) -> NDArray[np.float64]:
    """Values of f cos at quadrature points, times their weights: shape (cases, points, channels)."""
    core = tables.core()
    theta, weight = gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, 61), 2)
    phi = (np.arange(360) + 0.5) * np.pi / 360
    ti, ph = (np.ascontiguousarray(a).reshape(-1) for a in np.broadcast_arrays(theta[:, None], phi))
    solid = (weight * np.cos(theta) ** 2)[:, None, None]
    cases = []
    for viewer in _VIEWERS:
        for n in _COUNTS if tables.kind == "dual" else (0.0,):
            out = np.empty((ti.size, tables.channels))
            core.eval(ti, np.full(ti.size, viewer), ph, np.array([n]), 15, out)
            cases.append((out.reshape(len(theta), len(phi), -1) * solid).reshape(ti.size, -1))
    return np.array(cases)


def _distance(values: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    return float((np.abs(values - exact).sum(axis=1) / exact.sum(axis=1)).max())
