"""The 1-D densities that lobes are made of, each with pdf, cdf and icdf; densities are per radian.

- `longitudinal_normal`: a normal in theta truncated to [-pi/2, pi/2].
- `periodic_normal`: a normal in phi truncated to the period around its mean.
- `even_normal`: a normal in abs(phi) truncated to [0, pi], with either sign equally likely.

Every mean is allowed, even far outside the domain, and every sigma > 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate


@dataclass(frozen=True)
class Density:
    """A density on an interval: `pdf` (per radian), `cdf` and its inverse `icdf`. Arguments broadcast."""

    name: str
    low: float
    high: float
    _function: Callable[..., None]

    def pdf(self, x: ArrayLike, mean: ArrayLike, sigma: ArrayLike) -> NDArray:
        """Return the density at `x` (radians), per radian."""
        return self._call(0, x, mean, sigma)

    def cdf(self, x: ArrayLike, mean: ArrayLike, sigma: ArrayLike) -> NDArray:
        """Return the probability from the start of the domain to `x` (radians)."""
        return self._call(1, x, mean, sigma)

    def icdf(self, u: ArrayLike, mean: ArrayLike, sigma: ArrayLike) -> NDArray:
        """Return the angle (radians) below which the probability is `u` in [0, 1]."""
        return self._call(2, u, mean, sigma)

    def _call(self, function: int, x: ArrayLike, mean: ArrayLike, sigma: ArrayLike) -> NDArray:
        dtype = validate.float_type(x, mean, sigma)
        if function == 2:
            xs = validate.array("u", x, 0, 1, dtype, remedy="u is a probability")
        else:
            xs = validate.angles("x", x, 4 * np.pi, dtype)
        means = validate.array("mean", mean, -1e6, 1e6, dtype, remedy=validate.RADIANS)
        sigmas = validate.array("sigma", sigma, 1e-5, 1e9, dtype, remedy=validate.RADIANS)
        shape = validate.broadcast(x=xs, mean=means, sigma=sigmas)
        out = np.empty(int(np.prod(shape)), dtype)
        if out.size:
            self._function(function, *(validate.flat(a, shape) for a in (xs, means, sigmas)), out)
        return out.reshape(shape)


longitudinal_normal = Density("longitudinal_normal", -np.pi / 2, np.pi / 2, _core.longitudinal_normal)
periodic_normal = Density("periodic_normal", -np.pi, np.pi, _core.periodic_normal)
even_normal = Density("even_normal", -np.pi, np.pi, _core.even_normal)
DENSITIES = (longitudinal_normal, periodic_normal, even_normal)
