"""`cuticle fibres`: the published fibres."""

from __future__ import annotations

import json
from typing import Annotated

import numpy as np
import typer
from rich.text import Text

from cuticle.cli.tables import table
from cuticle.cli.terminal import JsonOption, out, refuse_idle
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.presets import PRESETS


def command(
    ctx: typer.Context,
    json_output: JsonOption = False,
    toml: Annotated[
        str | None, typer.Option(metavar="PRESET", help="Print this preset as TOML, to start a file from.")
    ] = None,
) -> None:
    """List the published fibres and where their numbers come from."""
    if toml is not None:
        refuse_idle(ctx, "with --toml", "json_output")
        print(Fibre.preset(toml).to_toml(), end="")
        return
    if json_output:
        print(json.dumps({name: Fibre.preset(name).to_dict() for name in PRESETS}, indent=2))
        return
    listing = table("Fibres: angles in degrees of theta_h, sigma_a per radius")
    for column in ("name", "alpha R, TT, TRT", "beta R, TT, TRT", "beta_N", "eta", "sigma_a"):
        listing.add_column(column, no_wrap=True)
    for name in PRESETS:
        f = Fibre.preset(name)
        angles = [", ".join(f"{x:.3g}" for x in np.degrees(v)) for v in (f.alpha, f.beta)]
        listing.add_row(name, *angles, f"{f.beta_N:g}", f"{f.eta:g}", ", ".join(f"{x:.3g}" for x in f.absorption))
    out.print(listing)
    for name, preset in PRESETS.items():
        out.print(Text(name, "bold"), f": {preset.about} {preset.source}", sep="")
