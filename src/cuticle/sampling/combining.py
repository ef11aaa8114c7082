"""Two samplers as one: the direct and the multiple scattering PDF of the draft, combined."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.interpolation import smooth_spline
from cuticle._support.quadrature import Grid, adapted_edges, grid
from cuticle.sampling.lobe_table import MAX_LOBES, WEIGHT
from cuticle.sampling.quality import Density
from cuticle.sampling.sampler import Sampler, fitted
from cuticle.scattering.bcsdf import Bcsdf, checked_even, evaluate, luminance

_MOST_NODES = 2000
_ORDER = 3
_COARSE, _FINE = (240, 60), (60, 36)


def combine(direct: Sampler, multiple: Sampler, weight: float, *, strands: float | None = None) -> Sampler:
    """Return the mixture weight·p_direct + (1 - weight)·p_multiple as one sampler.

    Use it if the host draws a direction before it knows whether the light there is blocked. The mixture is exact: its
    lobes are those of both samplers.

    Parameters
    ----------
    direct
        A sampler with a row for 0 strands, or with one row, for direct light.
    multiple
        A sampler with rows for n > 0 strands. It may be the same sampler.
    weight
        Share of the direct part, in (0, 1).
    strands
        The number of strands, if it is known. None gives all counts of `multiple` above 0 equal shares.

    Returns
    -------
    Sampler
        A sampler with one row, which serves every number of strands.

    Raises
    ------
    ValueError
        The weight is out of range, a sampler lacks the row, or there are more than 32 lobes in total.

    Examples
    --------
    >>> import cuticle
    >>> fit = cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset("document")), 2, strands=[0, 2])
    >>> both = cuticle.combine(fit.sampler, fit.sampler, 0.5, strands=2)
    >>> both.lobes
    4
    """
    for name, sampler in (("direct", direct), ("multiple", multiple)):
        fitted(name, sampler)
    weight = validate.number("weight", weight, 0, 1, above=True)
    if weight == 1:
        raise ValueError("weight must be in (0, 1), got 1; the direct sampler alone is what you ask for")
    if direct.even != multiple.even:
        raise ValueError("direct and multiple must both be even in phi or neither; fit both to models of one fibre")
    if direct.family != multiple.family:
        raise ValueError(f"direct and multiple must have lobes of one family, got {direct.family} and {multiple.family}")
    first = direct.row(0.0) if 0 in direct.strands or len(direct.strands) > 1 else direct
    if strands is not None:
        strands = validate.number("strands", strands, 0, validate.MAX_STRANDS, above=True)
        others = [multiple.row(strands)]
    else:
        others = [multiple.row(n) for n in multiple.strands if n > 0] or [multiple]
    parts = [(weight, first), *(((1 - weight) / len(others), s) for s in others)]
    lobes = sum(s.lobes for _, s in parts)
    if lobes > MAX_LOBES:
        raise ValueError(
            f"direct and multiple must have at most {MAX_LOBES} lobes together, got {lobes}; fit fewer lobes or counts,"
            " or name one count of strands"
        )
    steps = math.lcm(*(s.nodes.shape[1] - 1 for _, s in parts))
    if steps >= _MOST_NODES:
        raise ValueError(f"the tables' {[s.nodes.shape[1] for _, s in parts]} theta nodes have no common refinement")
    nodes, energy = [], np.zeros((1, steps + 1))
    for share, s in parts:
        own = _refine(s.nodes, steps)
        own[:, :, WEIGHT] *= share
        nodes.append(own)
        energy += share * _refine(s.energy, steps)
    about: dict[str, Any] = {k: v for k, v in direct.about.items() if k not in ("form", "objective", "functions")}
    covers = [0.0, *(sorted({n for n in multiple.strands if n > 0}) if strands is None else [strands])]
    about |= {"form": "combined", "weight": weight, "covers": covers}
    return Sampler(np.concatenate(nodes, axis=3), energy, (0.0,), direct.even, about, direct.family)


def _refine(table: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Return the same piecewise linear table on more nodes: (1, nodes, …) -> (1, steps + 1, …)."""
    lines = smooth_spline(np.linspace(0, steps, table.shape[1]), table, 1, axis=1)
    return lines(np.arange(steps + 1))


def mixed_ess(
    sampler: Density, direct: Bcsdf, multiple: Bcsdf | list[Bcsdf], share: float, theta_r: float
) -> tuple[float, float]:
    """Return a sampler's ESS if each direction is directly lit with probability `share`, and the largest ESS of any pdf.

    Light arrives through no strand with probability v, else through n, which is unknown when the direction is drawn. With
    E = ∫ (v f_0 + (1 - v) f_n) cos, ESS = E²/∫ (v f_0² + (1 - v) f_n²) cos²/p. It is largest for p proportional to the
    root of that mean square.

    Parameters
    ----------
    sampler
        Anything with a `pdf` per steradian.
    direct, multiple
        Scattering functions for no strands and for some. A list holds counts that are equally likely.
    share
        v, 0 to 1.
    theta_r
        Radians.
    """
    (ess,), best = mixed_ess_of([sampler], direct, multiple, share, theta_r)
    return ess, best


def mixed_ess_of(
    samplers: Sequence[Density], direct: Bcsdf, multiple: Bcsdf | list[Bcsdf], share: float, theta_r: float
) -> tuple[list[float], float]:
    """Return the same for several samplers: the functions, most of the work, are evaluated once."""
    share = validate.number("share", share, 0, 1)
    models = multiple if isinstance(multiple, list) else [multiple]
    even = all(checked_even(m) for m in (direct, *models))

    def squares(g: Grid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        first, *others = (luminance(evaluate(m, g.theta, theta_r, g.phi)) for m in (direct, *models))
        mean = share * first + (1 - share) * np.mean(others, axis=0)
        return mean, share * first**2 + (1 - share) * np.mean(np.square(others), axis=0)

    edges = adapted_edges(lambda g: np.sqrt(squares(g)[1]) * np.cos(g.theta)[:, None], even=even, coarse=_COARSE, fine=_FINE)
    g = grid(*edges, _ORDER)
    solid_angle = g.weights * np.cos(g.theta)[:, None] * (2 if even else 1)
    mean, square = squares(g)
    energy = float((solid_angle * mean).sum())
    densities = (s.pdf(g.theta[:, None], theta_r, g.phi[None, :]) for s in samplers)
    ess = [energy**2 / float((solid_angle * square / np.maximum(p, 1e-30)).sum()) for p in densities]
    return ess, energy**2 / float((solid_angle * np.sqrt(square)).sum()) ** 2
