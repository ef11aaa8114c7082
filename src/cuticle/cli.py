"""The command line: `fibres`, `fit`, `check`, `document`, `report`; `render`, `export`, `audit` have their own modules."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cuticle import validate
from cuticle.audit.command import audit_command
from cuticle.check import check
from cuticle.chiang import Chiang
from cuticle.console import check_tables, document_tables, fit_table, table
from cuticle.demo import demo_command
from cuticle.document import Document, Printed, document
from cuticle.export.command import export_command
from cuticle.fibre import Fibre
from cuticle.files import read_text, writable_directory, write_text
from cuticle.fit import FORMS, OBJECTIVES, Fit, fit
from cuticle.fit.result import fit_summary
from cuticle.headers import cmake_dir, include_dir
from cuticle.lobe_table import MAX_LOBES
from cuticle.models import DualScattering
from cuticle.origin import model_of, read_model
from cuticle.presets import PRESETS
from cuticle.quality import channel_bounds
from cuticle.render.command import app as render_app
from cuticle.sampler import Sampler
from cuticle.strands import Strands
from cuticle.terminal import JsonOption, ModelArgument, ParametersArgument, err, out, progress_bar
from cuticle.version import __version__

app = typer.Typer(
    help="Importance samplers for hair fibres: fitted to a scattering function, and proven.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(render_app, name="render")
app.command("export")(export_command)
app.command("audit")(audit_command)
app.command("demo", hidden=True)(demo_command)


def _print_and_exit(text: Callable[[], object]) -> Callable[[bool], None]:
    def act(asked: bool) -> None:
        if asked:
            print(text())
            raise typer.Exit

    return act


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_and_exit(lambda: __version__)),
    ] = False,
    include: Annotated[
        bool,
        typer.Option(
            "--include-dir", help="Print where the C++ headers lie.", is_eager=True, callback=_print_and_exit(include_dir)
        ),
    ] = False,
    cmake: Annotated[
        bool,
        typer.Option(
            "--cmake-dir", help="Print where cuticleConfig.cmake lies.", is_eager=True, callback=_print_and_exit(cmake_dir)
        ),
    ] = False,
) -> None:
    pass


def read_strands(text: str) -> tuple[float, ...]:
    """Return strand counts from text such as 0,1,2,4,8."""
    try:
        counts = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"--strands must be numbers with commas between, such as 0,1,2,4,8; got {text!r}") from None
    return validate.strand_counts("--strands", counts)


@app.command()
def fibres(
    json_output: JsonOption = False,
    toml: Annotated[
        str | None, typer.Option(metavar="PRESET", help="Print this preset as TOML, to start a file from.")
    ] = None,
) -> None:
    """List the published fibres and where their numbers come from."""
    if toml is not None:
        print(Fibre.preset(toml).to_toml(), end="")
        return
    if json_output:
        print(
            json.dumps({name: Fibre.preset(name).model_dump(exclude_none=True, mode="json") for name in PRESETS}, indent=2)
        )
        return
    listing = table("Fibres: angles in degrees of theta_h, sigma_a per radius")
    for column in ("name", "alpha R, TT, TRT", "beta R, TT, TRT", "beta_N", "eta", "sigma_a"):
        listing.add_column(column, no_wrap=True)
    for name, make in PRESETS.items():
        f = make()
        angles = [", ".join(f"{x:.3g}" for x in np.degrees(v)) for v in (f.alpha, f.beta)]
        listing.add_row(name, *angles, f"{f.beta_N:g}", f"{f.eta:g}", ", ".join(f"{x:.3g}" for x in f.absorption))
    out.print(listing)
    for name, make in PRESETS.items():
        out.print(f"[bold]{name}[/]: {(make.__doc__ or '').strip().splitlines()[0]}")


@app.command("fit")
def fit_command(
    model: ModelArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for sampler.json, fit.json and the model's file.")
    ],
    parameters: ParametersArgument = None,
    strands: Annotated[
        str | None,
        typer.Option(metavar="N,N,…", help="Strand counts toward the light, 0 is direct light; of a fibre 0,1,2,4,8."),
    ] = None,
    lobes: Annotated[
        str, typer.Option(metavar="K|auto", help=f"Lobes, 1 to {MAX_LOBES}; auto: as many as pay for themselves.")
    ] = "4",
    form: Annotated[str, typer.Option(help=" | ".join(FORMS))] = "lobes",
    objective: Annotated[str, typer.Option(help=" | ".join(OBJECTIVES))] = "luminance",
    defensive: Annotated[float, typer.Option(help="Share of the nearly uniform lobe in the document's form.")] = 0.1,
    json_output: JsonOption = False,
) -> None:
    """Fit a sampler to a fibre, a table of values or a material of Mitsuba."""
    number = _lobes(lobes)
    counts = None if strands is None else read_strands(strands)
    validate.choice("--form", form, FORMS)
    validate.choice("--objective", objective, OBJECTIVES)
    validate.number("--defensive", defensive, 0, 0.99)
    with progress_bar(json_output) as progress:
        parsed = read_model(model, parameters or (), progress=progress)
    if counts is None and isinstance(parsed, DualScattering):
        counts = (0.0, 1.0, 2.0, 4.0, 8.0)
    if counts is not None and not hasattr(parsed, "with_strands"):
        parsed = Strands(parsed)
    folder = writable_directory(output)
    with progress_bar(json_output) as progress:
        result = fit(parsed, number, strands=counts, form=form, objective=objective, defensive=defensive, progress=progress)
    result.sampler.save(folder / "sampler.json")
    beside = _save_model(parsed, folder)
    summary = fit_summary(result)
    write_text(folder / "fit.json", json.dumps(summary, indent=2) + "\n")
    if json_output:
        print(json.dumps(summary, indent=2))
        return
    out.print(fit_table(result))
    if result.ess_channels.shape[2] > 1:
        _tell_bounds(result, parsed, counts)
    out.print(f"wrote {', '.join(str(folder / name) for name in ('sampler.json', 'fit.json', *beside))}", soft_wrap=True)


def _tell_bounds(result: Fit, model: Any, counts: tuple[float, ...] | None) -> None:
    """Say how far the worst channel is from what one density for all can have, at the first strand count."""
    first = model.with_strands(counts[0]) if counts else model
    limits = [channel_bounds(first, float(t)) for t in result.theta_r]
    found = float(result.ess_channels[0].min())
    rgb, worst = min(min(b.rgb) for b in limits), min(b.worst for b in limits)
    out.print(
        f"Worst channel {found:.3f} (objective {result.objective}). One density serves all channels: the best for their mean"
        f" 1/ESS has {rgb:.3f} there, the best for the worst channel {worst:.3f}.",
        soft_wrap=True,
        highlight=False,
    )


def _save_model(model: Any, folder: Path) -> list[str]:
    """Write what a model was made of beside its sampler, where it has a file of its own; return the file's name."""
    if isinstance(model, DualScattering):
        return [model.fibre.save(folder / "fibre.toml").name]
    if isinstance(model, Strands):
        return _save_model(model.model, folder)
    if isinstance(model, Chiang):
        return [model.save(folder / "chiang.toml").name]
    return []


@app.command("check")
def check_command(
    sampler: Annotated[
        Path, typer.Argument(metavar="SAMPLER.json", help="A sampler that `cuticle fit` wrote, or its folder.")
    ],
    model: Annotated[
        str | None,
        typer.Option("--model", "--fibre", metavar="PRESET|FILE", help="Check against this one, not the sampler's own."),
    ] = None,
    strands: Annotated[
        str | None, typer.Option(metavar="N,N,…", help="Strand counts; the sampler's own if left out.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Samples a case.")] = 1_000_000,
    seed: Annotated[int, typer.Option(help="Of the random numbers.")] = 1,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the report as JSON there, too.")
    ] = None,
    json_output: JsonOption = False,
) -> None:
    """Check a sampler: a table of verdicts, and exit code 1 where one fails."""
    path = sampler / "sampler.json" if sampler.is_dir() else sampler
    loaded = Sampler.from_json(read_text(path, "sampler"), source=str(path))
    function = model_of(loaded, model)
    counts = None if strands is None else read_strands(strands)
    if output is not None:
        writable_directory(output.parent, make=False)
    with progress_bar(json_output) as progress:
        report = check(loaded, function, strands=counts, samples=samples, seed=seed, progress=progress)
    text = json.dumps(report.to_dict(), indent=2, allow_nan=False) + "\n"
    if output is not None:
        write_text(output, text)
    if json_output:
        print(text, end="")
    else:
        for listing in check_tables(report):
            out.print(listing)
    if not report.ok:
        raise typer.Exit(1)


@app.command("document")
def document_command(
    model: ModelArgument = "document",
    parameters: ParametersArgument = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for document.json, and the figures as SVG and PNG."),
    ] = None,
    printed: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the draft's table1.csv, table2.csv, table3.csv, to compare with."),
    ] = None,
    json_output: JsonOption = False,
) -> None:
    """Reproduce and complete the draft description: its tables, functions, figures and claims, for any fibre."""
    with progress_bar(json_output) as progress:
        parsed = read_model(model, parameters or (), progress=progress)
    tables = Printed.load(printed) if printed is not None else Printed.find() if model == "document" else None
    if output is not None:
        writable_directory(output)
    with progress_bar(json_output) as progress:
        result = document(parsed, printed=tables, name=Path(model).stem, progress=progress)
        if output is not None:
            result.save(output, progress=progress)
    if json_output:
        print(json.dumps(result.to_dict(), indent=2, allow_nan=False))
        return
    _tell_document(result)
    if model == "document" and tables is None:
        out.print(
            "The draft's own tables are not at hand: --printed DIR (or $CUTICLE_DATA) compares with them.", soft_wrap=True
        )
    if output is not None:
        out.print(f"wrote {output / 'document.json'} and {output / 'figures'}", soft_wrap=True)


def _tell_document(result: Document) -> None:
    plain = result.to_dict()
    for listing in document_tables(plain):
        out.print(listing)
    if plain["shader"] is not None:
        out.print("For a shader, t = theta_r in radians, n strands:")
        for line in (*plain["shader"]["direct"], *plain["shader"]["strands"]):
            out.print(f"  {line}", soft_wrap=True, highlight=False)


@app.command("report")
def report_command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder with results of fit, check, document.")],
) -> None:
    """Write one self-contained HTML page from the results of fit, check and document that lie in a folder."""
    from cuticle.report.page import write_report

    out.print(f"wrote {write_report(folder)}", soft_wrap=True)


def _lobes(text: str) -> int | None:
    if text == "auto":
        return None
    try:
        number = int(text)
    except ValueError:
        raise ValueError(f"--lobes must be a whole number from 1 to {MAX_LOBES} or auto, got {text!r}") from None
    return validate.integer("--lobes", number, 1, MAX_LOBES, remedy="4 suits most fibres; auto lets the program choose")


# The base of what Typer raises for a wrong command line: Click's own class, or the copy that newer Typer carries.
_UsageError: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")


def main() -> None:
    """Run the command line: exit code 2 and one line for bad input, 1 for a verdict that fails."""
    warnings.showwarning = _note  # type: ignore[assignment]
    try:
        code = app(args=sys.argv[1:] or ["--help"], standalone_mode=False)
    except _UsageError as error:
        code = _complain(error.format_message())
    except (ValueError, TypeError, RuntimeError) as error:
        code = _complain(str(error))
    except (KeyboardInterrupt, typer.Abort):
        code = _complain("stopped", code=130)
    sys.exit(code or 0)


def _note(message: Warning | str, *_: Any) -> None:
    err.print(f"cuticle: {' '.join(str(message).split())}", markup=False, highlight=False, soft_wrap=True)


def _complain(message: str, code: int = 2) -> int:
    err.print(f"cuticle: {' '.join(message.split())}", markup=False, highlight=False, soft_wrap=True)
    return code


if __name__ == "__main__":
    main()
