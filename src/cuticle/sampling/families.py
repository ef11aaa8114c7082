"""Families of lobes: the density that each coordinate of a lobe has, by the name that the core knows it by.

A family is a struct in include/cuticle/sampler and a line of families.h there; docs/extending/lobe_family.md adds one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle.sampling.lobe_table import PARAMETERS, WEIGHT

FAMILIES: tuple[str, ...] = _core.lobe_families  # the first is meant where none is named
NORMAL = FAMILIES[0]
_COMPILED = (4, 8, 16, 32)  # numbers of lobes that the core and the Mitsuba plugin are compiled for
PACKED = (1, 2, *_COMPILED)  # those that fill vectors


def padded(nodes: NDArray[np.float64], sizes: tuple[int, ...] = _COMPILED) -> NDArray[np.float64]:
    """Return nodes (..., 5, K) with lobes of weight 0 added up to one of `sizes`."""
    size = next(k for k in sizes if k >= nodes.shape[-1])
    out = np.ones((*nodes.shape[:-1], size))
    out[..., WEIGHT, :] = 0
    out[..., : nodes.shape[-1]] = nodes
    return out


def core_table(
    nodes: NDArray[np.float64],
    energy: NDArray[np.float64],
    strands: tuple[float, ...],
    even: bool,
    family: str,
    dtype: Any = np.float64,
) -> Any:
    """Return the core's sampler of a table of lobes, shape (strand counts, theta nodes, 5, K), in `dtype`."""
    whole = padded(nodes)
    precision = "f" if dtype is np.float32 else "d"
    ending = "" if family == NORMAL else f"_{family}"
    return getattr(_core, f"Table{whole.shape[-1]}{precision}{ending}")(whole, energy, np.array(strands), even)


def mixture_density(
    lobes: NDArray[np.float64], theta_i: NDArray[np.float64], phi: NDArray[np.float64], even: bool, family: str
) -> NDArray[np.float64]:
    """Return the density of one mixture, lobes (5, K), on the product of two axes, in d theta_i d phi: shape (A, B)."""
    assert lobes.shape[0] == len(PARAMETERS)
    table = core_table(np.stack([lobes, lobes])[None], np.ones((1, 2)), (0.0,), even, family)
    ti, ph = (np.ascontiguousarray(x).ravel() for x in np.broadcast_arrays(theta_i[:, None], phi))
    out = np.empty(len(ti))
    table.pdf(ti, np.zeros(1), ph, np.zeros(1), out)
    return out.reshape(len(theta_i), len(phi)) * np.cos(theta_i)[:, None]
