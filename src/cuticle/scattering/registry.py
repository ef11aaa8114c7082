"""Scattering functions of the first class: those that the command line, a sampler's file and exports know by themselves.

A class becomes one by the decorator `first_class`, in a module of this package. It offers

- `eval(theta_i, theta_r, phi)`, as every `Bcsdf` does;
- `to_dict()`, values that JSON can hold, and `from_dict(data)`, which makes an equal function of them;
- `table_name`, if it reads itself from a TOML file with that one table by `from_table(values)`;
- `suffixes`, if it reads itself from files with these endings by `load(path)`;
- `host_tables()`, if the core has closed forms for it; exports carry any other as a compact table.

docs/extending/fibre_model.md is a worked example.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

T = TypeVar("T", bound=type)
Restore = Callable[[dict[str, Any]], Any]

_CLASSES: dict[str, Any] = {}
_SOURCES: dict[str, Restore] = {}


def first_class(cls: T) -> T:
    """Register a class under its own name."""
    _CLASSES[cls.__name__] = cls
    return cls


def restores(key: str) -> Callable[[Restore], Restore]:
    """Register a function that makes a scattering function of a `source` dictionary that holds `key`."""

    def register(restore: Restore) -> Restore:
        _SOURCES[key] = restore
        return restore

    return register


@cache
def _import_all() -> None:
    package = importlib.import_module(__package__ or "")
    for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        importlib.import_module(module.name)


def classes() -> dict[str, Any]:
    """Return every registered class by its name."""
    _import_all()
    return _CLASSES


def sources() -> dict[str, Restore]:
    """Return every registered way to make a function of a `source`, by the key that tells it."""
    _import_all()
    return _SOURCES
