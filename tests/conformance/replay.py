"""Inputs, the reference and the comparison.

Tolerances. The density: 1e-4 relative. In single precision a lobe's exponent z² carries a relative error of a few 1e-7 and
is at most 60 before the density is 1e-24, which makes 3e-5; densities below 1e-12/sr are compared absolutely. Angles: 1e-4
radians, to the very ends of a lobe. A u for the lobe within 3e-6 of the border between two lobes may choose either. Within
2e-7 radians of a pole the core holds cos(theta) above 1.2e-7: there a density has to be finite. Compilers that may
reassociate (GLSL's, -ffast-math) merge pi/2's two parts and know cos(theta) to 5e-8 absolutely: their densities are
allowed that, too.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from cuticle.sampling.sampler import Sampler

COUNT = 100_000
DIGEST = "5c144dd58fa49c16"
COLUMNS = ("theta_i", "theta_r", "phi", "strands", "u_lobe", "u_theta", "u_phi")
PDF, ANGLE, BORDER, LEAST, MERGED = 1e-4, 1e-4, 3e-6, 1e-12, 5e-8


def inputs() -> np.ndarray:
    """Return the inputs, shape (COUNT, 7), single precision: a recipe that gives the same numbers anywhere."""
    rng = np.random.Generator(np.random.PCG64(20))
    pole = np.float32(np.pi / 2 - 5e-7)
    x = rng.random((COUNT, len(COLUMNS)))
    out = np.empty(x.shape, np.float32)
    out[:, 0] = (x[:, 0] - 0.5) * np.pi * 0.9999
    out[:, 1] = (x[:, 1] - 0.5) * np.pi * 0.9999
    out[:, 2] = (x[:, 2] - 0.5) * 2 * np.pi * 0.9999
    out[:, 3] = np.where(x[:, 3] < 0.2, 0, np.where(x[:, 3] < 0.3, x[:, 6], np.floor(x[:, 3] * 40) / 4))
    out[:, 4:] = np.minimum(x[:, 4:], 1 - 2.0**-24)
    # Every combination of the edges, over the first rows.
    angles = (-pole, 0.0, pole)
    turns = (-np.float32(np.pi), -1e-7, 0.0, np.nextafter(np.float32(np.pi), np.float32(0)))
    ends = (0.0, 0.5, 1 - 2.0**-24)
    edges = np.array(np.meshgrid(angles, angles, turns, (0.0, 0.5, 1.0, 3.0, 100.0), ends, ends, ends, indexing="ij"))
    edges = edges.reshape(len(COLUMNS), -1).T
    out[: len(edges)] = edges
    return out


def digest(values: np.ndarray) -> str:
    return hashlib.sha256(values.astype("<f4").tobytes()).hexdigest()[:16]


@dataclass(frozen=True)
class Worst:
    """A host's largest errors, and where they were."""

    host: str
    pdf: float
    angle: float
    sample_pdf: float
    at: dict[str, list[float]]

    @property
    def ok(self) -> bool:
        """Whether the host conforms; an error that is no number does not."""
        return self.pdf <= PDF and self.angle <= ANGLE and self.sample_pdf <= PDF

    def __str__(self) -> str:
        return f"{self.host}: off by {self.pdf:.2g} of the pdf, a sample {self.angle:.2g} rad, its pdf {self.sample_pdf:.2g}"


def compare(host: str, sampler: Sampler, x: np.ndarray, got: np.ndarray, *, reassociates: bool = False) -> Worst:
    """Compare a host's (pdf, theta_i, phi, pdf of the sample), shape (COUNT, 4), with Python in double precision."""
    slack = MERGED if reassociates else 0.0
    x, got = x.astype(float), got.astype(float)
    theta_i, theta_r, phi, strands = x[:, :4].T
    reference = sampler.pdf(theta_i, theta_r, phi, strands)
    pdf = _relative(got[:, 0], reference, slack / np.cos(theta_i))
    # The pdf that comes with a sample, against the reference at that very direction.
    inside = np.clip(got[:, 1], -np.pi / 2, np.pi / 2)
    own = sampler.pdf(np.nan_to_num(inside), theta_r, np.nan_to_num(np.clip(got[:, 2], -4, 4)), strands)
    sample_pdf = _relative(got[:, 3], own, slack / np.maximum(np.cos(got[:, 1]), 1e-9))
    sample_pdf[np.isfinite(got[:, 3]) & (np.abs(got[:, 1]) > np.pi / 2 - 2e-7)] = 0
    angle = np.full(len(x), np.inf)
    for step in (0.0, -BORDER, BORDER):
        u = x[:, 4:].copy()
        u[:, 0] = np.clip(u[:, 0] + step, 0, 1 - 1e-16)
        s = sampler.sample(theta_r, u, strands)
        off = np.maximum(np.abs(got[:, 1] - s.theta_i), np.abs(turn(got[:, 2] - s.phi)))
        angle = np.fmin(angle, off)
    bad = ~np.isfinite(got).all(axis=1)
    angle[bad] = np.inf
    return Worst(
        host,
        float(pdf.max()),
        float(angle.max()),
        float(sample_pdf.max()),
        {
            "pdf": x[int(np.argmax(pdf))].tolist(),
            "angle": x[int(np.argmax(angle))].tolist(),
            "sample_pdf": x[int(np.argmax(sample_pdf))].tolist(),
        },
    )


def _relative(value: np.ndarray, reference: np.ndarray, slack: np.ndarray) -> np.ndarray:
    """The relative error, less `slack`."""
    error = np.maximum(np.abs(value - reference) / (reference + LEAST / PDF) - slack, 0)
    return np.where(np.isfinite(error), error, np.inf)


def turn(x: np.ndarray) -> np.ndarray:
    """Return angles less whole turns."""
    return x - 2 * np.pi * np.round(x / (2 * np.pi))
