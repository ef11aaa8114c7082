"""`cuticle export`: a sampler as a file for another host."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from cuticle._support import validate
from cuticle._support.files import check_directory, check_file, make_directory, write_bytes
from cuticle.cli.terminal import STANDARD_OUTPUT, check_output, err, out, progress_bar, refuse_idle, write_output
from cuticle.export import HOSTS, MAX_TABLE, amalgamate, check_frame, check_name, export, export_family
from cuticle.export.family import family_writer
from cuticle.export.registry import Export, host
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.by_name import known_fibres, model_of, read_parameters_or_model
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.family_among import FAMILIES
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.frames import DEFAULT_FRAME, FRAMES


def command(
    ctx: typer.Context,
    sampler: Annotated[
        Path | None, typer.Argument(metavar="SAMPLER.json", help="A sampler that `cuticle fit` wrote, or its folder.")
    ] = None,
    to: Annotated[str | None, typer.Option(help=" | ".join(HOSTS))] = None,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The file to write.")] = ...,  # type: ignore[assignment]
    frame: Annotated[
        str | None,
        typer.Option(help=f"Frame of the directions: {' | '.join(FRAMES)}. Default: {DEFAULT_FRAME}.", metavar="FRAME"),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="Namespace in C++, prefix in shaders. Default: the output's name.", metavar="NAME"),
    ] = None,
    with_model: Annotated[
        bool,
        typer.Option("--with-model/--sampler-only", help="Include the scattering function: eval beside sample and pdf."),
    ] = False,
    model: Annotated[
        str | None,
        typer.Option(
            "--model", metavar="PRESET|FILE", help="The scattering function to include. Default: the sampler's own."
        ),
    ] = None,
    family: Annotated[
        str | None,
        typer.Option(
            "--family",
            metavar="FAMILY",
            help=f"Write the far field of any fibre instead of a sampler: {' | '.join(FAMILIES)}.",
        ),
    ] = None,
    among: Annotated[
        str | None,
        typer.Option(
            "--among",
            metavar="PRESET|FILE.toml",
            help="With --family dual_scattering: the mean fibre of the strands around.",
        ),
    ] = None,
    amalgamated: Annotated[
        bool, typer.Option("--amalgamate", help="Write the core's headers as one file, without a sampler.")
    ] = False,
) -> None:
    """Write a sampler or a family as one file for a renderer or shading language; a sampler also as JSON or HTML."""
    if (sampler is not None) + amalgamated + (family is not None) != 1:
        raise ValueError("give one of a sampler with --to HOST, --family FAMILY with --to HOST, and --amalgamate")
    if amalgamated:
        refuse_idle(
            ctx, "with --amalgamate, which writes the headers alone", "to", "frame", "name", "with_model", "model", "among"
        )  # fmt: skip
    elif to is None:
        raise ValueError(f"--to must say for which host: {', '.join(HOSTS)}")
    if family is not None:
        refuse_idle(ctx, "with --family, which is f and its sampler", "with_model", "model")
        family_writer(family, str(to))
        if not host(str(to)).framed:
            refuse_idle(ctx, f"with --to {to}", "frame")
    if family != "dual_scattering":
        refuse_idle(ctx, "without --family dual_scattering", "among")
    elif among is None:
        raise ValueError(f"--family dual_scattering needs --among, the mean fibre of the strands around: {known_fibres()}")
    folder = to == "pbrt" and output.suffix != ".h"  # such as src/pbrt; made when there is something to write
    if folder:
        output = check_directory(output) / f"{'fibre' if name is None else check_name(name, 'pbrt')}.h"
    if not folder or output.parent.is_dir():
        check_output(output)
    tell = err if output == STANDARD_OUTPUT else out
    if amalgamated:
        write_output(output, amalgamate())
        tell.print(f"wrote {output}: include it, no other file is needed", soft_wrap=True)
        return
    assert to is not None
    if family is None:
        _check_sampler_options(ctx, to, with_model, model)
    frame = frame or DEFAULT_FRAME
    check_frame(frame)
    name = check_name(name, to) if name is not None else _name_of(output, to)
    if family is not None:
        made = _family_export(family, to, output, frame, name, among)
    else:
        assert sampler is not None
        made = _sampler_export(sampler, to, output, frame, name, with_model, model)
    if folder:
        make_directory(output.parent)
    beside = _written(made, output)
    for line in _said(made, f"wrote {output}{beside}: {len(made.text):,} characters", family):
        tell.print(line, soft_wrap=True)
    tell.print(_lines_beside(made, name, output), end="", soft_wrap=True, highlight=False)


def _check_sampler_options(ctx: typer.Context, to: str, with_model: bool, model: str | None) -> None:
    """Refuse a host that there is not, and options that do nothing for it."""
    validate.choice("--to", to, HOSTS)
    if model is not None and not (with_model or to == "web"):
        raise ValueError("--model says which scattering function to put in: give --with-model, too")
    idle = {"name": host(to).named, "frame": host(to).framed, "with_model": host(to).model != "always"}
    refuse_idle(ctx, f"with --to {to}", *(option for option, used in idle.items() if not used))


def _family_export(family: str, to: str, output: Path, frame: str, name: str, among: str | None) -> Export:
    mean = None if among is None else _mean_fibre(among)
    if mean is not None and host(to).textured:
        _check_texture(output, f"--to {to} --family dual_scattering", f"{name}.{to}")
    return export_family(family, to, frame=frame, name=name, among=mean)


def _sampler_export(
    sampler: Path, to: str, output: Path, frame: str, name: str, with_model: bool, model: str | None
) -> Export:
    loaded = Sampler.load(sampler)
    if with_model and host(to).textured:
        _check_texture(output, f"--to {to} --with-model", f"{name}.{to}")
    if to == "web":
        from cuticle.export.hosts.web import LOBES

        others = [k for k in LOBES if k != loaded.lobes]
        err.print(
            f"the page compares this sampler with others of {', '.join(map(str, others))} lobes, which are fitted now",
            soft_wrap=True,
        )
    with progress_bar() as progress:
        function = None if model is None else model_of(loaded, model, progress=progress)
        return export(loaded, to, frame=frame, name=name, with_model=with_model, model=function, progress=progress)


def _said(made: Export, wrote: str, family: str | None) -> Iterator[str]:
    """Yield what a user is told of a text: `wrote`, with what is known of its tables."""
    if family is not None:
        tables = f", tables of {made.table_bytes:,} bytes" if family == "dual_scattering" and not made.data else ""
        yield f"{wrote}{tables}, for any fibre"
        return
    if made.table_bytes > MAX_TABLE:
        yield f"the table has {made.table_bytes:,} bytes, more than the {MAX_TABLE:,} of a small uniform block"
    yield f"{wrote}, a table of {made.table_bytes:,} bytes"
    if made.model is not None:
        error = f"{100 * made.model.error:.2g} % of ∫ f cos"
        yield f"the scattering function's tables: {made.model.size:,} bytes, within {error}"


def _texture_of(output: Path) -> Path:
    """Where the texture goes that a text reads."""
    return output.with_suffix(".f32")


def _check_texture(output: Path, asked: str, better: str) -> None:
    """Refuse an output beside which no texture can be written."""
    values = _texture_of(output)
    if output == STANDARD_OUTPUT or os.path.realpath(values).lower() == os.path.realpath(output).lower():
        raise ValueError(
            f"{asked} writes two files, a text and its texture, {values.name}: the text needs a name of its own, such as"
            f" -o {better}; got -o {output}"
        )
    check_file(values)


def _written(made: Export, output: Path) -> str:
    """Write a text and, where it reads one, its texture, both or neither; return how the second is told of."""
    values = _texture_of(output)
    before = values.read_bytes() if made.data and values.exists() else None
    if made.data:
        write_bytes(values, made.data)
    try:
        write_output(output, made.text)
    except ValueError:
        if made.data and before is None:
            values.unlink()
        elif before is not None:
            write_bytes(values, before)
        raise
    return f" and {values}, the texture it reads" if made.data else ""


def _mean_fibre(name: str) -> Fibre | Chiang:
    """Return the fibre, or Chiang's, of a preset's name or of a file."""
    found = read_parameters_or_model(name)
    if not isinstance(found, (Fibre, Chiang)):
        raise ValueError(f"--among must be a fibre, {known_fibres()}; got {name!r}, which is a {type(found).__name__}")
    return found


def _lines_beside(made: Export, name: str, output: Path) -> str:
    """What the host's own files need, with the header's name as it was written; nothing where they need nothing."""
    return made.remarks.replace(f"<pbrt/{name}.h>", f"<pbrt/{output.name}>") + "\n" if made.remarks else ""


def _name_of(output: Path, to: str) -> str:
    """The file's stem as an identifier."""
    try:
        return check_name(re.sub(r"[^A-Za-z0-9]+", "_", output.stem).strip("_"), to)
    except ValueError:
        return "fibre"
