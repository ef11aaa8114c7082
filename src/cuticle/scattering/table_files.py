"""Tables of scattering functions as files: .npz and CSV."""

from __future__ import annotations

import csv
import io
import math
import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.files import check_size, opened, read_text, reading, write_bytes

AXES = ("theta_r", "theta_i", "phi")
_COLOURS = (("red", "green", "blue"), ("r", "g", "b"))
_HELP = "it needs theta_r, theta_i, phi (radians; or theta_r_deg … in degrees) and f"
Table = tuple[NDArray, NDArray, NDArray, NDArray]


def read_table(path: str | os.PathLike[str]) -> Table:
    """Return theta_r, theta_i, phi (radians) and f (R, A, B, channels) of an .npz or CSV file.

    Raises
    ------
    ValueError
        One line: what is missing or wrong, and where.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        return _read_npz(path)
    if suffix == ".csv":
        return _read_csv(path)
    raise ValueError(f"a table must be an .npz or a .csv file, got {path}")


def write_table(path: str | os.PathLike[str], theta_r: NDArray, theta_i: NDArray, phi: NDArray, f: NDArray) -> Path:
    """Write a table as .npz, whole or not at all."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, theta_r=theta_r, theta_i=theta_i, phi=phi, f=f)
    return write_bytes(path, buffer.getvalue())


def read_arrays(path: str | os.PathLike[str], what: str) -> dict[str, NDArray]:
    """Return the arrays of an .npz file, or raise ValueError with the reason."""
    with reading(path, what), opened(path) as file:
        if not zipfile.is_zipfile(file):
            raise ValueError("not a whole .npz file")
        file.seek(0)
        with zipfile.ZipFile(file) as archive:
            check_size(sum(_declared_bytes(archive, member) for member in archive.infolist()))
        file.seek(0)
        with np.load(file, allow_pickle=False) as arrays:
            found = {}
            for name in arrays.files:
                try:
                    found[name] = arrays[name]
                except ValueError as error:
                    raise ValueError(f"its array {name!r} cannot be read: {error}; save numbers, or leave it out") from None
            return found


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, NDArray]) -> Path:
    """Write an .npz file that `read_arrays` reads, whole or not at all: the same bytes for the same arrays, of any names."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, values in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, values, allow_pickle=False)
    return write_bytes(path, buffer.getvalue())


def _declared_bytes(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> int:
    """Return the bytes that an array's header asks for; raise ValueError where its member holds fewer."""
    with archive.open(member) as file:
        version = np.lib.format.read_magic(file)
        # Version 3 differs from 2 in the encoding of field names alone.
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = header(file)
        size = math.prod(shape) * dtype.itemsize
        if not dtype.hasobject and size > member.file_size - file.tell():
            raise ValueError(f"{member.filename} is cut short: shape {shape} needs {size:,} bytes, it holds fewer")
        return size


def read_rows(path: str | os.PathLike[str], what: str) -> tuple[list[str], NDArray[np.float64]]:
    """Return the column names and the numbers of a CSV file with a header, or raise ValueError with the line."""
    with reading(path, what):
        text = read_text(path, what)
        rows = csv.reader(line for line in io.StringIO(text) if line.strip() and not line.startswith("#"))
        header = [name.strip().lower() for name in next(rows, [])]
        if len(set(header)) < len(header):
            raise ValueError(f"its header names a column twice: {','.join(header)[:60]}")
        data: list[list[float]] = []
        for number, row in enumerate(rows, 2):
            if len(row) != len(header):
                raise ValueError(f"row {number} has {len(row)} values, the header has {len(header)}")
            try:
                data.append([float(x) if x.strip() else np.nan for x in row])
            except ValueError:
                raise ValueError(f"row {number} holds something that is not a number: {','.join(row)[:60]}") from None
        if not data:
            raise ValueError("it holds no rows under its header")
        return header, np.array(data)


def channel_columns(stem: str, names: Sequence[str]) -> list[str]:
    """Return those of the columns that hold the channels of a value, in the order of the channels; none is an empty list.

    Names are `stem`, of one channel; or `stem`_r, _g and _b; or `stem`_ and numbers, such as wavelengths, of which the least
    is the first channel.

    Raises
    ------
    ValueError
        A name that begins like these is none of them, or there are two kinds.
    """
    ends = {name.removeprefix(stem): name for name in names if name == stem or name.startswith(stem + "_")}
    if ends.keys() == {"_r", "_g", "_b"}:
        return [ends["_r"], ends["_g"], ends["_b"]]
    if ends.keys() <= {""}:
        return list(ends.values())
    if all(end[1:].isdecimal() for end in ends):
        return [ends[end] for end in sorted(ends, key=lambda end: int(end[1:]))]
    raise ValueError(
        f"its columns {', '.join(ends.values())} are no channels: they must be {stem}; or {stem}_r, {stem}_g and {stem}_b;"
        f" or {stem}_1, {stem}_2, …"
    )


def _angle(columns: dict[str, Any], name: str, path: Any) -> NDArray[np.float64]:
    if name in columns:
        return validate.real(name, columns[name]).astype(np.float64)
    if f"{name}_deg" in columns:
        return np.radians(validate.real(f"{name}_deg", columns[f"{name}_deg"]).astype(np.float64))
    raise ValueError(f"{path} has no {name}: {_HELP}; it has {', '.join(columns) or 'nothing'}")


def _read_npz(path: Any) -> Table:
    arrays = read_arrays(path, "table")
    angles = [_angle(arrays, name, path) for name in AXES]
    if "f" not in arrays:
        raise ValueError(f"{path} has no f: {_HELP}; it has {', '.join(arrays)}")
    return angles[0], angles[1], angles[2], arrays["f"]


def _read_csv(path: Any) -> Table:
    header, rows = read_rows(path, "table")
    columns = dict(zip(header, rows.T, strict=True))
    angles = [_angle(columns, name, path) for name in AXES]
    used = {key for name in AXES for key in (name, f"{name}_deg")}
    others = [name for name in header if name not in used]
    # Columns of no f are channels of the user's own names: colours in their order, others in that of the file.
    named = channel_columns("f", header) or next((list(c) for c in _COLOURS if set(c) == set(others)), others)
    if not named or len(named) < len(others):
        wrong = (
            "has no values beside its angles" if not named else f"has a column {min(set(others) - set(named))!r} beside f"
        )
        raise ValueError(f"{path} {wrong}: {_HELP}, or f_r, f_g and f_b, or f_1, f_2, …, one column a channel")
    channels = [header.index(name) for name in named]
    # Rows in any order; what no row names is a hole.
    axes, places = zip(*(np.unique(np.round(x, 9), return_inverse=True) for x in angles), strict=True)
    shape = *(len(a) for a in axes), len(channels)
    if math.prod(shape) > 50 * rows.size + 1000:  # before memory is taken
        raise ValueError(
            f"{path}: its rows lie on {len(axes[0])} × {len(axes[1])} × {len(axes[2])} different angles and fill"
            f" {100 * len(rows) * len(channels) / math.prod(shape):.2g} % of that grid; they must form one grid"
        )
    f = np.full(shape, np.nan)
    at = tuple(p.ravel() for p in places)
    flat = np.ravel_multi_index(at, shape[:3])
    if len(np.unique(flat)) < len(flat):
        raise ValueError(f"{path}: {len(flat) - len(np.unique(flat))} rows have the same angles as another; average them")
    f[at] = rows[:, channels]
    return axes[0], axes[1], axes[2], f
