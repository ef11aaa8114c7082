"""HLSL, shader model 5 on."""

from __future__ import annotations

from collections.abc import Iterable

from cuticle.export.formulas import Printer
from cuticle.export.formulas.tree import Count, Instance, Node, Record, Type, Vector
from cuticle.export.reserved_words import HLSL
from cuticle.export.shader import Dialect
from cuticle.export.shader_family import shader_host

_WORDS = """
    asm centroid cast class const compile export extern far half in inline inout interface line lineadj linear
    matrix near nointerpolation noperspective out packoffset pass pixelfragment point precise register row_major
    sample sampler shared snorm static stateblock step string technique template texture triangle typedef uniform
    unorm using vector volatile abs all any asin atan2 clamp cos distance dot exp floor frac length lerp log max
    min sign sin sqrt
"""


class Hlsl(Printer):
    """HLSL's words."""

    constant = "static const"
    words = frozenset(_WORDS.split())

    def __init__(self, prefix: str) -> None:
        super().__init__(prefix)
        self.choices: set[int] = set()
        self.counters: dict[str, int] = {}  # of a function so far: loops with a counter of this name
        self.inside: dict[str, int] = {}  # of these, which is printed

    def text(self, items: Iterable[Record | Instance]) -> str:
        """The same, after its choices between vectors: no one operator does that in HLSL 2021 and before."""
        text = super().text(items)
        return "".join(map(self.choice, sorted(self.choices))) + text

    def instance(self, f: Instance) -> str:
        """A function, a name of its own for each counter: before HLSL 2021, one lives on after its loop."""
        self.counters, self.inside = {}, {}
        return super().instance(f)

    def count(self, line: Count, result: Type, depth: int) -> list[str]:
        """A loop, and the counters' names in it."""
        around = self.inside
        self.counters[line.name] = self.counters.get(line.name, 0) + 1
        self.inside = around | {line.name: self.counters[line.name]}
        printed = super().count(line, result, depth)
        self.inside = around
        return printed

    def local(self, name: str) -> str:
        """A variable, or a counter: i, i_2, i_3."""
        number = self.inside.get(name, 1)
        return self.variable(name) if number == 1 else f"{name}_{number}"

    def choice(self, size: int) -> str:
        """A function that chooses component by component."""
        mask, kind = self.type(Vector("bool", size)), self.type(Vector("float", size))
        each = ", ".join(f"mask.{c} ? a.{c} : b.{c}" for c in "xyzw"[:size])
        return f"{kind} {self.function('choose')}({mask} mask, {kind} a, {kind} b) {{ return {kind}({each}); }}\n\n"

    def splat(self, kind: Vector, text: str) -> str:
        """A cast: HLSL has no constructor of one number."""
        return f"(({self.type(kind)})({text}))"

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """The function of `choice`."""
        self.choices.add(kind.size)
        return f"{self.function('choose')}({', '.join(map(self.node, operands))})"

    def struct_from(self, kind: Record, items: list[str]) -> str | None:
        """HLSL has no constructor of structs."""
        return None


DIALECT = Dialect(
    printer=Hlsl,
    name="HLSL",
    about="For HLSL.",
    texture="Texture2D<float4> {name}_model;",
    fetch="{name}_model.Load(int3((i) % {width}, (i) / {width}, 0))",
)
HOST = shader_host("the same in HLSL", DIALECT, reserved=HLSL, reserved_prefixes=("SV_",))
