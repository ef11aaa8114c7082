"""What tests of Mitsuba's BSDFs share: directions, and what a BSDF says to them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import cuticle
from cuticle.scattering.marschner import LONGITUDINAL_OF

UseVariant = Callable[[str], Any]
# One with each formulation; the others say the same of other numbers.
FIBRES = ("blond", "document", *(pytest.param(name, marks=pytest.mark.slow) for name in ("brown", "black", "marschner")))
VARIANTS = {
    "scalar_rgb": 500,
    "llvm_ad_rgb": 100_000,
    "cuda_ad_rgb": 100_000,
}  # and how many inputs: scalar ones go one by one
AMONG_STRANDS, EXPECTED = 1 << 31, 1 << 29  # plugins/mitsuba/strands.h
HALF_SPACE = float(np.finfo(np.float32).max)
NEAR = {"near": True, "beta_m": 0.3, "beta_n": 0.25, "alpha": -2.0, "eumelanin": 1.3}


def alone(fibre: cuticle.Fibre) -> cuticle.Marschner:
    return cuticle.Marschner(fibre, LONGITUDINAL_OF[fibre.formulation])


class Directions(NamedTuple):
    theta: np.ndarray
    phi: np.ndarray
    vector: np.ndarray  # in a curve's shading frame, single precision


def directions(vector: np.ndarray) -> Directions:
    w = vector.astype(np.float32)
    x, y, z = w.astype(float).T
    return Directions(np.arctan2(y, np.hypot(x, z)), np.arctan2(z, x), w)


def random_directions(rng: np.random.Generator, n: int) -> Directions:
    theta, phi = rng.uniform(-1.55, 1.55, n), rng.uniform(-np.pi, np.pi, n)
    return directions(np.stack([np.cos(theta) * np.cos(phi), np.sin(theta), np.cos(theta) * np.sin(phi)], axis=-1))


def random_questions(seed: int, n: int) -> tuple[Directions, Directions, np.ndarray]:
    """Viewers, lights, and random numbers (n, 3) in single precision, as `ask` takes them."""
    rng = np.random.default_rng(seed)
    return random_directions(rng, n), random_directions(rng, n), rng.random((n, 3), np.float32)


class Answers(NamedTuple):
    f: np.ndarray  # f cos theta_i
    pdf: np.ndarray
    wo: Directions
    sample_pdf: np.ndarray
    weight: np.ndarray


def ask(
    mi: Any,
    bsdf: Any,
    r: Directions,
    i: Directions,
    u: np.ndarray,
    strands: np.ndarray | None = None,
    behind: float | None = None,
) -> Answers:
    """What a BSDF says to viewers r, lights i and random numbers u.

    Among strands where their number is given: counted or, with so many `behind`, expected.
    """
    context = mi.BSDFContext()
    if strands is not None:
        bsdf.parameters_changed(["strand_tables"])
        context.type_mask |= AMONG_STRANDS | (0 if behind is None else EXPECTED)

    def once(r_: np.ndarray, i_: np.ndarray, u_: np.ndarray, n_: Any) -> tuple[Any, ...]:
        import drjit as dr

        si = dr.zeros(mi.SurfaceInteraction3f, u_.shape[1] if u_.ndim > 1 else 1)
        si.wi = mi.Vector3f(*r_)
        if mi.is_spectral:
            si.wavelengths = type(si.wavelengths)(440, 550, 570, 620)
        if strands is not None:
            # Counted (or drawn), expected, and behind.
            si.duv_dx = mi.Vector2f(n_, 0) if behind is None else mi.Vector2f(-1, n_)
            si.duv_dy = mi.Vector2f(HALF_SPACE if behind is None else behind, 0)
        wo = mi.Vector3f(*i_)
        f, pdf = bsdf.eval_pdf(context, si, wo)
        sample, weight = bsdf.sample(context, si, mi.Float(u_[0]), mi.Point2f(u_[1], u_[2]))
        alone, own = bsdf.eval(context, si, wo), bsdf.pdf(context, si, wo)
        dr.eval(f, pdf, sample, weight, alone, own)  # one kernel: compiling is most of the time
        assert np.allclose(np.array(alone), np.array(f), rtol=1e-6, atol=0)
        assert np.allclose(np.array(own), np.array(pdf), rtol=1e-6, atol=0)
        return tuple(np.array(x) for x in (f, pdf, sample.wo, sample.pdf, weight))

    n = np.zeros(len(u), np.float32) if strands is None else strands.astype(np.float32)
    if "scalar" in mi.variant():
        rows = [
            once(*(list(map(float, v)) for v in (a, b)), np.array([float(x) for x in c]), float(k))
            for a, b, c, k in zip(r.vector, i.vector, u, n, strict=True)
        ]
        f, pdf, wo, sample_pdf, weight = (np.array(x) for x in zip(*rows, strict=True))
    else:
        f, pdf, wo, sample_pdf, weight = once(r.vector.T, i.vector.T, u.T, n)
        f, wo, weight = f.T, wo.T, weight.T
    return Answers(f, np.ravel(pdf), directions(wo), np.ravel(sample_pdf), weight)


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float((np.abs(a - b) / np.maximum(np.abs(b), 1e-10)).max())
