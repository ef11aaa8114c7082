"""JSON files with a format and a version, read into a pydantic model: each refusal is one line."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn, TypeVar

from pydantic import BaseModel, ValidationError

M = TypeVar("M", bound=BaseModel)


def parse(text: str, schema: type[M], *, what: str, version: int, source: str) -> M:
    """Return the values of JSON text whose "format" is `cuticle-{what}`, or raise ValueError with the reason.

    `version` is the newest that is known.
    """
    try:
        data = read_json(text)
    except json.JSONDecodeError as error:
        at_end = error.pos >= len(text.rstrip()) - 1
        reason = "it ends early (truncated?)" if at_end else f"{error.msg} at line {error.lineno} column {error.colno}"
        raise ValueError(f"{source} is not a {what}: {reason}") from None
    except ValueError as error:
        raise ValueError(f"{source} is refused: {error}") from None
    if not isinstance(data, dict) or data.get("format") != f"cuticle-{what}":
        raise ValueError(
            f'{source} is not a {what}: its "format" is not "cuticle-{what}"; {what.capitalize()}.save writes one'
        )
    found = data.get("version")
    if not isinstance(found, int) or isinstance(found, bool) or found < 1:
        raise ValueError(f"{source} is refused: its version is {found!r}, not a whole number from 1 on")
    if found > version:
        raise ValueError(f"{source} is refused: it has format version {found}, newer than {version}; upgrade cuticle")
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(p) for p in first["loc"])
        raise ValueError(f"{source} is refused: {place}: {first['msg']}") from None


def read_json(text: str) -> Any:
    """Return the values of JSON text, or raise ValueError: also for NaN, infinities and what overflows to one."""
    return json.loads(text, parse_constant=_refuse_constant, parse_float=_finite)


def _finite(digits: str) -> float:
    value = float(digits)
    return value if math.isfinite(value) else _refuse_constant(digits[:40])


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"it holds {name}, which is not a number a table can have")
