"""Checks of user input. A message is one line: the name, its range, the value received, the remedy."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core

HALF_PI = math.pi / 2
MAX_STRANDS = 1e4
Ranges = Mapping[str, tuple[float, float, str, str, bool]]  # name: low, high, unit, remedy, open at the low end
RADIANS = "angles are in radians: np.radians(...) converts degrees"


def number(
    name: str, value: Any, low: float, high: float, *, unit: str = "", remedy: str = "", above: bool = False
) -> float:
    """Return `value` as a float in [low, high] ((low, high] with `above`), or raise ValueError/TypeError."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{name} must be a number, got {_shown(value)}")
    x = float(value)
    if not (low < x if above else low <= x) or not x <= high:
        end = min((low, high), key=lambda end: abs(x - end))
        if isinstance(value, np.float32) and not (above and end == low) and abs(x - end) <= _slack(value.dtype, end):
            return float(end)
        raise ValueError(_outside(name, x, low, high, unit=unit, remedy=remedy, above=above))
    return x


def ranges(values: Mapping[str, Any], allowed: Ranges) -> dict[str, Any]:
    """Return `values` without those that are None; raise for a number outside the range in `allowed`."""
    out = {name: value for name, value in values.items() if value is not None}
    for name, (low, high, unit, remedy, above) in allowed.items():
        if name in out:
            out[name] = number(name, out[name], low, high, unit=unit, remedy=remedy, above=above)
    return out


def channel_values(name: str, given: Any, low: float, high: float, *, unit: str = "", remedy: str = "") -> tuple[float, ...]:
    """Return 1 to 32 channel values, each in [low, high]; a single number is one channel."""
    channels = given if isinstance(given, (list, tuple)) or (isinstance(given, np.ndarray) and given.ndim) else [given]
    if not 1 <= len(channels) <= 32:
        raise ValueError(f"{name} must have 1 to 32 channels, got {len(channels)}; linear RGB has 3")
    return tuple(
        number(f"{name}[{i}]" if len(channels) > 1 else name, x, low, high, unit=unit, remedy=remedy)
        for i, x in enumerate(channels)
    )


def integer(name: str, value: Any, low: int, high: int, *, remedy: str = "") -> int:
    """Return `value` as an int in [low, high]."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} must be a whole number, got {value!r}")
    if not low <= value <= high:
        raise ValueError(_outside(name, int(value), low, high, unit="", remedy=remedy, above=False))
    return int(value)


def random_numbers(seed: Any) -> np.random.Generator:
    """Return a generator of random numbers from a seed, which must be a whole number of 0 or more."""
    return np.random.default_rng(integer("seed", seed, 0, 2**63 - 1))


def flag(name: str, value: Any) -> bool:
    """Return `value` if it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be true or false, got {value!r}")
    return bool(value)


def choice(name: str, value: Any, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of `allowed`."""
    options = list(allowed)
    if not isinstance(value, str) or value not in options:  # an array compares by element
        raise ValueError(f"{name} must be one of {', '.join(options)}; got {value!r}")
    return str(value)


def strand_counts(name: str, values: Any) -> tuple[float, ...]:
    """Return increasing strand counts, at least one, each in [0, 10,000]."""
    if np.ndim(values) != 1 or not len(values):
        raise ValueError(f"{name} must be a list of counts such as [0, 1, 2, 4, 8], got {values!r}")
    counts = tuple(number(name, n, 0, MAX_STRANDS, remedy="it counts strands toward the light") for n in values)
    if any(b <= a for a, b in pairwise(counts)):
        raise ValueError(f"{name} must be increasing, got {', '.join(f'{n:g}' for n in counts)}")
    return counts


def real(name: str, value: Any) -> NDArray:
    """Return an array of integers or floats; raise TypeError for what converts to numbers that were not meant.

    Those are complex numbers, texts, booleans, dates, objects, and masked arrays, whose mask would be lost.
    """
    masked = sys.modules.get("numpy.ma")  # nothing is masked before it is imported, which takes as long as half of NumPy
    if masked is not None and isinstance(value, masked.MaskedArray):
        raise TypeError(
            f"{name} must be an array of numbers, got a masked array; .filled(np.nan) makes holes of what is masked"
        )
    try:
        x = np.asarray(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be an array of numbers, got {type(value).__name__}") from None
    if x.dtype.kind not in "iuf":
        got = f"an array of {x.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
        raise TypeError(f"{name} must be an array of numbers, got {got}")
    return x


def strands_of_light(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return numbers of strands that light meets, or expectations of them, as an array, each in [0, 10,000]."""
    x = real(name, value).astype(np.float64)
    wrong = x[~((x >= 0) & (x <= MAX_STRANDS))]  # a NaN is wrong, too
    if wrong.size:
        raise ValueError(f"{name} must be in [0, {MAX_STRANDS:,.0f}], got {float(wrong.flat[0]):g}")
    return x


def array(
    name: str, value: ArrayLike, low: float, high: float, dtype: Any, *, remedy: str, open_end: bool = False
) -> NDArray:
    """Return `value` as a contiguous array of `dtype`, every element in [low, high] ([low, high) with `open_end`)."""
    given = real(name, value)
    x = np.ascontiguousarray(given, dtype=dtype).reshape(given.shape)
    widened = given.dtype == np.float32 and x.dtype == np.float64
    slack = 0.0 if open_end else _slack(np.dtype(np.float32) if widened else x.dtype, max(abs(low), abs(high)))
    at = _core.first_outside(x, float(low) - slack, float(high) + slack, open_end)
    if at < 0 and widened and not open_end:
        return np.clip(x, low, high)
    if at >= 0:
        place = f" at {name}[{', '.join(map(str, np.unravel_index(at, x.shape)))}]" if x.ndim else ""
        close = ")" if open_end else "]"
        raise ValueError(f"{name} must lie in [{low:.6g}, {high:.6g}{close}, got {float(x.flat[at]):.6g}{place}; {remedy}")
    return x


def angles(name: str, value: ArrayLike, limit: float, dtype: Any) -> NDArray:
    """Return `value` as angles in radians within ±limit."""
    return array(name, value, -limit, limit, dtype, remedy=RADIANS)


def directions(
    theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, dtype: Any = np.float64
) -> tuple[NDArray, NDArray, NDArray]:
    """Return theta_i and theta_r in ±pi/2 and phi, their difference in azimuth, in ±4 pi."""
    ti, tr = angles("theta_i", theta_i, HALF_PI, dtype), angles("theta_r", theta_r, HALF_PI, dtype)
    return ti, tr, angles("phi", phi, 4 * np.pi, dtype)


def random_triples(u: ArrayLike, dtype: Any, meaning: str = "lobe, theta, phi") -> NDArray:
    """Return `u` as an array of shape (..., 3), random numbers in [0, 1); `meaning` says what the three are for."""
    x = array("u", u, 0, 1, dtype, remedy="u are random numbers in [0, 1)", open_end=True)
    if x.ndim < 1 or x.shape[-1] != 3:
        raise ValueError(f"u must have shape (..., 3): {meaning}; got {x.shape}")
    return x


def broadcast(**arrays: NDArray) -> tuple[int, ...]:
    """Return the common shape of `arrays`, or raise ValueError that tells each one's shape."""
    try:
        return np.broadcast_shapes(*(a.shape for a in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in arrays.items())
        raise ValueError(f"shapes do not broadcast together: {shapes}; give arrays of one shape, or add axes") from None


def flat(x: NDArray, shape: tuple[int, ...]) -> NDArray:
    """Return `x` as the core takes it: one value, or the whole of `shape` laid out flat."""
    return x.reshape(1) if x.size == 1 else np.ascontiguousarray(np.broadcast_to(x, shape)).reshape(-1)


def float_type(*values: ArrayLike) -> Any:
    """Return float32 if every array among `values` is single precision, else float64; plain numbers do not count."""
    kinds = {np.asarray(v).dtype for v in values if isinstance(v, (np.ndarray, np.generic))}
    return np.float32 if kinds == {np.dtype(np.float32)} else np.float64


def _shown(value: Any) -> str:
    """Return a value for a message, on one line: of what takes more, its type."""
    text = repr(value)
    return text if len(text) <= 80 and "\n" not in text else f"{type(value).__name__} {text[:40].splitlines()[0]}…"


def _slack(kind: np.dtype, end: float) -> float:
    """Return by how much a number may pass an end: in fewer digits it may round past one that a double respects."""
    return 4 * float(np.finfo(kind).eps) * abs(end)


def _outside(name: str, x: float, low: float, high: float, *, unit: str, remedy: str, above: bool) -> str:
    unit = f" {unit}" if unit else ""
    text = f"{name} must be in {'(' if above else '['}{low:g}, {high:g}]{unit}, got {x:g}"
    return f"{text}; {remedy}" if remedy else text
