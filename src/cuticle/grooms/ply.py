"""Reads strands from PLY: polylines as lists of vertices or as edges, or vertices that name their strand."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support.files import check_size, read_bytes
from cuticle.grooms.attributes import note

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4",
    "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_LISTS = ("vertex_indices", "vertex_index")
_STRAND = ("strand", "strand_id", "strand_index")
_NORMAL = ("nx", "ny", "nz")
_ENDS = ("vertex1", "vertex2")
_WIDTHS = {"radius": 1.0, "width": 0.5, "thickness": 0.5}
_LONGEST = 65536  # bytes of a header


class Element(NamedTuple):
    """An element of the header: how many rows it has, and its properties as (name, type, type of a list's length or "")."""

    name: str
    number: int
    properties: list[tuple[str, str, str]]


def read_ply(path: Path) -> tuple[Any, ...]:
    """Return points, points of each strand, radii where vertices have radius, width or thickness, no bend, notes, and the
    other properties of vertices and of the element that lists strands as attributes.

    Strands are, in this order, the lists `vertex_indices` of an element that is not "face"; the chains of the element
    "edge" (vertex1, vertex2), each edge in the direction of its strand; or the runs of a vertex property strand, strand_id
    or strand_index.
    """
    data = read_bytes(path, "groom")
    order, elements, at = _header(data)
    arrays = _text(data[at:], elements) if order is None else _binary(data, at, order, elements)
    vertex = arrays.get("vertex", {})
    missing = [a for a in "xyz" if not isinstance(vertex.get(a), np.ndarray)]
    if missing:
        raise ValueError(f"its vertices have no {', '.join(missing)}")
    points = np.column_stack([vertex[a] for a in "xyz"])
    indices, counts, source = _strands(arrays, len(points))
    if len(indices) and not (indices.min() >= 0 and indices.max() < len(points)):
        wrong = int(indices[np.argmax((indices < 0) | (indices >= len(points)))])
        raise ValueError(f"a strand names vertex {wrong}, the file has {len(points)}")
    found = next((name for name in _WIDTHS if name in vertex), None)
    radius = None if found is None else _WIDTHS[found] * vertex[found][indices]
    attributes, notes = _attributes(arrays, source, indices)
    return points[indices], counts, radius, None, notes, attributes


def _attributes(
    arrays: dict[str, Columns], source: str, indices: NDArray[np.int64]
) -> tuple[dict[str, NDArray], tuple[str, ...]]:
    """The properties of vertices, at every point, and of the element `source` that lists strands, one each; and a note on
    what neither is.
    """
    used = {*"xyz", *_NORMAL, *_WIDTHS, *_LISTS, *_ENDS, source}
    points, strands = (
        {n: v for n, v in arrays.get(e, {}).items() if n not in used}
        for e in ("vertex", "" if source == "vertex" else source)
    )
    lost = {n: "a list for each" for n, v in (points | strands).items() if not isinstance(v, np.ndarray)}
    if source == "edge":
        lost |= dict.fromkeys(strands, "edges have it, not strands")
    else:
        lost |= {n: f"both vertex and {source} have one" for n in points if n in strands}
    found = {n: np.asarray(v)[indices] for n, v in points.items() if n not in lost}
    return found | {n: np.asarray(v) for n, v in strands.items() if n not in lost}, tuple(note(lost))


def _header(data: bytes) -> tuple[str | None, list[Element], int]:
    """The byte order (None: text), the elements, and where they begin."""
    if data[:3] != b"ply":
        raise ValueError(f"not a PLY file: bytes 0 to 3 are {data[:3]!r}, not b'ply'")
    end = data.find(b"end_header", 0, _LONGEST)
    body = data.find(b"\n", end) + 1 if end >= 0 else 0
    if not body:
        raise ValueError(f"its header has no end_header in its first {_LONGEST} bytes")
    order, elements = "", []
    for number, line in enumerate(data[:end].decode("latin-1").splitlines()[1:], 2):
        try:
            match line.split():
                case ["format", "ascii", _]:
                    order = "ascii"
                case ["format", name, _]:
                    order = _ORDERS[name]
                case ["element", name, count] if int(count) >= 0:
                    elements.append(Element(name, int(count), []))
                case ["property", "list", length, kind, name] if _TYPES[length][0] != "f":
                    elements[-1].properties.append((name, _TYPES[kind], _TYPES[length]))
                case ["property", kind, name] if kind != "list":
                    elements[-1].properties.append((name, _TYPES[kind], ""))
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case _:
                    raise ValueError
        except (KeyError, IndexError, ValueError):
            raise ValueError(f"line {number} of its header is none that PLY has: {line.strip()[:60]!r}") from None
    if not order:
        raise ValueError("its header names no format")
    return None if order == "ascii" else order, elements, body


Columns = dict[str, NDArray | list[NDArray]]


def _binary(data: bytes, at: int, order: str, elements: list[Element]) -> dict[str, Columns]:
    out: dict[str, Columns] = {}
    for e in elements:
        if any(length for _, _, length in e.properties):
            out[e.name], at = _binary_rows(data, at, order, e)
            continue
        kind = np.dtype([(f"{k}", order + t) for k, (_, t, _) in enumerate(e.properties)])
        if at + e.number * kind.itemsize > len(data):
            raise ValueError(f"cut short: {e.number} of {e.name} need {e.number * kind.itemsize} bytes from byte {at}")
        rows = np.frombuffer(data, kind, e.number if kind.itemsize else 0, at)
        out[e.name] = {name: rows[f"{k}"].astype(np.float64) for k, (name, _, _) in enumerate(e.properties)}
        at += e.number * kind.itemsize
    return out


def _binary_rows(data: bytes, at: int, order: str, e: Element) -> tuple[Columns, int]:
    """An element with lists, row by row."""
    if e.number > len(data):
        raise ValueError(f"cut short: {e.number} of {e.name} need more than its {len(data)} bytes")
    columns: dict[str, list] = {name: [] for name, _, _ in e.properties}
    for row in range(e.number):
        for name, kind, length in e.properties:
            count = 1
            for part in (length, kind) if length else (kind,):
                size = np.dtype(part).itemsize * (count if part is kind else 1)
                if at + size > len(data):
                    raise ValueError(f"cut short: {name} of {e.name} {row} needs bytes {at} to {at + size}")
                values = np.frombuffer(data, order + part, count if part is kind else 1, at)
                at += size
                if length and part is length:
                    count = int(values[0])
                    if count < 0:
                        raise ValueError(f"{name} of {e.name} {row} has {count} values")
            columns[name].append(values if length else float(values[0]))
    return {n: columns[n] if length else np.array(columns[n]) for n, _, length in e.properties}, at


def _text(body: bytes, elements: list[Element]) -> dict[str, Columns]:
    check_size(10 * len(body))
    words = body.split()
    try:
        numbers = np.array(words, np.float64)
    except ValueError as error:
        raise ValueError(f"not all of its values are numbers: {str(error)[:80]}") from None
    out: dict[str, Columns] = {}
    at = 0
    for e in elements:
        lists = [length for _, _, length in e.properties if length]
        if not lists:
            width = len(e.properties)
            if at + width * e.number > len(numbers):
                raise ValueError(
                    f"cut short: {e.number} of {e.name} need {width * e.number} numbers, {len(numbers) - at} are left"
                )
            rows = numbers[at : at + width * e.number].reshape(-1, width)
            out[e.name] = {name: rows[:, k] for k, (name, _, _) in enumerate(e.properties)}
            at += width * e.number
            continue
        columns: dict[str, list] = {name: [] for name, _, _ in e.properties}
        for row in range(e.number):
            for name, _, length in e.properties:
                count = numbers[at] if length and at < len(numbers) else 1.0
                at += bool(length)
                if not (0 <= count <= len(numbers) - at and count == int(count)):
                    raise ValueError(f"cut short or damaged: {name} of {e.name} {row}")
                values = numbers[at : at + int(count)]
                at += int(count)
                columns[name].append(values if length else float(values[0]))
        out[e.name] = {n: columns[n] if length else np.array(columns[n]) for n, _, length in e.properties}
    return out


def _strands(arrays: dict[str, Columns], points: int) -> tuple[NDArray[np.int64], NDArray[np.int64], str]:
    """The vertices of all strands, one strand after the other, how many each has, and the element or the property of
    vertices that says so.
    """
    for element, columns in arrays.items():
        lists = next((columns[n] for n in _LISTS if n in columns), None)
        if element != "face" and isinstance(lists, list) and lists:
            return np.concatenate(lists).astype(np.int64), np.array([len(x) for x in lists], np.int64), element
    edge = arrays.get("edge", {})
    if all(isinstance(edge.get(n), np.ndarray) and len(edge[n]) for n in _ENDS):
        first, second = (np.asarray(edge[n]).astype(np.int64) for n in _ENDS)
        return *_chains(first, second, points), "edge"
    name = next((n for n in _STRAND if n in arrays["vertex"]), None)
    if name is None or not points:
        raise ValueError(
            "it has no strands: they are lists vertex_indices of an element, edges, or a vertex property"
            f" {', '.join(_STRAND)}; its elements are {', '.join(arrays)}"
        )
    own = np.asarray(arrays["vertex"][name])
    starts = np.flatnonzero(np.append(True, own[1:] != own[:-1]))
    return np.arange(points), np.diff(np.append(starts, points)), name


def _chains(first: NDArray[np.int64], second: NDArray[np.int64], points: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges joined into strands, in the order of their roots in the file."""
    ends = np.concatenate([first, second])
    if not (ends.min() >= 0 and ends.max() < points):
        raise ValueError(f"an edge names vertex {int(ends.max() if ends.max() >= points else ends.min())}, it has {points}")
    for name, values in (("begin", first), ("end", second)):
        twice = np.flatnonzero(np.bincount(values, minlength=points) > 1)
        if len(twice):
            raise ValueError(f"more than one edge {name}s at vertex {twice[0]}: a strand has no branches")
    after = np.full(points, -1)
    after[first] = second
    roots = np.setdiff1d(first, second)
    order: list[int] = []
    begins = [0]
    for root in roots.tolist():
        at = root
        while at >= 0:
            order.append(at)
            at = int(after[at])
        begins.append(len(order))
    if len(order) < len(np.unique(ends)):
        raise ValueError("some of its edges form a ring: a strand has a root")
    return np.array(order, np.int64), np.array([b - a for a, b in pairwise(begins)], np.int64)
