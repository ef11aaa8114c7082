"""How long work tells how far it is."""

from collections.abc import Callable

Progress = Callable[[str, float], None]  # called with a phase and a fraction from 0 to 1
