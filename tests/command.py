"""The command line as tests call it."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import warnings
from pathlib import Path
from unittest import mock

from cuticle.cli import app, terminal


def run(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """In this process, which has imported already what the program imports each time. An exception is what it is."""
    out, err, before = io.StringIO(), io.StringIO(), Path.cwd()
    code: int | str | None = 0
    with (
        contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings(),
        mock.patch.object(sys, "argv", ["cuticle", *arguments]), mock.patch.object(terminal.out, "_width", 118),
    ):  # fmt: skip
        warnings.simplefilter("default")
        os.chdir(cwd or before)
        try:
            app.main()
        except SystemExit as end:
            code = end.code
        finally:
            os.chdir(before)
    assert isinstance(code, int)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def run_program(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """As a program of its own: what sets a variant of Mitsuba, and whatever tells how the program starts and ends."""
    command = [sys.executable, "-m", "cuticle", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=cwd, check=False)


def refused(*arguments: str, words: str, cwd: Path) -> None:
    """One line that says so, exit code 2, and nothing written."""
    before = sorted(cwd.rglob("*"))
    done = run(*arguments, cwd=cwd)
    assert done.returncode == 2, done
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(cwd.rglob("*")) == before  # nothing written
