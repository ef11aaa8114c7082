"""What names mean while a declaration is read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NoReturn

from cuticle.export.formulas import syntax as cpp
from cuticle.export.formulas.syntax import SubsetError
from cuticle.export.formulas.tree import Node, Type


@dataclass(frozen=True)
class Listed:
    """A constant array's items, which a polynomial takes."""

    items: tuple[Node, ...]


@dataclass
class Scope:
    """What names mean while a declaration is read."""

    owner: str
    scope: str
    types: dict[str, Type] = field(default_factory=dict)
    values: dict[str, Node | Listed] = field(default_factory=dict)
    result: Type | None = None
    printed: set[str] = field(default_factory=set)  # what the block declares

    def inner(self) -> Scope:
        """Return the scope of a block within."""
        return Scope(self.owner, self.scope, dict(self.types), dict(self.values), self.result)

    def refuse(self, why: str) -> NoReturn:
        """Raise SubsetError."""
        raise SubsetError(f"{self.owner}: {why}")


def words(value: Any) -> str:
    """An expression as it was written, near enough to find it."""
    if isinstance(value, cpp.Number):
        return value.text
    if isinstance(value, cpp.Name):
        inner = "" if value.arguments is None else f"<{', '.join(map(words, value.arguments))}>"
        return value.path + inner + (f"::{value.member}" if value.member else "")
    if isinstance(value, cpp.Call):
        inner = ", ".join(map(words, value.arguments))
        return f"{{{inner}}}" if value.function is None else f"{words(value.function)}({inner})"
    if isinstance(value, cpp.Member):
        return f"{words(value.of)}.{value.name}"
    if isinstance(value, cpp.Index):
        return f"{words(value.of)}[{words(value.index)}]"
    if len(value.operands) == 1:
        return value.symbol + words(value.operands[0])
    if value.symbol == "?":
        a, b, c = map(words, value.operands)
        return f"{a} ? {b} : {c}"
    return f"{words(value.operands[0])} {value.symbol} {words(value.operands[1])}"
