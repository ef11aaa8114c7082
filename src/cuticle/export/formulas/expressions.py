"""Expressions of C++ with their types known and what is constant worked out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from cuticle.export.formulas import syntax as cpp
from cuticle.export.formulas.constants import combine, convert, number
from cuticle.export.formulas.library import Library
from cuticle.export.formulas.scope import Listed, Scope, words
from cuticle.export.formulas.tree import (  # fmt: skip
    BOOL,
    FLOAT,
    INT,
    Array,
    Choice,
    Element,
    Field,
    Horner,
    Intrinsic,
    Invoke,
    Literal,
    Local,
    Make,
    Node,
    Operation,
    Record,
    Traits,
    Type,
    Vector,
)

# Functions that every language has, and how many numbers they take; and what stands for those that shaders have not, or
# not to the precision of a float.
INTRINSICS = {
    "sqrt": 1, "log": 1, "exp": 1, "decay": 1, "abs": 1, "floor": 1, "atan2": 2, "max": 2, "min": 2, "clamp": 3,
}  # fmt: skip
INSTEAD = {
    "sin": "math::sin_turned", "cos": "math::cos_turned", "asin": "math::asin_signed", "copysign": "math::copysign_chosen",
}  # fmt: skip
MEMORY = "model"  # what a host calls the fetch of a texel; memory is the number of the first
_COMPARE = ("<", ">", "<=", ">=", "==", "!=")


class Expressions:
    """Reads expressions; what types are, and which function a call means, `Instances` says."""

    library: Library
    externals: Mapping[str, Type]

    def type(self, name: cpp.Expr, scope: Scope) -> Type:
        """Return what a type's name means."""
        raise NotImplementedError

    def type_or_none(self, name: cpp.Expr, scope: Scope) -> Type | None:
        """The same; None where a name is no type's."""
        raise NotImplementedError

    def resolved(self, path: str, scope: Scope) -> str:
        """A path with families in place of the parameters that stand for them."""
        raise NotImplementedError

    def bind(
        self, template: tuple[cpp.Parameter, ...], given: Iterable[cpp.Expr], scope: Scope
    ) -> tuple[dict[str, Type], dict[str, Node | Listed]]:
        """What a template's parameters are, where they are said."""
        raise NotImplementedError

    def invoke(self, name: cpp.Name, operands: list[Node], scope: Scope) -> Node:
        """A call of a header's function."""
        raise NotImplementedError

    def fitted(self, value: cpp.Expr, kind: Type, scope: Scope) -> Node:
        """An expression, or {...}, as a value of a type; constants are converted as C++ does."""
        if isinstance(value, cpp.Call) and value.function is None:
            return self.made(kind, value.arguments, scope)
        node = self.node(value, scope)
        if node.type == kind:
            return node
        if isinstance(node, Literal) and isinstance(kind, Vector) and isinstance(node.type, Vector):
            return convert(node, kind)
        return scope.refuse(f"{words(value)} is of another type than what it becomes")

    def made(self, kind: Type, arguments: tuple[cpp.Expr, ...], scope: Scope) -> Node:
        """A struct from {...}."""
        if not isinstance(kind, Record) or len(arguments) != len(kind.fields):
            scope.refuse(f"{len(arguments)} values do not make what they become")
        return Make(kind, tuple(self.fitted(a, t, scope) for a, (_, t) in zip(arguments, kind.fields, strict=True)))

    def constant(self, value: cpp.Expr, scope: Scope) -> Literal:
        """An expression that is constant."""
        node = self.node(value, scope)
        if not isinstance(node, Literal):
            scope.refuse(f"{words(value)} is no constant")
        return node

    def node(self, value: cpp.Expr, scope: Scope) -> Node:
        """An expression with its types known."""
        if isinstance(value, cpp.Number):
            return number(value.text)
        if isinstance(value, cpp.Name):
            return self.named(value, scope)
        if isinstance(value, cpp.Operator):
            return self.operation(value, scope)
        if isinstance(value, cpp.Member):
            of = self.node(value.of, scope)
            kind = of.type.field(value.name) if isinstance(of.type, Record) else _components(of.type, value.name)
            if kind is None:
                scope.refuse(f"{words(value.of)} has no {value.name}")
            return Field(kind, of, value.name)
        if isinstance(value, cpp.Index):
            return self.element(value, scope)
        return self.call(value, scope)

    def element(self, value: cpp.Index, scope: Scope) -> Node:
        """x[i]."""
        if isinstance(value.of, cpp.Name) and isinstance(scope.values.get(value.of.path), Listed):
            listed = scope.values[value.of.path]
            assert isinstance(listed, Listed)
            return listed.items[int(self.constant(value.index, scope).value)]
        of, index = self.node(value.of, scope), self.node(value.index, scope)
        if isinstance(of.type, Vector) and of.type.size > 1 and index.type == INT:
            return Element(Vector(of.type.kind), of, index)
        if not isinstance(of.type, Array) or index.type != INT:
            scope.refuse(f"{words(value)}: memory is read by the host's functions alone")
        kind = of.type.of
        if isinstance(kind, Array):  # of which the next index takes one
            index = _whole("*", index, Literal(INT, kind.length))
        if isinstance(of, Element):
            return Element(kind, of.of, _whole("+", of.index, index))
        return Element(kind, of, index)

    def named(self, name: cpp.Name, scope: Scope) -> Node:
        """A variable, or a constant of the headers."""
        if name.path in ("true", "false"):
            return Literal(BOOL, name.path == "true")
        if name.path in scope.values and name.arguments is None:
            found = scope.values[name.path]
            if isinstance(found, Listed):
                scope.refuse(f"the array {name.path} can only be a polynomial's")
            return found
        for one in self.library.find(self.resolved(name.path, scope), scope.scope):
            declared = self.library.parse(one)
            if isinstance(declared, cpp.Constant):
                types, values = self.bind(declared.template, name.arguments or (), scope)
                inside = Scope(declared.name, declared.scope, types, values)
                return self.fitted(declared.value, self.type(declared.type, inside), inside)
        kind, _, member = name.path.rpartition("::")
        enum = self.library.members.get(member)
        if enum is not None:
            declared = self.library.parse(enum)
            assert isinstance(declared, cpp.Enumeration)
            if kind and kind.rsplit("::", 1)[-1] == declared.name:
                return Literal(Choice(declared.name), member)
            if not kind:
                return Literal(INT, declared.members.index(member))
        return self.trait(name, scope)

    def trait(self, name: cpp.Name, scope: Scope) -> Node:
        """What `if constexpr` asks of a type: in shaders a number is single precision, no pack,
        and NaN compares as the compiler likes.
        """
        last = name.path.rsplit("::", 1)[-1]
        if last == "is_same_v" and name.arguments:
            a, b = (self.type(x, scope) for x in name.arguments)
            return Literal(BOOL, a == b)
        if last == "is_arithmetic_v" and name.arguments:
            kind = self.type(name.arguments[0], scope)
            return Literal(BOOL, isinstance(kind, Vector) and kind.size == 1)
        if last in ("is_pack", "CUTICLE_ORDERS_NAN"):
            return Literal(BOOL, False)
        if last == "abreast":
            return Literal(INT, 1)
        return scope.refuse(f"{words(name)} is outside the subset")

    def operation(self, value: cpp.Operator, scope: Scope) -> Node:
        """An operator on what stands beside it."""
        if value.symbol == "?":
            condition = self.node(value.operands[0], scope)
            if isinstance(condition, Literal):
                return self.node(value.operands[1 if condition.value else 2], scope)
        operands = [self.node(x, scope) for x in value.operands]
        if all(isinstance(x, Literal) for x in operands):
            folded = combine(value.symbol, [x for x in operands if isinstance(x, Literal)])
            if folded is not None:
                return folded
        kinds = [x.type for x in operands]
        if value.symbol == "?":
            if kinds[0] != BOOL or kinds[1] != kinds[2]:
                scope.refuse(f"{words(value)} chooses between two types, or by a mask: select does that")
            return Operation(kinds[1], "?", tuple(operands))
        symbol = {"&": "&&", "|": "||"}.get(value.symbol, value.symbol) if set(kinds) == {BOOL} else value.symbol
        if symbol in ("&&", "||", "!"):
            if any(k != BOOL for k in kinds):
                scope.refuse(f"{words(value)} is not of bools")
            return self.logic(symbol, operands)
        kind = self.common(kinds, value, scope)
        if value.symbol in _COMPARE:
            return Operation(Vector("bool", kind.size), value.symbol, tuple(operands))
        if value.symbol in ("&", "|") or (value.symbol == "%" and kind.kind != "int"):
            scope.refuse(f"{value.symbol!r} is outside the subset")
        if kind == INT and value.symbol == "+":
            return _whole("+", *operands)
        return Operation(kind, value.symbol, tuple(operands))

    def logic(self, symbol: str, operands: list[Node]) -> Node:
        """&& and || of what may be constant in part."""
        for x, other in (operands, operands[::-1]) if len(operands) == 2 else ():
            if isinstance(x, Literal):
                return other if bool(x.value) == (symbol == "&&") else x
        return Operation(BOOL, symbol, tuple(operands))

    def common(self, kinds: list[Type], value: cpp.Expr, scope: Scope) -> Vector:
        """The type of an operator's operands: one, or vectors beside a number of their kind."""
        vectors = [k for k in kinds if isinstance(k, Vector) and k.kind in ("float", "int")]
        sizes = {k.size for k in vectors if k.size > 1}
        if len(vectors) < len(kinds) or len({k.kind for k in vectors}) > 1 or len(sizes) > 1:
            scope.refuse(f"{words(value)} is of types that do not go together")
        return Vector(vectors[0].kind, max(sizes, default=1))

    # -- calls --

    def call(self, value: cpp.Call, scope: Scope) -> Node:
        """A cast, a function of the headers, or one of the languages' or of the host's own."""
        name = value.function
        if not isinstance(name, cpp.Name):
            return scope.refuse("a function that is a value is outside the subset")
        last = name.path.rsplit("::", 1)[-1]
        kind = self.type_or_none(name, scope)
        if isinstance(kind, Record):
            return self.made(kind, value.arguments, scope)
        if isinstance(kind, Vector):
            return self.cast(kind, value, scope)
        if name.path in self.externals:
            given = tuple(self.node(a, scope) for a in value.arguments)
            return Invoke(self.externals[name.path], name.path, given, external=True)
        if name.path.startswith("std::numeric_limits") and name.arguments:
            of = self.type(name.arguments[0], scope)
            info = np.finfo(np.float32 if of == FLOAT else np.float64)
            return Literal(of, {"epsilon": info.eps, "min": info.tiny, "max": info.max}[name.member])
        if (
            "::" in name.path and isinstance(scope.types.get(name.path.split("::")[0]), Traits)
        ) or name.path == "ArrayTraits":
            return self.of_traits(name, value, scope)
        if last == "load_abreast":
            return self.element(cpp.Index(*value.arguments), scope)
        if last == "sum_abreast":
            return self.node(value.arguments[0], scope)
        if last in ("polynomial", "estrin"):
            return self.polynomial(last, value, scope)
        operands = [self.node(a, scope) for a in value.arguments]
        if last == "select":
            return self.select(operands, value, scope)
        if last == "sum" and isinstance(operands[0].type, Vector):
            return Intrinsic(Vector(operands[0].type.kind), "sum", tuple(operands))
        if INTRINSICS.get(last) == len(operands) and all(x.type == operands[0].type for x in operands):
            return Intrinsic(operands[0].type, last, tuple(operands))
        return self.invoke(cpp.Name(INSTEAD.get(last, name.path), name.arguments), operands, scope)

    def cast(self, kind: Vector, value: cpp.Call, scope: Scope) -> Node:
        """T(x): a constant, a number in every component, a number of another kind, or a vector from parts."""
        operands = [self.node(a, scope) for a in value.arguments]
        if len(operands) > 1:
            given = [x.type for x in operands if isinstance(x.type, Vector) and x.type.kind == kind.kind]
            if len(given) < len(operands) or sum(t.size for t in given) != kind.size:
                scope.refuse(f"{words(value)}: its parts do not make a {kind.kind}{kind.size}")
            return Make(kind, tuple(operands))
        (x,) = operands or (scope.refuse("a cast of nothing"),)
        if isinstance(x, Literal):
            return convert(x, kind)
        if x.type == kind:
            return x
        numeric = isinstance(x.type, Vector) and x.type.kind in ("float", "int") and kind.kind in ("float", "int")
        if not numeric or (x.type.size != kind.size and (x.type.size > 1 or x.type.kind != kind.kind)):  # type: ignore[union-attr]
            scope.refuse(f"the cast {words(value)} is outside the subset")
        return Make(kind, (x,))

    def of_traits(self, name: cpp.Name, value: cpp.Call, scope: Scope) -> Node:
        """ArrayTraits<T>::any, to_index and gather, which takes as many components of a texel as T has."""
        member = name.member or name.path.rsplit("::", 1)[-1]
        x, *more = (self.node(a, scope) for a in value.arguments)
        assert isinstance(x.type, Vector)
        if member == "gather" and x.type == INT and MEMORY in self.externals:
            traits = scope.types.get(name.path.split("::")[0])
            kind = traits.of if isinstance(traits, Traits) else self.type((name.arguments or ())[0], scope)
            texel = Invoke(self.externals[MEMORY], MEMORY, (_whole("+", x, more[0]),), external=True)
            assert isinstance(kind, Vector)
            return texel if kind == texel.type else Field(kind, texel, "xyzw"[: kind.size])
        if member == "any" and x.type.kind == "bool":
            return x if x.type.size == 1 else Intrinsic(BOOL, "any", (x,))
        if member == "to_index":
            return Make(Vector("int", x.type.size), (x,))
        return scope.refuse(f"ArrayTraits::{member} is outside the subset: memory is read by the host's functions alone")

    def polynomial(self, last: str, value: cpp.Call, scope: Scope) -> Node:
        """Horner's rule for either of the headers' ways."""
        x = self.node(value.arguments[0], scope)
        if last == "estrin":
            listed = scope.values.get(value.arguments[1].path) if isinstance(value.arguments[1], cpp.Name) else None
            if not isinstance(listed, Listed):
                scope.refuse("estrin takes an array of constants")
            coefficients = listed.items
        else:
            coefficients = tuple(self.node(a, scope) for a in value.arguments[1:])
        if not isinstance(x, (Local, Literal)):
            scope.refuse(f"a polynomial of {words(value.arguments[0])}: give it a name first")
        return Horner(x.type, x, coefficients)

    def select(self, operands: list[Node], value: cpp.Call, scope: Scope) -> Node:
        """select(mask, a, b)."""
        mask, a, b = operands
        if isinstance(mask, Literal):
            return a if mask.value else b
        sizes = (1, a.type.size if isinstance(a.type, Vector) else 1)
        if a.type != b.type or not isinstance(mask.type, Vector) or mask.type.kind != "bool" or mask.type.size not in sizes:
            scope.refuse(f"{words(value)} chooses between two types, or by a mask of another size")
        return Operation(a.type, "?", (mask, a, b))


def _whole(symbol: str, a: Node, b: Node) -> Node:
    """A sum or product of whole numbers, worked out where it is constant; 0 is left out of a sum."""
    if isinstance(a, Literal) and isinstance(b, Literal):
        return combine(symbol, [a, b]) or a
    for x, other in ((a, b), (b, a)):
        if symbol == "+" and isinstance(x, Literal) and x.value == 0:
            return other
    return Operation(INT, symbol, (a, b))


def _components(of: Type, name: str) -> Type | None:
    """The type of a vector's components."""
    if not isinstance(of, Vector) or not name or any(c not in "xyzw"[: of.size] for c in name):
        return None
    return Vector(of.kind, len(name))
