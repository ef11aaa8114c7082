"""The command line: one module per command, imported when the command is called."""

from __future__ import annotations

import importlib
import io
import json
import os
import re
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from cuticle._support.extras import needed
from cuticle._support.files import allow_large

# Kept here so that `cuticle --help` imports none of the commands; each is the first line of that command's own help.
COMMANDS = {
    "fibres": "List the published fibres and where their numbers come from.",
    "fit": "Fit a sampler to a fibre, a table of values or a Mitsuba material.",
    "check": "Check a sampler against its scattering function. Exit code 1 if a verdict fails.",
    "document": "Recompute the draft description for any fibre: its tables, functions, figures and claims.",
    "report": "Write one self-contained HTML page from the results of fit, check and document in a folder.",
    "render": "Render a groom with Mitsuba: `cuticle render GROOM -o picture.png`, with the options of `picture`.",
    "export": "Write a sampler or a family as one file for a renderer or shading language; a sampler also as JSON or HTML.",
    "reference": "Values of the scattering functions with proven errors; `check` says what is wrong with someone's.",
    "audit": "Audit any sampler: do its samples follow its pdf? Exit code 1 if a verdict fails, 3 if one is inconclusive.",
}
HIDDEN = ("demo",)
READ_NO_FILE = ("demo", "fibres")
_LOOK: dict[str, Any] = {"add_completion": False, "pretty_exceptions_enable": False}


class _OnDemand(TyperGroup):
    """A group that imports a command's module only when that command is called."""

    listing = False

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in (*COMMANDS, *HIDDEN):
            return None
        if self.listing:
            return TyperCommand(cmd_name, help=COMMANDS[cmd_name])
        return load(cmd_name)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self.listing = True
        super().format_help(ctx, formatter)
        self.listing = False


def load(name: str) -> Any:
    """Return a command by name: the function `command` of its module, or its own group `app`."""
    module = importlib.import_module(f"cuticle.cli.{name}")
    if hasattr(module, "app"):
        return _with_common(typer.main.get_command(module.app))
    single = typer.Typer(**_LOOK)
    single.command(name)(module.command)
    command = typer.main.get_command(single)
    return command if name in READ_NO_FILE else _with_common(command)


def _allow_large(ctx: typer.Context, asked: bool) -> None:
    if asked:
        ctx.with_resource(allow_large())


def _common(
    large: Annotated[
        bool, typer.Option("--allow-large", help="Read files that need over 2 GB of memory.", callback=_allow_large)
    ] = False,
) -> None:
    """Hold the options that every command has which reads files."""


def _with_common(command: Any) -> Any:
    """Return a command, and those below it, with the options that all have."""
    if hasattr(command, "commands"):
        for below in command.commands.values():
            _with_common(below)
        return command
    single = typer.Typer(**_LOOK)
    single.command()(_common)
    for option in typer.main.get_command(single).params:
        option.expose_value = False  # their callbacks act
        command.params.append(option)
    return command


app = typer.Typer(
    help="Importance samplers for hair fibres: fitted to a scattering function, and proven correct.",
    cls=_OnDemand,
    no_args_is_help=True,
    **_LOOK | {"add_completion": True},
)


def _answer(option: str, text: str, module: str, name: str) -> Any:
    """An option that prints what a module has by a name, and ends."""

    def act(asked: bool) -> None:
        if asked:
            found = getattr(importlib.import_module(module), name)
            print(found() if callable(found) else found)
            raise typer.Exit

    return typer.Option(option, help=text, is_eager=True, callback=act)


_VERSION, _HEADERS = "cuticle._support.version", "cuticle.export.headers"


@app.callback()
def _options(
    version: Annotated[bool, _answer("--version", "Print the version.", _VERSION, "__version__")] = False,
    include: Annotated[bool, _answer("--include-dir", "Print the folder of C++ headers.", _HEADERS, "include_dir")] = False,
    cmake: Annotated[
        bool, _answer("--cmake-dir", "Print the folder of cuticleConfig.cmake.", _HEADERS, "cmake_dir")
    ] = False,
) -> None:
    pass


# The base of what Typer raises for a wrong command line: Click's own class, or the copy that newer Typer carries.
_UsageError: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")


def main() -> None:
    """Run the command line: bad input ends with one line and exit code 2, a failed verdict with 1, an open one with 3."""
    warnings.showwarning = _note  # type: ignore[assignment]
    _open_streams()
    with _interruption() as stopped:
        code = _run(stopped)
        if stopped() or code == 130:  # a library between may have taken it for its own, and gone on
            code = 130
            _complain("stopped", code)
    sys.exit(code)


class _Forgiving(io.FileIO):
    """A stream that goes on where its reader has seen enough, as `head` has: the work's own exit code counts.

    Any other failure of standard output is raised, once: Python writes again what is left when it ends.
    """

    lost = False

    def write(self, data: Any, /) -> int:
        try:
            return len(data) if self.lost else super().write(data)
        except OSError as error:
            self.lost = True
            if isinstance(error, BrokenPipeError) or self.fileno() == 2:
                return len(data)
            raise OSError(error.errno, error.strerror, "standard output") from None


def _open_streams() -> None:
    """Make standard output and error take any text: closed ones lose it, and what an encoding lacks is escaped."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - to the end
        elif stream is not getattr(sys, f"__{name}__"):
            continue
        elif stream.isatty():
            stream.reconfigure(errors="backslashreplace")
        else:
            raw = io.BufferedWriter(_Forgiving(stream.fileno(), "w", closefd=False))
            line = name == "stderr"
            setattr(sys, name, io.TextIOWrapper(raw, stream.encoding, "backslashreplace", line_buffering=line))


def _run(stopped: Callable[[], bool]) -> int:
    try:
        for argument in sys.argv[1:]:
            if not argument or re.fullmatch(r"--[\w-]+=", argument):  # a path of no letters would be the current folder
                raise ValueError(f"an argument is empty: {argument or repr('')}; leave it out, or give it a value")
        with needed("this command"):
            code = app(args=sys.argv[1:] or ["--help"], prog_name="cuticle", standalone_mode=False)
        sys.stdout.flush()  # a full disk says so now
        return code or 0
    except (KeyboardInterrupt, typer.Abort):
        return 130
    except Exception as error:
        if stopped():  # a library between has made another error of it
            return 130
        if isinstance(error, _UsageError):
            message = error.format_message()
            return _complain(message) if message else 2  # help was printed in its place
        if isinstance(error, (ValueError, TypeError, RuntimeError, OSError, MemoryError, ImportError)):
            return _complain(str(error) or type(error).__name__)
        raise


@contextmanager
def _interruption() -> Iterator[Callable[[], bool]]:
    """Return what says whether Ctrl-C was pressed within."""
    pressed = []

    def stop(*_: Any) -> None:
        pressed.append(True)
        raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    if before is not signal.SIG_IGN:  # as of a script's job in the background
        signal.signal(signal.SIGINT, stop)
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, before)


def _note(message: Warning | str, *_: Any) -> None:
    print(f"cuticle: {' '.join(str(message).split())}", file=sys.stderr)  # imports nothing, which Ctrl-C may have broken


def _complain(message: str, code: int = 2) -> int:
    """Print one line to standard error, and under --json an object to standard output; return the exit code."""
    line = " ".join(message.split())
    if "--json" in sys.argv[1:]:
        print(json.dumps({"error": line, "exit_code": code}))
    _note(line)
    return code
