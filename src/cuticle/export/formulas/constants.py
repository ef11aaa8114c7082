"""Constants of formulas: literals, and C++'s arithmetic on them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cuticle.export.formulas.tree import BOOL, DOUBLE, FLOAT, INT, Literal, Vector

_PYTHON = {"float": np.float32, "double": np.float64, "int": int, "bool": bool}
_ORDER = ("bool", "int", "float", "double")


def number(text: str) -> Literal:
    """Return a literal of C++; its digits are kept as they stand."""
    digits = text.rstrip("fF")
    if digits.isdigit() and digits == text:
        return Literal(INT, int(text), text)
    kind = FLOAT if text != digits else DOUBLE
    return Literal(kind, _PYTHON[kind.kind](digits), _tidy(digits))


def convert(x: Literal, kind: Vector) -> Literal:
    """Return a constant as another type's."""
    assert isinstance(x.type, Vector)
    value = _PYTHON[kind.kind](x.value)
    text = x.text
    if x.type.kind == "int" and kind.kind != "int":
        text = f"{int(x.value)}.0"
    return Literal(kind, value, text)


def combine(symbol: str, operands: list[Literal]) -> Literal | None:
    """Return what an operator makes of constants, in the precision that C++ uses; None where it is none of them."""
    if any(not isinstance(x.type, Vector) for x in operands):
        equal = operands[0].value == operands[1].value
        return Literal(BOOL, equal if symbol == "==" else not equal) if symbol in ("==", "!=") else None
    if symbol == "-" and len(operands) == 1:
        (x,) = operands
        return replace(x, value=-x.value, text=x.text[1:] if x.text.startswith("-") else x.text and "-" + x.text)
    if symbol == "!":
        return Literal(BOOL, not operands[0].value)
    a, b = operands
    assert isinstance(a.type, Vector)
    assert isinstance(b.type, Vector)
    kind = max(a.type.kind, b.type.kind, key=_ORDER.index)
    size = max(a.type.size, b.type.size)
    x, y = (_PYTHON[kind](v.value) for v in (a, b))
    made = _apply(symbol, x, y)
    if made is None:
        return None
    if isinstance(made, (bool, np.bool_)):
        return Literal(Vector("bool", size), bool(made))
    return Literal(Vector(kind, size), _PYTHON[kind](made))


def _apply(symbol: str, x: Any, y: Any) -> Any:
    whole = isinstance(x, int)
    made = {
        "+": lambda: x + y, "-": lambda: x - y, "*": lambda: x * y, "%": lambda: int(np.fmod(x, y)),
        "/": lambda: int(x / y) if whole else x / y, "<": lambda: x < y, ">": lambda: x > y, "<=": lambda: x <= y,
        ">=": lambda: x >= y, "==": lambda: x == y, "!=": lambda: x != y, "&&": lambda: bool(x and y),
        "||": lambda: bool(x or y),
    }.get(symbol)  # fmt: skip
    return None if made is None else made()


def _tidy(digits: str) -> str:
    """A literal's digits with a digit on either side of the point, as all languages take them."""
    mantissa, mark, power = digits.lower().partition("e")
    if mantissa.startswith("."):
        mantissa = "0" + mantissa
    if mantissa.endswith("."):
        mantissa += "0"
    if "." not in mantissa and not mark:
        mantissa += ".0"
    return mantissa + mark + power
