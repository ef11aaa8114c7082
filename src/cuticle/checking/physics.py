"""What a scattering function itself should obey, where it is asked to."""

from __future__ import annotations

import numpy as np

from cuticle.checking.foreign_sampler import Subject, bright

_PAIRS = 4000


def reciprocity_error(subject: Subject, rng: np.random.Generator) -> float:
    """Return the mean of |f(i, r) - f(r, i)| over the mean of f, over random pairs of directions."""
    difference = total = 0.0
    for theta_r in np.arcsin(rng.uniform(-1, 1, 16)):
        theta = np.arcsin(rng.uniform(-1, 1, _PAIRS // 16))
        phi = rng.uniform(-np.pi, np.pi, len(theta))
        there = bright(subject.values(theta, float(theta_r), phi)[1]) / np.cos(theta)  # type: ignore[arg-type]
        back = np.array(
            [
                bright(subject.values(np.array([theta_r]), float(t), np.array([-p]))[1])[0]  # type: ignore[arg-type]
                for t, p in zip(theta, phi, strict=True)
            ]
        ) / np.cos(theta_r)
        difference += float(np.abs(there - back).sum())
        total += 0.5 * float((there + back).sum())
    return difference / max(total, 1e-300)
