"""Public names whose modules are imported when a name is first asked for.

This module is what `import cuticle` takes its time for: it imports nothing that Python has not imported itself.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module

TYPE_CHECKING = False  # as type checkers know it; `typing` would double the time
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def attach(package: str, names: dict[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return a package's `__getattr__`, `__dir__` and `__all__` for public names and the modules that hold them.

    A name whose module is the package itself is a module in it.
    """

    def get(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = names[name]
        value = import_module(f"{package}.{name}") if home == package else getattr(import_module(home), name)
        setattr(sys.modules[package], name, value)  # the next time nothing is asked
        return value

    return get, lambda: list(names), list(names)


def attach_stub(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return the same for the names that the stub beside a package's `__init__.py` imports, one a line."""
    with open(os.path.splitext(file)[0] + ".pyi", encoding="utf-8") as stub:
        lines = [line.split() for line in stub]  # from .checking.audit import audit as audit
    return attach(package, {name: package + home.rstrip(".") for _, home, _, name, *_ in lines})
