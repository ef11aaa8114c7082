"""Slang, and through its compiler WGSL, Metal, SPIR-V and CUDA."""

from __future__ import annotations

from cuticle.export.family import family_shader
from cuticle.export.formulas.tree import Node, Vector
from cuticle.export.hosts.hlsl import Hlsl
from cuticle.export.registry import Host
from cuticle.export.reserved_words import SLANG
from cuticle.export.shader import Dialect, shader

_WORDS = """
    This extension func import internal let property public select var where
"""


class Slang(Hlsl):
    """HLSL's words, but where Slang has constructors and choices between vectors of its own."""

    words = Hlsl.words | frozenset(_WORDS.split())

    def splat(self, kind: Vector, text: str) -> str:
        """float3(x)."""
        return f"{self.type(kind)}({text})"

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """A choice component by component."""
        return f"select({', '.join(map(self.node, operands))})"


DIALECT = Dialect(
    printer=Slang,
    name="SLANG",
    about="For Slang: import it, or include it; slangc compiles it for SPIR-V, WGSL, Metal, CUDA, HLSL and the CPU.",
    texture="Texture2D<float4> {name}_model;",
    fetch="{name}_model.Load(int3((i) % {width}, (i) / {width}, 0))",
)
HOST = Host(
    "Slang",
    lambda job: shader(job, DIALECT),
    lambda job: family_shader(job, DIALECT),
    textured=True,
    reserved=SLANG,
    reserved_prefixes=("SV_", "slang"),
)
