"""Formulas with their types known and what is constant worked out: what a language's printer is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Vector:
    """A number, or 2 to 4 side by side: `kind` is float, int, bool, or double, of which constants alone are."""

    kind: str
    size: int = 1


@dataclass(frozen=True)
class Record:
    """A struct's instance, under the name it is printed by."""

    name: str
    fields: tuple[tuple[str, Type], ...]
    comment: str = ""

    def field(self, name: str) -> Type | None:
        """Return a field's type."""
        return dict(self.fields).get(name)


@dataclass(frozen=True)
class Array:
    """`length` of a type; arrays in an array are printed as one, the last index fastest."""

    of: Type
    length: int


@dataclass(frozen=True)
class Choice:
    """An enum class: constant wherever formulas ask for it."""

    name: str


@dataclass(frozen=True)
class Traits:
    """ArrayTraits of a type."""

    of: Vector


@dataclass(frozen=True)
class Family:
    """A struct without fields: functions that a template's parameter names."""

    name: str


Type = Vector | Record | Array | Choice | Traits | Family
FLOAT, INT, BOOL, DOUBLE = Vector("float"), Vector("int"), Vector("bool"), Vector("double")


@dataclass(frozen=True)
class Literal:
    """A constant, in every component; `text` are the digits that it stands in, where it stands anywhere."""

    type: Type
    value: Any
    text: str = ""


@dataclass(frozen=True)
class Local:
    """A variable."""

    type: Type
    name: str


@dataclass(frozen=True)
class Field:
    """A struct's field, or components of a vector."""

    type: Type
    of: Node
    name: str


@dataclass(frozen=True)
class Element:
    """One of an array."""

    type: Type
    of: Node
    index: Node


@dataclass(frozen=True)
class Operation:
    """An operator on numbers or vectors; "?" chooses component by component."""

    type: Type
    symbol: str
    operands: tuple[Node, ...]


@dataclass(frozen=True)
class Intrinsic:
    """A function that every language has, by its name in the headers."""

    type: Type
    name: str
    operands: tuple[Node, ...]


@dataclass(frozen=True)
class Horner:
    """Σ c[i] x^i, highest degree first."""

    type: Type
    x: Node
    coefficients: tuple[Node, ...]


@dataclass(frozen=True)
class Invoke:
    """A call of another formula, or, `external`, of what the host defines."""

    type: Type
    name: str
    operands: tuple[Node, ...]
    external: bool = False


@dataclass(frozen=True)
class Make:
    """A vector, a struct or an array from its parts; a vector from one number; a number from one of another kind."""

    type: Type
    operands: tuple[Node, ...]


Node = Literal | Local | Field | Element | Operation | Intrinsic | Horner | Invoke | Make


@dataclass(frozen=True)
class Let:
    """A new variable."""

    name: str
    type: Type
    value: Node | None


@dataclass(frozen=True)
class Store:
    """target = value, and +=, ..."""

    target: Node
    symbol: str
    value: Node


@dataclass(frozen=True)
class When:
    """if."""

    condition: Node
    then: tuple[Line, ...]
    otherwise: tuple[Line, ...]


@dataclass(frozen=True)
class Count:
    """for (int name = start; name < end; ++name)."""

    name: str
    start: Node
    end: Node
    body: tuple[Line, ...]


@dataclass(frozen=True)
class Give:
    """return."""

    value: Node


@dataclass(frozen=True)
class Block:
    """{ ... }, with variables of its own."""

    body: tuple[Line, ...]


Line = Let | Store | When | Count | Give | Block


@dataclass(frozen=True)
class Instance:
    """A function for known types, under the name it is printed by; parameters with whether they are written to."""

    name: str
    result: Type
    parameters: tuple[tuple[str, Type, bool], ...]
    body: tuple[Line, ...]
    comment: str = ""


_TYPES = (Vector, Record, Array, Choice, Traits, Family)


def names_in(part: Any) -> set[str]:
    """Return the variables that a node, a line or several of them name."""
    if isinstance(part, Local):
        return {part.name}
    if isinstance(part, tuple):
        return set().union(*map(names_in, part)) if part else set()
    if hasattr(part, "__dataclass_fields__") and not isinstance(
        part, (Literal, Vector, Record, Array, Choice, Traits, Family)
    ):
        return set().union(*(names_in(getattr(part, name)) for name in part.__dataclass_fields__))
    return set()


def without_unused(lines: tuple[Line, ...], later: set[str] | None = None) -> tuple[Line, ...]:
    """Return lines without the variables that nothing after them names."""
    used, out = set(later or ()), []
    for line in reversed(lines):
        if isinstance(line, Let) and line.name not in used:
            continue
        if isinstance(line, When):
            line = When(line.condition, without_unused(line.then, used), without_unused(line.otherwise, used))
        elif isinstance(line, Block):
            line = Block(without_unused(line.body, used))
        elif isinstance(line, Count):
            line = Count(line.name, line.start, line.end, without_unused(line.body, used | names_in(line.body)))
        used |= names_in(line)
        out.append(line)
    return tuple(reversed(out))
