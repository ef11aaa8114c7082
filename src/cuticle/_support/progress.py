"""How long work tells how far it is, and how long it will take."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]  # called with a phase and a fraction from 0 to 1


def silent(phase: str, fraction: float) -> None:
    """Report nothing: the progress of work that nobody watches."""


def part(progress: Progress, start: float, share: float) -> Progress:
    """Return what reports a part of the work, which begins at `start` and is this share of all."""
    return lambda phase, fraction: progress(phase, start + share * fraction)


def expect(progress: Progress | None, seconds: float) -> None:
    """Tell how long all of the work will take, where the progress has a method `expect` that wants to know."""
    tell = getattr(progress, "expect", None)
    if tell is not None:
        tell(seconds)
