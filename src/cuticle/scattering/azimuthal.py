"""Tables of the azimuthal functions N_p, and evaluation of a model in the core."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle.scattering.fibre import LOBES

ROWS = 181  # azimuthal tables: theta_d in steps of half a degree
OFFSETS = 1024  # cells of the quadrature over h >= 0


class AzimuthalTables(NamedTuple):
    """N_p and its half-turn average on a grid, and the energies that go on and back."""

    direct: NDArray[np.float64]
    spread: NDArray[np.float64]
    halves: NDArray[np.float64]


@lru_cache(maxsize=16)
def azimuthal_tables(
    eta: float, sigma_a: tuple[float, ...], beta_n: float, closed: bool, logistic: bool = False
) -> AzimuthalTables:
    """Tabulate N_p of a fibre; `beta_n` is the deviation of a wrapped normal or a trimmed logistic distribution, radians."""
    # Eight columns a standard deviation over the half circle, twice as many for a logistic's sharper top; a multiple of 32,
    # so that exports can leave every second one out, five times.
    columns = int(np.ceil(np.clip((16 if logistic else 8) * np.pi / beta_n, 256, 16384) / 32)) * 32 + 1
    direct = np.empty((ROWS, columns, len(LOBES), len(sigma_a)))
    spread = np.empty_like(direct)
    halves = np.empty((ROWS, len(LOBES), len(sigma_a), 2))
    _core.azimuthal_tables(eta, np.array(sigma_a), logistic, beta_n, closed, OFFSETS, direct, spread, halves)
    for table in (direct, spread, halves):
        table.setflags(write=False)
    return AzimuthalTables(direct, spread, halves)


def lobe_mask(lobes: str | Iterable[str] | None, known: tuple[str, ...]) -> int:
    """Return the bits of the lobes asked for, out of those that a model knows; all for None."""
    if lobes is None:
        return (1 << len(known)) - 1
    names = [lobes] if isinstance(lobes, str) else list(lobes)
    return sum({1 << known.index(validate.choice("lobes", name, known)) for name in names})


def evaluate_core(
    core: _core.Model,
    channels: int,
    mask: int,
    theta_i: ArrayLike,
    theta_r: ArrayLike,
    phi: ArrayLike,
    strands: ArrayLike = 0.0,
    behind: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return f of the core's model over what broadcasts, last axis = channels, or raise ValueError.

    With `behind`, both numbers of strands are expectations.
    """
    arrays = dict(zip(("theta_i", "theta_r", "phi"), validate.directions(theta_i, theta_r, phi), strict=True))
    arrays["strands"] = np.asarray(strands, np.float64)
    if behind is not None:
        arrays["behind"] = behind
    shape = validate.broadcast(**arrays)
    out = np.empty((int(np.prod(shape)), channels))
    if out.size:
        ti, tr, ph, n, *b = (validate.flat(x, shape) for x in arrays.values())
        if b:
            core.expected(ti, tr, ph, n, b[0], mask, out)
        else:
            core.eval(ti, tr, ph, n, mask, out)
    return out.reshape(*shape, channels)
