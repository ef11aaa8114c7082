"""Published fibres: their parameters, and where the numbers come from. `Fibre.preset(name)` makes one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Preset(NamedTuple):
    """A published fibre."""

    about: str  # in one line, what it is
    source: str  # where its numbers come from
    parameters: Mapping[str, Any]  # of `Fibre`


# pbrt's hair scenes have beta_m = beta_n = 0.3 and alpha 2°. As standard deviations these are sqrt(v)/2 = 8.3° in theta_h
# and s pi/sqrt(3) = 12.2°; tilts of 2 alpha, -alpha, -4 alpha in theta are alpha, -alpha/2, -2 alpha in theta_h.
_PBRT = {"alpha_R": -2.0, "alpha_TRT": 4.0, "beta_R": 8.3, "beta_N": 12.2}
_PBRT_SOURCE = "Eumelanin, roughness 0.3 and tilt 2 degrees of pbrt's hair scenes, converted to widths."

PRESETS: dict[str, Preset] = {
    "document": Preset(
        "The draft description's fibre, found by fitting its table 2.",
        "The draft does not state its fibre. With the Gaussian model and the backscatter as printed (zinke2008, d_b 0.7)"
        " these values reproduce the 45 numbers of its table 2 with rms errors of 0.13 rad in sigma_V, 0.02 rad in sigma_H"
        " and 1.0° in the shift; benchmarks/document_fibre.py prints every residual. An unconstrained least-squares fit"
        " improves sigma_V, worsens sigma_H and leaves the published range of alpha_R and beta_R.",
        {
            "alpha_R": 3.2, "alpha_TT": -1.24, "beta_R": 15.6, "beta_TT": 7.7, "beta_N": 2.0, "sigma_a": 0.40,
            "formulation": "zinke2008",
        },
    ),
    "marschner": Preset(
        "Middle of Marschner et al. 2003, table 1.",
        "alpha_R -10 to -5, beta_R 5 to 10, caustic width (our beta_N) 10 to 25 degrees, eta 1.55. sigma_a runs from 0.2 to"
        " infinity; 0.55 per radius has the middle of the transmittance exp(-2 sigma_a).",
        {"alpha_R": -7.5, "beta_R": 7.5, "beta_N": 17.5, "sigma_a": 0.55},
    ),
    "blond": Preset("Blond hair: eumelanin 0.3.", _PBRT_SOURCE, {**_PBRT, "eumelanin": 0.3}),
    "brown": Preset("Brown hair: eumelanin 1.3.", _PBRT_SOURCE, {**_PBRT, "eumelanin": 1.3}),
    "black": Preset("Black hair: eumelanin 8.", _PBRT_SOURCE, {**_PBRT, "eumelanin": 8.0}),
}  # fmt: skip
