"""Slang, and through its compiler WGSL, Metal, SPIR-V and CUDA."""

from __future__ import annotations

from dataclasses import replace

from cuticle.export.formulas import Printer
from cuticle.export.formulas.tree import Node, Vector
from cuticle.export.hosts import hlsl
from cuticle.export.reserved_words import SLANG
from cuticle.export.shader_family import shader_host

_WORDS = """
    This extension func import internal let property public select var where
"""


class Slang(hlsl.Hlsl):
    """HLSL's words, but where Slang has constructors and choices between vectors of its own."""

    words = hlsl.Hlsl.words | frozenset(_WORDS.split())

    splat = Printer.splat  # not HLSL's cast

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """A choice component by component."""
        return f"select({', '.join(map(self.node, operands))})"


DIALECT = replace(
    hlsl.DIALECT, printer=Slang, name="SLANG",
    about="For Slang: import it, or include it; slangc compiles it for SPIR-V, WGSL, Metal, CUDA, HLSL and the CPU.",
)  # fmt: skip
HOST = shader_host("Slang", DIALECT, reserved=SLANG, reserved_prefixes=("SV_", "slang"))
