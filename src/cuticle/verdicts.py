"""What a check or an audit says: claims that hold or do not, with numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Verdict:
    """One claim, whether it holds, the worst value found, its limit and where."""

    name: str
    passed: bool
    value: float
    limit: float
    where: str
    meaning: str


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: NumPy's numbers as Python's, NaN and infinity as None."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
