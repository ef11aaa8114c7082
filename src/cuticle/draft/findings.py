"""The results of recomputing the draft description, before they are drawn or written."""

from __future__ import annotations

from dataclasses import dataclass, field

from cuticle._support.values import Value
from cuticle.draft.claims import Claim
from cuticle.draft.functions import Choice, Found
from cuticle.draft.printed import Printed
from cuticle.draft.tables import PeakRow, SliceRow, StrandRow
from cuticle.fitting.result import Fit
from cuticle.scattering.among_strands import Strands
from cuticle.scattering.dual_scattering import DualScattering


@dataclass(frozen=True)
class Mixing:
    """ESS of the combined PDF by its weight, if a share v of directions is directly lit.

    `ess[i][j]` is the mean ESS over viewers at -60°, 0°, 60° for `shares[i]` and `weights[j]`. `best[i]` is the bound for
    every density, because the light behind a direction is unknown when the direction is drawn.
    """

    strands: float | None
    shares: tuple[float, ...]
    weights: tuple[float, ...]
    ess: tuple[tuple[float, ...], ...]
    best: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Findings(Value):
    """The draft description, recomputed and completed for one fibre.

    Attributes
    ----------
    name
        Name of the fibre.
    model
        The scattering function.
    axis
        Azimuth of its highlight, pi or 0.
    table_1, table_2, table_3
        As in the draft.
    found
        The general functions, or None if the draft's form does not suit the fibre; `reason` then says why.
    claims
        The draft's sentences, judged.
    quality
        [sampler][strands] -> mean "ess" and "total_variation" over viewers at 0°, ±30°, ±60°; samplers are "uniform",
        "draft" (printed functions), "found" (those found here), "lobes".
    fits
        The fitted samplers by the same names.
    mixing
        The combined PDFs for two strands, and for an unknown number.
    printed
        The draft's printed tables, or None.
    """

    name: str
    model: DualScattering | Strands
    axis: float
    table_1: tuple[PeakRow, ...]
    table_2: tuple[SliceRow, ...]
    table_3: tuple[StrandRow, ...]
    found: Found | None
    reason: str
    claims: tuple[Claim, ...]
    quality: dict[str, dict[str, dict[str, float]]]
    fits: dict[str, Fit]
    mixing: tuple[Mixing, ...]
    printed: Printed | None
    printed_choices: dict[str, Choice] = field(default_factory=dict)
