"""Values of the C++ core for the reference's cases, with slips planted by inputs and factors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import cuticle
from cuticle.reference import Submission
from cuticle.reference.cases import ANGLES, Inputs
from cuticle.scattering.bcsdf import luminance

Row = dict[str, float]


def _scaled(factor: float, *names: str) -> Callable[[Row], Row]:
    """Inputs whose name begins so, times a factor."""
    return lambda row: {k: factor * v if k.startswith(names) else v for k, v in row.items()}


INPUTS: dict[str, Callable[[Row], Row]] = {
    "tilt-sign": _scaled(-1, "alpha"),
    "tilt-halved": _scaled(0.5, "alpha"),
    "tilt-missing": _scaled(0, "alpha"),
    "path-per-diameter": _scaled(0.5, "sigma_a"),
    "path-doubled": _scaled(2, "sigma_a"),
    "phi-sign": _scaled(-1, "h"),
    "density-missing": lambda row: row | {"d_f": 1.0},
    "density-behind-missing": lambda row: row | {"d_b": 1.0},
}
FACTORS: dict[str, Callable[[Row], float]] = {
    "over-pi": lambda row: 1 / np.pi,
    "cosine-in": lambda row: np.cos(row["theta_i"]),
    "cosine-out-twice": lambda row: 1 / np.cos(row["theta_i"]),
    "cosine-viewer-in": lambda row: np.cos(row["theta_r"]),
    "pdf-over-pi": lambda row: 1 / np.pi,
    "pdf-per-angle": lambda row: np.cos(row["theta_i"]),
    "pdf-no-cosine": lambda row: 1 / np.cos(row["theta_i"]),
}


def function(inputs: Inputs, row: Row) -> cuticle.Bcsdf:
    """Return the core's scattering function of a case."""
    sigma_a = tuple(row[f"sigma_a_{c}"] for c in "rgb")
    fibre = {k: v for k, v in row.items() if k.startswith(("alpha", "beta", "eta"))}
    if inputs.model == "chiang":
        hair = cuticle.Chiang(**fibre, sigma_a=sigma_a)
        return hair.near(row["h"]) if inputs.near else hair
    if inputs.model == "marschner":
        return cuticle.Marschner(cuticle.Fibre(**fibre, sigma_a=sigma_a), inputs.longitudinal)
    own = cuticle.Fibre(**fibre, sigma_a=sigma_a, d_f=row["d_f"], d_b=row["d_b"], formulation="zinke2008")
    return cuticle.DualScattering(own).with_strands(row["strands"])


def directional_albedo(inputs: Inputs, row: Row) -> float:
    """Return the luminance of the integral of f cos theta_i over directions, summed over a grid of the core's f."""
    own = function(inputs, row)
    t, w = np.polynomial.legendre.leggauss(12)
    edges = np.unique(np.concatenate([np.linspace(-np.pi / 2, np.pi / 2, 41), np.geomspace(1e-4, 0.05, 6) - np.pi / 2]))
    edges = np.unique(np.concatenate([edges, -edges]))
    half, middle = np.diff(edges)[:, None] / 2, (edges[1:] + edges[:-1])[:, None] / 2
    theta, weight = (middle + half * t).ravel(), (half * w).ravel()
    phi = (np.arange(360) + 0.5) * np.pi / 180 - np.pi
    light = luminance(own.eval(theta[:, None], row["theta_r"], phi))
    return float((light.mean(axis=1) * 2 * np.pi * np.cos(theta) ** 2 * weight).sum())


def submission(inputs: Inputs, f: np.ndarray | None = None, pdf: np.ndarray | None = None, *, single: bool) -> Submission:
    """Return values of f (n, channels), of the density (n,), or of both, as a file of them would be read."""
    n = len(inputs)
    f = np.full((n, inputs.channels), np.nan) if f is None else f
    pdf = np.full(n, np.nan) if pdf is None else pdf
    if single:
        with np.errstate(over="ignore"):
            f, pdf = (x.astype(np.float32).astype(float) for x in (f, pdf))
    f = np.where(np.isfinite(f), f, np.nan)  # as a file is read
    return Submission("values", inputs, f, pdf, {"f": single, "pdf": single}, np.arange(1, n + 1))


def planted(inputs: Inputs, slips: tuple[str, ...] = (), *, density: bool = False, single: bool = False) -> Submission:
    """Return the core's f, or its density, with slips."""
    found = []
    for i in range(len(inputs)):
        row = given = inputs.row(i)
        for slip in slips:
            row = INPUTS.get(slip, dict)(row)
        own = function(inputs, row)
        angles = tuple(row[k] for k in ANGLES)
        if not density:
            value = own.eval(*angles)
        elif inputs.model == "chiang":
            value = own.pdf(*angles)  # type: ignore[attr-defined]
        else:
            value = luminance(own.eval(*angles)) * np.cos(row["theta_i"]) / directional_albedo(inputs, row)
        found.append(np.prod([FACTORS[s](given) for s in slips if s in FACTORS]) * value)
    values = np.array(found)
    return submission(inputs, single=single, **({"pdf": values} if density else {"f": values}))
