"""Files that are damaged, or ask for too much: one line with the file's name, before memory is taken."""

from __future__ import annotations

import io
import json
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import cuticle
from command import run
from cuticle._support import files
from cuticle.grooms.groom import read_groom

AXES = {"theta_r": [0.0], "theta_i": [0.0], "phi": [0.0]}


def npz(**members: bytes) -> bytes:
    """An .npz of members as they are given, beside good axes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, value in AXES.items():
            data = io.BytesIO()
            np.save(data, value)
            archive.writestr(f"{name}.npy", data.getvalue())
        for name, raw in members.items():
            archive.writestr(f"{name}.npy", raw)
    return buffer.getvalue()


def npy(header: str) -> bytes:
    text = header.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def damaged_stream() -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, f=np.random.default_rng(1).random(5000), **AXES)
    data = bytearray(buffer.getvalue())
    for at in range(300, 320):
        data[at] ^= 0x5A
    return bytes(data)


def sampler(**changes: object) -> bytes:
    base = {"format": "cuticle-sampler", "version": 1, "lobes": 1, "theta_nodes": 2, "strands": [0.0], "even": True}
    return json.dumps(base | changes).encode()


def pixels(shape: tuple[int, ...]) -> bytes:
    return npy(f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}")


def scattered() -> bytes:
    """Measurements in random directions, a row each."""
    rows = np.random.default_rng(1).uniform(-1, 1, (3000, 4))
    return b"theta_r,theta_i,phi,f\n" + b"".join(b"%g,%g,%g,%g\n" % tuple(row) for row in rows)


def dump_without_channels() -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, direction=np.tile([0.0, 1, 0], (6000, 1)), pdf=np.ones(6000), weight=np.ones((6000, 0)))
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("command", "name", "data", "reason"),
    [
        ("fit", "a.npz", damaged_stream(), "damaged"),
        ("fit", "b.npz", npz(f=npy("{'descr': '<f8', (")), "cannot read table"),
        ("fit", "c.npz", npz(f=npy("'" + "(" * 3000)), "cannot read table"),
        ("fit", "d.npz", npz(f=pixels((10**12,))), "cut short"),
        ("fit", "e.npz", npz(f=b"not an array"), "cannot read table"),
        ("audit", "f.npz", dump_without_channels(), "weight has shape"),
        ("fit", "g.csv", b"theta_r,theta_i,phi,f\n0,0,0," + b"1" * 140_000, "field larger"),
        ("fit", "h.csv", b"theta_r,theta_i,phi,f\n0,0,0,\xff", "UTF-8"),
        ("fit", "i.toml", b"[fibre]\neta = 1" + b"0" * 4000, "too large"),
        ("fit", "j.toml", b"[fibre]\neta = 1" + b"0" * 5000, "cannot read"),
        ("fit", "k.toml", b"[fibre]\neta = " + b"[" * 5000, "nested too deeply"),
        ("fit", "k2.toml", b"a." * 100_000 + b"b = 1", "over 30 parts"),  # hours in Python's reader
        ("fit", "k3.toml", b"[" + b"'a' . " * 100_000 + b"b]", "over 30 parts"),
        ("fit", "scattered.csv", scattered(), "must form one grid"),  # 3,000^3 cells
        ("check", "l.json", b"[" * 100_000, "nested too deeply"),
        ("check", "m.json", sampler(version=10**4000), "version"),
        ("check", "n.json", b'{"format": "cuticle-sampler", "version": 1' + b"0" * 5000 + b"}", "n.json"),
        ("check", "o.json", sampler(nodes=[[[[10**400]]]], energy=[[1.0]]), "o.json"),
        ("document", "p.toml", b"\x00\x01", "p.toml"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_one_line_with_its_name(command: str, name: str, data: bytes, reason: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(data)
    output = ("-o", "out") if command == "fit" else ()
    done = run(command, name, *output, "--json", cwd=tmp_path)
    assert done.returncode == 2
    assert name in done.stderr
    assert reason in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert len(done.stderr) < 600
    assert json.loads(done.stdout) == {"error": done.stderr.removeprefix("cuticle: ").strip(), "exit_code": 2}
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize(
    ("name", "data", "read"),
    [
        ("t.npz", npz(f=pixels((10,)) + bytes(80)), cuticle.Tabulated.load),
        ("t.csv", b"theta_r,theta_i,phi,f\n0,0,0,1\n", cuticle.Tabulated.load),
        ("t.toml", b"[fibre]\neta = 1.5\nsigma_a = 0.2\n", cuticle.Fibre.load),
        ("t.json", sampler(), cuticle.Sampler.load),
        ("t.hair", b"HAIR" + bytes(200), read_groom),
    ],
)
def test_the_limit_of_size_holds_for_every_reader(
    name: str, data: bytes, read: Callable[[Path], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / name).write_bytes(data)
    monkeypatch.setattr(files, "LARGEST", 20)
    with pytest.raises(ValueError, match=rf"{name}: it needs .* the limit is .*--allow-large"):
        read(tmp_path / name)
    with cuticle.allow_large():
        assert files.read_bytes(tmp_path / name, "file") == data


def test_a_small_file_that_unpacks_to_much_is_refused_unless_allowed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    np.savez_compressed(tmp_path / "z.npz", f=np.zeros(200_000), **AXES)
    monkeypatch.setattr(files, "LARGEST", 1_000_000)
    done = run("fit", "z.npz", "-o", "out", cwd=tmp_path)
    assert "z.npz: it needs 0.0016 GB" in done.stderr
    done = run("fit", "z.npz", "-o", "out", "--allow-large", cwd=tmp_path)
    assert "limit" not in done.stderr
    assert done.returncode == 2  # it is no table: read, and then refused for its shape


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such device")
def test_a_device_without_end_is_read_to_the_limit_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "zero.hair").symlink_to("/dev/zero")
    monkeypatch.setattr(files, "LARGEST", 5_000_000)
    with pytest.raises(ValueError, match="limit is"):
        read_groom(tmp_path / "zero.hair")
