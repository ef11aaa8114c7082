"""What the printers of shading languages share: the layout of declarations, statements and expressions."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from cuticle.export.formulas.syntax import SubsetError
from cuticle.export.formulas.tree import (  # fmt: skip
    INT,
    Array,
    Block,
    Choice,
    Count,
    Element,
    Field,
    Give,
    Horner,
    Instance,
    Intrinsic,
    Invoke,
    Let,
    Line,
    Literal,
    Local,
    Make,
    Node,
    Operation,
    Record,
    Store,
    Traits,
    Type,
    Vector,
    When,
)
from cuticle.export.literals import single, singles, wrapped

WIDTH = 125
_LEVEL = {
    "?": 1,
    "||": 2,
    "&&": 3,
    "==": 4,
    "!=": 4,
    "<": 5,
    ">": 5,
    "<=": 5,
    ">=": 5,
    "+": 6,
    "-": 6,
    "*": 7,
    "/": 7,
    "%": 7,
}
_SIGN, _WHOLE = 8, 9
_COMPARE = ("<", ">", "<=", ">=", "==", "!=")


class Printer:
    """Prints structs and functions in one language; what languages differ in are the methods that subclasses give.

    Parameters
    ----------
    prefix
        What the names of functions begin with; those of structs begin with it in capitals.
    """

    constant = ""  # what stands before a constant table
    closed = "}"  # what stands after an array's items
    suffix = ""  # what stands after a float's digits
    next = "++{}"  # what counts a variable up
    directives = True  # whether there is a preprocessor
    words: frozenset[str] = frozenset()  # of the language, which no variable may be called
    numbers: Mapping[str, str] = MappingProxyType(
        {}
    )  # the language's names of float, float2, ... int2, ..., where they are others
    functions: Mapping[str, str] = MappingProxyType({})  # its names of intrinsics, where they are others

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix

    # -- what languages differ in --

    def opened(self, kind: str, length: int) -> str:
        """What stands before an array's items."""
        return "{"

    def splat(self, kind: Vector, text: str) -> str:
        """A number in every component."""
        return f"{self.type(kind)}({text})"

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """A choice between the components of two vectors."""
        raise NotImplementedError

    def compared(self, symbol: str, operands: tuple[Node, ...]) -> str:
        """A comparison of vectors, component by component."""
        a, b = operands
        return f"({self.node(a, 6)} {symbol} {self.node(b, 6)})"

    def struct_from(self, kind: Record, items: list[str]) -> str | None:
        """An expression that makes a struct; None where the language has none."""
        return f"{self.type(kind)}({', '.join(items)})"

    # -- names and types --

    def variable(self, name: str) -> str:
        """A variable's name, another one where the language has that for itself."""
        return name + "_" if name in self.words else name

    def local(self, name: str) -> str:
        """The same where it is read, written to or counted."""
        return self.variable(name)

    def function(self, name: str) -> str:
        """A function's name."""
        return f"{self.prefix}_{name}"

    def named(self, x: Instance | Invoke) -> str:
        """A function's name among the headers' instances."""
        return x.name

    def type(self, kind: Type) -> str:
        """A type's name."""
        if isinstance(kind, Record):
            return f"{self.prefix.upper()}_{kind.name}"
        if isinstance(kind, Vector) and kind.kind != "double":
            plain = kind.kind + (str(kind.size) if kind.size > 1 else "")
            return self.numbers.get(plain, plain)
        raise SubsetError(f"{kind} is no type of a shader")

    def table(self, name: str, size: int, values: NDArray[np.float32]) -> str:
        """A constant array of numbers, or of vectors of them."""
        kind = self.type(Vector("float", size))
        words = singles(values, self.suffix)
        items = [f"{kind}({', '.join(words[i : i + size])})" if size > 1 else words[i] for i in range(0, len(words), size)]
        head = f"{self.constants(kind, self.function(name), len(items))} = {self.opened(kind, len(items))}"
        return f"{head}\n{wrapped(items)}\n{self.closed};"

    def constants(self, kind: str, name: str, length: int) -> str:
        """What declares a constant array."""
        return f"{self.constant} {kind} {name}[{length}]"

    def fetch(self, name: str, result: Type, text: str) -> str:
        """What `name`(i) means: an expression of i."""
        return f"#define {name}(i) {text}"

    def declared(self, kind: Type, name: str) -> str:
        """A type and a name."""
        of, length = flat(kind)
        return f"{self.type(of)} {self.variable(name)}{_brackets(length)}"

    def parameter(self, name: str, kind: Type, out: bool) -> str:
        """A function's parameter; `out`: it is written to."""
        return ("out " if out else "") + self.declared(kind, name)

    def signature(self, result: Type, name: str, parameters: Iterable[tuple[str, Type, bool]]) -> str:
        """A function's head."""
        return f"{self.type(result)} {self.function(name)}({', '.join(self.parameter(*p) for p in parameters)})"

    # -- declarations --

    def text(self, items: Iterable[Record | Instance]) -> str:
        """Return structs and functions as source code; what several instances share is said once."""
        said: set[str] = set()
        out = []
        for x in items:
            note = "" if x.comment in said else x.comment
            said.add(x.comment)
            out.append(note + (self.record(x) if isinstance(x, Record) else self.instance(x)))
        return "\n".join(out)

    def record(self, r: Record) -> str:
        """A struct, fields of one type on one line."""
        lines = []
        for kind, group in itertools.groupby(r.fields, key=lambda f: flat(f[1])[0]):
            names = [self.variable(n) + _brackets(flat(t)[1]) for n, t in group]
            lines.append(f"    {self.type(kind)} {', '.join(names)};\n")
        return f"struct {self.type(r)} {{\n{''.join(lines)}}};\n"

    def instance(self, f: Instance) -> str:
        """A function."""
        head = f"{self.signature(f.result, self.named(f), f.parameters)} {{"
        body = self.lines(f.body, f.result, 1)
        if len(body) == 1 and len(head) + len(body[0]) <= WIDTH - 2:
            return f"{head} {body[0].strip()} }}\n"
        wrapped = "\n".join(wrap(line) for line in [head, *body])
        return f"{wrapped}\n}}\n"

    # -- statements --

    def lines(self, lines: Iterable[Line], result: Type, depth: int) -> list[str]:
        """Statements, a line each, unwrapped."""
        out: list[str] = []
        tab = "    " * depth
        for line in lines:
            if isinstance(line, Let):
                value = "" if line.value is None else f" = {self.initial(line.value)}"
                out.append(f"{tab}{self.begun(line)}{value};")
            elif isinstance(line, Store) and self.in_parts(line.value):
                assert isinstance(line.value, Make)
                assert isinstance(line.value.type, Record)
                for (name, kind), part in zip(line.value.type.fields, line.value.operands, strict=True):
                    out += self.lines([Store(Field(kind, line.target, name), "=", part)], result, depth)
            elif isinstance(line, Store):
                out.append(f"{tab}{self.node(line.target)} {line.symbol} {self.node(line.value)};")
            elif isinstance(line, Give):
                out += [tab + x for x in self.given(line.value)]
            elif isinstance(line, Count):
                out += self.count(line, result, depth)
            elif isinstance(line, Block):
                out += [tab + "{", *self.lines(line.body, result, depth + 1), tab + "}"]
            else:
                out += self.when(line, result, depth)
        return out

    def begun(self, line: Let) -> str:
        """What declares a variable."""
        return self.declared(line.type, line.name)

    def count(self, line: Count, result: Type, depth: int) -> list[str]:
        """A loop."""
        tab, start, name = "    " * depth, self.node(line.start), self.local(line.name)
        begun = f"{self.begun(Let(name, INT, line.start))} = {start}"
        head = f"{tab}for ({begun}; {name} < {self.node(line.end)}; {self.next.format(name)}) {{"
        return [head, *self.lines(line.body, result, depth + 1), tab + "}"]

    def when(self, line: When, result: Type, depth: int) -> list[str]:
        """if, and else where there is one."""
        tab = "    " * depth
        out = [f"{tab}if ({self.node(line.condition)}) {{", *self.lines(line.then, result, depth + 1)]
        if line.otherwise:
            out += [tab + "} else {", *self.lines(line.otherwise, result, depth + 1)]
        return [*out, tab + "}"]

    def in_parts(self, value: Node) -> bool:
        """Whether a value is a struct that the language has no expression for."""
        return isinstance(value, Make) and isinstance(value.type, Record) and self.struct_from(value.type, []) is None

    def initial(self, value: Node) -> str:
        """What a variable begins with."""
        if isinstance(value, Make) and isinstance(value.type, Array):
            items = ", ".join(map(self.node, value.operands))
            return f"{self.opened(self.type(value.type.of), value.type.length)}{items}{self.closed}"
        if isinstance(value, Make) and self.in_parts(value):
            return f"{{ {', '.join(map(self.initial, value.operands))} }}"
        return self.node(value)

    def given(self, value: Node) -> list[str]:
        """return, by way of a variable where a struct is made and the language has no expression for that."""
        if self.in_parts(value):
            return [f"{self.type(value.type)} made = {self.initial(value)};", "return made;"]
        return [f"return {self.node(value)};"]

    # -- expressions --

    def node(self, x: Node, level: int = 0) -> str:
        """An expression; in brackets where it binds less than `level`."""
        text, own = self.bound(x)
        return f"({text})" if own < level else text

    def bound(self, x: Node) -> tuple[str, int]:
        """An expression, and how much it binds."""
        if isinstance(x, Literal):
            return self.literal(x)
        if isinstance(x, Local):
            return self.local(x.name), _WHOLE
        if isinstance(x, Field):
            name = x.name if isinstance(x.of.type, Vector) else self.variable(x.name)
            return f"{self.node(x.of, _WHOLE)}.{name}", _WHOLE
        if isinstance(x, Element):
            if isinstance(x.type, Array):
                raise SubsetError("an array of an array of them is no value of a shader")
            return f"{self.node(x.of, _WHOLE)}[{self.node(x.index)}]", _WHOLE
        if isinstance(x, Horner):
            return self.horner(x)
        if isinstance(x, Make):
            return self.make(x), _WHOLE
        if isinstance(x, Operation):
            return self.operation(x)
        return self.invoke(x) if isinstance(x, Invoke) else self.intrinsic(x), _WHOLE

    def invoke(self, x: Invoke) -> str:
        """A call."""
        name = f"{self.prefix.upper()}_{x.name.upper()}" if x.external else self.function(self.named(x))
        return f"{name}({', '.join(self.given_to(x))})"

    def given_to(self, x: Invoke) -> list[str]:
        """What a function is called with."""
        return list(map(self.node, x.operands))

    def intrinsic(self, x: Intrinsic) -> str:
        """A function that the language has."""
        if x.name == "sum":
            (of,), dot = x.operands, self.functions.get("dot", "dot")
            assert isinstance(of.type, Vector)
            return self.node(of) if of.type.size == 1 else f"{dot}({self.node(of)}, {self.splat(of.type, '1.0')})"
        name = "exp" if x.name == "decay" else x.name
        return f"{self.functions.get(name, name)}({', '.join(map(self.node, x.operands))})"

    def literal(self, x: Literal) -> tuple[str, int]:
        """A constant, in every component of its type."""
        if isinstance(x.type, Choice | Traits) or not isinstance(x.type, Vector) or x.type.kind == "double":
            raise SubsetError(f"the constant {x.value} is of no type of a shader")
        text = self.digits(x)
        if x.type.size > 1:
            return self.splat(x.type, text), _WHOLE
        return text, _SIGN if text.startswith("-") else _WHOLE

    def digits(self, x: Literal) -> str:
        """A constant as it stands in the headers, or, where it was worked out or has more digits than tell, the fewest."""
        assert isinstance(x.type, Vector)
        if x.type.kind == "bool":
            return "true" if x.value else "false"
        if x.type.kind == "int":
            return str(x.value)
        return x.text + self.suffix if x.text and len(x.text) <= 15 else single(float(x.value), self.suffix)

    def operand(self, x: Node, level: int, *, right: bool = False) -> str:
        """An operator's: a constant needs no vector there, and brackets where it is negative and on the right."""
        if isinstance(x, Literal) and isinstance(x.type, Vector) and x.type.kind == "float":
            text = self.digits(x)
            return f"({text})" if right and text.startswith("-") else text
        return self.node(x, level)

    def operation(self, x: Operation) -> tuple[str, int]:
        """An operator."""
        kinds = [o.type for o in x.operands]
        vector = any(isinstance(k, Vector) and k.size > 1 for k in kinds)
        if x.symbol == "?":
            if isinstance(x.type, Vector) and x.type.size > 1 and kinds[0] != Vector("bool"):
                return self.masked(x.type, x.operands), _WHOLE
            a, b, c = x.operands
            return f"{self.node(a, 2)} ? {self.node(b, 2)} : {self.node(c, 1)}", 1
        if len(x.operands) == 1:
            return x.symbol + self.node(x.operands[0], _SIGN + (x.symbol == "-")), _SIGN
        if x.symbol in _COMPARE and vector:
            return self.compared(x.symbol, x.operands), _WHOLE
        own = _LEVEL[x.symbol]
        a, b = x.operands
        constants = isinstance(a, Literal) and isinstance(b, Literal)
        left = self.node(a, own) if constants else self.operand(a, own)
        return f"{left} {x.symbol} {self.operand(b, own + 1, right=True)}", own

    def horner(self, x: Horner) -> tuple[str, int]:
        """A polynomial."""
        at = self.node(x.x, _WHOLE)
        text = self.operand(x.coefficients[0], _LEVEL["*"])
        for i, c in enumerate(x.coefficients[1:]):
            part = self.operand(c, _LEVEL["*"])
            negative = isinstance(c, Literal) and part.startswith("-")
            text = f"{f'({text})' if i else text} * {at} {f'- {part[1:]}' if negative else f'+ {part}'}"
        return text, _LEVEL["+"]

    def make(self, x: Make) -> str:
        """A value from its parts."""
        if isinstance(x.type, Record):
            text = self.struct_from(x.type, [self.node(o) for o in x.operands])
            if text is None:
                raise SubsetError(f"a {x.type.name} can be made by return alone, or as a variable begins")
            return text
        if isinstance(x.type, Array):
            raise SubsetError("an array can be made as a variable begins, and nowhere else")
        assert isinstance(x.type, Vector)
        (first, *rest) = x.operands
        if not rest and x.type.size > 1 and isinstance(first.type, Vector) and first.type.size == 1:
            return self.splat(x.type, self.node(first))
        return f"{self.type(x.type)}({', '.join(map(self.node, x.operands))})"


def flat(kind: Type) -> tuple[Type, int]:
    """Return what an array is made of, and its length; any other type itself, and 0."""
    of, length = kind, 1
    while isinstance(of, Array):
        length *= of.length
        of = of.of
    return of, length if isinstance(kind, Array) else 0


def _brackets(length: int) -> str:
    """An array's length after its name."""
    return f"[{length}]" if length else ""


def wrap(line: str) -> str:
    """Return a statement on lines of at most `WIDTH` columns, broken after a comma or before an operator."""
    indent = len(line) - len(line.lstrip())
    out = []
    while len(line) > WIDTH:
        at = line.rfind(" ", indent + 9, WIDTH + 1)
        if at < 0:
            break
        out.append(line[:at])
        line = " " * (indent + 8) + line[at + 1 :]
    return "\n".join([*out, line])
