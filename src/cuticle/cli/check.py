"""`cuticle check`: verdicts on a sampler."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cuticle._support import validate
from cuticle.checking.check import check
from cuticle.checking.verdicts import EXIT_CODES, LIMITS
from cuticle.cli.tables import check_tables
from cuticle.cli.terminal import (
    STANDARD_OUTPUT,
    JsonOption,
    check_output,
    out,
    progress_bar,
    read_strands,
    refuse_idle,
    write_output,
)
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.by_name import model_of

QUICK = 100_000


def command(
    ctx: typer.Context,
    sampler: Annotated[Path, typer.Argument(metavar="SAMPLER.json", help="A sampler's file, or its folder.")],
    model: Annotated[
        str | None,
        typer.Option("--model", "--fibre", metavar="PRESET|FILE", help="Scattering function; default: the sampler's own."),
    ] = None,
    strands: Annotated[str | None, typer.Option(metavar="N,N,…", help="Strand counts; default: the sampler's own.")] = None,
    samples: Annotated[int, typer.Option(help="Samples per viewer and strand count.")] = 1_000_000,
    quick: Annotated[bool, typer.Option("--quick", help=f"Draw {QUICK:,} samples: finds errors of some per cent.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 1,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Also write the report there, as JSON.")
    ] = None,
    json_output: JsonOption = False,
) -> None:
    """Check a sampler against its scattering function. Exit code 1 if a verdict fails."""
    if quick:
        refuse_idle(ctx, "with --quick", "samples")
        samples = QUICK
    if output == STANDARD_OUTPUT:
        refuse_idle(ctx, "with -o -, which prints the report as JSON", "json_output")
    validate.integer("--samples", samples, *LIMITS["samples"])
    validate.integer("--seed", seed, *LIMITS["seed"])
    loaded = Sampler.load(sampler)
    function = model_of(loaded, model)
    counts = None if strands is None else read_strands(strands)
    if output is not None:
        output = check_output(output)
    with progress_bar(json_output) as progress:
        report = check(loaded, function, strands=counts, samples=samples, seed=seed, progress=progress)
    if output is not None:
        write_output(output, report.to_json())
    if output == STANDARD_OUTPUT:
        pass
    elif json_output:
        print(report.to_json(), end="")
    else:
        for listing in check_tables(report):
            out.print(listing)
    raise typer.Exit(EXIT_CODES[report.outcome])
