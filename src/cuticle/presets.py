"""Published fibres. Each function's docstring tells where its numbers come from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cuticle.fibre import Fibre


def document() -> Fibre:
    """The draft description's fibre, found by fitting its table 2.

    The draft does not state its fibre. These values meet the 45 numbers of its table 2, with the Gaussian model and
    the backscatter as printed (zinke2008, d_b 0.7), to 0.13 rad in sigma_V, 0.02 rad in sigma_H and 1.0° in the
    shift (rms; benchmarks/document_fibre.py prints every residual). A free least squares gains in sigma_V and loses in
    sigma_H while alpha_R and beta_R run out of the published range, so it is not taken.
    """
    return Fibre(alpha_R=3.2, alpha_TT=-1.24, beta_R=15.6, beta_TT=7.7, beta_N=2.0, sigma_a=0.40, formulation="zinke2008")


def marschner() -> Fibre:
    """Middle of Marschner et al. 2003, table 1.

    alpha_R -10 to -5, beta_R 5 to 10, caustic width (our beta_N) 10 to 25 degrees, eta 1.55; sigma_a runs from 0.2 to
    infinity, of which 0.55 per radius is the middle of the transmittance exp(-2 sigma_a).
    """
    return Fibre(alpha_R=-7.5, beta_R=7.5, beta_N=17.5, sigma_a=0.55)


def _pigmented(eumelanin: float) -> Fibre:
    # pbrt's beta_m = beta_n = 0.3 and alpha 2° (its hair scenes), as standard deviations: sqrt(v)/2 = 8.3° in theta_h,
    # s pi/sqrt(3) = 12.2°; tilts 2 alpha, -alpha, -4 alpha in theta are alpha, -alpha/2, -2 alpha in theta_h.
    return Fibre(alpha_R=-2.0, alpha_TRT=4.0, beta_R=8.3, beta_N=12.2, eumelanin=eumelanin)


def blond() -> Fibre:
    """Blond hair: eumelanin 0.3 (pbrt's scenes), its usual roughness 0.3 and tilt 2 degrees converted to widths."""
    return _pigmented(0.3)


def brown() -> Fibre:
    """Brown hair: eumelanin 1.3 (pbrt's scenes), its usual roughness 0.3 and tilt 2 degrees converted to widths."""
    return _pigmented(1.3)


def black() -> Fibre:
    """Black hair: eumelanin 8 (pbrt's scenes), its usual roughness 0.3 and tilt 2 degrees converted to widths."""
    return _pigmented(8.0)


PRESETS: dict[str, Callable[[], Fibre]] = {f.__name__: f for f in (document, marschner, blond, brown, black)}


def read_fibre(name: str) -> Fibre:
    """Return a preset by name or a fibre from a TOML file."""
    if name in PRESETS:
        return Fibre.preset(name)
    if not name.endswith(".toml") and not Path(name).exists():
        raise ValueError(f"fibre must be a preset ({', '.join(PRESETS)}) or a TOML file, got {name!r}")
    return Fibre.load(name)
