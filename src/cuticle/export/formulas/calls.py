"""Who calls what and writes to what: for languages without overloads, or in which variables and pointers differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from cuticle.export.formulas.syntax import SubsetError
from cuticle.export.formulas.tree import (  # fmt: skip
    Count,
    Element,
    Field,
    Instance,
    Invoke,
    Line,
    Local,
    Node,
    Record,
    Store,
    Type,
    Vector,
)

Key = tuple[str, tuple[Type, ...]]

# What stands within a line or a node.
_PARTS = {
    "Let": ("value",), "Store": ("target", "value"), "When": ("condition", "then", "otherwise"), "Count": ("body",),
    "Give": ("value",), "Block": ("body",), "Field": ("of",), "Element": ("of", "index"), "Operation": ("operands",),
    "Intrinsic": ("operands",), "Horner": ("x", "coefficients"), "Invoke": ("operands",), "Make": ("operands",),
}  # fmt: skip


class Calls:
    """The functions of a file, told apart by their parameters; and the variables of the one that is being printed."""

    def __init__(self, items: Iterable[Record | Instance] = ()) -> None:
        self._known = {key_of(f): f for f in items if isinstance(f, Instance)}
        self._names: dict[Key, str] = {}
        shared = Counter(name for name, _ in self._known)
        longest = {name: max(len(k) for n, k in self._known if n == name) for name in shared}
        full = Counter(name for name, kinds in self._known if len(kinds) == longest[name])
        taken = set(shared)
        for key in self._known:
            name, kinds = key
            if full[name] > 1 or len(kinds) < longest[name]:  # the plain name is that of the one with all parameters
                name = f"{name}_{_widest(kinds)}"
                while name in taken:
                    name += "_"
                taken.add(name)
            self._names[key] = name
        self._changed: set[str] = set()
        self._pointers: set[str] = set()

    def name(self, x: Invoke | Instance) -> str:
        """Return a function's name, one that no other has."""
        return self._names[key_of(x)]

    def external(self, name: str) -> set[Key]:
        """Return the functions that call what the host defines under a name, or call those that do."""
        direct = {
            key: {x.name if x.external else key_of(x) for x in parts(f.body) if isinstance(x, Invoke)}
            for key, f in self._known.items()
        }
        found: set[Key] = set()
        while more := {key for key, called in direct.items() if key not in found and (name in called or called & found)}:
            found |= more
        return found

    def enter(self, f: Instance) -> None:
        """Begin a function.

        Raises
        ------
        SubsetError
            It writes to a parameter that its caller does not get back.
        """
        self._pointers = {name for name, _, out in f.parameters if out}
        self._changed = set()
        for x in parts(f.body):
            if isinstance(x, Store):
                self._changed.add(root(x.target))
            elif isinstance(x, Count):
                self._changed.add(x.name)
            elif isinstance(x, Invoke):
                self._changed |= {root(o) for o, out in zip(x.operands, self.outs(x), strict=True) if out}
        own = self._changed & {name for name, _, out in f.parameters if not out}
        if own:
            raise SubsetError(f"{f.name} changes its parameter {', '.join(sorted(own))}: give it a variable of its own")

    def outs(self, x: Invoke) -> tuple[bool, ...]:
        """Return which operands a function writes to."""
        return (False,) * len(x.operands) if x.external else tuple(out for *_, out in self._known[key_of(x)].parameters)

    def changes(self, name: str) -> bool:
        """Whether the function writes to a variable of this name."""
        return name in self._changed

    def pointer(self, name: str) -> bool:
        """Whether a name is that of a parameter that is written to."""
        return name in self._pointers


def key_of(x: Invoke | Instance) -> Key:
    """Return what tells functions apart: a name, and the types of parameters."""
    kinds = (o.type for o in x.operands) if isinstance(x, Invoke) else (kind for _, kind, _ in x.parameters)
    return x.name, tuple(kinds)


def parts(part: Line | Node | tuple[Line | Node, ...] | None) -> Iterator[Line | Node]:
    """Yield lines and nodes, and all that is within them."""
    if isinstance(part, tuple):
        for one in part:
            yield from parts(one)
    elif part is not None:
        yield part
        for name in _PARTS.get(type(part).__name__, ()):
            yield from parts(getattr(part, name))


def root(x: Node) -> str:
    """Return the variable of which something is a part."""
    while isinstance(x, Field | Element):
        x = x.of
    return x.name if isinstance(x, Local) else ""


def _widest(kinds: tuple[Type, ...]) -> int:
    return max((k.size for k in kinds if isinstance(k, Vector)), default=1)
