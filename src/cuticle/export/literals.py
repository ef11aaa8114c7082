"""Numbers as they stand in source code."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike


def single(value: float, suffix: str = "f") -> str:
    """Return the shortest literal that reads back as the same single-precision number, and is not above the largest one."""
    x = np.float32(value)
    if abs(x) == np.finfo(np.float32).max:  # rounded up as 3.4028235e38, which WGSL refuses
        return f"{'-' * bool(x < 0)}3.4028234e38{suffix}"
    if x == 0:
        return f"0.{suffix or '0'}"
    plain = np.format_float_positional(x, unique=True, trim="0")
    power = np.format_float_scientific(x, unique=True, trim="-", exp_digits=1).replace("e+", "e")
    return (power if len(power) < len(plain) else plain) + suffix


def singles(values: ArrayLike, suffix: str = "f") -> list[str]:
    """Return `single` of each value, in C order."""
    distinct, where = np.unique(np.asarray(values, np.float32), return_inverse=True)
    words = [single(x, suffix) for x in distinct.tolist()]
    return [words[i] for i in where.reshape(-1)]


def wrapped(words: Iterable[str], indent: int = 4) -> str:
    """Return words with commas between, on lines of at most 125 columns."""
    lines: list[list[str]] = []
    room = 0
    for word in words:
        room -= len(word) + 2
        if room < -1 or not lines:  # no space ends a line
            lines.append([])
            room = 125 - indent - len(word) - 2
        lines[-1].append(word)
    return ",\n".join(" " * indent + ", ".join(line) for line in lines)
