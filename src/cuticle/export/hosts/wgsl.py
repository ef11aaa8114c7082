"""WGSL, the language of WebGPU."""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType

from cuticle.export.formulas import Printer
from cuticle.export.formulas.calls import Calls
from cuticle.export.formulas.printer import flat
from cuticle.export.formulas.syntax import SubsetError
from cuticle.export.formulas.tree import Array, Instance, Invoke, Let, Local, Node, Operation, Record, Type, Vector
from cuticle.export.reserved_words import WGSL
from cuticle.export.shader import Dialect
from cuticle.export.shader_family import shader_host

_PLAIN = {"float": "f32", "int": "i32", "bool": "bool"}
_NUMBERS = {
    **_PLAIN,
    **{f"{kind}{n}": f"vec{n}<{short}>" for kind, short in _PLAIN.items() for n in (2, 3, 4)},
}  # fmt: skip
_FUNCTIONS = "abs all any array atan2 clamp cos dot exp f32 floor i32 log max min select sign sin sqrt vec2 vec3 vec4"
_COMPARE = ("<", ">", "<=", ">=", "==", "!=")


class Wgsl(Printer):
    """WGSL's words. Variables that are not written to are `let`; what a function writes to, it is given a pointer of."""

    constant = "const"
    closed = ")"
    next = "{}++"
    directives = False
    numbers = MappingProxyType(_NUMBERS)
    words = WGSL | frozenset(_FUNCTIONS.split())

    def __init__(self, prefix: str) -> None:
        super().__init__(prefix)
        self.calls = Calls()

    def text(self, items: Iterable[Record | Instance]) -> str:
        """The same, once it is known who writes to what."""
        items = tuple(items)
        self.calls = Calls(items)
        return super().text(items)

    # -- names and types --

    def named(self, x: Instance | Invoke) -> str:
        """A name that no other function has: WGSL has no overloads."""
        return self.calls.name(x)

    def type(self, kind: Type) -> str:
        """An array is a type, too."""
        if isinstance(kind, Array):
            of, length = flat(kind)
            return f"array<{self.type(of)}, {length}>"
        return super().type(kind)

    def constants(self, kind: str, name: str, length: int) -> str:
        """The array's type is that of what it begins with."""
        return f"const {name}"

    def fetch(self, name: str, result: Type, text: str) -> str:
        """A function: WGSL has no macros."""
        return f"fn {name}(i: i32) -> {self.type(result)} {{ return {text}; }}"

    def declared(self, kind: Type, name: str) -> str:
        """name: type."""
        return f"{self.variable(name)}: {self.type(kind)}"

    def parameter(self, name: str, kind: Type, out: bool) -> str:
        """A pointer where it is written to."""
        return f"{self.variable(name)}: ptr<function, {self.type(kind)}>" if out else self.declared(kind, name)

    def signature(self, result: Type, name: str, parameters: Iterable[tuple[str, Type, bool]]) -> str:
        """Fn name(...) -> result."""
        return f"fn {self.function(name)}({', '.join(self.parameter(*p) for p in parameters)}) -> {self.type(result)}"

    def record(self, r: Record) -> str:
        """A struct, a line where it fits on one."""
        fields = [self.declared(kind, name) for name, kind in r.fields]
        return f"struct {self.type(r)} {{\n{''.join(f'    {f},{chr(10)}' for f in fields)}}};\n"

    # -- statements --

    def instance(self, f: Instance) -> str:
        """A function."""
        self.calls.enter(f)
        return super().instance(f)

    def begun(self, line: Let) -> str:
        """`var` for what changes, and for arrays: not every compiler indexes others by a variable."""
        changes = line.value is None or self.calls.changes(line.name) or isinstance(line.type, Array)
        return f"{'var' if changes else 'let'} {self.declared(line.type, line.name)}"

    def opened(self, kind: str, length: int) -> str:
        """array<type, n>(...)."""
        return f"array<{kind}, {length}>("

    # -- expressions --

    def bound(self, x: Node) -> tuple[str, int]:
        """What a pointer points to, wherever it is named but in a call."""
        text, own = super().bound(x)
        return (f"(*{text})" if isinstance(x, Local) and self.calls.pointer(x.name) else text), own

    def given_to(self, x: Invoke) -> list[str]:
        """A pointer for what is written to; comparisons in brackets, or `a < b, c > d` were a template."""
        return [
            self.pointer_to(operand) if out else self.argument(operand)
            for operand, out in zip(x.operands, self.calls.outs(x), strict=True)
        ]

    def pointer_to(self, x: Node) -> str:
        """A pointer to a variable."""
        if not isinstance(x, Local):
            raise SubsetError("a function can write to a variable, not to a part of one")
        return self.variable(x.name) if self.calls.pointer(x.name) else f"&{self.variable(x.name)}"

    def argument(self, x: Node) -> str:
        """A comparison in brackets."""
        return self.node(x, 6 if isinstance(x, Operation) and x.symbol in _COMPARE else 0)

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """What is chosen comes last."""
        mask, a, b = operands
        return f"select({self.node(b)}, {self.node(a)}, {self.argument(mask)})"

    def operation(self, x: Operation) -> tuple[str, int]:
        """No `?`; and no && beside || without brackets."""
        if x.symbol == "?":
            if not isinstance(x.type, Vector):
                raise SubsetError("WGSL chooses between numbers and vectors alone")
            return self.masked(x.type, x.operands), 9
        if x.symbol in ("&&", "||"):
            a, b = (
                self.node(o, 4 if isinstance(o, Operation) and o.symbol in {"&&", "||"} - {x.symbol} else 0)
                for o in x.operands
            )
            return f"{a} {x.symbol} {b}", 3 if x.symbol == "&&" else 2
        return super().operation(x)


DIALECT = Dialect(
    printer=Wgsl,
    name="WGSL",
    about="For WGSL: put this text before or after your own.",
    texture="@group(1) @binding(0) var {name}_model: texture_2d<f32>;  // yours to number",
    fetch="textureLoad({name}_model, vec2<i32>(i % {width}, i / {width}), 0)",
    replaced="write another function {}",
)
HOST = shader_host("WGSL, for WebGPU", DIALECT, reserved=WGSL, reserved_prefixes=("__",))
