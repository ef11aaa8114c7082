"""The formulas of a model, and their values in double precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cuticle.reference.albedo import albedo
from cuticle.reference.among_strands import among_strands, dual_scattering
from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import PANELS, Evaluated, Formulas, arguments, chiang, evaluate_fibre, marschner


def formulas_of(inputs: Inputs) -> Formulas:
    """Return the right formulas for inputs."""
    if inputs.model == "chiang":
        return chiang()
    return dual_scattering() if inputs.model == "dual_scattering" else marschner(inputs.longitudinal == "energy_conserving")


def evaluate(F: Formulas, inputs: Inputs, panels: int = PANELS, *, density: bool = False) -> Evaluated:
    """Return the values of all cases by these formulas.

    Parameters
    ----------
    panels
        Of the quadrature over h, in the far field; fewer than `PANELS` make other quadratures rougher, too.
    density
        Whether the density of the Gaussian forms is wanted: it takes an integral over directions. The others have theirs.
    """
    detail = int(panels >= PANELS)
    found = evaluate_fibre(F, inputs, panels) if F.back is None else among_strands(F, inputs, detail)
    if F.normalised or not density:
        return found
    with np.errstate(all="ignore"):  # a slip may divide by nothing
        light = found.f @ F.pdf_weights(inputs.channels) * np.cos(inputs.columns["theta_i"])
        pdf = F.finish_pdf(arguments(inputs, 1), (light / albedo(F, inputs, detail))[:, None])[:, 0]
    return replace(found, pdf=pdf)
