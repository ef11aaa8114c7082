"""What a fit gives back."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support.extras import needed
from cuticle._support.files import read_text, reading, write_text
from cuticle._support.json_file import NUMBER, array, file_schema, parse
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


_ROWS = array(NUMBER, 2)
FILE = file_schema(  # the attributes of `Fit`; the sampler as its own file has it
    "fit",
    {
        "sampler": {"type": "object"},
        "theta_r": array(NUMBER),
        "ess": _ROWS,
        "ess_channels": array(NUMBER, 3),
        "largest_weight": _ROWS,
        "total_variation": _ROWS,
        "seconds": NUMBER,
        "form": {"type": "string"},
        "objective": {"type": "string"},
    },
    {
        "worst": {"type": ["array", "null"], "items": NUMBER},
        "candidates": _ROWS,
        "families": {"type": "object"},
    },
)


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
        file = {
            "format": "cuticle-fit", "version": FORMAT_VERSION, "sampler": json.loads(self.sampler.to_json()), **values,
            "seconds": self.seconds, "form": self.form, "objective": self.objective, "worst": self.worst,
            "candidates": self.candidates, "families": self.families,
        }  # fmt: skip
        return write_text(path, json.dumps(file, allow_nan=False) + "\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Fit:
        """Read a fit that `save` wrote, or raise ValueError with the reason."""
        source = str(path)
        with reading(source, "fit"):
            file = parse(read_text(path, "fit"), FILE, what="fit", version=FORMAT_VERSION, source=source)
            values = {name: file[name] for name in FILE["properties"] if name in file and name not in ("format", "version")}
            try:
                values["worst"] = Worst(*file["worst"]) if file.get("worst") is not None else None
                values["candidates"] = tuple(Candidate(*row) for row in file.get("candidates", []))
                values["sampler"] = Sampler.from_json(json.dumps(file["sampler"]), source=source)
                return cls(**values)
            except TypeError:
                raise ValueError(f"{source} is refused: a row of worst or candidates has not its length") from None
            except ValueError as error:
                if str(error).startswith(source):  # the sampler's own
                    raise
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
        with needed("a plot"):  # Matplotlib takes a second to import
            from cuticle._support.plots import new_axes

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
