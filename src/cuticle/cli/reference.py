"""`cuticle reference`: cases with values of proven error, and a check of someone's values beside them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from cuticle._support import validate
from cuticle.cli.tables import table
from cuticle.cli.terminal import JsonOption, check_output, err, out, progress_bar, write_output
from cuticle.reference.cases import LONGITUDINAL, MODELS
from cuticle.reference.comparison import PRECISIONS, check
from cuticle.reference.making import MOST_CASES, make
from cuticle.reference.slip_table import SLIPS

app = typer.Typer(
    help="Values of the scattering functions with proven errors; `check` says what is wrong with someone's.",
    no_args_is_help=True,
)
CasesOption = Annotated[int, typer.Option("--cases", help="Number of cases.")]
OutputOption = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE", help="The file of cases, CSV; - is standard output.")
]
SeedOption = Annotated[int, typer.Option(help="Seed of the draw.")]


def _make(model: str, cases: int, output: Path, seed: int, **options: str) -> None:
    validate.integer("--cases", cases, 8, MOST_CASES)
    validate.integer("--seed", seed, 0, 2**63 - 1)
    target = check_output(output)
    with progress_bar() as progress:
        made = make(model, cases, seed=seed, progress=progress, **options)
    write_output(target, made.to_csv())
    if str(output) != "-":
        err.print(f"{made!r}", soft_wrap=True, highlight=False)
        err.print(f"wrote {output}", soft_wrap=True, highlight=False)


@app.command("chiang")
def chiang(
    cases: CasesOption = 1000,
    output: OutputOption = Path("cases.csv"),
    seed: SeedOption = 1,
    field: Annotated[str, typer.Option(help="near: the offset h is known; far: its mean over the width.")] = "near",
) -> None:
    """Write cases of Chiang et al. 2016, the hair model of pbrt, Mitsuba, Cycles and MaterialX."""
    validate.choice("--field", field, ("near", "far"))
    _make("chiang", cases, output, seed, field=field)


@app.command("marschner")
def marschner(
    cases: CasesOption = 1000,
    output: OutputOption = Path("cases.csv"),
    seed: SeedOption = 1,
    longitudinal: Annotated[str, typer.Option(help="energy_conserving (d'Eon 2011) or gaussian.")] = LONGITUDINAL[0],
) -> None:
    """Write cases of Marschner 2003 with azimuthal roughness."""
    validate.choice("--longitudinal", longitudinal, LONGITUDINAL)
    _make("marschner", cases, output, seed, longitudinal=longitudinal)


@app.command("dual_scattering")
def dual_scattering(
    cases: CasesOption = 100,
    output: OutputOption = Path("cases.csv"),
    seed: SeedOption = 1,
) -> None:
    """Write cases of dual scattering as Zinke et al. 2008 print it."""
    _make("dual_scattering", cases, output, seed)


@app.command("check")
def check_values(
    values: Annotated[
        Path, typer.Argument(metavar="FILE", help="Cases with f_r, f_g, f_b or pdf filled in, CSV; or Falcor's .dat.")
    ],
    precision: Annotated[str, typer.Option(help="auto | single | double: how much rounding is allowed.")] = "auto",
    tolerance: Annotated[
        float | None, typer.Option(help="Relative difference allowed besides; default 1e-3, 1e-5 in double, .01 far field.")
    ] = None,
    f_cos: Annotated[bool, typer.Option("--f-cos", help="The values of f hold cos theta_i.")] = False,
    cases: Annotated[
        Path | None, typer.Option("--cases", metavar="CASES", help="The file of cases, if FILE has only case and values.")
    ] = None,
    model: Annotated[str | None, typer.Option(help=f"{' | '.join(MODELS)}; default: what FILE says.")] = None,
    json_output: JsonOption = False,
) -> None:
    """Check someone's values: right or wrong, the worst cases, and which known slip they have. Exit code 1 if wrong."""
    validate.choice("--precision", precision, PRECISIONS)
    if model is not None:
        validate.choice("--model", model, MODELS)
    if tolerance is not None:
        validate.number("--tolerance", tolerance, 1e-12, 1)
    with progress_bar(json_output) as progress:
        found = check(
            values, precision=precision, tolerance=tolerance, f_cos=f_cos, cases=cases, model=model, progress=progress
        )
    if json_output:
        print(json.dumps(found.to_dict(), indent=2, allow_nan=False))
    else:
        out.print(str(found), soft_wrap=True, highlight=False)
    raise typer.Exit(0 if found.ok else 1)


@app.command("slips")
def slips() -> None:
    """List the known slips: what is meant, the right formula and the wrong one."""
    listing = table(f"{len(SLIPS)} known slips")
    for column in ("slip", "meaning", "right", "wrong"):
        listing.add_column(column, overflow="fold")
    for s in SLIPS:
        listing.add_row(s.name, s.meaning, s.right, s.wrong)
    out.print(listing)
