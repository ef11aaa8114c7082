"""Strands of a mean fibre, as a strand of any kind meets them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle.scattering.chiang import Chiang
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.through_strands import own_energies, through_tables

Array = NDArray[np.float64]


class MeanStrands(NamedTuple):
    """What the core's MeanStrands views (far_among.h).

    `energy` to `limit` are those of `ThroughTables`, but that energies of R, TT and TRT are out of the
    mean fibre's own: those of the strand that is met multiply them. `tilt` and `variance`, shape (3,): of its M in theta,
    radians.
    """

    energy: Array
    along: Array
    azimuth: Array
    behind: Array
    limit: float
    tilt: Array
    variance: Array


def mean_strands(fibre: Fibre | Chiang) -> MeanStrands:
    """Return the tables of strands of a fibre, one channel an absorption; a few seconds each, once.

    Raises
    ------
    ValueError
        An absorption is 0: light that is never absorbed leaves scattering among strands without a sum.
    """
    if min(fibre.absorption) <= 0:
        raise ValueError(
            f"strands among others need an absorption above 0 in every channel, got {fibre.absorption}: light that is never"
            " absorbed leaves scattering among them without a sum"
        )
    through = through_tables(fibre)
    energy = through.energy.copy()
    energy[:, :, :, 0, :3] -= np.log(own_energies(fibre))
    alpha, beta = fibre.half_angle_lobes if isinstance(fibre, Chiang) else (fibre.alpha, fibre.beta)
    return MeanStrands(energy, *through[1:], 2 * alpha, 4 * beta**2)
