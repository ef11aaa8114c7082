"""The draft description's own form: one product of two Gaussians, or one Gaussian through n strands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

THETA_NODES = 61  # every 3 degrees: the quartic sigma_V is then followed to 0.2 %
_FLAT_PHI = 100.0  # radians: uniform around the fibre to 5e-4
_WIDE_THETA = 0.8  # radians: about the cosine of a uniform sphere


SIGMA_H = 0.29  # Eq. 2, radians
SLOPE = (0.5365, 0.0823)  # per unit of theta_r, and per unit and doubling of the strands
OFFSET = -1.46  # degrees
WIDTH = (0.5065, -0.0494, 0.0495)  # radians: at normal view through 1 strand, per doubling, per theta_r²


def sigma_v(theta_r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Azimuthal deviation for direct light, radians: ¼ theta_r⁴ + 0.59 (the draft's Eq. 3, theta_r in radians)."""
    return 0.25 * theta_r**4 + 0.59


def mu_h(theta_r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shift of the peak from -theta_r for direct light, in degrees: 3 theta_r - 2 (Eq. 4, theta_r in radians)."""
    return 3 * theta_r - 2


def multiple(theta_r: NDArray[np.float64], strands: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the shift from -theta_r and the deviation, radians, of the one Gaussian for n > 0 strands.

    The draft gives these as a table (table 3) for 1, 2, 4 and 8 strands and leaves the functions open. Ours are the least
    squares of a line in theta_r with a slope linear in log2 n, and of a parabola, over |theta_r| ≤ 60°
    (benchmarks/document_fibre.py): rms residuals 1.1° and 0.02.
    """
    octave = np.log2(max(strands, 1.0))
    shift = theta_r * (SLOPE[0] + SLOPE[1] * octave) + np.radians(OFFSET)
    return shift, WIDTH[0] + WIDTH[1] * octave + WIDTH[2] * theta_r**2


def document_nodes(strands: Sequence[float], defensive: float) -> NDArray[np.float64]:
    """Return the table (strand counts, theta nodes, 5, lobes) of the draft's form with a defensive share.

    The defensive lobe is close to a uniform sphere: without it weights have no bound.
    """
    theta_r = np.linspace(-np.pi / 2, np.pi / 2, THETA_NODES)
    lobes = 2 if defensive > 0 else 1
    nodes = np.empty((len(strands), THETA_NODES, 5, lobes))
    for row, n in zip(nodes, strands, strict=True):
        if n > 0:
            shift, sigma = multiple(theta_r, n)
            spread = np.full(THETA_NODES, _FLAT_PHI)
        else:
            shift, sigma = np.radians(mu_h(theta_r)), np.full(THETA_NODES, SIGMA_H)
            spread = sigma_v(theta_r)
        mean = np.clip(shift - theta_r, -np.pi / 2 - 0.9 * sigma, np.pi / 2 + 0.9 * sigma)
        row[:, :, 0] = np.stack([np.full(THETA_NODES, 1 - defensive), mean, np.full(THETA_NODES, np.pi), sigma, spread], 1)
        if lobes == 2:
            row[:, :, 1] = [defensive, 0.0, np.pi, _WIDE_THETA, _FLAT_PHI]
    return nodes
