"""`cuticle audit`: any sampler, from a plugin's name, a sampler's file or a file of samples."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from cuticle._support import validate
from cuticle._support.backends import check_backend
from cuticle._support.files import check_directory, filling, read_text, write_text
from cuticle.checking.audit import LEVEL, SAMPLES, Audit, audit
from cuticle.checking.sample_file import Dump, audit_dump
from cuticle.checking.verdicts import EXIT_CODES, LIMITS
from cuticle.cli.tables import RESULTS, ess_text, table, verdict_table
from cuticle.cli.terminal import JsonOption, ParametersArgument, out, progress_bar, refuse_idle
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import with_strands
from cuticle.scattering.by_name import MITSUBA, model_of, read_model, read_parameters
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.from_mitsuba import from_mitsuba

PLUGIN, SAMPLER, DUMP, CHIANG = "a plugin", "a sampler's file", "a file of samples", "a .toml with [chiang]"
_IDLE = {  # options that do nothing with each
    PLUGIN: ("strands",),
    SAMPLER: ("h", "variant"),
    DUMP: ("h", "theta_r", "strands", "samples", "variant", "reciprocity", "energy"),
    CHIANG: ("strands", "variant"),
}


def _kind(source: str) -> str:
    if source.startswith(MITSUBA):
        return PLUGIN
    ending = Path(source).suffix.lower()
    return DUMP if ending in (".npz", ".csv") else CHIANG if ending == ".toml" else SAMPLER


def command(
    ctx: typer.Context,
    source: Annotated[
        str,
        typer.Argument(
            metavar="TARGET",
            help="mitsuba:PLUGIN, a sampler's file or folder, a TOML file with a table named chiang, or a file of samples"
            " (.npz, .csv).",
        ),
    ],
    parameters: ParametersArgument = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for audit.json and audit.png.")
    ] = None,
    h: Annotated[float, typer.Option("--h", help="Offset across the fibre, -1 to 1, for a plugin or Chiang's model.")] = 0.0,
    theta_r: Annotated[
        str | None, typer.Option("--theta-r", metavar="T,T,…", help="Viewers, degrees; default ±{0, 30, 60, 75, 85}.")
    ] = None,
    strands: Annotated[float | None, typer.Option(help="Strand count of a sampler; default: its first.")] = None,
    samples: Annotated[int, typer.Option(help="Samples per viewer.")] = SAMPLES,
    level: Annotated[float, typer.Option(help="False-positive rate of the whole audit.")] = LEVEL,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 1,
    variant: Annotated[str, typer.Option(help="Mitsuba's variant; llvm_ad_rgb is faster and needs LLVM.")] = "scalar_rgb",
    reciprocity: Annotated[bool, typer.Option("--reciprocity", help="Also test that f is reciprocal.")] = False,
    energy: Annotated[bool, typer.Option("--energy", help="Also test that ∫ f cos is at most 1.")] = False,
    json_output: JsonOption = False,
) -> None:
    """Audit any sampler: do its samples follow its pdf? Exit code 1 if a verdict fails, 3 if one is inconclusive."""
    if parameters and not source.startswith(MITSUBA):
        raise ValueError(f"key=value parameters go with {MITSUBA}PLUGIN, got {parameters[0]!r} with {source!r}")
    refuse_idle(ctx, f"for {_kind(source)}", *_IDLE[_kind(source)])
    validate.number("--h", h, -1, 1)
    validate.integer("--samples", samples, *LIMITS["samples"])
    validate.number("--level", level, *LIMITS["level"])
    validate.integer("--seed", seed, *LIMITS["seed"])
    if strands is not None:
        validate.number("--strands", strands, 0, validate.MAX_STRANDS)
    angles = None if theta_r is None else _angles(theta_r)
    if output is not None:
        check_directory(output)
    made: Audit | Dump
    if _kind(source) == DUMP:
        made = audit_dump(source, level=level, seed=seed)
    else:
        sampler, own = _load(source, parameters or [], h, strands, variant)
        if not callable(own.get("eval", getattr(sampler, "eval", None))):
            refuse_idle(ctx, "for a sampler without its scattering function", "reciprocity", "energy")
        with progress_bar(json_output) as progress:
            made = audit(
                sampler, theta_r=angles, samples=samples, level=level, seed=seed, reciprocity=reciprocity, energy=energy,
                progress=progress, **own,
            )  # fmt: skip
    written = []
    if output is not None:
        with filling(output) as folder:
            write_text(folder / "audit.json", made.to_json())
            if isinstance(made, Audit):
                made.figure(folder / "audit.png")
            written = [output / file.name for file in sorted(folder.iterdir())]
    if json_output:
        print(made.to_json(), end="")
    else:
        _print(made)
        if written:
            out.print(f"wrote {', '.join(map(str, written))}", soft_wrap=True)
    raise typer.Exit(EXIT_CODES[made.outcome])


def _load(source: str, parameters: list[str], h: float, strands: float | None, variant: str) -> tuple[Any, dict[str, Any]]:
    """Return the sampler that `source` names, and the other arguments that `audit` needs with it."""
    if source.startswith(MITSUBA):
        _set_variant(variant)
        given = read_parameters(parameters)
        words = " ".join([source[len(MITSUBA) :], *parameters])
        return from_mitsuba(source[len(MITSUBA) :], h=h, **given), {"name": f"Mitsuba's {words}, h = {h:g}"}
    path = Path(source)
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
    chiang = read_model(source) if path.suffix.lower() == ".toml" else None
    if isinstance(chiang, Chiang):
        return chiang.near(h), {"name": f"{source}, h = {h:g}"}
    raise ValueError(
        f"an audit needs {MITSUBA}PLUGIN, a sampler's .json or its folder, a .toml with [chiang], or samples in an .npz or"
        f" .csv file; got {source!r}"
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


def _print(made: Audit | Dump) -> None:
    if isinstance(made, Audit):
        out.print(_viewers(made))
        title = f"{made.name}: {len(made.cases)} viewers, {made.samples:,} samples each, {made.seconds:.1f} s"
    else:
        title = f"{made.name}: {made.rows:,} rows, {made.viewers} viewers, {made.patches} patches ({made.left_out} left out)"
        if np.isfinite(made.mean_weight):
            mean = f"mean weight {made.mean_weight:.5g} ± {made.error:.2g}, ESS {made.ess:.3f}"
            out.print(f"{mean}, largest weight {made.largest_weight:.3g} of the mean", soft_wrap=True)
    out.print(verdict_table(title, made.verdicts))
    for note in made.notes:
        out.print(f"note: {note}", soft_wrap=True, highlight=False)
    out.print(f"{RESULTS[made.outcome]} (false-positive rate: one audit in {1 / made.level:,.0f})")


def _viewers(made: Audit) -> Table:
    listing = table("By viewer")
    columns = "theta_r|∫ pdf|dropped|p-value|TV distance|TV of noise|ESS|worst channel|largest weight"
    for column in columns.split("|"):
        listing.add_column(column, justify="right", no_wrap=True)
    for m in made.cases:
        quality = ["–"] * 3
        if m.ess_channels:
            quality = [ess_text(m.ess), ess_text(min(m.ess_channels)), f"{m.largest_weight:.3g}"]
        listing.add_row(
            f"{np.degrees(m.theta_r):.3g}°", f"{m.integral:.5f}", f"{m.dropped:.3g}", f"{m.p_value:.2g}",
            f"{m.total_variation:.4f}", f"{m.noise_floor:.4f}", *quality,
        )  # fmt: skip
    return listing
