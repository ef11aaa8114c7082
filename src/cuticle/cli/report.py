"""`cuticle report`: one page from a folder of results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cuticle.cli.terminal import out
from cuticle.report.page import write_report


def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with the results of fit, check and document.")],
) -> None:
    """Write one self-contained HTML page from the results of fit, check and document in a folder."""
    out.print(f"wrote {write_report(folder)}", soft_wrap=True)
