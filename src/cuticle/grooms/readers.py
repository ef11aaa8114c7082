"""Hair file formats: one row of `READERS` each. Help texts and error messages are built from the table.

A reader checks the header against the file's size first: nothing is allocated because a header says so.
"""

from __future__ import annotations

import os
import struct
from array import array
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support import files
from cuticle.grooms import attributes as named
from cuticle.grooms import splines
from cuticle.grooms.alembic import read_alembic
from cuticle.grooms.ply import read_ply
from cuticle.grooms.scene_curves import ATTRIBUTE
from cuticle.grooms.usd import read_usd
from cuticle.scattering.table_files import read_arrays


class Raw(NamedTuple):
    """What a reader finds.

    Attributes
    ----------
    points
        The points of all strands, shape (N, 3).
    counts
        The number of points of each strand, shape (strands,).
    radius
        The radius at each point, shape (N,), or None where the file has none.
    bend
        As `Groom.bend`, shape (strands, 2, 4), or None.
    notes
        What the user should know of what is left out or made up, a line each.
    attributes
        Other values by their names in the file: one a strand, (strands,) or (strands, C), or one a point, (N,) or (N, C).
        What is not such numbers is left out, and a warning names it.
    """

    points: NDArray
    counts: NDArray[np.int64]
    radius: NDArray | None = None
    bend: NDArray | None = None
    notes: tuple[str, ...] = ()
    attributes: Mapping[str, NDArray] = named.NONE


class Reader(NamedTuple):
    """One file format.

    Attributes
    ----------
    name
        What the format is called in help texts.
    endings
        The file name endings that select it, lower case, with the dot.
    read
        Returns a `Raw`, or its values as a tuple. Raises ValueError with the path and the reason.
    timed
        Whether `read` takes the frame as a second argument.
    """

    name: str
    endings: tuple[str, ...]
    read: Callable[..., tuple]
    timed: bool = False


def read(path: str | os.PathLike[str], frame: float | None = None) -> Raw:
    """Read a hair file with the reader that its ending selects."""
    ending = Path(path).suffix.lower()
    for reader in READERS:
        if ending in reader.endings:
            if frame is not None and not reader.timed:
                timed = ", ".join(ending for r in READERS if r.timed for ending in r.endings)
                raise ValueError(f"{path}: frame is for {timed}; a file of ending {ending} has one time, leave it out")
            return Raw(*(reader.read(Path(path)) if frame is None else reader.read(Path(path), frame)))
    raise ValueError(f"{path}: a groom file must end in one of {known_endings()}; got {ending or 'none'!r}")


def known_endings() -> str:
    """Return every ending that can be read, in words for a message."""
    return ", ".join(ending for reader in READERS for ending in reader.endings)


def format_of(path: str | os.PathLike[str], but: tuple[str, ...]) -> str | None:
    """Return the name of the format that a path's ending is read as; None of an unknown ending, and of those in `but`."""
    ending = Path(path).suffix.lower()
    return next((r.name for r in READERS if ending in r.endings and ending not in but), None)


def known_formats() -> str:
    """Return every format with its endings, in words for a help text."""
    return ", ".join(f"{reader.name} ({' '.join(reader.endings)})" for reader in READERS)


def read_bytes(path: Path) -> bytes:
    """Return the whole file, or raise ValueError with the reason."""
    return files.read_bytes(path, "groom")


def read_text(path: Path) -> str:
    """Return the whole file as text in UTF-8, without a byte order mark, or raise ValueError with the reason."""
    return files.read_text(path, "groom")


def _take(path: Path, data: bytes, at: int, kind: str, count: int, what: str) -> NDArray:
    """Return `count` values of a NumPy type at byte `at`, or say where the file ends."""
    size = np.dtype(kind).itemsize * count
    if at + size > len(data):
        raise ValueError(
            f"{path} is cut short: {what} needs bytes {at} to {at + size}, the file has {len(data)}"
            if count < 1 << 40
            else f"{path}: {what} would need {size} bytes at byte {at}, the file has {len(data)}"
        )
    return np.frombuffer(data, kind, count, at)


def _header(path: Path, data: bytes, layout: str, at: int = 0) -> tuple:
    size = struct.calcsize(layout)
    if len(data) < at + size:
        raise ValueError(f"{path} is cut short: its header needs bytes {at} to {at + size}, the file has {len(data)}")
    return struct.unpack_from(layout, data, at)


def _some(path: Path, count: int, what: str, at: int) -> None:
    if count <= 0:
        raise ValueError(f"{path}: it says it holds {count} {what} (byte {at})")


def _cyhair(path: Path, data: bytes) -> Raw:
    """Cem Yuksel's cyHair: a header of 128 bytes, then the arrays that its flags announce."""
    magic, strands, points, flags, segments, thickness = _header(path, data, "<4sIIIIf")
    if magic != b"HAIR":
        raise ValueError(f"{path} is not a cyHair file: bytes 0 to 4 are {magic!r}, not b'HAIR'")
    _header(path, data, "<128s")
    _some(path, strands, "strands", 4)
    _some(path, points, "points", 8)
    if not flags & 2:
        raise ValueError(f"{path}: it says it holds no points (flags {flags} at byte 12)")
    at = 128
    if flags & 1:
        counts = _take(path, data, at, "<u2", strands, "the strands' segments").astype(np.int64) + 1
        at += 2 * strands
    else:
        if strands * (segments + 1) > len(data):
            raise ValueError(
                f"{path}: {strands} strands of {segments} segments (bytes 4 and 16) are more than the file holds"
            )
        counts = np.full(strands, segments + 1, np.int64)
    if counts.sum() != points:
        raise ValueError(f"{path}: its strands have {counts.sum()} points, its header says {points} (byte 8)")
    xyz = _take(path, data, at, "<f4", 3 * points, "the points").reshape(-1, 3)
    at += 12 * points
    radius: NDArray[np.float32] | None = None
    if flags & 4:
        radius = (0.5 * _take(path, data, at, "<f4", points, "the thickness")).astype(np.float32)
        at += 4 * points
    elif thickness != 0 and not (thickness == 1 and np.ptp(xyz, axis=0).max() < 1):
        # 1 is also what cyHair's own writer leaves there. It is no thickness where it is more than the groom's size.
        radius = np.full(points, 0.5 * thickness, np.float32)
    attributes = {}
    if flags & 8:
        attributes["transparency"] = _take(path, data, at, "<f4", points, "the transparency")
        at += 4 * points
    if flags & 16:
        attributes["color"] = _take(path, data, at, "<f4", 3 * points, "the colors").reshape(-1, 3)
    return Raw(xyz, counts, radius, attributes=attributes)


def _hair(path: Path) -> Raw:
    """Files that end in .hair: cyHair by its first four bytes, else the layout of MonoHair."""
    data = read_bytes(path)
    return _cyhair(path, data) if data[:4] == b"HAIR" or len(data) < 8 else _monohair(path, data)


def _monohair(path: Path, data: bytes) -> Raw:
    """MonoHair, without a mark of its own: uint32 strands, uint32 points, uint16 points of each strand, float32 x y z."""
    strands, points = _header(path, data, "<II")
    size = 8 + 2 * strands + 12 * points
    if not strands or size != len(data):
        raise ValueError(
            f"{path} is neither a cyHair file, whose bytes 0 to 4 are b'HAIR', nor MonoHair's: {strands} strands of {points}"
            f" points in all (bytes 0 and 4) take {size} bytes, the file has {len(data)}"
        )
    counts = _take(path, data, 8, "<u2", strands, "the strands' points").astype(np.int64)
    if counts.sum() != points:
        raise ValueError(f"{path}: its strands have {counts.sum()} points, it says {points} (byte 4)")
    return Raw(_take(path, data, 8 + 2 * strands, "<f4", 3 * points, "the points").reshape(-1, 3), counts)


def _npz(path: Path) -> Raw:
    """NumPy arrays: `points` (strands, points, 3), or (N, 3) with `counts` (strands,) or `offsets` (strands + 1,).

    `radius`, where there is one: at each point, one a strand, or a single number. `bend` as `Groom.bend`. All others are
    attributes.
    """
    arrays = read_arrays(path, "groom")
    if "points" not in arrays:
        raise ValueError(f"it must hold points, with counts or offsets where they are (N, 3); it has {', '.join(arrays)}")
    points = _numbers(arrays, "points")
    if points.ndim == 3:
        counts = np.full(points.shape[0], points.shape[1], np.int64)
    elif "counts" in arrays:
        counts = _numbers(arrays, "counts", "iu").astype(np.int64)
    elif "offsets" in arrays:
        offsets = _numbers(arrays, "offsets", "iu").astype(np.int64)
        if offsets.ravel()[:1].tolist() != [0]:
            raise ValueError(f"offsets must begin at 0, got {offsets.ravel()[:1].tolist()}")
        counts = offsets[1:] - offsets[:-1]
    else:
        raise ValueError(f"points of shape {points.shape} need counts or offsets; it has {', '.join(arrays)}")
    if points.shape[-1:] != (3,) or not points.size:
        raise ValueError(f"points must have shape (strands, points, 3) or (N, 3), got {points.shape}")
    points = points.reshape(-1, 3)
    if counts.ndim != 1:
        raise ValueError(f"counts must have shape (strands,), offsets (strands + 1,); got {counts.ndim} axes")
    bend = _numbers(arrays, "bend") if "bend" in arrays else None
    if bend is not None and bend.shape != (len(counts), 2, 4):
        raise ValueError(f"bend must have shape ({len(counts)}, 2, 4), got {bend.shape}")
    own = {name: values for name, values in arrays.items() if name not in named.TAKEN}
    notes: tuple[str, ...] = ()
    if arrays["points"].ndim == 3:
        dense = arrays["points"].shape[:2]
        if dense[1] == 3 and (unclear := [name for name, values in own.items() if values.shape == dense]):
            notes = (
                f"took {', '.join(unclear)} of shape {dense} as a value at each of a strand's 3 points; for 3 channels a"
                " strand give points as (N, 3), with counts",
            )
        own = {n: v.reshape(-1, *v.shape[2:]) if v.shape[:2] == dense else v for n, v in own.items()}
    return Raw(points, counts, _npz_radius(arrays, counts, len(points)), bend, notes, own)


def _npz_radius(arrays: dict[str, NDArray], counts: NDArray[np.int64], points: int) -> NDArray | None:
    if "radius" not in arrays:
        return None
    radius = _numbers(arrays, "radius")
    if radius.size == points:
        return radius.ravel()
    if radius.size not in (1, len(counts)):
        raise ValueError(
            f"radius must have {points} values, one a point, or {len(counts)}, one a strand, or 1; got {radius.size}"
        )
    return np.repeat(np.broadcast_to(radius.ravel(), len(counts)), counts)


def _numbers(arrays: dict[str, NDArray], name: str, kinds: str = "fiu") -> NDArray:
    if arrays[name].dtype.kind not in kinds:
        wanted = "numbers" if "f" in kinds else "whole numbers"
        raise ValueError(f"{name} must be {wanted}, got an array of {arrays[name].dtype}")
    return arrays[name]


def _usc(path: Path) -> Raw:
    """USC-HairSalon: the number of strands as int32; for each, the number of points as int32 and their float32 x y z."""
    data = read_bytes(path)
    (strands,) = _header(path, data, "<i")
    _some(path, strands, "strands", 0)
    if 4 + 4 * strands > len(data):
        raise ValueError(f"{path}: it says it holds {strands} strands (byte 0), the file has {len(data)} bytes")
    at, counts, parts = 4, [], []
    for k in range(strands):
        (count,) = _header(path, data, "<i", at)
        if count < 0:
            raise ValueError(f"{path}: strand {k} says it has {count} points (byte {at})")
        parts.append(_take(path, data, at + 4, "<f4", 3 * count, f"strand {k}'s points"))
        counts.append(count)
        at += 4 + 12 * count
    if at != len(data):
        raise ValueError(f"{path}: after {strands} strands {len(data) - at} bytes are left (byte {at})")
    return Raw(np.concatenate(parts).reshape(-1, 3), np.array(counts, np.int64))


def _tressfx(path: Path) -> Raw:
    """AMD TressFX: version 3 holds x y z from byte 296, version 4 x y z w where its header says."""
    data = read_bytes(path)
    version, strands, vertices, offset = _header(path, data, "<fIII")
    if not 3 <= version < 5:
        raise ValueError(f"{path}: TressFX version {version:g} (byte 0) is not supported; versions 3 and 4 are")
    _some(path, strands, "strands", 4)
    _some(path, vertices, "vertices a strand", 8)
    count = strands * vertices
    if version < 4:
        xyz = _take(path, data, 296, "<f4", 3 * count, f"{strands} strands of {vertices} points").reshape(-1, 3)
    else:
        if offset < 160:
            raise ValueError(f"{path}: its positions begin at byte {offset} (byte 12), inside the header of 160 bytes")
        values = _take(path, data, offset, "<f4", 4 * count, f"{strands} strands of {vertices} points")
        xyz = values.reshape(-1, 4)[:, :3]
    return Raw(xyz, np.full(strands, vertices, np.int64))


def _text(path: Path) -> Raw:
    """Mitsuba's text: one line `x y z radius` per point, a blank line between strands.

    The lines are control points of cubic B-splines, as of `bsplinecurve`. That plugin refuses a file with a strand of fewer
    than 4 lines: such a file is `linearcurve`'s, and its lines are points.
    """
    lines = read_text(path).splitlines()
    rows = array("d")
    counts: list[int] = [0]
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            if counts[-1]:
                counts.append(0)
            continue
        try:
            row = tuple(map(float, words))
        except ValueError:
            row = ()
        if len(row) != 4:
            raise ValueError(f"{path}: line {number} must be x y z radius, got {line.strip()[:60]!r}")
        rows.extend(row)
        counts[-1] += 1
    if not rows:
        raise ValueError(f"{path} holds no strand")
    values, strands = np.frombuffer(rows).reshape(-1, 4), np.array([c for c in counts if c], np.int64)
    if len(strands) > 1 and not values[-strands[-1] :, 3].any():  # what `Groom.save` adds for Mitsuba's sake
        values, strands = values[: -strands[-1]], strands[:-1]
    type_ = "cubic" if strands.min() >= 4 else "linear"
    found, points, bend = splines.to_splines(values, strands, type_)
    return Raw(found[:, :3], points, found[:, 3], bend)


def _scene(arrays: dict[str, NDArray]) -> Raw:
    notes = tuple(map(str, arrays["notes"]))
    radius = arrays["radius"] if arrays["radius"].size else None
    own = {name.removeprefix(ATTRIBUTE): values for name, values in arrays.items() if name.startswith(ATTRIBUTE)}
    return Raw(arrays["points"], arrays["counts"], radius, arrays["bend"], notes, own)


TEXT = (".txt", ".curves")  # Mitsuba's own
READERS = [
    Reader("cyHair or MonoHair", (".hair",), _hair),
    Reader("USC-HairSalon", (".data",), _usc),
    Reader("TressFX 3 and 4", (".tfx",), _tressfx),
    Reader("USD", (".usd", ".usda", ".usdc", ".usdz"), lambda path, frame=None: _scene(read_usd(path, frame)), timed=True),
    Reader("Alembic", (".abc",), lambda path, frame=None: _scene(read_alembic(path, frame)), timed=True),
    Reader("PLY", (".ply",), lambda path: Raw(*read_ply(path))),
    Reader("NumPy arrays", (".npz",), _npz),
    Reader("Mitsuba's text", TEXT, _text),
]
