"""What is written, and where: devices, links and modes stay, and what is stopped leaves nothing."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import refused, run
from cuticle._support.files import filling, write_bytes

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")


@pytest.fixture(autouse=True)
def heeds_ctrl_c() -> Iterator[None]:
    """Also where the tests themselves run in a script's background, which ignores Ctrl-C: what they start would, too."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory, document_fit: cuticle.Fit) -> Path:
    return document_fit.sampler.save(tmp_path_factory.mktemp("written") / "sampler.json")


@posix
def test_a_file_keeps_its_mode_its_owner_and_the_links_to_it(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    real, link, second = tmp_path / "real" / "a.txt", tmp_path / "link.txt", tmp_path / "second.txt"
    real.write_text("old")
    real.chmod(0o600)
    if os.geteuid() == 0:
        os.chown(real, 1234, 1235)
    link.symlink_to("real/a.txt")
    before = real.stat()
    write_bytes(link, b"new")
    after = real.stat()
    assert link.is_symlink()
    assert real.read_bytes() == b"new"
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    os.link(real, second)
    write_bytes(real, b"both")
    assert second.read_bytes() == b"both"
    for mask, mode in ((0o022, 0o644), (0o077, 0o600)):
        before_mask = os.umask(mask)
        try:
            write_bytes(tmp_path / f"new{mask}", b"new")
        finally:
            os.umask(before_mask)
        assert (tmp_path / f"new{mask}").stat().st_mode & 0o777 == mode
    dangling = tmp_path / "dangling"
    dangling.symlink_to("real/made.txt")
    write_bytes(dangling, b"made")
    assert (tmp_path / "real" / "made.txt").read_bytes() == b"made"
    long = tmp_path / ("n" * 255)  # the longest name that a file may have
    assert write_bytes(long, b"x").read_bytes() == b"x"


@posix
@pytest.mark.parametrize("command", ["export", "check"])
def test_a_fifo_is_written_into(command: str, saved: Path, tmp_path: Path) -> None:
    fifo = tmp_path / "pipe.json"
    os.mkfifo(fifo)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(fifo.read_bytes()))
    reader.start()
    more = ("--to", "json") if command == "export" else ("--samples", "10000", "--strands", "0")
    done = run(command, str(saved), *more, "-o", str(fifo))
    reader.join(timeout=20)
    assert done.returncode in (0, 1), done.stderr
    assert got[0].startswith(b"{")
    assert stat.S_ISFIFO(fifo.stat().st_mode)


@posix
@pytest.mark.parametrize("kind", ["folder", "socket", "missing parent"])
def test_what_cannot_be_written_is_refused_before_the_work(kind: str, saved: Path, tmp_path: Path) -> None:
    import socket

    target, opened = tmp_path / "t.json", socket.socket(socket.AF_UNIX)
    if kind == "folder":
        target.mkdir()
    if kind == "socket":
        opened.bind(str(target))
    if kind == "missing parent":
        target = tmp_path / "none" / "t.json"
    words = {"folder": "it is a folder", "socket": "it is a socket", "missing parent": "No such file or directory"}[kind]
    for command in (["export", str(saved), "--to", "json"], ["check", str(saved)]):
        refused(*command, "-o", str(target), words=words, cwd=tmp_path)
    opened.close()


@posix
def test_devices_stay(saved: Path, tmp_path: Path) -> None:
    done = run("export", str(saved), "--to", "json", "-o", "/dev/null")
    assert done.returncode == 0
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    if Path("/dev/full").exists():
        refused("export", str(saved), "--to", "json", "-o", "/dev/full", words="No space left", cwd=tmp_path)


def test_a_dash_is_standard_output_where_the_output_is_one_text(saved: Path, tmp_path: Path) -> None:
    done = run("export", str(saved), "--to", "json", "-o", "-")
    assert done.stdout == cuticle.Sampler.load(saved).to_json()
    assert "wrote -" in done.stderr
    done = run("export", "--amalgamate", "-o", "-")
    assert done.stdout == cuticle.export.amalgamate()
    refused("fit", "brown", "-o", "-", words="several files", cwd=tmp_path)
    refused("export", str(saved), "--to", "glsl", "--with-model", "-o", "-", words="name of its own", cwd=tmp_path)
    refused("export", str(saved), "--to", "glsl", "--with-model", "-o", "same.f32", words="name of its own", cwd=tmp_path)


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path: Path) -> None:
    def stopped() -> None:
        with filling(tmp_path / "new" / "folder") as work:
            (work / "first").write_text("1")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert not list(tmp_path.iterdir())
    with filling(tmp_path / "new" / "folder") as work:
        (work / "below").mkdir()
        (work / "below" / "first").write_text("1")
    assert (tmp_path / "new" / "folder" / "below" / "first").read_text() == "1"


@posix
@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        ("fit.fit", ("fit", "brown", "-o", "out")),
        ("document.document", ("document", "-o", "out")),
        ("export.export", ("export", "SAVED", "--to", "cpp", "-o", "out.h")),
        ("check.check", ("check", "SAVED", "-o", "out.json")),
        ("audit.audit", ("audit", "SAVED", "-o", "out")),
    ],
)
@pytest.mark.parametrize("becomes", [None, RuntimeError, ValueError])
def test_ctrl_c_leaves_nothing(
    function: str, arguments: tuple[str, ...], becomes: Any, saved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a library in between makes another error of it, as Mitsuba does of what a plugin raises."""

    def interrupted(*_: Any, **__: Any) -> Any:
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)
        except KeyboardInterrupt:
            raise (becomes or KeyboardInterrupt)("a long text\nof its own") from None

    module, name = function.split(".")
    monkeypatch.setattr(f"cuticle.cli.{module}.{name}", interrupted)
    done = run(*(str(saved) if a == "SAVED" else a for a in arguments), cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "cuticle: stopped\n")
    assert not list(tmp_path.iterdir())


@posix
@pytest.mark.parametrize(
    ("shell", "code", "words"),
    [
        ("exec {cuticle} fibres >&-", 0, ""),
        ("exec {cuticle} fibres 2>&-", 0, ""),
        ("exec {cuticle} check none.json >&- 2>&-", 2, ""),
        ("exec {cuticle} check none.json 2>/dev/full", 2, ""),
        ("exec {cuticle} fibres >/dev/full", 2, "cuticle: [Errno 28] No space left on device: 'standard output'\n"),
        ("export PYTHONIOENCODING=ascii; exec {cuticle} fibres", 0, ""),
        (
            "mkdir gone; cd gone; rmdir ../gone; exec {cuticle} export --family chiang --to cpp -o x.h",
            2,
            "cuticle: cannot write to x.h: No such file or directory\n",
        ),
        # the exit code is that of the work, though `head` has seen enough
        ("set -o pipefail; {cuticle} audit bad.npz | head -c 1 >/dev/null", 1, ""),
        # Ctrl-C of a script is not for its jobs in the background
        ("trap '' INT; (sleep .4; kill -INT $$) & exec {cuticle} audit bad.npz", 1, ""),
    ],
)
def test_streams_and_signals_as_a_shell_gives_them(shell: str, code: int, words: str, tmp_path: Path) -> None:
    if "/dev/full" in shell and not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    drawn = np.random.default_rng(1).normal(size=(6000, 3))
    np.savez(tmp_path / "bad.npz", direction=drawn, pdf=1 + (drawn[:, 2] > 0))  # no audit passes it
    command = shell.format(cuticle=f"{sys.executable} -m cuticle")
    done = subprocess.run(["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (code, words)


@posix
def test_a_terminal_that_lacks_a_letter_shows_its_code() -> None:
    import pty

    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "cuticle", "fibres"]
    with subprocess.Popen(command, stdout=theirs, env={**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "60"}) as done:
        os.close(theirs)
        shown = b""
        with contextlib.suppress(OSError):  # the terminal's end
            while part := os.read(ours, 4096):
                shown += part
    os.close(ours)
    assert done.returncode == 0
    assert b"\\u2026" in shown


@posix
def test_a_name_that_is_no_text_stands_on_pages_and_pictures(saved: Path, tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xc3\xa9-\xff.json")
    (tmp_path / name).write_bytes(saved.read_bytes())
    done = run("audit", name, "--strands", "0", "--theta-r", "20", "--samples", "10000", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "caf\u00e9-\\udcff.json, 0 strands" in (tmp_path / "out/audit.html").read_text("utf-8")


def test_ctrl_c_before_the_package_is_imported() -> None:
    code = "import cuticle_command, os, signal; assert 'cuticle' not in __import__('sys').modules; os.kill(os.getpid(), 2)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "cuticle: stopped\n")


@posix
@pytest.mark.slow
def test_ctrl_c_within_a_render_of_mitsuba(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    command = [sys.executable, "-m", "cuticle", "render", "lock", "--width", "64", "--spp", "1000000", "-o", "a.png"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as started:
        late = threading.Timer(120, started.kill)
        late.start()
        assert started.stderr is not None
        try:
            first = started.stderr.readline()  # it is told right before the render
            time.sleep(0.5)
            started.send_signal(signal.SIGINT)
            rest = started.stderr.read()
            started.wait()
        finally:
            late.cancel()
            started.kill()
    assert re.fullmatch(r"this takes about \d+ s\n", first), first
    assert (started.returncode, rest) == (130, "cuticle: stopped\n")
    assert not list(tmp_path.iterdir())
