"""Tables of scattering functions as files: .npz and CSV."""

from __future__ import annotations

import csv
import io
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support.files import write_bytes

AXES = ("theta_r", "theta_i", "phi")
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
    try:
        with open(path, "rb") as opened:
            file = np.load(opened, allow_pickle=False)
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise ValueError("it is a single array")
            with file:
                return {name: file[name] for name in file.files}
    except OSError as error:
        raise ValueError(f"cannot read {what} {path}: {error.strerror or error}") from None
    except (ValueError, EOFError, KeyError, zipfile.BadZipFile, zipfile.LargeZipFile) as error:
        raise ValueError(f"cannot read {what} {path}: not a whole .npz file ({error})") from None


def read_rows(path: str | os.PathLike[str], what: str) -> tuple[list[str], NDArray[np.float64]]:
    """Return the column names and the numbers of a CSV file with a header, or raise ValueError with the line."""
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(line for line in file if line.strip() and not line.startswith("#"))
            header = [name.strip() for name in next(rows, [])]
            data: list[list[float]] = []
            for number, row in enumerate(rows, 2):
                if len(row) != len(header):
                    raise ValueError(f"row {number} has {len(row)} values, the header has {len(header)}")
                try:
                    data.append([float(x) if x.strip() else np.nan for x in row])
                except ValueError:
                    raise ValueError(f"row {number} holds something that is not a number: {','.join(row)[:60]}") from None
    except OSError as error:
        raise ValueError(f"cannot read {what} {path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"cannot read {what} {path}: it is not text in UTF-8") from None
    except ValueError as error:
        raise ValueError(f"cannot read {what} {path}: {error}") from None
    if not data:
        raise ValueError(f"cannot read {what} {path}: it holds no rows under its header")
    return header, np.array(data)


def _angle(columns: dict[str, Any], name: str, path: Any) -> NDArray[np.float64]:
    if name in columns:
        return np.asarray(columns[name], np.float64)
    if f"{name}_deg" in columns:
        return np.radians(np.asarray(columns[f"{name}_deg"], np.float64))
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
    channels = [k for k, name in enumerate(header) if name not in used]
    if not channels:
        raise ValueError(f"{path} has no values beside its angles: {_HELP}, one column a channel")
    # Rows in any order; what no row names is a hole.
    axes, places = zip(*(np.unique(np.round(x, 9), return_inverse=True) for x in angles), strict=True)
    f = np.full((*(len(a) for a in axes), len(channels)), np.nan)
    if f.size > 50 * rows.size + 1000:
        raise ValueError(
            f"{path}: its rows lie on {len(axes[0])} × {len(axes[1])} × {len(axes[2])} different angles and fill"
            f" {100 * len(rows) * len(channels) / f.size:.2g} % of that grid; they must form one grid"
        )
    at = tuple(p.ravel() for p in places)
    flat = np.ravel_multi_index(at, f.shape[:3])
    if len(np.unique(flat)) < len(flat):
        raise ValueError(f"{path}: {len(flat) - len(np.unique(flat))} rows have the same angles as another; average them")
    f[at] = rows[:, channels]
    return axes[0], axes[1], axes[2], f
