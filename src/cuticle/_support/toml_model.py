"""Parameters that live in a TOML file as one table."""

from __future__ import annotations

import copy
import os
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict

from cuticle._support.files import read_text, read_toml, toml_table, write_text
from cuticle._support.plain_values import html_table
from cuticle._support.values import without_caches

T = TypeVar("T", bound="TomlModel")


class TomlModel(BaseModel):
    """Frozen parameters that read and write themselves as TOML.

    A class sets the name of its table, and `table_remedy`, which error messages end with.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    table_name: ClassVar[str]
    table_remedy: ClassVar[str]

    def __getstate__(self) -> dict[Any, Any]:
        state = super().__getstate__()
        return state | {"__dict__": without_caches(type(self), state["__dict__"])}

    def __copy__(self: T) -> T:
        other = type(self).__new__(type(self))
        other.__setstate__(copy.deepcopy(self.__getstate__()))
        return other

    def __deepcopy__(self: T, memo: dict[int, Any] | None = None) -> T:
        return self.__copy__()

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
        return toml_table(self.table_name, self.model_dump(exclude_none=True))

    def _repr_html_(self) -> str:
        return html_table(type(self).__name__, ("parameter", "value"), self.model_dump(exclude_none=True).items())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a TOML file, whole or not at all."""
        return write_text(path, self.to_toml())
