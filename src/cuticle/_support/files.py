"""Reading and writing files: errors in one line, sizes checked before memory is taken, and no half-written files."""

from __future__ import annotations

import errno
import os
import re
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

T = TypeVar("T")
LARGEST = 2 * 10**9  # bytes that a file may ask for
_TEXT_GROWS = 10  # how many times its own bytes a text takes once it is numbers: 32 for each, and some characters
_CHUNK = 1 << 20
_LONGEST = 400  # characters of a message: it may quote the file
_PARTS = 30  # of a TOML key, with dots between: Python's reader takes the square of their number
_MANY_PARTS = re.compile(rf"(?:\.[^.,=#\n]+){{{_PARTS}}}")
_unlimited = ContextVar("_unlimited", default=False)


@contextmanager
def reading(path: str | os.PathLike[str], what: str = "file", *, remedy: str = "") -> Iterator[None]:
    """Turn any failure within into a ValueError of one line, `cannot read {what} {path}: {reason}; {remedy}`.

    A file can be wrong in more ways than its readers foresee: a decoder of any library may raise whatever it likes. A
    ValueError that names the path already passes unchanged.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, ValueError) and re.search(rf"(?<!\S){re.escape(str(path))}(?!\w)", str(error)):
            if len(str(error)) <= _LONGEST:
                raise
            raise ValueError(_clipped(error)) from None
        message = f"cannot read {what} {path}: {_reason(error)}" + (f"; {remedy}" if remedy else "")
        foreseen = isinstance(error, (OSError, ValueError, TypeError))
        raise ValueError(message) from (None if foreseen else error)  # for one that is not, the cause stays at hand


def _reason(error: Exception) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error) or type(error).__name__
    if isinstance(error, UnicodeDecodeError):
        return "it is not text in UTF-8"
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    text = _clipped(error)
    plain = isinstance(error, (ValueError, TypeError, OverflowError)) and text
    return text if plain else f"it is damaged ({type(error).__name__}: {text})"


def _clipped(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …"


@contextmanager
def allow_large() -> Iterator[None]:
    """Within this context, files may ask for more than 2 GB of memory."""
    token = _unlimited.set(True)
    try:
        yield
    finally:
        _unlimited.reset(token)


def largest() -> int:
    """Return how many bytes a file may ask for here."""
    return sys.maxsize if _unlimited.get() else LARGEST


def check_size(size: int, what: str = "it") -> None:
    """Raise ValueError where a file is about to take over 2 GB; call it before memory is taken."""
    if size > largest():
        raise ValueError(
            f"{what} needs {size / 1e9:,.3g} GB, the limit is {LARGEST / 1e9:g} GB; --allow-large, in Python"
            " cuticle.allow_large(), lifts it"
        )


@contextmanager
def opened(path: str | os.PathLike[str], *, text: bool = False) -> Iterator[BinaryIO]:
    """Open a file to read after checking its size, that of a text by what it takes once it is parsed."""
    with open(path, "rb") as file:
        check_size(os.fstat(file.fileno()).st_size * (_TEXT_GROWS if text else 1))
        yield file


def read_bytes(path: str | os.PathLike[str], what: str, *, text: bool = False) -> bytes:
    """Return a whole file, or raise ValueError with the reason."""
    data = bytearray()
    with reading(path, what), opened(path, text=text) as file:
        while chunk := file.read(_CHUNK):  # a pipe or a device does not say how much it holds
            data += chunk
            check_size(len(data) * (_TEXT_GROWS if text else 1))
    return bytes(data)


def read_text(path: str | os.PathLike[str], what: str) -> str:
    """Return the text of a file, or raise ValueError with the reason."""
    with reading(path, what):
        return read_bytes(path, what, text=True).decode("utf-8-sig")


def shown(path: str | os.PathLike[str]) -> str:
    """Return a path as text for pages, pictures and files: bytes in it that are no text are escaped."""
    return str(path).encode("utf-8", "backslashreplace").decode()


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write a text file as `write_bytes` does, and return its path."""
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file whole or not at all, and return its path.

    A link is followed. A file that exists keeps its mode and its owner. What is no regular file (a device, a FIFO) is
    written straight into, and so is a file that others share: one with several names, or of an owner we cannot give it.
    """
    target = Path(path)
    try:
        before = target.stat() if target.exists() else None
        if before is None or (stat.S_ISREG(before.st_mode) and before.st_nlink == 1 and not _is_standard_output(before)):
            _replace(Path(os.path.realpath(target)), data, before)
        else:
            _write_into(target, data)
    except OSError as error:
        raise ValueError(f"cannot write {target}: {error.strerror or error}") from None
    return target


def _replace(target: Path, data: bytes, before: os.stat_result | None) -> None:
    """Write a new file beside the target and give it the target's name."""
    if before is not None and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, "it is read-only")
    handle, temporary = tempfile.mkstemp(prefix=".cuticle-", dir=target.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        if before is None:
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(temporary, 0o666 & ~mask)
        else:
            made = os.stat(temporary)
            if (made.st_uid, made.st_gid) != (before.st_uid, before.st_gid):
                try:
                    os.chown(temporary, before.st_uid, before.st_gid)
                except PermissionError:
                    _write_into(target, data)
                    return
            os.chmod(temporary, stat.S_IMODE(before.st_mode))  # after chown, which clears bits
        os.replace(temporary, target)
    finally:
        if os.path.exists(temporary):  # also when it is stopped
            os.unlink(temporary)


def _write_into(target: Path, data: bytes) -> None:
    with open(target, "wb") as file:
        file.write(data)


def _is_standard_output(found: os.stat_result) -> bool:
    """Whether a file is what standard output or error goes to: to replace it would lose what was printed."""
    for descriptor in (1, 2):
        with suppress(OSError):
            if os.path.samestat(found, os.fstat(descriptor)):
                return True
    return False


def read_toml(text: str, make: Mapping[str, Callable[[dict[str, Any]], T]], *, source: str, remedy: str) -> T:
    """Return what is made of the one table that TOML text holds, by its name; `source` names it in errors."""
    with reading(source, "TOML"):
        if _MANY_PARTS.search(text):
            raise ValueError(f"a key has over {_PARTS} parts with dots between; this table's keys have one")
        try:
            document = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise ValueError(f"{source} is not valid TOML: {error}") from None
        name = next((n for n in document if n in make), None)
        if name is None or not isinstance(document[name], dict) or len(document) > 1:
            known = " or ".join(f"[{n}]" for n in ([name] if name else make))
            raise ValueError(f"{source} must hold one table, {known}, got {sorted(document) or 'nothing'}; {remedy}")
        try:
            return make[name](document[name])
        except (TypeError, ValueError) as error:
            raise ValueError(f"{source}: {error}") from None


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


def check_file(path: str | os.PathLike[str]) -> Path:
    """Return the path of a file after checking that it can be written, or raise ValueError; nothing is made."""
    target = Path(path)
    if not str(path):
        raise ValueError("the file to write has no name: give -o FILE")
    if target.is_dir():
        raise ValueError(f"cannot write {target}: it is a folder; name the file")
    if target.exists():
        if stat.S_ISSOCK(target.stat().st_mode):
            raise ValueError(f"cannot write {target}: it is a socket")
        if not os.access(target, os.W_OK):
            raise ValueError(f"cannot write {target}: it is read-only")
        if not target.is_file():
            return target
    try:
        folder = Path(os.path.realpath(target)).parent
    except OSError as error:  # the current folder is gone
        raise ValueError(f"cannot write to {target}: {error.strerror or error}") from None
    if not folder.is_dir():
        raise ValueError(f"cannot write to {target.parent}: No such file or directory")
    _check_writable(folder, target)
    return target


def check_directory(path: str | os.PathLike[str]) -> Path:
    """Return a folder's path after checking that it is one, or can be made, and can be written to; nothing is made."""
    target = Path(path)
    if str(path) == "-":
        raise ValueError(
            "cannot write several files to standard output: give -o DIR; `-` is for commands that write one text"
        )
    there = next(p for p in (target, *target.parents) if p.exists() or p.is_symlink())
    if not there.is_dir():
        kind = "file" if there.exists() else "link to nothing"
        raise ValueError(f"cannot write to {target}: {there} is a {kind}: Not a directory")
    _check_writable(there, target)
    return target


def _check_writable(folder: Path, target: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ValueError(f"cannot write to {target}: {error.strerror or error}") from None


def make_directory(path: str | os.PathLike[str]) -> Path:
    """Return a folder, made with its parents if it is missing, or raise ValueError."""
    target = check_directory(path)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"cannot write to {target}: {error.strerror or error}") from None
    return target


@contextmanager
def filling(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a folder to write to; its files move to `path` at the end, and none do if the work fails or is stopped."""
    target = check_directory(path)
    with tempfile.TemporaryDirectory(prefix="cuticle-") as work:
        yield Path(work)
        for file in sorted(p for p in Path(work).rglob("*") if p.is_file()):
            place = target / file.relative_to(work)
            make_directory(place.parent)
            write_bytes(place, file.read_bytes())
