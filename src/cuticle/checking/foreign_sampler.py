"""A sampler from anywhere: its functions, called with arrays, and their results checked and brought into one form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from cuticle._support import validate
from cuticle.checking.measurements import Array, Drawn
from cuticle.checking.regions import Region
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import luminance

_T = TypeVar("_T")
_MAX_DIMENSIONS = 32
_PAIRS = 4000  # of directions, for reciprocity
_SAID = 300  # characters of a user's exception


@dataclass(frozen=True)
class ForeignSampler:
    """The functions of a sampler, as `cuticle.audit` documents them."""

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
        theta, phi, *others = _columns(self.sample, theta_r, u)
        pdf, weight = [*others, None, None][:2]
        finite = np.isfinite(theta) & np.isfinite(phi)
        none = np.zeros(count, bool)
        if pdf is not None:
            none = pdf == 0
            finite = none | (finite & np.isfinite(pdf) & (pdf > 0))
        biased = 0
        if weight is not None:
            weight = weight.reshape(count, -1)
            finite &= np.isfinite(weight).all(axis=1)
            biased = int((none & (weight > 0).any(axis=1)).sum())
            # A host that rejects a sample may keep its pdf and return weight 0. A weight of 0 is right where f is 0; where
            # f is above 0, or the pdf evaluated there is 0, it means that the sample was rejected.
            dark = np.flatnonzero(finite & ~none & (weight == 0).all(axis=1) & (np.abs(theta) <= np.pi / 2))
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
        """Return the pdf, unchecked."""
        return _call("pdf", self.pdf, theta, theta_r, phi)

    def values(self, theta: Array, theta_r: float, phi: Array) -> tuple[Array, Array | None]:
        """Return the pdf and f·cos (n, channels), unchecked."""
        if self.eval is None:
            return self.density(theta, theta_r, phi), None
        if self.eval_pdf is not None:
            f, p = self.eval_pdf(theta.copy(), theta_r, phi.copy())
            return _real("eval_pdf", p), _real("eval_pdf", f) * np.cos(theta)[:, None]
        f = _call("eval", self.eval, theta, theta_r, phi, channels=True)
        return self.density(theta, theta_r, phi), f * np.cos(theta)[:, None]

    def lobe_behind(self, region: Region, theta_r: float, theta: Array, phi: Array, samples: int) -> str:
        """Return in words which lobe's density lies in a region, or whose samples went there; edges cover the sphere."""
        if self.lobe_densities is None or not self.lobe_names:
            return ""

        def shares(t: Array, p: Array) -> Array:
            tt, pp = (x.ravel() for x in np.meshgrid(0.5 * (t[:-1] + t[1:]), 0.5 * (p[:-1] + p[1:]), indexing="ij"))
            density = _real("lobes", self.lobe_densities(tt, theta_r, pp))  # type: ignore[misc]
            return (density * np.cos(tt)) @ np.outer(np.diff(t), np.diff(p)).ravel()

        whole = shares(theta, phi)
        if not whole.sum() > 0:
            return ""
        whole /= whole.sum()
        excess = (region.drawn - region.expected) / samples
        near = np.abs(whole - excess) < 0.15 * whole + 3 * np.sqrt(whole / samples)
        if region.drawn > 2 * region.expected and near.sum() == 1:
            k = int(np.argmax(near))
            return f"the excess is as large as all of lobe {self.lobe_names[k]} ({100 * whole[k]:.2g} %)"
        here = shares(np.linspace(*region.theta, 33), np.linspace(*region.phi, 65))
        if region.drawn > 2 * region.expected or not here.sum() > 0:
            return ""
        k = int(np.argmax(here))
        return f"{100 * here[k] / here.sum():.0f} % of the pdf there is lobe {self.lobe_names[k]}"

    def reciprocity_error(self, rng: np.random.Generator) -> float:
        """Return the mean of |f(i, r) - f(r, i)| over the mean of f, over random pairs of directions."""

        def f(theta: Array, theta_r: float, phi: Array) -> Array:
            return luminance(self.values(theta, theta_r, phi)[1]) / np.cos(theta)  # type: ignore[arg-type]

        difference = total = 0.0
        for theta_r in np.arcsin(rng.uniform(-1, 1, 16)):
            theta = np.arcsin(rng.uniform(-1, 1, _PAIRS // 16))
            phi = rng.uniform(-np.pi, np.pi, len(theta))
            there = f(theta, float(theta_r), phi)
            pairs = zip(theta, phi, strict=True)
            back = np.array([f(np.array([theta_r]), float(t), np.array([-p]))[0] for t, p in pairs])
            difference += float(np.abs(there - back).sum())
            total += 0.5 * float((there + back).sum())
        return difference / max(total, 1e-300)


def foreign_sampler(
    sample: Any,
    pdf: Callable[..., Any] | None,
    eval: Callable[..., Any] | None,
    *,
    dimensions: int,
    strands: float | None,
    lobes: tuple[Sequence[str], Callable[..., Any]] | None,
    name: str | None,
) -> ForeignSampler:
    """Return the sampler that `audit` was given: three functions, an object that has them, or a `Sampler`."""
    validate.integer("dimensions", dimensions, 1, _MAX_DIMENSIONS)
    if lobes is not None and not (isinstance(lobes, (tuple, list)) and len(lobes) == 2 and callable(lobes[1])):
        raise TypeError(
            "lobes must be a pair, the names and a function lobes(theta_i, theta_r, phi); see help(cuticle.audit)"
        )
    if strands is not None and not isinstance(sample, Sampler):
        raise TypeError(f"strands is for a cuticle.Sampler, got {type(sample).__name__}: its own with_strands(n) sets them")
    lobe_names, lobe_densities = lobes if lobes is not None else ((), None)
    draw: Any = sample
    density: Any = pdf
    eval_pdf = None
    if isinstance(sample, Sampler):
        n = strands if strands is not None or len(sample.strands) > 1 else sample.strands[0]
        if n is None:
            counts = ", ".join(f"{c:g}" for c in sample.strands)
            raise ValueError(f"strands must be given: this sampler covers {counts}; strands=0 is direct light")
        if lobes is None:
            lobe_names, lobe_densities = [str(k) for k in range(sample.lobes)], partial(_lobe_densities, sample, n)
        draw, density = partial(_with_strands, sample.sample, n), pdf or partial(_with_strands, sample.pdf, n)
    elif hasattr(sample, "sample"):
        if pdf is None and eval is None:
            eval_pdf = getattr(sample, "eval_pdf", None)  # one call for both
        draw, density, eval = sample.sample, pdf or getattr(sample, "pdf", None), eval or getattr(sample, "eval", None)
        if lobes is None and getattr(sample, "lobe_names", None):
            lobe_names, lobe_densities = sample.lobe_names, sample.lobe_densities
    for which, function in (("sample", draw), ("pdf", density), *((("eval", eval),) if eval is not None else ())):
        if not callable(function):
            raise TypeError(f"{which} must be a function, got {type(function).__name__}; see help(cuticle.audit)")
    if draw is not sample:
        name = name or repr(sample)
    return ForeignSampler(draw, density, eval, name or "sampler", dimensions, lobe_names, lobe_densities, eval_pdf)


def _with_strands(function: Callable[..., Any], strands: float, *arguments: Any) -> Any:
    return function(*arguments, strands)


def _lobe_densities(sampler: Sampler, strands: float, theta_i: Any, theta_r: float, phi: Any) -> Array:
    """Return each lobe's part of a sampler's pdf, per steradian, (lobes, n): the pdf of that lobe alone times its weight."""
    parts = []
    for weight, *lobe in zip(*sampler.mixture(theta_r, strands), strict=True):
        nodes = np.tile(np.array([1.0, *lobe]).reshape(1, 1, 5, 1), (1, 2, 1, 1))
        alone = Sampler(nodes, np.ones((1, 2)), even=sampler.even, family=sampler.family)
        parts.append(weight * alone.pdf(theta_i, theta_r, phi))
    # Between 0 strands and the next count two rows are blended, and a lobe has a part in each.
    return np.array(parts).reshape(-1, sampler.lobes, np.size(theta_i)).sum(axis=0)


def _columns(sample: Callable[..., Any], theta_r: float, u: Array) -> list[Array]:
    def together() -> list[Array]:
        columns = [_real("sample", c) for c in sample(theta_r, u.copy())]
        if len(columns) > 4:
            raise ValueError(f"it returned {len(columns)} arrays, at most theta_i, phi, pdf and weight are needed")
        if any(c.shape[:1] != (len(u),) for c in columns):
            raise ValueError(f"it returned shapes {', '.join(str(c.shape) for c in columns)}")
        return columns

    def one_by_one() -> list[Array]:
        rows = [tuple(sample(theta_r, row)) for row in u.copy()]
        return [_real("sample", c) for c in zip(*rows, strict=True)]

    columns = _first_that_works(f"sample(theta_r, u), for u of shape {u.shape},", together, one_by_one)
    if not 2 <= len(columns) <= 4 or any(c.shape != (len(u),) for c in columns[:3]):
        shapes = ", ".join(str(c.shape) for c in columns)
        raise ValueError(
            f"sample(theta_r, u) must return theta_i, phi and, optionally, pdf and weight: one value per row of u (a weight"
            f" may have channels); got shapes {shapes} for {len(u)} rows"
        )
    if len(columns) == 4 and (columns[3].ndim > 2 or 0 in columns[3].shape):
        raise ValueError(f"sample(theta_r, u) must return weights of shape (n,) or (n, channels), got {columns[3].shape}")
    return columns


def _call(
    name: str, function: Callable[..., Any], theta: Array, theta_r: float, phi: Array, *, channels: bool = False
) -> Array:
    answer = _first_that_works(
        f"{name}(theta_i, theta_r, phi)",
        lambda: _real(name, function(theta.copy(), theta_r, phi.copy())),  # a function may work in place
        lambda: _real(name, [function(float(t), theta_r, float(p)) for t, p in zip(theta, phi, strict=True)]),
    )
    if answer.ndim == 0:  # a constant
        answer = np.full(len(theta), float(answer))
    if channels and answer.shape == theta.shape:
        answer = answer[:, None]
    expected = 2 if channels else 1
    if answer.ndim != expected or answer.shape[0] != len(theta):
        raise ValueError(
            f"{name}(theta_i, theta_r, phi) must return one value per direction; got shape {answer.shape} for {len(theta)}"
        )
    return answer


class _NotRealError(TypeError):
    """An answer that was given, and is not made of real numbers: to ask again would not help."""


def _real(name: str, answer: Any) -> Array:
    try:
        return validate.real(f"what {name} returns", answer).astype(np.float64)
    except TypeError as error:
        raise _NotRealError(str(error)) from None


def _first_that_works(name: str, together: Callable[[], _T], one_by_one: Callable[[], _T]) -> _T:
    """Return the result for whole arrays, or for single numbers; where neither works, raise ValueError about the first."""
    try:
        return together()
    except _NotRealError:
        raise
    except Exception as first:
        try:
            return one_by_one()
        except _NotRealError:
            raise
        except Exception:
            said = " ".join(str(first).split())
            raise ValueError(f"{name} raised {type(first).__name__}: {said[:_SAID]}{'…' * (len(said) > _SAID)}") from first
