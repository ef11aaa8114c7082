"""The table behind a sampler: what its columns are, and what holds of every entry."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cuticle._support.validate import MAX_STRANDS

# The order of include/cuticle/sampler/lobes.h: both coordinates of a kind side by side.
PARAMETERS = ("weight", "mean_theta", "mean_phi", "sigma_theta", "sigma_phi")
WEIGHT, MEAN_THETA, MEAN_PHI, SIGMA_THETA, SIGMA_PHI = range(5)
MAX_LOBES = 32


def check_table(nodes: NDArray, energy: NDArray, strands: Sequence[float], even: bool) -> None:
    """Raise ValueError where a table breaks a rule that the core relies on (see `Sampler`)."""
    if nodes.ndim != 4 or nodes.shape[0] != len(strands) or nodes.shape[2] != len(PARAMETERS):
        raise ValueError(
            f"nodes must have shape ({len(strands)} strand counts, theta nodes, {len(PARAMETERS)}, lobes), got {nodes.shape}"
        )
    if nodes.shape[1] < 2 or not 1 <= nodes.shape[3] <= MAX_LOBES:
        raise ValueError(f"nodes needs at least 2 theta nodes and 1 to {MAX_LOBES} lobes, got shape {nodes.shape}")
    if energy.shape != nodes.shape[:2]:
        raise ValueError(f"energy must have shape {nodes.shape[:2]}, got {energy.shape}")
    if not np.isfinite(nodes).all():
        row, node, parameter, lobe = (int(i) for i in np.argwhere(~np.isfinite(nodes))[0])
        raise ValueError(f"nodes[{row}][{node}] {PARAMETERS[parameter]} of lobe {lobe} is not a finite number")
    if not (np.isfinite(energy).all() and (energy > 0).all()):
        raise ValueError("energy must be finite and above 0 everywhere")
    counts = np.array(strands)
    if not ((counts >= 0) & (counts <= MAX_STRANDS)).all() or (np.diff(counts) <= 0).any():
        raise ValueError(f"strands must be increasing counts from 0 on, up to {MAX_STRANDS:g}, got {list(strands)}")
    weight, mean_t, mean_p, sigma_t, sigma_p = np.moveaxis(nodes, 2, 0)
    if (weight < 0).any() or not np.allclose(weight.sum(axis=-1), 1, rtol=0, atol=1e-6):
        raise ValueError(
            f"weights must be at least 0 and sum to 1 at every node, got {weight.min():g} to {weight.sum(-1).max():g}"
        )
    for name, sigma in (("sigma_theta", sigma_t), ("sigma_phi", sigma_p)):
        if (sigma < 1e-4).any() or (sigma > 1e3).any():
            raise ValueError(f"{name} must be in [0.0001, 1000] radians, got {sigma.min():g} to {sigma.max():g}")
    tolerance = 1 + 1e-6
    outside = [("mean_theta", np.abs(mean_t) - math.pi / 2, sigma_t)]
    if even:
        outside.append(("mean_phi", np.maximum(-mean_p, mean_p - math.pi), sigma_p))
    for name, distance, sigma in outside:
        if (distance > tolerance * sigma).any():
            raise ValueError(
                f"{name} must lie in its domain or at most one sigma outside, got {float(np.max(distance / sigma)):g} sigma"
            )
    if not even and (np.abs(mean_p) > 2 * math.pi).any():
        raise ValueError(f"mean_phi must be within ±2 pi, got up to {float(np.abs(mean_p).max()):g}")
