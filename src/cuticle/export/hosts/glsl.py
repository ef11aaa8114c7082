"""GLSL ES 3.00 and GLSL 3.30 to 4.60."""

from __future__ import annotations

from types import MappingProxyType

from cuticle.export.formulas import Printer
from cuticle.export.formulas.tree import Node, Vector
from cuticle.export.reserved_words import GLSL
from cuticle.export.shader import Dialect
from cuticle.export.shader_family import shader_host

_COMPARE = {
    "<": "lessThan", ">": "greaterThan", "<=": "lessThanEqual", ">=": "greaterThanEqual", "==": "equal", "!=": "notEqual",
}  # fmt: skip
_PLAIN = {"float": "vec", "int": "ivec", "bool": "bvec"}

_WORDS = """
    active asm cast class common enum extern external far filter fixed flat goto half hvec2 inline input
    interface invariant long namespace near noinline noperspective output partition patch precise public resource
    sample short sizeof smooth static step superp template this typedef union unsigned using volatile abs all any
    asin atan clamp cos distance dot exp floor length log max min mix sign sin sqrt
"""


class Glsl(Printer):
    """GLSL's words."""

    constant = "const"
    closed = ")"
    numbers = MappingProxyType({f"{kind}{n}": f"{short}{n}" for kind, short in _PLAIN.items() for n in (2, 3, 4)})
    functions = MappingProxyType({"atan2": "atan"})
    words = frozenset(_WORDS.split())

    def opened(self, kind: str, length: int) -> str:
        """type[n](...)."""
        return f"{kind}[{length}]("

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """Mix with a mask."""
        mask, a, b = map(self.node, operands)
        return f"mix({b}, {a}, {mask})"

    def compared(self, symbol: str, operands: tuple[Node, ...]) -> str:
        """LessThan and its kin."""
        return f"{_COMPARE[symbol]}({', '.join(map(self.node, operands))})"


DIALECT = Dialect(
    printer=Glsl,
    name="GLSL",
    about="For GLSL ES 3.00 and GLSL 3.30 to 4.60: write `#version` and `precision highp float;` before it.",
    texture="""#ifdef VULKAN  // which wants a number; define {upper}_BINDING before this file for another
#ifndef {upper}_BINDING
#define {upper}_BINDING set = 0, binding = 0
#endif
layout({upper}_BINDING)
#endif
uniform highp sampler2D {name}_model;""",
    fetch="texelFetch({name}_model, ivec2((i) % {width}, (i) / {width}), 0)",
)
HOST = shader_host(
    "GLSL ES 3.00 and 3.30 to 4.60, without loops of varying length", DIALECT, reserved=GLSL, reserved_prefixes=("gl_",)
)
