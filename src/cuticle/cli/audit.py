"""`cuticle audit`: any sampler, from a plugin's name, a sampler's file or a file of samples."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from rich.table import Table

from cuticle._support import validate
from cuticle._support.apart import apart
from cuticle._support.backends import check_backend
from cuticle._support.files import check_directory, filling, shown, write_text
from cuticle._support.progress import Progress, part
from cuticle.checking.audit import LEVEL, SAMPLES, Audit, audit
from cuticle.checking.compare_audits import Comparison, compare_audits
from cuticle.checking.sample_file import Dump, audit_dump
from cuticle.checking.shared_library import LibrarySampler
from cuticle.checking.verdicts import EXIT_CODES, LIMITS
from cuticle.cli.tables import RESULTS, ess_text, table, verdict_table
from cuticle.cli.terminal import JsonOption, ParametersArgument, out, prints_to_stderr, progress_bar, refuse_idle
from cuticle.report.audit_page import write_audit_page
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import with_strands
from cuticle.scattering.by_name import MITSUBA, model_of, read_model, read_parameters
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.frames import DEFAULT_FRAME, FRAMES
from cuticle.scattering.from_mitsuba import from_mitsuba

PLUGIN, SAMPLER, DUMP, CHIANG = "a plugin", "a sampler's file", "a file of samples", "a .toml with [chiang]"
LIBRARY = "a shared library"
_IDLE = {  # options that do nothing with each
    PLUGIN: ("strands", "frame"),
    SAMPLER: ("h", "variant", "frame"),
    DUMP: ("h", "theta_r", "strands", "samples", "variant", "reciprocity", "energy", "frame"),
    CHIANG: ("strands", "variant", "frame"),
    LIBRARY: ("h", "strands", "variant"),
}
_ENDINGS = {".npz": DUMP, ".csv": DUMP, ".toml": CHIANG, ".so": LIBRARY, ".dylib": LIBRARY, ".dll": LIBRARY}


def _target(text: str) -> tuple[str, list[str]]:
    """Return a target's name, and a plugin's parameters that stand with it in quotation marks."""
    name, *parameters = text.split() if text.startswith(MITSUBA) else [text]
    return name, parameters


def _kind(source: str) -> str:
    if source.startswith(MITSUBA):
        return PLUGIN
    path = Path(source)
    return LIBRARY if ".so." in path.name else _ENDINGS.get(path.suffix.lower(), SAMPLER)  # libmine.so.1


class _Asked(NamedTuple):
    """Options that say how a target is loaded."""

    h: float
    strands: float | None
    variant: str
    frame: str


def command(
    ctx: typer.Context,
    source: Annotated[
        str,
        typer.Argument(
            metavar="TARGET",
            help="mitsuba:PLUGIN, a sampler's file or folder, a TOML file with a table named chiang, a shared library (.so,"
            " .dylib, .dll) with the functions of cuticle/audit.h, or a file of samples (.npz, .csv).",
        ),
    ],
    parameters: ParametersArgument = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for audit.json, audit.html and audit.png.")
    ] = None,
    compare: Annotated[
        str | None,
        typer.Option(
            metavar="TARGET", help="Another target, to set TARGET beside; a plugin with parameters in quotation marks."
        ),
    ] = None,
    h: Annotated[float, typer.Option("--h", help="Offset across the fibre, -1 to 1, for a plugin or Chiang's model.")] = 0.0,
    theta_r: Annotated[
        str | None, typer.Option("--theta-r", metavar="T,T,…", help="Viewers, degrees; default ±{0, 30, 60, 75, 85}.")
    ] = None,
    strands: Annotated[float | None, typer.Option(help="Strand count of a sampler; default: its first.")] = None,
    frame: Annotated[
        str, typer.Option(metavar="FRAME", help=f"Frame of a library's directions: {' | '.join(FRAMES)}.")
    ] = DEFAULT_FRAME,
    samples: Annotated[int, typer.Option(help="Samples per viewer.")] = SAMPLES,
    level: Annotated[float, typer.Option(help="False-positive rate of the whole audit.")] = LEVEL,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 1,
    variant: Annotated[str, typer.Option(help="Mitsuba's variant; llvm_ad_rgb is faster and needs LLVM.")] = "scalar_rgb",
    reciprocity: Annotated[bool, typer.Option("--reciprocity", help="Also test that f is reciprocal.")] = False,
    energy: Annotated[bool, typer.Option("--energy", help="Also test that ∫ f cos is at most 1.")] = False,
    json_output: JsonOption = False,
) -> None:
    """Audit any sampler: do its samples follow its pdf? Exit code 1 if a verdict fails, 3 if one is inconclusive."""
    first = [] if compare is None else [_target(compare)]
    source, given = _target(source)
    targets = [*first, (source, [*given, *(parameters or [])])]
    for name, given in targets:
        if given and not name.startswith(MITSUBA):
            raise ValueError(f"key=value parameters go with {MITSUBA}PLUGIN, got {given[0]!r} with {name!r}")
    kinds = [_kind(name) for name, _ in targets]
    if compare is not None and DUMP in kinds:
        raise ValueError(f"--compare sets samplers side by side, viewer by viewer: a file of samples has no pdf between its"
                         f" rows; got {targets[kinds.index(DUMP)][0]!r}")  # fmt: skip
    idle = set(_IDLE[kinds[0]]).intersection(*(_IDLE[kind] for kind in kinds[1:]))
    refuse_idle(ctx, f"for {' and '.join(dict.fromkeys(kinds))}", *sorted(idle))
    validate.number("--h", h, -1, 1)
    validate.choice("--frame", frame, FRAMES)
    validate.integer("--samples", samples, *LIMITS["samples"])
    validate.number("--level", level, *LIMITS["level"])
    validate.integer("--seed", seed, *LIMITS["seed"])
    angles = None if theta_r is None else _angles(theta_r)
    if output is not None:
        check_directory(output)
    made: Audit | Dump | Comparison
    if kinds == [DUMP]:
        made = audit_dump(source, level=level, seed=seed)
    else:
        options: dict[str, Any] = {"theta_r": angles, "samples": samples, "level": level, "seed": seed}
        options |= {"reciprocity": reciprocity, "energy": energy}
        asked = _Asked(h, strands, variant, frame)
        works = [
            partial(apart, partial(_audited_library, name, asked, options), name=name)
            if kind == LIBRARY
            else _prepared(name, given, asked, options)
            for kind, (name, given) in zip(kinds, targets, strict=True)
        ]
        with prints_to_stderr() if LIBRARY in kinds else nullcontext(), progress_bar(json_output) as progress:
            share = 1 / len(works)
            audits = [work(part(progress, i * share, share)) for i, work in enumerate(works)]
        made = audits[0] if compare is None else compare_audits(*audits)
    written = [] if output is None else _write(made, output)
    if json_output:
        print(made.to_json(), end="")
    else:
        for part_made in (made.first, made.second) if isinstance(made, Comparison) else (made,):
            _print(part_made)
        if isinstance(made, Comparison):
            out.print(_side_by_side(made))
        if written:
            out.print(f"wrote {', '.join(map(str, written))}", soft_wrap=True)
    raise typer.Exit(EXIT_CODES[made.outcome])


def _prepared(source: str, given: list[str], asked: _Asked, options: dict[str, Any]) -> Callable[[Progress], Audit]:
    """Return what audits a target, which is loaded now."""
    sampler, own, note = _load(source, given, asked)
    if not callable(own.get("eval", getattr(sampler, "eval", None))):
        for name in ("reciprocity", "energy"):
            if options[name]:
                raise ValueError(f"--{name} does nothing for a sampler without its scattering function: leave it out")

    def work(progress: Progress) -> Audit:
        made = audit(sampler, progress=progress, **options, **own)
        return made if note is None else replace(made, notes=(*made.notes, note))

    return work


def _audited_library(source: str, asked: _Asked, options: dict[str, Any], progress: Progress) -> Audit:
    return _prepared(source, [], asked, options)(progress)


def _write(made: Audit | Dump | Comparison, output: Path) -> list[Path]:
    """Write the numbers, the page and the pictures into a folder, all or none; return their paths."""
    with filling(output) as folder:
        write_text(folder / "audit.json", made.to_json())
        write_audit_page(folder / "audit.html", made)
        if isinstance(made, Comparison):
            made.first.figure(folder / "first.png")
            made.second.figure(folder / "second.png")
        elif isinstance(made, Audit):
            made.figure(folder / "audit.png")
        return [output / file.name for file in sorted(folder.iterdir())]


def _load(source: str, parameters: list[str], asked: _Asked) -> tuple[Any, dict[str, Any], str | None]:
    """Return the sampler that `source` names, the other arguments that `audit` needs, and what the user should know."""
    h, strands = asked.h, asked.strands
    if _kind(source) == LIBRARY:
        return LibrarySampler(source, frame=asked.frame), {"name": shown(source)}, None
    if source.startswith(MITSUBA):
        _set_variant(asked.variant)
        given = read_parameters(parameters)
        words = " ".join([source[len(MITSUBA) :], *parameters])
        return from_mitsuba(source[len(MITSUBA) :], h=h, **given), {"name": f"Mitsuba's {words}, h = {h:g}"}, None
    path = Path(source)
    if path.is_dir() or path.suffix.lower() == ".json":
        sampler = Sampler.load(path)
        n = strands if strands is not None else sampler.strands[0]
        own: dict[str, Any] = {"strands": n, "name": f"{shown(path)}, {n:g} strands"}
        try:
            model = model_of(sampler)
        except ValueError as error:  # its pdf can be audited all the same
            return sampler, own, f"not tested against its scattering function: {str(error).partition(';')[0]}"
        return sampler, own | {"eval": with_strands(model, n).eval}, None
    chiang = read_model(source) if path.suffix.lower() == ".toml" else None
    if isinstance(chiang, Chiang):
        return chiang.near(h), {"name": f"{shown(source)}, h = {h:g}"}, None
    raise ValueError(
        f"an audit needs {MITSUBA}PLUGIN, a sampler's .json or its folder, a .toml with [chiang], a shared library"
        f" (.so, .dylib, .dll), or samples in an .npz or .csv file; got {source!r}"
    )


def _set_variant(variant: str) -> None:
    import mitsuba as mi

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
    out.print(RESULTS[made.outcome], f"(false-positive rate: one audit in {1 / made.level:,.0f})")


def _side_by_side(made: Comparison) -> Table:
    far = made.farthest
    listing = table(
        f"{made.first.name} and {made.second.name}",
        f"farthest apart at theta_r {np.degrees(far.theta_r):.3g}°, {far.where}: {100 * far.shares[0]:.3g} % of the first"
        f" pdf, {100 * far.shares[1]:.3g} % of the second",
    )
    columns = "theta_r|ESS, first|second|largest weight, first|second|∫ f cos, first|second|TV of the pdfs"
    for column in columns.split("|"):
        listing.add_column(column, justify="right")
    for v in made.viewers:
        cells = [*(f"{x:.3f}" for x in v.ess), *(f"{x:.3g}" for x in v.largest_weight), *(f"{x:.4g}" for x in v.energy)]
        listing.add_row(f"{np.degrees(v.theta_r):.3g}°", *(c.replace("nan", "–") for c in cells), f"{v.distance:.3f}")
    return listing


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
