"""Metal's shading language, 2.0 on."""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType

from cuticle.export.formulas import Printer
from cuticle.export.formulas.calls import Calls
from cuticle.export.formulas.printer import flat
from cuticle.export.formulas.tree import Array, Instance, Invoke, Node, Record, Type, Vector
from cuticle.export.reserved_words import METAL
from cuticle.export.shader import Dialect
from cuticle.export.shader_family import shader_host

_FUNCTIONS = ("abs", "any", "atan2", "clamp", "dot", "exp", "floor", "log", "max", "min", "select", "sqrt")
_MODEL = "model"  # the host's macro that reads the scattering function's texture, `model_`


class Metal(Printer):
    """C++14's words. No texture is global: functions that read the model's are given it."""

    constant = "constant"
    suffix = "f"
    functions = MappingProxyType({name: f"metal::{name}" for name in _FUNCTIONS})
    words = METAL

    def __init__(self, prefix: str) -> None:
        super().__init__(prefix)
        self.calls = Calls()
        self.reading: set[str] = set()

    def text(self, items: Iterable[Record | Instance]) -> str:
        """The same, once it is known who reads the model."""
        items = tuple(items)
        self.calls = Calls(items)
        self.reading = {name for name, _ in self.calls.external(_MODEL)}
        return super().text(items)

    def parameter(self, name: str, kind: Type, out: bool) -> str:
        """A reference where it is written to, and to arrays: they are no values."""
        if isinstance(kind, Array):
            of, length = flat(kind)
            return f"{'' if out else 'const '}thread {self.type(of)} (&{self.variable(name)})[{length}]"
        return f"thread {self.type(kind)} &{self.variable(name)}" if out else self.declared(kind, name)

    def signature(self, result: Type, name: str, parameters: Iterable[tuple[str, Type, bool]]) -> str:
        """One with the texture, where it is read."""
        given = [self.parameter(*p) for p in parameters]
        if name in self.reading:
            given.append(f"{self.prefix.upper()}_TEXTURE model_")
        return f"inline {self.type(result)} {self.function(name)}({', '.join(given)})"

    def given_to(self, x: Invoke) -> list[str]:
        """The texture, too, where it is read."""
        return super().given_to(x) + ["model_"] * (not x.external and x.name in self.reading)

    def masked(self, kind: Vector, operands: tuple[Node, ...]) -> str:
        """What is chosen comes last."""
        mask, a, b = map(self.node, operands)
        return f"metal::select({b}, {a}, {mask})"

    def struct_from(self, kind: Record, items: list[str]) -> str | None:
        """Braces after its name."""
        return f"{self.type(kind)}{{{', '.join(items)}}}"


DIALECT = Dialect(
    printer=Metal,
    name="METAL",
    about="For Metal 2.0 on: include it.",
    prelude="#include <metal_stdlib>\n",
    texture="#define {upper}_TEXTURE metal::texture2d<float>",
    fetch="model_.read(uint2(uint(i) % {width}u, uint(i) / {width}u))",
    model="The scattering function reads a texture, which its functions are given last, as model_",
)
HOST = shader_host("Metal's shading language", DIALECT, reserved=METAL, reserved_prefixes=("__", "metal"))
