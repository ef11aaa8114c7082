"""Values: what equality, hashing, copying, pickling and other processes need, for every public class alike."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import fields, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np


class Value:
    """A value that can be compared, hashed, copied, pickled and sent to another process, used or not.

    What was computed on the way, its cached properties, is left behind and made again when asked for: objects of the
    compiled core cannot be pickled. An array that was read-only is so again; NumPy itself forgets it. Two values are equal
    if they are of one class and the state that they were made with is; `compare=False` takes a dataclass's field out.
    """

    def __getstate__(self) -> dict[str, Any]:
        state = without_caches(type(self), vars(self))
        return state | {_READ_ONLY: [k for k, v in state.items() if isinstance(v, np.ndarray) and not v.flags.writeable]}

    def __setstate__(self, state: dict[str, Any]) -> None:
        read_only = state.pop(_READ_ONLY)
        vars(self).update(state)
        for name in read_only:
            vars(self)[name].setflags(write=False)

    def __eq__(self, other: object) -> bool:
        return self is other or (type(other) is type(self) and _key(self) == _key(other))

    def __hash__(self) -> int:
        return hash(_key(self))


_READ_ONLY = "read-only arrays"


def without_caches(cls: type, state: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object's attributes without what its cached properties hold."""
    cached = {name for c in cls.__mro__ for name, v in vars(c).items() if isinstance(v, cached_property)}
    return {k: v for k, v in state.items() if k not in cached}


def _key(value: Any) -> Hashable:
    """Return what is equal for equal values, NaN being equal to itself, and can be hashed."""
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            return value.shape, *map(_key, value.ravel())
        return value.shape, value.dtype.str, (value + 0 if value.dtype.kind == "f" else value).tobytes()  # -0 is 0
    if isinstance(value, float) and value != value:
        return float, "nan"
    if isinstance(value, Mapping):
        return frozenset((k, _key(v)) for k, v in value.items())
    if isinstance(value, (list, tuple)):
        return tuple(map(_key, value))
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), *(_key(getattr(value, f.name)) for f in fields(value) if f.compare)
    if isinstance(value, Value):
        return type(value), _key(without_caches(type(value), vars(value)))
    return value
