"""Reading and writing files: errors in one line, and no half-written files."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

T = TypeVar("T")


def read_text(path: str | os.PathLike[str], what: str) -> str:
    """Return a file's text, or raise ValueError with the reason."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ValueError(f"cannot read {what} {path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"cannot read {what} {path}: it is not text in UTF-8") from None


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write a text file whole or not at all, and return its path."""
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file whole or not at all, and return its path."""
    target = Path(path)
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, target)
    except OSError as error:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)
        raise ValueError(f"cannot write {target}: {error.strerror or error}") from None
    return target


def read_toml(text: str, name: str, make: Callable[[dict[str, Any]], T], *, source: str, remedy: str) -> T:
    """Return what `make` makes of the one table, [name], that TOML text holds; `source` names it in errors."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{source} is not valid TOML: {error}") from None
    table = document.get(name)
    if not isinstance(table, dict) or set(document) != {name}:
        raise ValueError(f"{source} must hold one table, [{name}], got {sorted(document) or 'nothing'}; {remedy}")
    try:
        return make(table)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{source}: {error}") from None


def toml_tables(text: str) -> list[str]:
    """Return the names of the tables of TOML text, an empty list where it is not TOML."""
    try:
        return list(tomllib.loads(text))
    except tomllib.TOMLDecodeError:
        return []


def toml_table(name: str, values: Mapping[str, Any]) -> str:
    """Return numbers, strings and tuples of numbers as TOML text with one table, [name]."""
    lines = [f"[{name}]"]
    for key, value in values.items():
        if isinstance(value, tuple):
            text = f"[{', '.join(repr(float(v)) for v in value)}]"
        else:
            text = f'"{value}"' if isinstance(value, str) else repr(float(value))
        lines.append(f"{key} = {text}")
    return "\n".join(lines) + "\n"


def writable_directory(path: str | os.PathLike[str], *, make: bool = True) -> Path:
    """Return a directory after checking that files can be written to it; create it if `make`, or raise ValueError."""
    target = Path(path)
    try:
        if make:
            target.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=target):
            pass
    except OSError as error:
        raise ValueError(f"cannot write to {target}: {error.strerror or error}") from None
    return target
