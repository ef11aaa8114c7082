"""What a check and an audit measure: at one viewer, over pairs of directions, in a file of samples."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle.checking.regions import Region, RepeatedAngle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drawn:
    """The samples of one viewer that are directions with a density, and how many of those `asked` for are not."""

    asked: int
    theta: NDArray  # radians
    phi: NDArray
    pdf: NDArray | None  # 1/sr, as `sample` returned it; None where it returned none
    weight: NDArray | None  # as `sample` returned it, (n, channels); then f·cos/pdf (luminance) of the first 100,000
    dropped: int = 0  # no direction, and said so: pdf 0, or weight 0 where f is above 0 or the pdf evaluated there is 0
    invalid: int = 0  # angles, pdf or weight NaN or infinite, or pdf negative
    outside: int = 0  # theta beyond a pole, or phi beyond two turns
    biased: int = 0  # no direction, yet a weight


@dataclass(frozen=True)
class Measurement:
    """What a check and an audit both measure at one viewer."""

    theta_r: float  # the viewer, radians
    integral: float  # ∫ pdf over the sphere
    chi2: float  # of the samples' counts in a grid of cells
    dof: int
    p_value: float  # of all tests of the counts together: the smallest p-value times the number of tests
    total_variation: float  # check: ½ ∫ |f cos/∫ f cos - pdf|; audit: ½ Σ |drawn - expected| over 12 x 8 cells
    pdf_mismatch: float  # sample's pdf against the pdf there; check: largest relative error; audit: share off by 2 %
    ess: float  # this and the next two as in `cuticle.Quality`; NaN and () without f
    ess_channels: tuple[float, ...]
    largest_weight: float
    drawn: Drawn | None = field(default=None, repr=False, compare=False, kw_only=True)  # the samples, while tests run

    @property
    def place(self) -> str:
        """The viewer in words."""
        return f"at theta_r {np.degrees(self.theta_r):.3g}°"


@dataclass(frozen=True)
class CheckMeasurement(Measurement):
    """What a check measures at one viewer and strand count."""

    strands: float
    integral_single: float  # ∫ pdf in single precision
    estimate: float  # mean of f cos/pdf over the samples (luminance)
    expected: float  # ∫ f cos by quadrature
    z: float  # their difference in standard errors; NaN where one sample dominates the mean

    @property
    def place(self) -> str:
        """The viewer and the strand count in words."""
        return f"{super().place}, {self.strands:g} strands"


class Maps(NamedTuple):
    """Edges of the fine cells, and the probabilities drawn and claimed in each, for a picture."""

    theta: Array
    phi: Array
    drawn: Array
    claimed: Array

    def spread(self, probabilities: Array, theta: Array, phi: Array) -> Array:
        """Return the probabilities in cells of other edges, if each is spread evenly over its own cell."""

        def share(edges: Array, to: Array) -> Array:
            low, high = np.maximum(edges[None, :-1], to[:-1, None]), np.minimum(edges[None, 1:], to[1:, None])
            return np.maximum(high - low, 0) / np.diff(edges)

        return share(self.theta, theta) @ probabilities @ share(self.phi, phi).T


@dataclass(frozen=True)
class AuditMeasurement(Measurement):
    """What an audit measures at one viewer."""

    integral_error: float  # bound on the quadrature's error in ∫ pdf
    dropped: float  # share of samples that gave no direction
    noise_floor: float  # expected total variation of a correct sampler at this sample size
    mean_z: float  # largest deviation of the mean weight from ∫ f cos in a cell, standard errors; NaN: no cell is testable
    mean_where: str  # that cell
    means_left_out: int  # cells that cannot be tested
    weight_mismatch: float  # share of samples whose weight is off f·cos/pdf by over 2 % in a channel
    estimate_mismatch: (
        float  # of the estimate by what sample returns against that by pdf and eval there: the worst channel's
    )
    energy: tuple[float, ...]  # ∫ f cos, one value a channel
    lost: float  # share of ∫ f cos where the pdf is 0
    wasted: float  # share of the pdf where f is 0
    invalid: float  # share of samples with NaN or infinite values, or a negative pdf
    outside: float  # share of samples off the sphere
    biased: float  # share of samples that have a weight but no direction
    bad_density: int  # values of the pdf that were NaN, infinite or negative
    bad_values: int  # the same of f
    region: Region | None  # where drawn and expected counts differ most clearly, if they do
    lobe: str  # what is known of the lobes there
    repeated: tuple[RepeatedAngle, ...]  # angles that many samples share exactly
    maps: Maps | None = field(repr=False, default=None)

    @property
    def excess_variation(self) -> float:
        """Total variation above that of a correct sampler."""
        return self.total_variation - self.noise_floor


class Reciprocity(NamedTuple):
    """Mean difference between f(i, r) and f(r, i) over random pairs of directions, over the mean of f."""

    error: float
    place: str = "random pairs"


@dataclass(frozen=True)
class Control:
    """A sampler broken on purpose, and whether the check caught it at the sample size it uses.

    `applies` is false where the broken density is within 1 % in total variation of the right one: turning phi where the
    density hardly depends on it, widening a lobe that is flat already.
    """

    name: str
    strands: float
    caught: bool
    applies: bool
    evidence: str


class Controls(NamedTuple):
    """All negative controls of a check."""

    controls: tuple[Control, ...]

    @property
    def missed(self) -> list[Control]:
        """Those that should have been caught."""
        return [c for c in self.controls if c.applies and not c.caught]

    @property
    def place(self) -> str:
        """How many were caught, and the first that was missed."""
        text = f"{sum(c.caught for c in self.controls)} of {len(self.controls)} caught"
        if self.missed:
            text += f"; missed: {self.missed[0].name}, {self.missed[0].strands:g} strands"
        idle = sum(not c.applies and not c.caught for c in self.controls)
        return f"{text}; {idle} hardly change the density" if idle else text


class ViewerOfFile(NamedTuple):
    """Samples of one viewer in a file."""

    name: str  # "" where there is one viewer only
    p_value: float
    difference: str  # the patch that is least likely, in words
    patches: int
    left_out: int
    tested: float  # share of the samples that lie in the patches tested
    repeated: tuple[RepeatedAngle, ...]  # angles that too many samples share, the most frequent first

    @property
    def place(self) -> str:
        """The viewer and the patch that is least likely."""
        return self.name + self.difference


class RowsOfFile(NamedTuple):
    """Which rows of a file are no samples at all, have a bad weight, or have a weight without a direction."""

    bad: NDArray[np.bool_]
    bad_weight: NDArray[np.bool_]
    biased: NDArray[np.bool_]
