"""Work in a process of its own: a crash there, or a call of exit, is an error here and no end."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
from collections.abc import Callable
from typing import Any, TypeVar

from cuticle._support.progress import Progress

T = TypeVar("T")


def apart(work: Callable[[Progress], T], progress: Progress, name: str) -> T:
    """Return what `work` returns, or raise what it raises, in a process of its own; all of it must pickle.

    Raises
    ------
    ValueError
        That process ended without either; `name` is what ended it.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_work, args=(work, there), daemon=True)
    child.start()
    there.close()
    try:
        while (message := here.recv())[0] == "progress":
            progress(*message[1:])
    except EOFError:
        child.join()
        code = child.exitcode or 0
        how = f"it was stopped by {signal.Signals(-code).name}" if code < 0 else f"it called exit({code})"
        raise ValueError(f"{name} ended before the work did: {how}") from None
    finally:
        child.kill()
        child.join()
    kind, found = message
    if kind == "error":
        raise found
    return found


def _work(work: Callable[[Progress], Any], there: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other process ends this one
    try:
        message = "result", work(lambda phase, fraction: there.send(("progress", phase, fraction)))
    except Exception as error:
        message = "error", error
    ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)  # what C still holds
    there.send(message)
