"""The subset of C++ that formulas are written in: its tokens and its tree.

Whatever lies outside the subset raises `SubsetError`, which names the declaration, the line and the token: a formula is
printed right or not at all.
"""

from __future__ import annotations

import re
from dataclasses import dataclass


class SubsetError(ValueError):
    """What a formula uses is not in the subset."""


@dataclass(frozen=True)
class Token:
    """A token: `kind` is name, number, mark, comment (lines above a declaration), directive or end."""

    kind: str
    text: str
    line: int


_TOKEN = re.compile(
    r"(?P<comment>(?:^[ \t]*//[^\n]*\n)+)|(?P<directive>^[ \t]*#(?:[^\n\\]|\\\n|\\.)*)|(?P<skip>[^\S\n]+|\n|//[^\n]*)"
    r"|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[fF]?)|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<mark>::|<<=|>>=|<<|<=|>=|==|!=|&&|\|\||\+\+|--|[-+*/%]=|->|\.\.\.|[-+*/%<>=!&|^~?:;,.(){}\[\]\"'])",
    re.MULTILINE,
)


def tokens(text: str) -> list[Token]:
    """Return the tokens of a text; `>>` is two of them, as templates want it."""
    out, at, line = [], 0, 1
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            out.append(Token("mark", text[at], line))
            at += 1
            continue
        kind, word = str(found.lastgroup), found.group()
        if kind != "skip":
            out.append(Token(kind, re.sub(r"^[ \t]+", "", word, flags=re.MULTILINE), line))
        line += word.count("\n")
        at = found.end()
    return out


# ---- The tree. Expressions, types, statements, declarations. ----


@dataclass(frozen=True)
class Number:
    """A literal, as it stands."""

    text: str


@dataclass(frozen=True)
class Name:
    """A name, `math::abs`, with what stands between < and > after it, if anything does."""

    path: str
    arguments: tuple[Expr, ...] | None = None
    member: str = ""  # of a template's instance: ArrayTraits<Float>::Index


@dataclass(frozen=True)
class Call:
    """f(x, ...), a cast T(x), or, `braces`, T{x, ...} and {x, ...}; `function` is None for the last."""

    function: Expr | None
    arguments: tuple[Expr, ...]
    braces: bool = False


@dataclass(frozen=True)
class Member:
    """x.name."""

    of: Expr
    name: str


@dataclass(frozen=True)
class Index:
    """x[i]."""

    of: Expr
    index: Expr


@dataclass(frozen=True)
class Operator:
    """-x, !x, a + b, a < b, a ? b : c ("?")."""

    symbol: str
    operands: tuple[Expr, ...]


Expr = Number | Name | Call | Member | Index | Operator


@dataclass(frozen=True)
class Variable:
    """A declaration. `length`: an array's, 0 for its list's, None for no array; `width`: of each array in an array;
    `changes`: a reference or an array to write to.
    """

    type: Name
    name: str
    value: Expr | None = None
    length: Expr | int | None = None
    width: Expr | int | None = None
    constant: bool = False
    changes: bool = False


@dataclass(frozen=True)
class Assign:
    """target = value, and +=, -=, *=, /=."""

    target: Expr
    symbol: str
    value: Expr


@dataclass(frozen=True)
class If:
    """if (condition) then else otherwise; `constant` is if constexpr."""

    condition: Expr
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]
    constant: bool


@dataclass(frozen=True)
class For:
    """for (int name = start; name < end; name += step)."""

    name: str
    start: Expr
    end: Expr
    step: Expr
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Return:
    """return value."""

    value: Expr


@dataclass(frozen=True)
class Using:
    """using name = type."""

    name: str
    type: Name


Statement = Variable | Assign | If | For | Return | Using


@dataclass(frozen=True)
class Parameter:
    """A template's parameter: `kind` is "class" or the type of a value."""

    kind: str
    name: str
    value: Expr | None


@dataclass(frozen=True)
class Function:
    """A function, or a template of one; `constant` is constexpr."""

    scope: str
    name: str
    comment: str
    template: tuple[Parameter, ...]
    result: Name
    parameters: tuple[Variable, ...]
    body: tuple[Statement, ...]
    constant: bool = False


@dataclass(frozen=True)
class Struct:
    """A struct's fields, or those of a template of one; one without fields is a family of functions."""

    scope: str
    name: str
    comment: str
    template: tuple[Parameter, ...]
    fields: tuple[Variable, ...]


@dataclass(frozen=True)
class Constant:
    """A constant of a namespace, or a template of one."""

    scope: str
    name: str
    comment: str
    template: tuple[Parameter, ...]
    type: Name
    value: Expr


@dataclass(frozen=True)
class Enumeration:
    """An enum; `members` in order from 0."""

    scope: str
    name: str
    members: tuple[str, ...]


@dataclass(frozen=True)
class Alias:
    """template <...> using name = type."""

    scope: str
    name: str
    template: tuple[Parameter, ...]
    type: Name


Declaration = Function | Struct | Constant | Enumeration | Alias
