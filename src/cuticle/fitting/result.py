"""What a fit gives back."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from cuticle._support.files import read_text, reading, write_text
from cuticle._support.json_file import parse
from cuticle._support.plain_values import html_table, number
from cuticle._support.values import Value
from cuticle.sampling.sampler import Sampler

FORMAT_VERSION = 1
_MEASURED = ("ess", "ess_channels", "largest_weight", "total_variation")


class Candidate(NamedTuple):
    """One number of lobes that the program weighed: mean ESS, cost in calibration kernels, and their ratio."""

    lobes: int
    ess: float
    cost: float
    efficiency: float


class Worst(NamedTuple):
    """The least ESS that a fit found on and between its table's nodes and rows, and where (radians, strands)."""

    ess: float
    theta_r: float
    strands: float


class FitFile(BaseModel):
    """What a fit's JSON file holds, version 1: the attributes of `Fit`, the sampler as its own file has it."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    format: Literal["cuticle-fit"] = "cuticle-fit"
    version: int = FORMAT_VERSION
    sampler: dict[str, Any]
    theta_r: list[float]
    ess: list[list[float]]
    ess_channels: list[list[list[float]]]
    largest_weight: list[list[float]]
    total_variation: list[list[float]]
    seconds: float
    form: str
    objective: str
    worst: Worst | None = None
    candidates: list[Candidate] = []
    families: dict[str, float] = {}


@dataclass(frozen=True, eq=False)
class Fit(Value):
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
    worst
        The least ESS on and between all nodes and rows, and where it is. None in a fit that an older version saved.
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
    seconds: float = field(compare=False)
    form: str
    objective: str
    worst: Worst | None = None
    candidates: tuple[Candidate, ...] = field(default=())
    families: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("theta_r", *_MEASURED):
            value = np.array(getattr(self, name), np.float64)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        shape = len(self.sampler.strands), len(self.theta_r)
        for name in _MEASURED:
            found = getattr(self, name).shape
            if found[:2] != shape or len(found) != 2 + (name == "ess_channels"):
                raise ValueError(f"{name} must have shape {shape}{' plus channels' * (name == 'ess_channels')}, got {found}")

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the fit to a JSON file, whole or not at all; `load` reads an equal one.

        The file holds the sampler, and with it the record of the scattering function.
        """
        values = {name: getattr(self, name).tolist() for name in ("theta_r", *_MEASURED)}
        file = FitFile(
            sampler=json.loads(self.sampler.to_json()), seconds=self.seconds, form=self.form, objective=self.objective,
            worst=self.worst, candidates=list(self.candidates), families=self.families, **values,
        )  # fmt: skip
        return write_text(path, json.dumps(file.model_dump(), allow_nan=False) + "\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Fit:
        """Read a fit that `save` wrote, or raise ValueError with the reason."""
        source = str(path)
        with reading(source, "fit"):
            file = parse(read_text(path, "fit"), FitFile, what="fit", version=FORMAT_VERSION, source=source)
            values = {name: getattr(file, name) for name in FitFile.model_fields if name not in ("format", "version")}
            values |= {
                "sampler": Sampler.from_json(json.dumps(file.sampler), source=source),
                "candidates": tuple(file.candidates),
            }
            try:
                return cls(**values)
            except ValueError as error:
                raise ValueError(f"{source} is refused: {error}") from None

    @property
    def summary(self) -> list[tuple[float, float, float, float]]:
        """One row a strand count: (strands, mean ESS for |theta_r| ≤ 75°, worst there, worst beyond)."""
        inner = np.abs(self.theta_r) <= np.radians(75.01)
        return [
            (n, float(e[inner].mean()), float(e[inner].min()), float(e[~inner].min(initial=1.0)))
            for n, e in zip(self.sampler.strands, self.ess, strict=True)
        ]

    def plot(self, *, axes: Any = None) -> Any:
        """Draw the ESS over the viewer's inclination, a line a strand count; return the Matplotlib axes.

        `axes` are those to draw on; default: those of a new figure. `fit.sampler.plot` draws the density.
        """
        from cuticle._support.plots import new_axes  # Matplotlib takes a second to import

        axes = new_axes() if axes is None else axes
        for n, ess in zip(self.sampler.strands, self.ess, strict=True):
            axes.plot(np.degrees(self.theta_r), ess, marker="o", label=f"{n:g} strands")
        axes.set(xlabel="θ_r, degrees", ylabel="ESS", ylim=(0, 1.02), title=f"{self.sampler.lobes} lobes")
        axes.legend()
        return axes

    @property
    def worst_text(self) -> str:
        """The worst ESS that was found, in words; empty if it is not known."""
        if self.worst is None:
            return ""
        w = self.worst
        return (
            f"worst ESS between nodes and rows {w.ess:.4f}, at theta_r {np.degrees(w.theta_r):.1f}°, {w.strands:g} strands"
        )

    def _repr_html_(self) -> str:
        title = f"Fit: {self.sampler.lobes} {self.sampler.family} lobes, objective {self.objective}, {self.seconds:.2f} s"
        title += f"; {self.worst_text}" if self.worst else ""
        header = ("strands", "ESS, mean within 75°", "worst", "worst beyond")
        return html_table(title, header, [(f"{n:g}", *(number(x, 4) for x in ess)) for n, *ess in self.summary])

    def __repr__(self) -> str:
        lines = [f"Fit({self.form}, {self.sampler.lobes} lobes, objective {self.objective}, {self.seconds:.2f} s)"]
        lines += [
            f"  strands {n:g}: ESS mean {mean:.4f}, worst {worst:.4f} within 75°, {beyond:.4f} at 85°"
            for n, mean, worst, beyond in self.summary
        ]
        if self.worst:
            lines.append(f"  {self.worst_text}")
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
        "worst": None if result.worst is None else result.worst._asdict(),
        "candidates": [c._asdict() for c in result.candidates],
    }
