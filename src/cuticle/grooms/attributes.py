"""Values that strands carry by name, one each strand or one each point: their shapes, and how they follow the strands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.values import Value

__all__ = ["NONE", "Attributes", "checked", "joined", "on_segments", "readable"]

TAKEN = ("points", "counts", "offsets", "radius", "bend")  # what a groom's own arrays are called, also in its files
MAX_CHANNELS = 32
_NAMED = 8  # attributes in a note
Lost = dict[str, str]  # why an attribute was left out, by its name
Array = NDArray[np.float32]


class Attributes(Value, Mapping[str, Array]):
    """Arrays by name, all read-only. Equal where names and values are, in any order."""

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._arrays = dict(arrays)
        for values in self._arrays.values():
            values.setflags(write=False)

    def __getitem__(self, name: str) -> Array:
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __reduce__(self) -> tuple[Any, ...]:  # NumPy forgets that an array is read-only; the constructor says so again
        return type(self), (self._arrays,)

    def __repr__(self) -> str:
        return f"Attributes({', '.join(f'{name} {values.shape}' for name, values in self.items())})"


NONE = Attributes({})


def checked(given: Mapping[str, ArrayLike], strands: int, points: int) -> Attributes:
    """Return attributes in single precision, or raise: ValueError for a name, a shape or a number that cannot be, TypeError
    for what is no array of numbers.
    """
    if not isinstance(given, Mapping):
        raise TypeError(f"attributes must be a mapping from names to arrays, got {type(given).__name__}")
    if not given:
        return NONE
    # What another groom holds is read-only and was looked at, but for its number of strands and of points.
    held = isinstance(given, Attributes)
    return Attributes({name: _checked(name, values, strands, points, held) for name, values in given.items()})


def _checked(name: str, given: ArrayLike, strands: int, points: int, held: bool = False) -> Array:
    if not isinstance(name, str) or not name.isprintable() or not 1 <= len(name) <= 200:
        raise ValueError(f"the name of an attribute must be 1 to 200 printable characters, got {str(name)[:40]!r}")
    if name in TAKEN:
        raise ValueError(f"an attribute cannot be called {name!r}: {', '.join(TAKEN)} are a groom's own")
    what = f"attribute {name!r}"
    values = validate.real(what, given)
    channels = values.shape[1] if values.ndim == 2 else 1
    if values.ndim not in (1, 2) or len(values) not in (strands, points) or not 1 <= channels <= MAX_CHANNELS:
        raise ValueError(
            f"{what} must have shape ({strands},) or ({strands}, C), one value a strand, or ({points},) or ({points}, C),"
            f" one a point, C from 1 to {MAX_CHANNELS}; got {values.shape}"
        )
    if held:
        return values
    with np.errstate(over="ignore"):  # what is too large for single precision is refused
        values = np.array(values, np.float32)
    finite = np.isfinite(values)
    if not finite.all():
        at = int(np.argmin(finite.reshape(len(values), -1).all(axis=1)))
        place = "strand" if len(values) == strands else "point"
        raise ValueError(f"{what} must be finite numbers in single precision, {place} {at} has {values[at].tolist()}")
    return values


def readable(given: Mapping[str, NDArray], strands: int, points: int) -> tuple[Attributes, Lost]:
    """Return what of a file's values a groom can carry, and why not the rest: no reason to refuse its strands."""
    kept: dict[str, Array] = {}
    lost: Lost = {}
    for name, values in given.items():
        try:
            kept[name] = _checked(name, values, strands, points)
        except (TypeError, ValueError) as error:
            lost[name] = str(error).removeprefix(f"attribute {name!r} ")
    return Attributes(kept), lost


def note(lost: Lost) -> list[str]:
    """Return a note that names what was left out, or none where that is nothing."""
    said = [f"{name} ({why})" for name, why in lost.items()]
    more = [f"{len(said) - _NAMED} more"] * (len(said) > _NAMED)
    return [f"left out attribute {', '.join([*said[:_NAMED], *more])}"] if said else []


def chosen(attributes: Attributes, strands: NDArray[np.bool_], points: NDArray[np.bool_]) -> Attributes:
    """Return the values of some of the strands and of some of the points."""
    return Attributes({n: v[strands if len(v) == len(strands) else points] for n, v in attributes.items()})


def tiled(attributes: Mapping[str, Array], times: int) -> Attributes:
    """Return the values of all strands several times over."""
    return Attributes({n: np.tile(v, (times, *(1,) * (v.ndim - 1))) for n, v in attributes.items()})


def at_points(values: Array, counts: NDArray[np.int64]) -> Array:
    """Return values at every point, (N,) or (N, C): a strand's own at each of its points."""
    return np.repeat(values, counts, axis=0) if len(values) == len(counts) else values


def joined(
    attributes: Sequence[Mapping[str, Array]], counts: Sequence[NDArray[np.int64]], names: Sequence[str]
) -> tuple[Attributes, Lost]:
    """Return the values of all strands of several grooms, and why names are left out that they do not all have alike.

    A strand without a value would have to be given one, and no number stands for none: such a name is left out. Values a
    strand become values a point where another groom has those.
    """
    found: dict[str, Array] = {}
    lost: Lost = {}
    for name in dict.fromkeys(n for a in attributes for n in a):
        without = [k for k, a in enumerate(attributes) if name not in a]
        shapes = {a[name].shape[1:] for a in attributes if name in a}
        if without:
            lost[name] = f"{names[without[0]]} does not have it"
        elif len(shapes) > 1:
            lost[name] = f"its values have {' or '.join(str(s[0] if s else 1) for s in sorted(shapes))} channels"
        else:
            own = [a[name] for a in attributes]
            if any(len(v) != len(c) for v, c in zip(own, counts, strict=True)):
                own = [at_points(v, c) for v, c in zip(own, counts, strict=True)]
            found[name] = np.concatenate(own)
    return Attributes(found), lost


def columns(attributes: Mapping[str, Array], counts: NDArray[np.int64]) -> Array:
    """Return all values at every point side by side, (N, channels of all)."""
    n = int(counts.sum())
    return np.concatenate(
        [np.empty((n, 0), np.float32), *(at_points(v, counts).reshape(n, -1) for v in attributes.values())], 1
    )


def of_columns(values: NDArray, attributes: Mapping[str, Array], strands: int) -> Attributes:
    """Return attributes as `columns` laid them out for so many strands, of other strands of equal numbers of points.

    `values` has shape (strands, points, channels of all). One a strand stays so: blending is the same all along a strand.
    """
    found: dict[str, Array] = {}
    at = 0
    for name, before in attributes.items():
        width = before[:1].size
        own = values[:, :, at : at + width]
        own = own[:, 0] if len(before) == strands else own.reshape(-1, width)
        found[name] = own.astype(np.float32).reshape(-1, *before.shape[1:])
        at += width
    return Attributes(found)


def on_segments(values: Array, offsets: NDArray[np.int64]) -> Array:
    """Return values at the begin and the end of each segment between two points of a strand: (segments, 2, C)."""
    values = values.reshape(len(values), -1)
    counts = np.diff(offsets)
    if len(values) == len(counts):
        return np.repeat(np.repeat(values[:, None], 2, axis=1), counts - 1, axis=0)
    begins = np.delete(np.arange(len(values)), offsets[1:] - 1)
    return np.stack([values[begins], values[begins + 1]], axis=1)
