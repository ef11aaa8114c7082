"""A walk of light among parallel strands, by ray optics alone: no table, no operator and no density of the package.

Paths go from a viewed strand toward the light. At each strand an offset h is drawn evenly, and R, TT or TRT by what Fresnel
and absorption leave of it; azimuths are the rays', blurred by a normal; inclinations are latitudes of a von Mises-Fisher
distribution. What then goes to the light is scored in closed form for the same h.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle import Fibre

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Arrived:
    """Weights of f cos² theta_i, out of `count` paths; inclinations of the light; whether it came from those behind."""

    weight: Array
    theta_i: Array
    behind: NDArray[np.bool_]
    count: int

    def moments(self) -> tuple[float, float, float]:
        """Energy over the whole turn, mean and deviation of theta_i."""
        total = self.weight.sum()
        mean = (self.weight * self.theta_i).sum() / total
        square = (self.weight * (self.theta_i - mean) ** 2).sum() / total
        return 2 * np.pi * total / self.count, mean, np.sqrt(square)


def _optics(fibre: Fibre, sigma_a: float, theta: Array, h: Array) -> tuple[Array, Array]:
    """Attenuations and azimuths phi_i - phi_r of R, TT and TRT with what follows it: (3, n) each."""
    sine, cosine = np.sin(theta), np.maximum(np.cos(theta), 1e-6)
    eta = np.sqrt(fibre.eta**2 - sine**2) / cosine
    gamma_i, gamma_t = np.arcsin(h), np.arcsin(h / eta)
    cos_i = cosine * np.sqrt(1 - h**2)
    cos_t = np.sqrt(1 - (1 - cos_i**2) / fibre.eta**2)
    parallel = (fibre.eta * cos_i - cos_t) / (fibre.eta * cos_i + cos_t)
    across = (cos_i - fibre.eta * cos_t) / (cos_i + fibre.eta * cos_t)
    fresnel = 0.5 * (parallel**2 + across**2)
    path = np.exp(-2 * sigma_a * np.cos(gamma_t) / np.sqrt(1 - (sine / fibre.eta) ** 2))
    tt = (1 - fresnel) ** 2 * path
    attenuation = np.array([fresnel, tt, tt * fresnel * path / (1 - fresnel * path)])
    azimuth = np.array([2 * p * gamma_t - 2 * gamma_i + p * np.pi for p in range(3)])
    return attenuation, azimuth


def _latitude(axis: Array, variance: Array, rng: np.random.Generator) -> Array:
    u, turn = rng.random(len(axis)), 2 * np.pi * rng.random(len(axis))
    w = 1 + variance * np.log(u + (1 - u) * np.exp(-2 / variance))
    return np.arcsin(np.clip(w * np.sin(axis) + np.sqrt(np.maximum(1 - w**2, 0)) * np.cos(turn) * np.cos(axis), -1, 1))


def _pick(weights: Array, rng: np.random.Generator) -> NDArray[np.intp]:
    """One of three in proportion; 3 for what is left of 1."""
    return (rng.random(weights.shape[1]) >= np.cumsum(weights, axis=0)).sum(axis=0)


def _scatter(
    fibre: Fibre, attenuation: Array, azimuth: Array, theta: Array, phi: Array, rng: np.random.Generator
) -> tuple[NDArray[np.bool_], Array, Array]:
    """Return which paths are not absorbed, and the inclinations and azimuths at which they go on."""
    lobe = _pick(attenuation, rng)
    alive, lobe = lobe < 3, np.minimum(lobe, 2)
    spread = np.radians(fibre.beta_N)
    phi = phi + np.pi + azimuth[lobe, np.arange(len(lobe))] + spread * rng.normal(size=len(lobe))
    return alive, _latitude(theta + 2 * fibre.alpha[lobe], 4 * fibre.beta[lobe] ** 2, rng), phi


def passed(
    fibre: Fibre, sigma_a: float, theta_i: float, sheets: NDArray[np.int_], seed: int = 1, *, back: bool = False,
    azimuths: float = 0.0,
) -> float:  # fmt: skip
    """Return the share of light that leaves numbers of sheets, one a path, on the side where it did not fall in, or `back`.

    It falls in at azimuths from 0 to `azimuths`, evenly.
    """
    rng = np.random.default_rng(seed)
    theta, phi, depth, last = (
        np.full(len(sheets), -theta_i),
        azimuths * rng.random(len(sheets)),
        np.zeros(len(sheets)),
        sheets,
    )
    out = 0 if back else np.count_nonzero(sheets == 0)
    theta, phi, depth, last = (x[sheets > 0] for x in (theta, phi, depth, last))
    while len(theta):
        optics = _optics(fibre, sigma_a, theta, 2 * rng.random(len(theta)) - 1)
        alive, theta, phi = _scatter(fibre, *optics, theta, phi, rng)
        depth = depth + np.where(np.cos(phi) > 0, 1, -1)
        out += np.count_nonzero(alive & (depth < -0.5 if back else depth >= last))
        alive &= (depth > -0.5) & (depth < last)
        theta, phi, depth, last = (x[alive] for x in (theta, phi, depth, last))
    return float(out / len(sheets))


def walk(
    fibre: Fibre, sigma_a: float, theta_r: float, strands: float, *, arrangement: str, count: int = 100_000, seed: int = 1,
    phi_r: float | None = None, behind: float = np.inf,
) -> Arrived:  # fmt: skip
    """Return what reaches the light of a viewer at any azimuth, less what meets no other strand.

    `arrangement`: "sheets" of strands; a "lock" of a Poisson number of sheets, `strands` and `behind` on average; or a
    "medium" of strands at random.
    """
    rng = np.random.default_rng(seed)
    medium, lock = arrangement == "medium", arrangement == "lock"
    theta, depth = np.full(count, -theta_r), np.full(count, float(strands))
    last = depth + behind
    if lock:
        depth = rng.poisson(strands, count).astype(float)
        last = depth + (behind if np.isinf(behind) else rng.poisson(behind, count))
    phi = np.pi + (rng.random(count) * 2 * np.pi if phi_r is None else np.full(count, phi_r))
    returned, found = np.zeros(count, bool), []
    for event in range(1000):
        attenuation, azimuth = _optics(fibre, sigma_a, theta, 2 * rng.random(len(theta)) - 1)
        seen = np.exp(-depth) if medium else (depth < 0.5).astype(float)
        # Toward azimuth 0: phi_i - phi_r with phi_r opposite to where the path travels.
        off = (-(phi + np.pi) - azimuth + np.pi) % (2 * np.pi) - np.pi
        spread = np.radians(fibre.beta_N)
        density = attenuation * sum(
            np.exp(-0.5 * ((off + 2 * np.pi * k) / spread) ** 2) / (spread * np.sqrt(2 * np.pi)) for k in (-1, 0, 1)
        )
        total = density.sum(axis=0)
        lobe = np.minimum(_pick(density / np.maximum(total, 1e-300), rng), 2)
        light = _latitude(theta + 2 * fibre.alpha[lobe], 4 * fibre.beta[lobe] ** 2, rng)
        if event == 0:  # light that meets no strand on its way
            seen = seen * (0 if medium else depth >= 0.5)
        found.append((total * seen, light, returned.copy()))
        alive, theta, phi = _scatter(fibre, attenuation, azimuth, theta, phi, rng)
        up = np.cos(phi) > 0
        if event == 0:
            returned = ~up
        depth = depth - (np.cos(phi) * rng.exponential(size=len(phi)) if medium else np.where(up, 1, -1))
        alive &= (depth > 0) & (depth < last) if medium else (depth > -0.5) & (depth < last + 0.5)
        theta, phi, depth, last, returned = (x[alive] for x in (theta, phi, depth, last, returned))
        if not len(theta):
            break
    weight, light, returned = (np.concatenate(x) for x in zip(*found, strict=True))
    return Arrived(weight, light, returned, count)


def quadrature(f: Any, theta_r: float, phi: Array | None = None) -> tuple[float, float, float]:
    """Return energy over the turn (at given azimuths: 2 pi times their mean), mean and deviation of a function's light."""
    theta = (np.arange(360) + 0.5) * np.pi / 360 - np.pi / 2
    phi = (np.arange(72) + 0.5) * np.pi / 72 if phi is None else phi
    weight = f(theta[:, None], theta_r, phi[None, :]).mean(axis=1) * np.cos(theta) ** 2 * np.pi / 360
    total = weight.sum()
    mean = (weight * theta).sum() / total
    return 2 * np.pi * total, mean, np.sqrt((weight * (theta - mean) ** 2).sum() / total)
