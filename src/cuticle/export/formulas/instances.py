"""From a formula as C++ has it, a template, to its instances for the types of a shader: types told, constants worked out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from cuticle.export.formulas import syntax as cpp
from cuticle.export.formulas.expressions import Expressions
from cuticle.export.formulas.library import Library
from cuticle.export.formulas.scope import Listed, Scope, words
from cuticle.export.formulas.syntax import SubsetError
from cuticle.export.formulas.tree import (  # fmt: skip
    BOOL,
    DOUBLE,
    FLOAT,
    INT,
    Array,
    Block,
    Choice,
    Count,
    Element,
    Family,
    Field,
    Give,
    Instance,
    Invoke,
    Let,
    Line,
    Literal,
    Local,
    Make,
    Node,
    Record,
    Store,
    Traits,
    Type,
    Vector,
    When,
    without_unused,
)

NUMBERS = {"float": FLOAT, "double": DOUBLE, "int": INT, "bool": BOOL} | {
    f"{kind}{n}": Vector(kind, n) for kind in ("float", "int", "bool") for n in (2, 3, 4)
}


SHORT = 4  # steps of a loop, such as channels and lobes, that are printed one after the other


class Instances(Expressions):
    """Makes instances of what is asked for and of all that this needs, each once, what is needed first.

    Parameters
    ----------
    library
        The headers' declarations.
    types
        Names of types beside the languages' own.
    externals
        Functions that the host defines: what they return, by name.
    """

    def __init__(self, library: Library, types: Mapping[str, Type], externals: Mapping[str, Type]) -> None:
        self.library = library
        self.types: dict[str, Type] = NUMBERS | dict(types)
        self.externals = externals
        self.items: list[Record | Instance] = []
        self._records: dict[tuple[Any, ...], Record] = {}
        self._origin: dict[Record, tuple[cpp.Struct, dict[str, Type], dict[str, Node | Listed]]] = {}
        self._made: dict[tuple[Any, ...], Instance] = {}
        self._taken: dict[tuple[Any, ...], tuple[Any, ...]] = {}

    # -- what is asked for --

    def add(self, text: str) -> None:
        """Make all that a text in the headers' language declares."""
        for found in self.library.add(text):
            declared = self.library.parse(found)
            if isinstance(declared, cpp.Function) and not declared.template:
                scope = Scope(declared.name, declared.scope)
                self.instance(declared, scope, [self.type(p.type, scope) for p in declared.parameters], {})
            elif isinstance(declared, cpp.Struct) and not declared.template:
                self.record(declared, {}, {})

    def record(self, declared: cpp.Struct, types: dict[str, Type], values: dict[str, Node | Listed]) -> Record:
        """Return a struct's instance."""
        key = (id(declared), tuple(types.items()), tuple(values.items()))
        if key not in self._records:
            scope = Scope(declared.name, declared.scope, types, values)
            fields = tuple((f.name, self.array_type(f, scope)) for f in declared.fields)
            wide = [t.size for t in types.values() if isinstance(t, Vector) and t.size > 1]
            wide += [v.value for v in values.values() if isinstance(v, Literal)]
            made = Record(declared.name + "".join(map(str, wide)), fields, declared.comment)
            self._records[key] = made
            self._origin[made] = (declared, types, values)
            self.items.append(made)
        return self._records[key]

    def instance(self, declared: cpp.Function, scope: Scope, given: list[Type], known: dict[str, Node | Listed]) -> Instance:
        """Return a function's instance for the types of its arguments, `known` those that are constant."""
        key = (id(declared), tuple(given), tuple((k, str(v)) for k, v in known.items()), tuple(scope.types.items()))
        if key in self._made:
            return self._made[key]
        inside = Scope(declared.name, declared.scope, dict(scope.types), dict(known))
        parameters = []
        for p, kind in zip(declared.parameters, given, strict=True):
            if p.name in known:
                continue
            inside.values[p.name] = Local(kind, p.name)
            parameters.append((p.name, kind, p.changes))
        inside.result = self.type(declared.result, inside)
        body = without_unused(self.lines(declared.body, inside))
        marks = [k for k, v in known.items() if isinstance(v, Literal) and v.value is True]
        marks += [str(v.value) for v in known.values() if isinstance(v, Literal) and isinstance(v.type, Choice)]
        unsaid = _unsaid(declared)
        marks += [str(v.value) for n in unsaid if isinstance(v := known.get(n), Literal)]
        marks += [f"{t.kind}{t.size}" for n in unsaid if isinstance(t := scope.types.get(n), Vector) and t.size > 1]
        plain = declared.name + "".join(f"_{m.lower()}" for m in marks)
        used = tuple((k, t, c) for k, t, c in parameters)
        made = Instance(plain, inside.result, used, body, declared.comment)
        self._made[key] = made
        if constant_of(made) is None:
            sign = (plain, tuple(t for _, t, _ in used))
            if self._taken.setdefault(sign, key) != key:
                scope.refuse(f"{plain} has two meanings for the same types")
            self.items.append(made)
        return made

    # -- types --

    def type(self, name: cpp.Expr, scope: Scope) -> Type:
        """Return what a type's name means, or raise SubsetError."""
        found = self.type_or_none(name, scope)
        if found is None:
            scope.refuse(f"the type {words(name)} is outside the subset")
        return found

    def type_or_none(self, name: cpp.Expr, scope: Scope) -> Type | None:
        """The same; None where a name is no type's."""
        if not isinstance(name, cpp.Name):
            return None
        path, member = self.resolved(name.path, scope), name.member
        if not name.arguments and "::" in path and isinstance(scope.types.get(path.split("::")[0]), Traits):
            path, member = path.split("::")
        found: Type | None = scope.types.get(path) or self.types.get(path)
        if path in ("Abreast", "Several") and name.arguments:  # cells one after the other, lobes in a vector
            of = self.type(name.arguments[0], scope)
            if path == "Several":
                if of != FLOAT:
                    scope.refuse(f"{words(name)} is no vector of a shader")
                of = Vector("float", int(self.constant(name.arguments[1], scope).value))
            return of
        if path in ("scalar_t", "ArrayTraits") and name.arguments:
            of = self.type(name.arguments[0], scope)
            if not isinstance(of, Vector):
                scope.refuse(f"{path} of a struct is outside the subset")
            found = Vector(of.kind) if path == "scalar_t" else Traits(of)
        if isinstance(found, Traits) and member:
            kinds = {"Index": Vector("int", found.of.size), "Scalar": Vector(found.of.kind)}
            found = kinds.get(member)
        elif found is None:
            for one in self.library.find(path, scope.scope):
                if one.kind in ("enum", "struct", "alias"):
                    found = self.declared_type(self.library.parse(one), name, scope)
        return found

    def declared_type(self, declared: cpp.Declaration, name: cpp.Name, scope: Scope) -> Type | None:
        """What a header's struct or enum is, with what stands between < and >."""
        if isinstance(declared, cpp.Enumeration):
            return Choice(declared.name)
        if not isinstance(declared, (cpp.Struct, cpp.Alias)):
            return None
        types, values = self.bind(declared.template, name.arguments or (), scope)
        if isinstance(declared, cpp.Alias):
            return self.type(declared.type, Scope(declared.name, declared.scope, types, values))
        if not declared.fields:
            return Family(f"{declared.scope}::{declared.name}" if declared.scope else declared.name)
        return self.record(declared, types, values)

    def resolved(self, path: str, scope: Scope) -> str:
        """A path whose first part may be a template's parameter, a family, by the family's own name."""
        first, mark, rest = path.partition("::")
        family = scope.types.get(first) if mark else None
        return f"{family.name}::{rest}" if isinstance(family, Family) else path

    def array_type(self, variable: cpp.Variable, scope: Scope) -> Type:
        """The type of a field or a variable, with its length where it is an array."""
        kind = self.type(variable.type, scope)
        if variable.length is None:
            return kind
        for length in (variable.width, variable.length):
            if isinstance(length, int):
                scope.refuse(f"{variable.name} is an array of no length")
            if length is not None:
                kind = Array(kind, int(self.constant(length, scope).value))
        return kind

    def bind(
        self, template: tuple[cpp.Parameter, ...], given: Iterable[cpp.Expr], scope: Scope
    ) -> tuple[dict[str, Type], dict[str, Node | Listed]]:
        """What a template's parameters are, where they are said."""
        types: dict[str, Type] = {}
        values: dict[str, Node | Listed] = {}
        for p, argument in zip(template, given, strict=False):
            if p.kind == "class":
                types[p.name] = self.type(argument, scope)
            else:
                values[p.name] = self.constant(argument, scope)
        for p in template:
            if p.kind == "class" and p.value is not None and p.name not in types:
                types[p.name] = self.type(p.value, scope)
        return types, values

    # -- statements --

    def lines(self, statements: Iterable[cpp.Statement], scope: Scope) -> tuple[Line, ...]:
        """Return statements with their types known; what follows a return is left out."""
        out: list[Line] = []
        for s in statements:
            if isinstance(s, cpp.Using):
                scope.types[s.name] = self.type(s.type, scope)
            elif isinstance(s, cpp.Variable):
                out += self.variable(s, scope)
            elif isinstance(s, cpp.Return):
                assert scope.result is not None
                return (*out, Give(self.fitted(s.value, scope.result, scope)))
            elif isinstance(s, cpp.If):
                condition = self.node(s.condition, scope)
                if isinstance(condition, Literal):  # what is taken stands in this block from now on
                    inside = scope.inner()
                    taken = self.lines(s.then if condition.value else s.otherwise, inside)
                    hidden = {x.name for x in taken if isinstance(x, Let)} & scope.values.keys()
                    if hidden and not _returns(taken):
                        scope.refuse(f"{', '.join(sorted(hidden))} hides another variable")
                    scope.printed |= inside.printed
                    out += taken
                    if _returns(taken):
                        return tuple(out)
                    continue
                if s.constant:
                    scope.refuse(f"{words(s.condition)} is no constant that shaders know")
                if condition.type != BOOL:
                    scope.refuse(f"{words(s.condition)} is not one bool")
                out.append(When(condition, self.lines(s.then, scope.inner()), self.lines(s.otherwise, scope.inner())))
            elif isinstance(s, cpp.For):
                out += self.loop(s, scope)
            else:
                target = self.node(s.target, scope)
                if not isinstance(target, (Local, Field, Element)):
                    scope.refuse(f"{words(s.target)} cannot be changed")
                value = self.fitted(s.value, target.type, scope)
                out.append(Store(target, s.symbol, value))
        return tuple(out)

    def loop(self, s: cpp.For, scope: Scope) -> list[Line]:
        """A loop; a short one's steps one after the other, each with its number known."""
        start, end = self.node(s.start, scope), self.node(s.end, scope)
        if not (isinstance(start, Literal) and isinstance(end, Literal)):
            scope.refuse(f"the loop over {s.name} has no constant bounds")
        if self.constant(s.step, scope).value != 1:
            scope.refuse(f"the loop over {s.name} is not by one")
        short = end.value - start.value <= SHORT
        out: list[Line] = []
        for number in range(start.value, end.value if short else start.value + 1):
            inside = scope.inner()
            inside.values[s.name] = Literal(INT, number) if short else Local(INT, s.name)
            body = self.lines(s.body, inside)
            if not short:
                out.append(Count(s.name, start, end, body))
            else:
                out += [Block(body)] if any(isinstance(x, Let) for x in body) else body
        return out

    def variable(self, v: cpp.Variable, scope: Scope) -> list[Line]:
        """A declaration; one that is constant leaves no line."""
        if v.type.path == "auto" and v.value is not None and v.length is None:  # a mask, mostly
            value = self.node(v.value, scope)
            constant = v.constant and isinstance(value, Literal)
            scope.values[v.name] = value if constant else Local(value.type, v.name)
            return [] if constant else [Let(v.name, value.type, value)]
        if v.name in scope.printed:
            scope.refuse(f"{v.name} is declared twice in one block")
        kind = self.type(v.type, scope)
        if isinstance(v.value, cpp.Call) and v.value.function is None and v.length is not None:
            items = tuple(self.fitted(x, kind, scope) for x in v.value.arguments)
            if v.constant and v.length == 0:
                scope.values[v.name] = Listed(items)
                return []
            made = Array(kind, len(items))
            scope.values[v.name] = Local(made, v.name)
            scope.printed.add(v.name)
            return [Let(v.name, made, Make(made, items))]
        kind = self.array_type(v, scope)
        first = None if v.value is None else self.fitted(v.value, kind, scope)
        if v.constant and isinstance(first, Literal):
            scope.values[v.name] = first
            return []
        scope.values[v.name] = Local(kind, v.name)
        scope.printed.add(v.name)
        return [Let(v.name, kind, first)]

    def invoke(self, name: cpp.Name, operands: list[Node], scope: Scope) -> Node:
        """A call of a header's function, whose instance is made for these types."""
        tried, failed = [], None
        for one in self.library.find(self.resolved(name.path, scope), scope.scope):
            try:
                declared = self.library.parse(one)
            except SubsetError as error:  # another of the same name may do
                failed = failed or error
                continue
            if isinstance(declared, cpp.Function) and len(declared.parameters) == len(operands):
                fits = self.fits(declared, name, operands, scope)
                if fits is not None:
                    tried.append((declared, *fits))
        if not tried and failed is not None:
            raise failed
        if len(tried) != 1:
            what = f"{len(tried)} functions" if tried else "no function"
            scope.refuse(f"{what} of the headers, and none of the languages, is {name.path} of these arguments")
        declared, inside, known = tried[0]
        made = self.instance(declared, inside, [x.type for x in operands], known)
        constant = constant_of(made)
        if constant is not None:
            return constant
        kept = tuple(x for x, p in zip(operands, declared.parameters, strict=True) if p.name not in known)
        return Invoke(made.result, made.name, kept)

    def fits(
        self, declared: cpp.Function, name: cpp.Name, operands: list[Node], scope: Scope
    ) -> tuple[Scope, dict[str, Node | Listed]] | None:
        """A template's parameters as its arguments tell them, and what is constant of these; None if they do not fit."""
        types, values = self.bind(declared.template, name.arguments or (), scope)
        inside = Scope(declared.name, declared.scope, types, dict(values))
        for t in declared.template:
            if t.kind != "class" and t.name not in values and t.value is not None:
                inside.values[t.name] = values[t.name] = self.constant(t.value, inside)
        pairs = list(zip(declared.parameters, operands, strict=True))
        free = {p.name for p in declared.template if p.kind == "class"} - types.keys()
        for p, x in pairs:  # what says a template's parameter
            if p.type.path in free and not p.type.arguments:
                kind = x.type.of if isinstance(x.type, Array) else x.type
                if inside.types.setdefault(p.type.path, kind) != kind:
                    return None
            elif p.type.arguments and isinstance(x.type, Record):
                self.learn(p.type, x.type, free, inside)
        named = [t.name for t in declared.template if t.name]
        if not {*named} <= inside.types.keys() | inside.values.keys():
            return None
        if any(self.type_or_none(p.type, inside) is None or self.array_type(p, inside) != x.type for p, x in pairs):
            return None
        known = {name: inside.values[name] for name in named if name in inside.values}
        worked_out = declared.constant and all(isinstance(x, Literal) for x in operands)
        for p, x in pairs:
            if isinstance(x, Literal) and (isinstance(x.type, Choice) or x.type == BOOL or worked_out):
                known[p.name] = x
            elif isinstance(x.type, Choice):
                scope.refuse(f"{p.name} of {declared.name} is not constant")
        return inside, known

    def learn(self, wanted: cpp.Name, given: Record, free: set[str], inside: Scope) -> None:
        """Struct<Float, N> for a struct's instance: what Float and N are."""
        declared, types, values = self._origin[given]
        if wanted.path.rsplit("::", 1)[-1] == declared.name:
            for p, a in zip(declared.template, wanted.arguments or (), strict=False):
                if isinstance(a, cpp.Name) and a.path in free and p.name in types:
                    inside.types.setdefault(a.path, types[p.name])
                elif isinstance(a, cpp.Name) and p.name in values:
                    inside.values.setdefault(a.path, values[p.name])


def constant_of(f: Instance) -> Literal | None:
    """What a function returns where that is a constant."""
    value = f.body[0].value if len(f.body) == 1 and isinstance(f.body[0], Give) else None
    return value if isinstance(value, Literal) else None


def _unsaid(declared: cpp.Function) -> list[str]:
    """A template's parameters that the types of its arguments do not tell, and the name of an instance must."""
    said = {a for p in declared.parameters for a in (p.length, cpp.Name(p.type.path), *(p.type.arguments or ()))}
    return [t.name for t in declared.template if t.kind != "bool" and cpp.Name(t.name) not in said]


def _returns(lines: tuple[Line, ...]) -> bool:
    """Whether lines end in a return, in either branch."""
    last = lines[-1] if lines else None
    return isinstance(last, Give) or (isinstance(last, When) and _returns(last.then) and _returns(last.otherwise))
