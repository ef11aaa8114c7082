"""`cuticle audit`: verdicts on any sampler, given as a plugin's name, a sampler's file or a file of samples."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from cuticle._support import validate
from cuticle._support.backends import check_backend
from cuticle._support.files import read_text, writable_directory, write_text
from cuticle.checking.audit import LEVEL, SAMPLES, audit
from cuticle.checking.audit_report import Audit
from cuticle.checking.sample_file import Dump, audit_dump
from cuticle.cli.tables import ess_text, table, verdict_table
from cuticle.cli.terminal import JsonOption, ParametersArgument, out, progress_bar
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import with_strands
from cuticle.scattering.by_name import MITSUBA, model_of, read_model, read_parameters
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.from_mitsuba import from_mitsuba


def command(
    target: Annotated[
        str,
        typer.Argument(
            metavar="TARGET",
            help="mitsuba:PLUGIN, a sampler's file or folder, a TOML file with the table chiang, or samples (.npz, .csv).",
        ),
    ],
    parameters: ParametersArgument = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for audit.json and audit.png.")
    ] = None,
    h: Annotated[float, typer.Option("--h", help="Offset across the fibre, -1 to 1, for a material or a near field.")] = 0.0,
    theta_r: Annotated[
        str | None, typer.Option("--theta-r", metavar="T,T,…", help="Viewers, degrees. Default: ±{0, 30, 60, 75, 85}.")
    ] = None,
    strands: Annotated[
        float | None, typer.Option(help="Strand count, for a sampler that covers several. Default: 0.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Samples per viewer.")] = SAMPLES,
    level: Annotated[float, typer.Option(help="False-positive rate: how often a correct sampler may fail.")] = LEVEL,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 1,
    variant: Annotated[
        str, typer.Option(help="Mitsuba variant: scalar_rgb needs nothing else, llvm_ad_rgb is faster and needs LLVM 19.")
    ] = "scalar_rgb",
    reciprocity: Annotated[bool, typer.Option("--reciprocity", help="Also require reciprocity of f.")] = False,
    energy: Annotated[bool, typer.Option("--energy", help="Also require that f creates no energy.")] = False,
    json_output: JsonOption = False,
) -> None:
    """Audit any sampler: do its samples follow its pdf? Exit code 1 if a verdict fails."""
    angles = None if theta_r is None else _angles(theta_r)
    if output is not None:
        writable_directory(output)
    made: Audit | Dump
    if Path(target).suffix.lower() in (".npz", ".csv"):
        if parameters:
            raise ValueError(f"key=value parameters go with {MITSUBA}PLUGIN, got {parameters[0]!r} with {target!r}")
        made = audit_dump(target, level=level, seed=seed)
    else:
        subject, own = _subject(target, parameters or [], h, strands, variant)
        with progress_bar(json_output) as progress:
            made = audit(
                subject, theta_r=angles, samples=samples, level=level, seed=seed, reciprocity=reciprocity, energy=energy,
                progress=progress, **own,
            )  # fmt: skip
    text = json.dumps(made.to_dict(), indent=2, allow_nan=False) + "\n"
    written = []
    if output is not None:
        written.append(write_text(output / "audit.json", text))
        if isinstance(made, Audit):
            made.figure(output / "audit.png")
            written.append(output / "audit.png")
    if json_output:
        print(text, end="")
    else:
        _tell(made)
        if written:
            out.print(f"wrote {', '.join(map(str, written))}", soft_wrap=True)
    if not made.ok:
        raise typer.Exit(1)


def _subject(
    target: str, parameters: list[str], h: float, strands: float | None, variant: str
) -> tuple[Any, dict[str, Any]]:
    """Return what is to be audited, and what else `audit` has to be told."""
    if target.startswith(MITSUBA):
        _set_variant(variant)
        given = read_parameters(parameters)
        words = " ".join([target[len(MITSUBA) :], *parameters])
        return from_mitsuba(target[len(MITSUBA) :], h=h, **given), {"name": f"Mitsuba's {words}, h = {h:g}"}
    if parameters:
        raise ValueError(f"key=value parameters go with {MITSUBA}PLUGIN, got {parameters[0]!r} with {target!r}")
    path = Path(target)
    if path.is_dir() or path.suffix.lower() == ".json":
        path = path / "sampler.json" if path.is_dir() else path
        sampler = Sampler.from_json(read_text(path, "sampler"), source=str(path))
        n = strands if strands is not None else sampler.strands[0]
        own: dict[str, Any] = {"strands": n, "name": f"{path}, {n:g} strands"}
        try:
            model = model_of(sampler)
        except ValueError:
            return sampler, own  # without f: its pdf can be audited all the same
        return sampler, own | {"eval": with_strands(model, n).eval}
    chiang = read_model(target) if path.suffix.lower() == ".toml" else None
    if isinstance(chiang, Chiang):
        return chiang.near(h), {"name": f"{target}, h = {h:g}"}
    raise ValueError(
        f"an audit needs {MITSUBA}PLUGIN, a sampler's .json or its folder, a .toml with [chiang], or samples in an .npz or"
        f" .csv file; got {target!r}"
    )


def _set_variant(variant: str) -> None:
    try:
        import mitsuba as mi
    except ImportError:
        raise RuntimeError("this needs Mitsuba 3, which is not installed: pip install cuticle[mitsuba]") from None
    validate.choice("--variant", variant, [v for v in mi.variants() if v.endswith("rgb") or "mono" in v])
    check_backend(variant)
    mi.set_variant(variant)


def _angles(text: str) -> Any:
    try:
        degrees = [float(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"--theta-r must be numbers with commas between, such as -60,0,60; got {text!r}") from None
    for d in degrees:
        validate.number("--theta-r", d, -89.9, 89.9, unit="degrees")
    return np.radians(degrees)


def _tell(made: Audit | Dump) -> None:
    if isinstance(made, Audit):
        out.print(_cases(made))
        title = f"{made.name}: {len(made.cases)} viewers, {made.samples:,} samples each, {made.seconds:.1f} s"
    else:
        title = f"{made.name}: {made.rows:,} rows, {made.viewers} viewers, {made.patches} patches ({made.left_out} left out)"
        if np.isfinite(made.mean_weight):
            out.print(
                f"mean weight {made.mean_weight:.5g} ± {made.error:.2g}, ESS {made.ess:.3f}, largest weight"
                f" {made.largest_weight:.3g} of the mean",
                soft_wrap=True,
            )
    out.print(verdict_table(title, made.verdicts))
    for note in made.notes:
        out.print(f"note: {note}", soft_wrap=True, highlight=False)
    sure = f"false-positive rate: 1 in {1 / made.level:,.0f} audits"
    out.print(f"[green]passes[/] ({sure})" if made.ok else f"[red]FAILED[/] ({sure})")


def _cases(made: Audit) -> Table:
    listing = table("By viewer")
    for column in (
        "theta_r",
        "∫ pdf",
        "dropped",
        "p-value",
        "TV distance",
        "of chance",
        "ESS",
        "worst channel",
        "largest weight",
    ):
        listing.add_column(column, justify="right", no_wrap=True)
    for c in made.cases:
        known = np.isfinite(c.ess)
        listing.add_row(
            f"{np.degrees(c.theta_r):.3g}°", f"{c.integral:.5f}", f"{c.dropped:.3g}", f"{c.p_value:.2g}",
            f"{c.total_variation:.4f}", f"{c.noise_floor:.4f}", ess_text(c.ess) if known else "–",
            ess_text(min(c.ess_channels)) if known else "–", f"{c.largest_weight:.3g}" if known else "–",
        )  # fmt: skip
    return listing
