"""The sampler under audit: three functions from anywhere, called with arrays, their answers put into one form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle.scattering.bcsdf import luminance

Array = NDArray[np.float64]
MAX_DIMENSIONS = 32


@dataclass(frozen=True)
class Drawn:
    """Samples of one viewer.

    Of those `asked` for, the ones kept are directions with a density; `pdf`, `weight` (luminance) as they came with them, or
    None. `dropped`: answers that say there is no direction: pdf 0, or weight 0 where f is above 0 or the pdf asked for is 0.
    `invalid`: NaN or infinite angles, pdf or weight, or a negative pdf; `outside`: theta beyond a pole or phi beyond two
    turns. `biased`: no direction, yet a weight.
    """

    theta: Array
    phi: Array
    pdf: Array | None
    weight: Array | None
    asked: int
    dropped: int
    invalid: int
    outside: int
    biased: int


@dataclass(frozen=True)
class Subject:
    """sample(theta_r, u) -> (theta_i, phi[, pdf[, weight]]), pdf and eval(theta_i, theta_r, phi), and lobes if known."""

    sample: Callable[..., Any]
    pdf: Callable[..., Any]
    eval: Callable[..., Any] | None
    name: str
    dimensions: int
    lobe_names: Sequence[str] = ()
    lobe_densities: Callable[..., Any] | None = None
    eval_pdf: Callable[..., Any] | None = None

    def draw(self, theta_r: float, count: int, rng: np.random.Generator) -> Drawn:
        """Draw `count` samples for one viewer."""
        u = rng.random((count, self.dimensions))
        answer = _columns(self.sample, theta_r, u)
        theta, phi = answer[0], answer[1]
        pdf = answer[2] if len(answer) > 2 else None
        weight = answer[3] if len(answer) > 3 else None
        finite = np.isfinite(theta) & np.isfinite(phi)
        none = np.zeros(count, bool)
        if pdf is not None:
            none = pdf == 0
            finite = none | (finite & np.isfinite(pdf) & (pdf > 0))
        biased = 0
        if weight is not None:
            finite &= np.isfinite(weight)
            biased = int((none & (weight > 0)).sum())
            # Hosts that fail a sample leave its pdf and return no weight: so it is where there is no density, or where f
            # is above 0. A weight of 0 where f is 0 is what it should be.
            dark = np.flatnonzero(finite & ~none & (weight == 0) & (np.abs(theta) <= np.pi / 2))
            if len(dark):
                p, f = self.values(theta[dark], theta_r, phi[dark])
                none[dark] = (p == 0) | (False if f is None else f.max(axis=1) > 0)
        inside = none | ((np.abs(theta) <= np.pi / 2 + 1e-5) & (np.abs(phi) <= 4 * np.pi))
        keep = finite & inside & ~none
        wrapped = np.pi - np.mod(np.pi - phi[keep], 2 * np.pi)
        return Drawn(
            theta=theta[keep].clip(-np.pi / 2, np.pi / 2), phi=wrapped, pdf=None if pdf is None else pdf[keep],
            weight=None if weight is None else weight[keep], asked=count, dropped=int((none & finite).sum()),
            invalid=int((~finite).sum()), outside=int((finite & ~inside).sum()), biased=biased,
        )  # fmt: skip

    def density(self, theta: Array, theta_r: float, phi: Array) -> Array:
        """The claimed density, as it came."""
        return _call("pdf", self.pdf, theta, theta_r, phi)

    def values(self, theta: Array, theta_r: float, phi: Array) -> tuple[Array, Array | None]:
        """The claimed density and f·cos (n, channels), as they came."""
        if self.eval is None:
            return self.density(theta, theta_r, phi), None
        if self.eval_pdf is not None:
            f, p = self.eval_pdf(theta, theta_r, phi)
            return np.asarray(p, np.float64), np.asarray(f, np.float64) * np.cos(theta)[:, None]
        f = _call("eval", self.eval, theta, theta_r, phi, channels=True)
        return self.density(theta, theta_r, phi), f * np.cos(theta)[:, None]


def bright(f: Array) -> Array:
    """Luminance of f (n, channels)."""
    return luminance(f)


def _columns(sample: Callable[..., Any], theta_r: float, u: Array) -> list[Array]:
    try:
        answer = sample(theta_r, u)
        columns = [np.asarray(c, np.float64) for c in answer]
        if any(c.shape[:1] != (len(u),) for c in columns):
            columns = _one_by_one(sample, theta_r, u)
    except (TypeError, ValueError) as error:
        try:
            columns = _one_by_one(sample, theta_r, u)
        except Exception:
            raise ValueError(
                f"sample(theta_r, u) raised {type(error).__name__} for u of shape {u.shape}: {error}"
            ) from error
    except Exception as error:
        raise ValueError(f"sample(theta_r, u) raised {type(error).__name__} for u of shape {u.shape}: {error}") from error
    if not 2 <= len(columns) <= 4 or any(c.shape != (len(u),) for c in columns[:3]):
        shapes = ", ".join(str(c.shape) for c in columns)
        raise ValueError(
            f"sample(theta_r, u) must return theta_i, phi and, if it has them, pdf and weight: each one value for a row of"
            f" u (a weight may have channels), got shapes {shapes} for {len(u)} rows"
        )
    if len(columns) == 4 and columns[3].ndim > 1:
        columns[3] = luminance(columns[3])
    return columns


def _one_by_one(sample: Callable[..., Any], theta_r: float, u: Array) -> list[Array]:
    rows = [tuple(sample(theta_r, row)) for row in u]
    return [np.array(c, np.float64) for c in zip(*rows, strict=True)]


def _call(
    name: str, function: Callable[..., Any], theta: Array, theta_r: float, phi: Array, *, channels: bool = False
) -> Array:
    try:
        answer = np.asarray(function(theta, theta_r, phi), np.float64)
    except Exception as first:
        try:
            answer = np.array([function(float(t), theta_r, float(p)) for t, p in zip(theta, phi, strict=True)], np.float64)
        except Exception:
            raise ValueError(f"{name}(theta_i, theta_r, phi) raised {type(first).__name__}: {first}") from first
    if answer.ndim == 0:  # a constant
        answer = np.full(len(theta), float(answer))
    if channels and answer.shape == theta.shape:
        answer = answer[:, None]
    expected = 2 if channels else 1
    if answer.ndim != expected or answer.shape[0] != len(theta):
        raise ValueError(
            f"{name}(theta_i, theta_r, phi) must return one value a direction, got {answer.shape} for {len(theta)}"
        )
    return answer
