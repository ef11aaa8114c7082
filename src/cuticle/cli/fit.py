"""`cuticle fit`: a sampler for a fibre, a table or a material."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from cuticle._support import validate
from cuticle._support.files import check_directory, filling, write_text
from cuticle._support.progress import part
from cuticle.cli.tables import fit_table
from cuticle.cli.terminal import JsonOption, ModelArgument, ParametersArgument, out, progress_bar, read_strands, refuse_idle
from cuticle.fitting.fit import AUTO, BEST, fit
from cuticle.fitting.result import Fit, fit_summary
from cuticle.fitting.samplings import FORMS
from cuticle.fitting.targets import OBJECTIVES
from cuticle.sampling.families import FAMILIES, NORMAL
from cuticle.sampling.lobe_table import MAX_LOBES
from cuticle.sampling.quality import channel_bounds
from cuticle.scattering.among_strands import Strands
from cuticle.scattering.bcsdf import with_strands
from cuticle.scattering.by_name import MITSUBA, read_model
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.dual_scattering import DualScattering

_TABULATING = 0.9  # the reading of a Mitsuba plugin's share of all: over h it is asked millions of times


def command(
    ctx: typer.Context,
    model: ModelArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for sampler.json, fit.json and the fibre's file.")
    ],
    parameters: ParametersArgument = None,
    strands: Annotated[
        str | None,
        typer.Option(
            metavar="N,N,…|auto",
            help="Strand counts to cover; 0 is direct light. auto, the default for a fibre, covers all numbers: 0,1,2,4,8,16"
            " and more where the shape of light still changes.",
        ),
    ] = None,
    lobes: Annotated[
        str, typer.Option(metavar="K|auto", help=f"Number of lobes, 1 to {MAX_LOBES}; auto chooses by ESS per cost.")
    ] = "4",
    form: Annotated[str, typer.Option(help=" | ".join(FORMS))] = "lobes",
    objective: Annotated[str, typer.Option(help=" | ".join(OBJECTIVES))] = "luminance",
    family: Annotated[str, typer.Option(help=" | ".join((*FAMILIES, BEST)))] = NORMAL,
    defensive: Annotated[float, typer.Option(help="Share of the nearly uniform lobe, for --form document.")] = 0.1,
    json_output: JsonOption = False,
) -> None:
    """Fit a sampler to a fibre, a table of values or a Mitsuba material."""
    start = time.perf_counter()
    number = _lobes(lobes)
    counts = strands if strands is None or strands == AUTO else read_strands(strands)
    validate.choice("--form", form, FORMS)
    validate.choice("--objective", objective, OBJECTIVES)
    validate.choice("--family", family, (*FAMILIES, BEST))
    validate.number("--defensive", defensive, 0, 0.99)
    if form == "document":
        refuse_idle(ctx, "with --form document", "lobes")
    else:
        refuse_idle(ctx, "without --form document", "defensive")
    check_directory(output)
    reading = _TABULATING if model.startswith(MITSUBA) else 0.0
    with progress_bar(json_output) as progress:
        parsed = read_model(model, parameters or (), progress=part(progress, 0.0, reading))
        if counts is None and isinstance(parsed, DualScattering):
            counts = AUTO
        if counts is not None and not hasattr(parsed, "with_strands"):
            parsed = Strands(parsed)
        parameters_of = _parameters(parsed)
        _refuse_another(output, parameters_of and parameters_of[0])
        result = fit(
            parsed, number, strands=counts, form=form, objective=objective, family=family, defensive=defensive,
            progress=part(progress, reading, 1 - reading),
        )  # fmt: skip
    whole = time.perf_counter() - start
    summary = fit_summary(result) | {"seconds_in_all": round(whole, 3)}
    with filling(output) as folder:
        result.sampler.save(folder / "sampler.json")
        beside = [] if parameters_of is None else [parameters_of[1].save(folder / parameters_of[0]).name]
        write_text(folder / "fit.json", json.dumps(summary, indent=2) + "\n")
    if json_output:
        print(json.dumps(summary, indent=2))
        return
    out.print(fit_table(result, whole))
    if result.ess_channels.shape[2] > 1:
        _tell_bounds(result, parsed)
    out.print(f"wrote {', '.join(str(output / name) for name in ('sampler.json', 'fit.json', *beside))}", soft_wrap=True)


def _tell_bounds(result: Fit, model: Any) -> None:
    """Print the ESS of the worst channel beside its bounds, at the first strand count."""
    first = with_strands(model, result.sampler.strands[0])
    limits = [channel_bounds(first, float(t)) for t in result.theta_r]
    found = float(result.ess_channels[0].min())
    rgb, worst = min(min(b.rgb) for b in limits), min(b.worst for b in limits)
    out.print(
        f"ESS of the worst channel: {found:.3f} (objective {result.objective}). One density serves all channels: the best"
        f" for their mean 1/ESS has {rgb:.3f} there, the best for the worst channel {worst:.3f}.",
        soft_wrap=True,
        highlight=False,
    )


def _parameters(model: Any) -> tuple[str, Any] | None:
    """Return the file of a model's parameters, and what it holds, if they have a file format."""
    if isinstance(model, Strands):
        return _parameters(model.model)
    if isinstance(model, DualScattering):
        return "fibre.toml", model.fibre
    return ("chiang.toml", model) if isinstance(model, Chiang) else None


def _refuse_another(folder: Path, own: str | None) -> None:
    for name in ("fibre.toml", "chiang.toml"):
        if name != own and (folder / name).exists():
            raise ValueError(f"{folder / name} describes another model than this fit's; move it, or give another folder")


def _lobes(text: str) -> int | None:
    if text == "auto":
        return None
    try:
        number = int(text)
    except ValueError:
        raise ValueError(f"--lobes must be a whole number from 1 to {MAX_LOBES} or auto, got {text!r}") from None
    return validate.integer("--lobes", number, 1, MAX_LOBES, remedy="4 suits most fibres; auto lets the program choose")
