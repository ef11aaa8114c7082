"""What a fit gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle.sampling.sampler import Sampler


class Candidate(NamedTuple):
    """One number of lobes that the program weighed: mean ESS, cost in calibration kernels, and their ratio."""

    lobes: int
    ess: float
    cost: float
    efficiency: float


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted sampler and how good it is.

    Attributes
    ----------
    sampler
        The sampler.
    theta_r
        Viewer inclinations at which the quality was measured, radians, shape (T,).
    ess
        Effective sample size of the luminance, 0 to 1, shape (strand counts, T).
    ess_channels
        The same for each channel, shape (strand counts, T, channels).
    largest_weight, total_variation
        Shape (strand counts, T).
    seconds
        Time of the fit, without the measurement.
    form, objective
        The arguments of `fit`.
    candidates
        The numbers of lobes that were compared, if `fit` chose.
    families
        Mean ESS of each family of lobes, if `fit` chose.
    """

    sampler: Sampler
    theta_r: NDArray[np.float64]
    ess: NDArray[np.float64]
    ess_channels: NDArray[np.float64]
    largest_weight: NDArray[np.float64]
    total_variation: NDArray[np.float64]
    seconds: float
    form: str
    objective: str
    candidates: tuple[Candidate, ...] = field(default=())
    families: dict[str, float] = field(default_factory=dict)

    @property
    def summary(self) -> list[tuple[float, float, float, float]]:
        """One row a strand count: (strands, mean ESS for |theta_r| ≤ 75°, worst there, worst beyond)."""
        inner = np.abs(self.theta_r) <= np.radians(75.01)
        return [
            (n, float(e[inner].mean()), float(e[inner].min()), float(e[~inner].min(initial=1.0)))
            for n, e in zip(self.sampler.strands, self.ess, strict=True)
        ]

    def __repr__(self) -> str:
        lines = [f"Fit({self.form}, {self.sampler.lobes} lobes, objective {self.objective}, {self.seconds:.2f} s)"]
        lines += [
            f"  strands {n:g}: ESS mean {mean:.4f}, worst {worst:.4f} within 75°, {beyond:.4f} at 85°"
            for n, mean, worst, beyond in self.summary
        ]
        if self.families:
            tried = ", ".join(f"{name} {ess:.4f}" for name, ess in self.families.items())
            lines.append(f"  {self.sampler.family} lobes chosen by mean ESS: {tried}")
        if self.candidates:
            tried = ", ".join(f"{c.lobes}: {c.efficiency:.5f}" for c in self.candidates)
            lines.append(f"  lobes chosen by ESS per cost of a traced sample: {tried}")
        return "\n".join(lines)


def fit_summary(result: Fit) -> dict[str, Any]:
    """Return a fit's quality as plain values."""
    return {
        "form": result.form,
        "objective": result.objective,
        "lobes": result.sampler.lobes,
        "family": result.sampler.family,
        "seconds": round(result.seconds, 3),
        "theta_r_degrees": np.degrees(result.theta_r).round(6).tolist(),
        "strands": list(result.sampler.strands),
        "ess": result.ess.round(6).tolist(),
        "ess_channels": result.ess_channels.round(6).tolist(),
        "largest_weight": result.largest_weight.round(6).tolist(),
        "candidates": [c._asdict() for c in result.candidates],
    }
