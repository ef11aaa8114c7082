"""Reads Alembic curves with Blender as a Python module, in a separate process that a bad file can crash safely."""

from __future__ import annotations

import importlib.util
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_NO_CURVES = 3  # the process's exit status


def read_alembic(path: Path) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.float32] | None]:
    """Return all curves at the file's first time, in world space: points (N, 3), points of each strand, and radii."""
    try:
        with open(path, "rb") as file:
            _check(path, file.read(16), path.stat().st_size)
    except OSError as error:
        raise ValueError(f"cannot read groom {path}: {error.strerror or error}") from None
    if importlib.util.find_spec("bpy") is None:
        raise ValueError(
            f"reading {path} needs the package bpy, Blender as a module: pip install 'cuticle[alembic]'; or export it as USD"
        )
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "groom.npz"
        # Not `-m`: nothing of this package is needed there.
        done = subprocess.run([sys.executable, __file__, str(path.resolve()), str(out)], capture_output=True, check=False)
        if done.returncode == _NO_CURVES:
            raise ValueError(f"{path} holds no curves")
        if done.returncode or not out.is_file():
            lines = done.stderr.decode(errors="replace").strip().splitlines() or ["it says nothing"]
            raise ValueError(f"cannot read groom {path}: Blender's reader gave up ({done.returncode}): {lines[-1][:200]}")
        with np.load(out) as found:
            radius = found["radius"] if found["radius"].size else None
            return found["points"], found["counts"], radius


def _check(path: Path, head: bytes, size: int) -> None:
    """Check the header, or raise ValueError: 'Ogawa', a mark that the archive was closed, and the position of its root."""
    if head[:4] == b"\x89HDF":
        raise ValueError(f"{path} is an old Alembic archive in HDF5 (byte 0), write it again as Ogawa: abcconvert -toOgawa")
    if head[:5] != b"Ogawa":
        raise ValueError(f"{path} is not an Alembic archive: bytes 0 to 5 are {head[:5]!r}, not b'Ogawa'")
    if len(head) < 16:
        raise ValueError(f"{path} is cut short: its header needs bytes 0 to 16, the file has {size}")
    if head[5] != 0xFF:
        raise ValueError(f"{path} was not closed by the program that wrote it (byte 5 is {head[5]}, not 255)")
    (root,) = struct.unpack_from("<Q", head, 8)
    if root + 8 > size:
        raise ValueError(f"{path} is cut short: its root group lies at byte {root} (byte 8), the file has {size}")


def _blender(path: str, out: str) -> int:
    """Write the curves of an archive to a .npz file."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    if "FINISHED" not in bpy.ops.wm.alembic_import(filepath=path, as_background_job=False):
        print("it is no archive that it knows", file=sys.stderr)
        return 1
    bpy.context.view_layer.update()
    points, counts, radii = [], [], []
    for thing in sorted(bpy.data.objects, key=lambda o: o.name):
        if thing.type != "CURVES" or not len(thing.data.points):
            continue
        curves = thing.data
        xyz = np.empty(3 * len(curves.points), np.float32)
        curves.position_data.foreach_get("vector", xyz)
        own = np.empty(len(curves.curves), np.int32)
        curves.curves.foreach_get("points_length", own)
        to_world = np.array(thing.matrix_world, np.float64)
        x, y, z = (xyz.reshape(-1, 3) @ to_world[:3, :3].T + to_world[:3, 3]).T
        points.append(np.stack([x, z, -y], axis=1))  # Blender turned the file's y up into z up
        counts.append(own)
        if "radius" in curves.attributes:
            radius = np.empty(len(curves.points), np.float32)
            curves.attributes["radius"].data.foreach_get("value", radius)
            radii.append(radius * np.cbrt(abs(np.linalg.det(to_world[:3, :3]))))
    if not points:
        return _NO_CURVES
    whole = sum(map(len, radii)) == sum(map(len, points))
    np.savez(
        out,
        points=np.concatenate(points).astype(np.float32),
        counts=np.concatenate(counts).astype(np.int64),
        radius=np.concatenate(radii).astype(np.float32) if whole else np.empty(0, np.float32),
    )
    return 0


if __name__ == "__main__":
    sys.exit(_blender(sys.argv[1], sys.argv[2]))
