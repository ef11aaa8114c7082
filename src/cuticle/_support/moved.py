"""Import paths that the documentation used to name. They work for one release, and warn."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from types import ModuleType

TYPE_CHECKING = False  # as type checkers know it: `import cuticle` imports this module, and leaves `typing` out
if TYPE_CHECKING:
    from typing import Any

MOVED = {
    "conventions": "scattering.conventions",
    "densities": "sampling.densities",
    "document": "draft",
    "document.tables": "draft.tables",
    "document.figures": "draft.figures",
    "presets": "scattering.presets",
    "render.density": "grooms.density_grid",
    "render.groom": "grooms.groom",
    "render.procedural": "grooms.procedural",
    "sampler": "sampling.sampler",
}
# `from cuticle.document import table_1`: a package that held its names itself
_HELD = ("draft.tables", "draft.functions", "draft.gaussians", "draft.printed", "draft.claims", "draft.document")


class _Moved(ModuleType):
    """A module at an old path that returns the names of the new one."""

    def __init__(self, old: str, new: str) -> None:
        super().__init__(old, f"Moved to {new}.")
        self.__dict__["_new"] = new
        self.__dict__["__path__"] = []  # a module may have had modules in it

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        new = self.__dict__["_new"]
        for place in _held(new):
            module = import_module(place)
            if hasattr(module, name):
                warnings.warn(f"{self.__name__} has moved: import {name} from {place}", DeprecationWarning, stacklevel=2)
                return getattr(module, name)
        raise AttributeError(f"module {self.__name__!r}, which has moved to {new}, has no attribute {name!r}")


def _held(new: str) -> tuple[str, ...]:
    return tuple(f"cuticle.{name}" for name in _HELD) if new == "cuticle.draft" else (new,)


def install() -> None:
    """Add the old paths to `sys.modules`, unless a module of that name exists."""
    for old, new in MOVED.items():
        name = f"cuticle.{old}"
        sys.modules.setdefault(name, _Moved(name, f"cuticle.{new}"))
