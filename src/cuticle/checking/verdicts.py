"""What a check or an audit says: claims that hold or do not, with numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from cuticle._support.plain_values import plain


@dataclass(frozen=True)
class Verdict:
    """One claim, whether it holds, the worst value found, its limit and where."""

    name: str
    passed: bool
    value: float
    limit: float
    where: str
    meaning: str


class Judged:
    """What has verdicts: whether all hold, all of it as plain values, and in words."""

    verdicts: tuple[Verdict, ...]

    @property
    def ok(self) -> bool:
        """Whether every verdict holds."""
        return all(v.passed for v in self.verdicts)

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain values that JSON can hold (NaN as None)."""
        return plain({"ok": self.ok, **asdict(self)})  # type: ignore[call-overload]

    def _told(self, about: str) -> str:
        lines = [f"{type(self).__name__}({'ok' if self.ok else 'FAILED'}: {about})"]
        lines += [
            f"  {'pass' if v.passed else 'FAIL'}  {v.name}: {v.value:.4g} (limit {v.limit:.4g}) {v.where}"
            for v in self.verdicts
        ]
        return "\n".join([*lines, *(f"  note  {n}" for n in getattr(self, "notes", ()))])
