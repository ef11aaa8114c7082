"""Parameters that live in a TOML file as one table."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from cuticle._support.files import read_text, read_toml, toml_table, write_text
from cuticle._support.plain_values import html_table
from cuticle._support.values import Value

T = TypeVar("T", bound="TomlModel")


@dataclass(frozen=True, init=False, eq=False)
class TomlModel(Value):
    """Frozen parameters that read and write themselves as TOML.

    A class is a dataclass like this one, whose fields have defaults. It sets the name of its table, and `table_remedy`,
    which error messages end with. Its `__init__` checks the values.
    """

    table_name: ClassVar[str]
    table_remedy: ClassVar[str]

    def __init__(self, **values: Any) -> None:
        for f in fields(self):
            object.__setattr__(self, f.name, values.get(f.name, f.default))

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of the parameters."""
        return tuple(f.name for f in fields(cls))

    def values(self, *, without_defaults: bool = False) -> dict[str, Any]:
        """Return the parameters that are set, by their names; if asked, only those that are not the default's."""
        found = {f.name: (getattr(self, f.name), f.default) for f in fields(self)}
        return {k: v for k, (v, default) in found.items() if v is not None and not (without_defaults and v == default)}

    @classmethod
    def from_toml(cls: type[T], text: str, *, source: str = "TOML") -> T:
        """Read it from TOML text with one table; error messages call it `source`."""
        return read_toml(text, {cls.table_name: cls.from_table}, source=source, remedy=cls.table_remedy)

    @classmethod
    def from_table(cls: type[T], table: dict[str, Any]) -> T:
        """Return it from the values of its table."""
        return cls(**table)

    @classmethod
    def load(cls: type[T], path: str | os.PathLike[str]) -> T:
        """Read it from a TOML file."""
        return cls.from_toml(read_text(path, cls.table_name), source=str(path))

    def to_toml(self) -> str:
        """Return TOML text that `from_toml` reads back to an equal value."""
        return toml_table(self.table_name, self.values())

    def _repr_html_(self) -> str:
        return html_table(type(self).__name__, ("parameter", "value"), self.values().items())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a TOML file, whole or not at all."""
        return write_text(path, self.to_toml())
