"""`make`: cases with their reference values, each with an error bound."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cuticle._support import validate
from cuticle._support.files import check_file, write_text
from cuticle._support.progress import Progress, expect
from cuticle._support.values import Value
from cuticle.reference import among_strands_in_balls, proven
from cuticle.reference.balls import Ball, flint, told, working_precision
from cuticle.reference.cases import LONGITUDINAL, MODELS, Inputs, draw
from cuticle.reference.formulas import Evaluated
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.values_file import text

MOST_CASES = 1_000_000
PROVEN = "a proven bound of how far the printed number is off"
ESTIMATED = "not proven but estimated, from quadratures of two orders; rounding is bounded"
_SECONDS = {"near": 0.0008, "far": 0.08, "marschner": 0.09, "dual_scattering": 1.5}  # for one case


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
    proof
        What the errors are.
    """

    inputs: Inputs
    seed: int
    values: Sequence[dict[str, tuple[str, str]]]
    proof: str

    def __repr__(self) -> str:
        worst = max(float(e) / max(abs(float(v)), 1e-300) for row in self.values for n, (v, e) in row.items() if n[0] == "f")
        return f"Reference({self.inputs.about}: {len(self.inputs):,} cases; f's largest relative error bound {worst:.1e})"

    def to_csv(self) -> str:
        """Return the file of cases as text."""
        return text(self.inputs, self.seed, self.proof, self.values)

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
        f, its parts by lobe and the density, written with 25 digits.

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
    kind = model if model != "chiang" else field
    flint()
    longitudinal = "gaussian" if model == "dual_scattering" else longitudinal
    inputs = draw(model, cases, seed, near=near, longitudinal=longitudinal)
    expect(progress, cases * _SECONDS[kind])
    approximate = evaluate(formulas_of(inputs), inputs)
    values, told_at = [], time.monotonic()
    with working_precision():
        for i in range(len(inputs)):
            values.append(_texts(values_of(inputs, i, approximate), inputs.channels))
            if progress is not None and time.monotonic() - told_at > 0.1:
                told_at = time.monotonic()
                progress(f"case {i + 1:,} of {len(inputs):,}", (i + 1) / len(inputs))
    return Reference(inputs, seed, values, ESTIMATED if model == "dual_scattering" else PROVEN)


def values_of(inputs: Inputs, i: int, approximate: Evaluated) -> proven.Values:
    """Return the reference values of one case as balls; call it within `working_precision`."""
    row, sizes = inputs.row(i), approximate.around[i].tolist()
    if inputs.model == "chiang":
        return proven.chiang_near(row) if inputs.near else proven.chiang_far(row, sizes)
    if inputs.model == "dual_scattering":
        return among_strands_in_balls.dual_scattering(row, sizes)
    return proven.marschner(row, sizes, inputs.longitudinal == "energy_conserving")


def _texts(values: proven.Values, channels: int) -> dict[str, tuple[str, str]]:
    names = proven.CHANNELS if channels == 3 else ("",)

    def named(start: str, c: int) -> str:
        return f"{start}_{names[c]}" if names[c] else start

    out: dict[str, Ball] = {named("f", c): values.f(c) for c in range(channels)}
    density = values.pdf()
    if density is not None:
        out["pdf"] = density
    lobes = ("R", "TT", "TRT", "rest") if values.lobes is None else values.lobes
    for lobe, parts in zip(lobes, values.parts, strict=False):
        out |= {named(lobe, c): part for c, part in enumerate(parts)}
    return {name: told(ball) for name, ball in out.items()}
