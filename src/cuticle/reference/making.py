"""`make`: cases with their reference values, each with an error bound."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cuticle._support import validate
from cuticle._support.files import check_file, write_text
from cuticle._support.progress import Progress, expect
from cuticle._support.values import Value
from cuticle.reference import albedo_in_balls, among_strands_in_balls, proven
from cuticle.reference.balls import flint, told, working_precision
from cuticle.reference.cases import LONGITUDINAL, MODELS, Inputs, draw
from cuticle.reference.inclinations import gaussian_energies
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.values_file import NO_DENSITY, text

MOST_CASES = 1_000_000
_SECONDS = {"near": 0.0008, "far": 0.08, "conserving": 0.09, "gaussian": 0.6, "dual_scattering": 2.2}  # for one case
_TOGETHER = 64  # cases that are prepared together


@dataclass(frozen=True, eq=False)
class Reference(Value):
    """Cases and their reference values.

    Attributes
    ----------
    inputs
        The cases.
    seed
        Of the draw.
    values
        For each case, by name (f_r, pdf, R_r, TT_g …): the number to 25 digits and a bound of its error, as decimal text.
    """

    inputs: Inputs
    seed: int
    values: Sequence[dict[str, tuple[str, str]]]

    def __repr__(self) -> str:
        f, density = self._largest("f"), self._largest("pdf")
        errors = f"largest relative errors: {f:.1e} of f and {density:.1e} of the density"
        return f"Reference({self.inputs.about}: {len(self.inputs):,} cases; {errors})"

    def _largest(self, start: str) -> float:
        """Return the largest relative error of the values whose names begin so; 0 if there is none."""
        named = [x for row in self.values for name, x in row.items() if name.startswith(start) and x[0]]
        return max((float(e) / max(abs(float(v)), 1e-300) for v, e in named), default=0.0)

    def to_csv(self) -> str:
        """Return the file of cases as text."""
        return text(self.inputs, self.seed, self.values)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the file of cases, whole or not at all."""
        return write_text(check_file(path), self.to_csv())


def make(
    model: str,
    cases: int = 1000,
    *,
    seed: int = 1,
    field: str = "near",
    longitudinal: str = "energy_conserving",
    progress: Progress | None = None,
) -> Reference:
    """Return cases over the whole box of inputs, with the values that a right implementation has.

    Parameters
    ----------
    model
        "chiang" (Chiang et al. 2016), "marschner" (Marschner 2003 with azimuthal roughness), or "dual_scattering" (Zinke et
        al. 2008 as printed).
    cases
        How many, 8 to 1,000,000.
    seed
        Of the draw: the same seed gives the same file.
    field
        Of Chiang's: "near", at a known offset h, or "far", the mean over h.
    longitudinal
        Of Marschner's: "energy_conserving" (d'Eon 2011) or "gaussian".
    progress
        Called with a phase and a fraction from 0 to 1.

    Returns
    -------
    Reference
        f, its parts by lobe and the density, written with 25 digits. Errors are proven bounds.

    Raises
    ------
    ValueError
        An argument is out of range.
    ImportError
        python-flint is not installed.
    """
    validate.choice("model", model, MODELS)
    validate.integer("cases", cases, 8, MOST_CASES)
    validate.choice("field", field, ("near", "far"))
    validate.choice("longitudinal", longitudinal, LONGITUDINAL)
    near = model == "chiang" and field == "near"
    kind = field if model == "chiang" else model if model == "dual_scattering" else longitudinal.split("_")[-1]
    flint()
    longitudinal = "gaussian" if model == "dual_scattering" else longitudinal
    inputs = draw(model, cases, seed, near=near, longitudinal=longitudinal)
    expect(progress, cases * _SECONDS[kind])
    F, values, told_at = formulas_of(inputs), [], time.monotonic()
    with working_precision():
        for start in range(0, len(inputs), _TOGETHER):
            some = inputs.take(slice(start, start + _TOGETHER))
            sizes = evaluate(F, some).around.tolist()
            for i in range(len(some)):
                values.append(_texts(values_of(some, i, sizes[i], density=True), inputs.channels))
                if progress is not None and time.monotonic() - told_at > 0.1:
                    told_at = time.monotonic()
                    progress(f"case {len(values):,} of {len(inputs):,}", len(values) / len(inputs))
    return Reference(inputs, seed, values)


def values_of(inputs: Inputs, i: int, sizes: Sequence[Sequence[float]], *, density: bool) -> proven.Values:
    """Return the reference values of one case as balls, or all but the density; call it within `working_precision`.

    `sizes` are about the lobes' azimuthal parts, [lobe][channel]. The density of Gaussian lobes takes half a second, that of
    dual scattering many for a fibre; it is left out nearer to a pole than cases are drawn.
    """
    row = inputs.row(i)
    if inputs.model == "chiang":
        return proven.chiang_near(row) if inputs.near else proven.chiang_far(row, sizes)
    if inputs.model == "dual_scattering":
        values = among_strands_in_balls.dual_scattering(row, sizes)
        near_pole = abs(row["theta_r"]) > albedo_in_balls.FURTHEST
        return replace(values, albedo=albedo_in_balls.albedo(row)) if density and not near_pole else values
    conserving = inputs.longitudinal == "energy_conserving"
    values = proven.marschner(row, sizes, conserving)
    return replace(values, energies=gaussian_energies(row)) if density and not conserving else values


def _texts(values: proven.Values, channels: int) -> dict[str, tuple[str, str]]:
    names = proven.CHANNELS if channels == 3 else ("",)

    def named(start: str, c: int) -> str:
        return f"{start}_{names[c]}" if names[c] else start

    out: dict[str, tuple[str, str]] = {named("f", c): told(values.f(c)) for c in range(channels)}
    density = values.pdf()
    out["pdf"] = ("", NO_DENSITY) if density is None else told(density)
    for lobe, parts in zip(values.lobes, values.parts, strict=True):
        out |= {named(lobe, c): told(part) for c, part in enumerate(parts)}
    return out
