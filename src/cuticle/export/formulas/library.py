"""The declarations of the core's headers, found by name and parsed when they are asked for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from cuticle.export.formulas.parser import Parser
from cuticle.export.formulas.syntax import Declaration, Struct, SubsetError, Token, tokens

# Of headers that are not read: what each means in a shader, `Instances` and `Expressions` know.
_TEMPLATES = frozenset(
    (
        "scalar_t", "ArrayTraits", "numeric_limits", "is_same_v", "is_arithmetic_v", "Abreast", "abreast", "sum_abreast",
        "Several",
    )
)  # fmt: skip


@dataclass(frozen=True)
class Found:
    """A declaration's tokens, and where it stands; `kind` is struct, enum, alias, or value for
    functions and constants.
    """

    kind: str
    scope: str
    name: str
    comment: str
    stream: tuple[Token, ...]


@dataclass
class Library:
    """All that some texts declare, in their order."""

    found: dict[str, list[Found]] = field(default_factory=dict)
    templates: frozenset[str] = frozenset()
    members: dict[str, Found] = field(default_factory=dict)
    parsed: dict[int, Declaration] = field(default_factory=dict)

    @staticmethod
    def of(texts: Iterable[str]) -> Library:
        """Return the declarations of headers."""
        library = Library()
        for text in texts:
            library.add(text)
        return library

    def copy(self) -> Library:
        """Return the same declarations, to which others may be added."""
        return Library({k: list(v) for k, v in self.found.items()}, self.templates, dict(self.members), dict(self.parsed))

    def add(self, text: str) -> list[Found]:
        """Add a text's declarations; return them."""
        added = list(_declarations(tokens(text)))
        for one in added:
            self.found.setdefault(one.name, []).append(one)
            if one.stream[0].text == "template":
                self.templates |= {one.name}
            if one.kind == "enum":
                for token in one.stream:
                    if token.kind == "name" and token.text not in ("enum", "class", one.name):
                        self.members.setdefault(token.text, one)
        return added

    def find(self, path: str, scope: str) -> list[Found]:
        """Return what a name may mean within a scope, innermost first."""
        name = path.rsplit("::", 1)[-1]
        given = path[: -len(name) - 2] if "::" in path else ""
        candidates = self.found.get(name, [])
        around = scope.split("::") if scope else []
        for depth in range(len(around), -1, -1):
            full = "::".join(part for part in ("::".join(around[:depth]), given) if part)
            inside = [c for c in candidates if c.scope == full]
            if inside:
                return inside
        return []

    def fields(self, path: str) -> tuple[str, ...]:
        """Return the names of a struct's fields."""
        declared = [self.parse(one) for one in self.find(path, "")]
        return tuple(f.name for d in declared if isinstance(d, Struct) for f in d.fields)

    def parse(self, one: Found) -> Declaration:
        """Return a declaration's tree.

        Raises
        ------
        SubsetError
            It uses what is not in the subset.
        """
        key = id(one)
        if key not in self.parsed:
            directive = next((t for t in one.stream if t.kind == "directive"), None)
            if directive is not None:
                raise SubsetError(f"{one.name}: {directive.text.strip()!r} is outside the subset (line {directive.line})")
            known = self.templates | _TEMPLATES
            self.parsed[key] = Parser(list(one.stream), one.scope, one.name, known, one.comment).declaration()
        return self.parsed[key]


def _declarations(stream: list[Token]) -> Iterable[Found]:
    """Take a text apart, at the level of namespaces."""
    scopes: list[str] = []
    comment, at = "", 0
    while at < len(stream):
        token = stream[at]
        if token.kind == "comment":
            comment = token.text
        elif token.text == "namespace":
            named = stream[at + 1].kind == "name"
            scopes.append(stream[at + 1].text if named else "")
            at += 2 if named else 1
            comment = ""
        elif token.text == "}" and scopes:
            scopes.pop()
        elif token.kind != "directive" and token.text not in (";", "}"):
            end = _end_of(stream, at)
            kind, name = _kind_and_name(stream[at:end])
            if name:
                scope = "::".join(s for s in scopes if s and s != "cuticle")
                found = Found(kind, scope, name, comment, tuple(stream[at:end]))
                yield found
                if kind == "struct":
                    yield from _members(found)
            comment, at = "", end
            continue
        else:
            comment = ""
        at += 1


def _members(struct: Found) -> Iterable[Found]:
    """What a struct declares within, as in a namespace of its name: static functions, constants, other structs."""
    first = next((i for i, t in enumerate(struct.stream) if t.text == "{"), None)
    if first is None:
        return
    scope = f"{struct.scope}::{struct.name}" if struct.scope else struct.name
    for found in _declarations(list(struct.stream[first + 1 : -1])):
        yield replace(found, scope=f"{scope}::{found.scope}" if found.scope else scope)


def _end_of(stream: list[Token], at: int) -> int:
    """Where the declaration that begins at a token ends: past its semicolon, or past a function's body."""
    depth = 0
    while at < len(stream):
        text = stream[at].text if stream[at].kind == "mark" else ""
        at += 1
        depth += (text in ("{", "(")) - (text in ("}", ")"))
        if depth == 0 and text == ";":
            return at
        if depth == 0 and text == "}":
            return at + 1 if at < len(stream) and stream[at].text == ";" else at
    return at


def _kind_and_name(stream: list[Token]) -> tuple[str, str]:
    """What a declaration is, and the name that it gives; no name where it is of no kind that formulas know."""
    at = 0
    if stream[0].text == "template":
        at, depth = 1, 0
        while True:
            depth += (stream[at].text == "<") - (stream[at].text == ">")
            at += 1
            if depth == 0:
                break
    first = stream[at].text
    if first == "using" and at:
        return "alias", stream[at + 1].text
    if first in ("struct", "enum"):
        names = [t.text for t in stream[at + 1 : at + 3] if t.kind == "name" and t.text != "class"]
        return first, names[0] if names else "(an enum without a name)"
    if first not in ("using", "static_assert", "friend", "typedef", "class"):
        depth, before = 0, None
        for token in stream[at:]:
            if depth == 0 and token.text in ("(", "=", "{"):
                return "value", before.text if before is not None and before.kind == "name" else ""
            depth += (token.text == "<") - (token.text == ">")
            before = token
    return "", ""
