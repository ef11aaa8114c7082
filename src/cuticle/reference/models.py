"""The formulas of a model, and their values in double precision."""

from __future__ import annotations

from cuticle.reference.among_strands import among_strands, dual_scattering
from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import PANELS, Evaluated, Formulas, chiang, evaluate_fibre, marschner


def formulas_of(inputs: Inputs) -> Formulas:
    """Return the right formulas for inputs."""
    if inputs.model == "chiang":
        return chiang()
    return dual_scattering() if inputs.model == "dual_scattering" else marschner(inputs.longitudinal == "energy_conserving")


def evaluate(F: Formulas, inputs: Inputs, panels: int = PANELS) -> Evaluated:
    """Return the values of all cases by these formulas; `panels` of the quadrature over h, in the far field."""
    return evaluate_fibre(F, inputs, panels) if F.back is None else among_strands(F, inputs)
