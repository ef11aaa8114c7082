"""JSON files with a format and a version, held against a JSON Schema: each refusal is one line."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any, NoReturn

Schema = Mapping[str, Any]
NUMBER: Schema = {"type": "number"}
_TYPES: dict[str, tuple[type, ...]] = {
    "array": (list,),
    "boolean": (bool,),
    "integer": (int,),
    "null": (type(None),),
    "number": (int, float),
    "object": (dict,),
    "string": (str,),
}


def array(items: Schema, depth: int = 1) -> Schema:
    """Return the schema of a list, or of lists in lists down to `depth`."""
    return {"type": "array", "items": items if depth == 1 else array(items, depth - 1)}


def file_schema(what: str, required: Mapping[str, Schema], optional: Mapping[str, Schema]) -> dict[str, Any]:
    """Return the schema of a file of the format `cuticle-{what}`, which holds these keys and no others."""
    head = {"format": {"type": "string"}, "version": {"type": "integer"}}
    return {
        "title": f"cuticle-{what}",
        "type": "object",
        "properties": {**head, **required, **optional},
        "required": [*head, *required],
        "additionalProperties": False,
    }


def parse(text: str, schema: Schema, *, what: str, version: int, source: str) -> dict[str, Any]:
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
    wrong = mismatch(data, schema)
    if wrong:
        raise ValueError(f"{source} is refused: {wrong}")
    return data


def mismatch(value: Any, schema: Schema, place: str = "") -> str:
    """Return the first place where a value breaks a schema, and how, or "".

    Of JSON Schema it knows `type`, `items`, `properties`, `required` and `additionalProperties`.
    """
    names = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if not any(type(value) in _TYPES[name] for name in names):  # True is no number
        return f"{place or 'the file'} must be of type {' or '.join(names)}, got {json.dumps(value)[:40]}"
    if isinstance(value, list):
        return _first(mismatch(x, schema["items"], f"{place}.{i}") for i, x in enumerate(value))
    if isinstance(value, dict) and "properties" in schema:
        known, missing = schema["properties"], [name for name in schema["required"] if name not in value]
        unknown = [name for name in value if name not in known and not schema["additionalProperties"]]
        if missing or unknown:
            return f"{missing[0]} is missing" if missing else f"it holds {unknown[0][:40]!r}, which is not known"
        return _first(mismatch(x, known[name], f"{place}.{name}".lstrip(".")) for name, x in value.items() if name in known)
    return ""


def _first(found: Iterable[str]) -> str:
    return next(filter(None, found), "")


def read_json(text: str) -> Any:
    """Return the values of JSON text, or raise ValueError: also for NaN, infinities and what overflows to one."""
    return json.loads(text, parse_constant=_refuse_constant, parse_float=_finite)


def _finite(digits: str) -> float:
    value = float(digits)
    return value if math.isfinite(value) else _refuse_constant(digits[:40])


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"it holds {name}, which is not a number a table can have")
