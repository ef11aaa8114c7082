"""`cuticle document`: the draft description, recomputed for any fibre."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from cuticle._support.files import check_directory, filling, shown
from cuticle.cli.tables import document_tables
from cuticle.cli.terminal import JsonOption, ModelArgument, ParametersArgument, out, progress_bar
from cuticle.draft.document import Document, document
from cuticle.draft.printed import Printed
from cuticle.scattering.by_name import read_model


def command(
    model: ModelArgument = "document",
    parameters: ParametersArgument = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for document.json and the figures (SVG and PNG)."),
    ] = None,
    printed: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder with the draft's table1.csv, table2.csv and table3.csv, to compare with."),
    ] = None,
    json_output: JsonOption = False,
) -> None:
    """Recompute the draft description for any fibre: its tables, functions, figures and claims."""
    with progress_bar(json_output) as progress:
        parsed = read_model(model, parameters or (), progress=progress)
    tables = Printed.load(printed) if printed is not None else Printed.find() if model == "document" else None
    if output is not None:
        check_directory(output)
    with progress_bar(json_output) as progress:
        result = document(parsed, printed=tables, name=shown(Path(model).stem), progress=progress)
        if output is not None:
            with filling(output) as folder:
                result.save(folder, progress=progress)
    if json_output:
        print(json.dumps(result.to_dict(), indent=2, allow_nan=False))
        return
    _tell_document(result)
    if model == "document" and tables is None:
        out.print(
            "To compare with the draft's printed tables, name their folder: --printed DIR, or $CUTICLE_DATA.", soft_wrap=True
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
