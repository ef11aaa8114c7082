"""`cuticle export`: a sampler as a file for another host."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from cuticle._support import validate
from cuticle._support.files import read_text, writable_directory, write_bytes, write_text
from cuticle.cli.terminal import out, progress_bar
from cuticle.export import HOSTS, MAX_TABLE, amalgamate, check_frame, check_name, export
from cuticle.export.frames import FRAMES
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.by_name import model_of


def command(
    sampler: Annotated[
        Path | None, typer.Argument(metavar="SAMPLER.json", help="A sampler that `cuticle fit` wrote, or its folder.")
    ] = None,
    to: Annotated[str | None, typer.Option(help=" | ".join(HOSTS))] = None,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The file to write.")] = ...,  # type: ignore[assignment]
    frame: Annotated[str, typer.Option(help=f"Frame of the directions: {' | '.join(FRAMES)}.", metavar="FRAME")] = "local-x",
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
    amalgamated: Annotated[
        bool, typer.Option("--amalgamate", help="Write the core's headers as one file, without a sampler.")
    ] = False,
) -> None:
    """Write a sampler as one file for C++, CUDA, GLSL or HLSL, as JSON, or as an interactive web page."""
    if amalgamated == (sampler is not None):
        raise ValueError("give a sampler with --to HOST, or --amalgamate without a sampler")
    if output.is_dir():
        raise ValueError(f"cannot write {output}: it is a folder; name the file")
    writable_directory(output.parent, make=False)
    if amalgamated or sampler is None:
        write_text(output, amalgamate())
        out.print(f"wrote {output}: include it, no other file is needed", soft_wrap=True)
        return
    if to is None:
        raise ValueError(f"--to must say for which host: {', '.join(HOSTS)}")
    validate.choice("--to", to, HOSTS)
    check_frame(frame)
    if model is not None and not (with_model or to == "web"):
        raise ValueError("--model says which scattering function to put in: give --with-model, too")
    name = check_name(name if name is not None else _name_of(output))
    path = sampler / "sampler.json" if sampler.is_dir() else sampler
    loaded = Sampler.from_json(read_text(path, "sampler"), source=str(path))
    with progress_bar() as progress:
        function = None if model is None else model_of(loaded, model, progress=progress)
        made = export(loaded, to, frame=frame, name=name, with_model=with_model, model=function, progress=progress)
    values = output.with_suffix(".f32")
    if made.data:
        write_bytes(values, made.data)
    try:
        write_text(output, made.text)
    except ValueError:
        if made.data:
            values.unlink()
        raise
    if made.table_bytes > MAX_TABLE:
        out.print(
            f"the table has {made.table_bytes:,} bytes, more than the {MAX_TABLE:,} of a small uniform block", soft_wrap=True
        )
    beside = f" and {values}, the texture it reads" if made.data else ""
    out.print(
        f"wrote {output}{beside}: {len(made.text):,} characters, a table of {made.table_bytes:,} bytes", soft_wrap=True
    )
    if made.model is not None:
        out.print(
            f"the scattering function's tables: {made.model.size:,} bytes, within {100 * made.model.error:.2g} % of ∫ f cos",
            soft_wrap=True,
        )


def _name_of(output: Path) -> str:
    """The file's stem as an identifier."""
    stem = re.sub(r"[^A-Za-z0-9]+", "_", output.stem).strip("_")
    return stem if re.match(r"[A-Za-z]", stem) and stem not in ("cuticle", "std", "main") else "fibre"
