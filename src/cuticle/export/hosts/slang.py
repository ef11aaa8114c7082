"""Slang, and through its compiler WGSL, Metal, SPIR-V and CUDA."""

from __future__ import annotations

from dataclasses import replace

from cuticle.export.formulas.tree import Node, Vector
from cuticle.export.hosts import hlsl
from cuticle.export.registry import Host
from cuticle.export.reserved_words import SLANG
from cuticle.export.shader import shader
from cuticle.export.shader_family import family_shader

_WORDS = """
    This extension func import internal let property public select var where
"""


class Slang(hlsl.Hlsl):
    """HLSL's words, but where Slang has constructors and choices between vectors of its own."""

    words = hlsl.Hlsl.words | frozenset(_WORDS.split())

    def splat(self, kind: Vector, text: str) -> str:
        """float3(x)."""
        return f"{self.type(kind)}({text})"

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """A choice component by component."""
        return f"select({', '.join(map(self.node, operands))})"


DIALECT = replace(
    hlsl.DIALECT, printer=Slang, name="SLANG",
    about="For Slang: import it, or include it; slangc compiles it for SPIR-V, WGSL, Metal, CUDA, HLSL and the CPU.",
)  # fmt: skip
HOST = Host(
    "Slang",
    lambda job: shader(job, DIALECT),
    lambda job: family_shader(job, DIALECT),
    textured=True,
    reserved=SLANG,
    reserved_prefixes=("SV_", "slang"),
)
