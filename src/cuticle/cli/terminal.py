"""What the commands share: consoles, progress bars and common arguments."""

from __future__ import annotations

import io
import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from cuticle._support import validate
from cuticle._support.files import check_file, write_text

# A pipe or a file has no width of its own: give the tables room there. No markup: a file's name may hold brackets.
out = Console(markup=False, emoji=False, width=None if sys.stdout.isatty() else 118)
err = Console(stderr=True, markup=False, emoji=False)

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]
ModelArgument = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="A preset, a TOML file with a table named fibre or chiang, a table of values (.npz, .csv), or mitsuba:PLUGIN.",
    ),
]
ParametersArgument = Annotated[
    list[str] | None, typer.Argument(metavar="KEY=VALUE…", help="Parameters of a Mitsuba plugin.", show_default=False)
]


STANDARD_OUTPUT = Path("-")


def check_output(path: Path) -> Path:
    """Return where one text is to go after checking that it can be written; `-` is standard output."""
    return path if path == STANDARD_OUTPUT else check_file(path)


def write_output(path: Path, text: str) -> None:
    """Write a text to a file, or to standard output."""
    if path == STANDARD_OUTPUT:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(encoding="utf-8", errors="backslashreplace", newline="\n")  # as in a file
        sys.stdout.write(text)
    else:
        write_text(path, text)


def was_given(ctx: typer.Context, name: str) -> bool:
    """Return whether the user gave a parameter, even if its value is the default's."""
    source = ctx.get_parameter_source(name)
    return source is not None and source.name != "DEFAULT"


def refuse_idle(ctx: typer.Context, why: str, *names: str) -> None:
    """Raise ValueError for the first of the parameters that was given, though it would do nothing."""
    for parameter in ctx.command.params:
        if parameter.name in names and was_given(ctx, parameter.name):
            raise ValueError(f"{parameter.opts[0]} does nothing {why}: leave it out")


@contextmanager
def prints_to_stderr() -> Iterator[None]:
    """Send what another process prints to standard error: standard output is the command's own."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


LONG = 20.0  # seconds: work that takes longer says so


@contextmanager
def progress_bar(quiet: bool = False) -> Iterator[Watch]:
    """Show a progress bar on a terminal, and say about how long long work takes; neither if the caller wants quiet."""
    columns = (TextColumn("{task.description:<34}", markup=False), BarColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=err, transient=True)
    # One that is not begun shows nothing; one that is disabled ends with an empty line before Rich 14.3.
    with nullcontext() if quiet or not err.is_terminal else bar:
        yield Watch(bar, quiet)


class Watch:
    """The progress of work: called with a phase and the fraction done of all."""

    def __init__(self, bar: Progress, quiet: bool) -> None:
        self._bar, self._quiet = bar, quiet
        self._task = bar.add_task("starting", total=1.0)
        self._estimate: _Estimate | None = _Estimate()

    def __call__(self, phase: str, fraction: float) -> None:
        """Show how far the work is, and estimate a phase of unknown cost."""
        self._bar.update(self._task, description=phase, completed=fraction)
        if self._estimate is not None:
            self._say(self._estimate.after(phase, fraction))

    def expect(self, seconds: float) -> None:
        """Say how long the work will take, before it begins; no phase is estimated any more."""
        self._estimate = None
        if seconds > LONG:
            self._say(f"this takes about {seconds:.0f} s")

    def _say(self, text: str) -> None:
        if text and not self._quiet:
            err.print(text, soft_wrap=True, highlight=False)


class _Estimate:
    """How long a phase of unknown cost will take, once, after its first two seconds and if that is over 20 s.

    A phase is known by what its description says before its first number, comma or colon.
    """

    def __init__(self) -> None:
        self.kind, self.began, self.before, self.told = "", 0.0, 0.0, False

    def after(self, phase: str, fraction: float) -> str:
        """Return the sentence, or "" where there is nothing to say."""
        kind, now = re.split(r"[\d,:]", phase)[0].rstrip(" ±+-"), time.monotonic()
        if kind != self.kind:
            self.kind, self.began, self.before, self.told = kind, now, fraction, False
        took, done = now - self.began, fraction - self.before
        if self.told or took < 2 or done <= 0:
            return ""
        left = took / done * (1 - fraction)
        self.told = True
        return f"{kind}: about {left:.0f} s more" if took + left > LONG else ""


def read_strands(text: str) -> tuple[float, ...]:
    """Return strand counts from text such as 0,1,2,4,8."""
    try:
        counts = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"--strands must be numbers with commas between, such as 0,1,2,4,8; got {text!r}") from None
    return validate.strand_counts("--strands", counts)
