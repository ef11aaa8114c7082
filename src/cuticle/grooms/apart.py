"""Reads a file with another project's library in a process of its own, which a damaged file may crash, hang or fill."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cuticle._support.files import LARGEST, largest

_REFUSED = 3  # the process's exit status where its last line is the message
_SECONDS, _SECONDS_PER_MB = 15, 3  # a whole file takes a tenth of it; a damaged one may never end
_OWN = 4 * 10**9  # bytes of address space for libraries and their threads, which use a part of it


def read_apart(module: str, path: Path, *arguments: object) -> dict[str, NDArray]:
    """Run `python -m module path out.npz arguments…`, which calls `serve`, and return the arrays that it writes."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "groom.npz"
        command = [sys.executable, "-m", module, str(path.resolve()), str(out), str(largest() + _OWN), *map(str, arguments)]
        seconds = _SECONDS + _SECONDS_PER_MB * path.stat().st_size / 1e6
        try:
            done = subprocess.run(command, capture_output=True, check=False, timeout=seconds, cwd=folder, env=_own_modules())
        except subprocess.TimeoutExpired:
            raise ValueError(
                f"cannot read groom {path}: it is damaged (its reader did not end in {seconds:.0f} s)"
            ) from None
        lines = done.stderr.decode(errors="replace").strip().splitlines() or ["it says nothing"]
        if done.returncode == _REFUSED:
            raise ValueError(f"cannot read groom {path}: {lines[-1]}")
        if done.returncode or not out.is_file():
            raise ValueError(f"cannot read groom {path}: its reader crashed ({done.returncode}): {lines[-1][:200]}")
        with np.load(out) as found:
            return dict(found)


def serve(read: Callable[..., dict[str, NDArray]]) -> None:
    """Answer `read_apart`: write what `read(path, *arguments)` returns, or end with the reason."""
    path, out, limit, *arguments = sys.argv[1:]
    _limit_memory(int(limit))
    try:
        np.savez(out, **read(path, *arguments))  # type: ignore[arg-type]
    except MemoryError:
        reason = f"it needs over {LARGEST / 1e9:g} GB of memory; --allow-large lifts the limit"
    except Exception as error:
        reason = " ".join(str(error).split())[:300] or type(error).__name__
    else:
        return
    print(reason, file=sys.stderr)
    sys.exit(_REFUSED)


def _own_modules() -> dict[str, str]:
    """The environment, with modules found where this process finds them, whatever the current folder is."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}


def _limit_memory(size: int) -> None:
    try:
        import resource
    except ImportError:  # Windows
        return
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    if size < sys.maxsize - _OWN and (hard == resource.RLIM_INFINITY or size < hard):
        with suppress(ValueError, OSError):  # macOS has no such limit
            resource.setrlimit(resource.RLIMIT_AS, (size, hard))
