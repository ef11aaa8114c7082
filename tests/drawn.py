"""What tests of many samplers share: samples follow their density, and wrong ones are found out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import cuticle


def ends_of_random_numbers() -> Iterator[tuple[Any, np.ndarray]]:
    """Both precisions, and all triples of their least, small, middle and last random numbers, (64, 3)."""
    for dtype, last in ((np.float64, 1 - 2.0**-53), (np.float32, 1 - 2.0**-24)):
        yield dtype, np.array(np.meshgrid(*[[0, 1e-30, 0.5, last]] * 3), dtype).reshape(3, -1).T


def are_directions(s: cuticle.Sample, dtype: Any) -> None:
    """Hold samples to what every one is: in their precision, finite, on the sphere, with a density."""
    assert s.pdf.dtype == dtype
    assert np.isfinite(np.array(s)).all()
    assert (np.abs(s.theta_i) <= np.pi / 2).all()
    assert (np.abs(s.phi) <= np.pi + 1e-6).all()
    assert (s.pdf >= 0).all()


def follows(sampler: Any, theta_r: float, dtype: Any, *, samples: int, level: float, seed: int) -> None:
    """Audit a sampler at one viewer in a precision; of every tenth seed inclinations 5 % too small, too, which must fail."""

    def sample(tr: float, u: np.ndarray, scale: float = 1) -> Any:
        theta_i, phi, p = sampler.sample(dtype(tr), np.minimum(u, 1 - 2.0**-24).astype(dtype))
        return theta_i * dtype(scale), phi, p

    def pdf(theta_i: np.ndarray, tr: float, phi: np.ndarray) -> np.ndarray:
        density: np.ndarray = sampler.pdf(theta_i.astype(dtype), dtype(tr), phi.astype(dtype))
        return density

    asked: dict[str, Any] = {"theta_r": [theta_r], "samples": samples, "level": level}
    audit = cuticle.audit(sample, pdf, **asked, seed=seed)
    assert audit.ok, (sampler, theta_r, audit)
    if seed % 10 == 0:
        wrong = cuticle.audit(lambda t, u: sample(t, u, 0.95), pdf, **asked)
        assert not wrong.ok, (sampler, theta_r)
