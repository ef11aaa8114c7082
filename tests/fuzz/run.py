"""Reads damaged files: `python tests/fuzz/run.py --count 20000 --seed 1`. Exit code 1 if a reader does more than refuse.

Each reader runs in a process of its own with bounded memory. It may return something whole or raise a ValueError of one line
that names the file. A crash, a hang, any other exception, a value that is not finite and memory beyond the bound are
failures; the file that caused one is kept.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

from mutate import mutate
from targets import Target, controls, targets

MEMORY = 1 << 30  # bytes beyond what the process has taken before it reads
LONGEST = 700  # characters of a message


def damaged(target: Target, seed: int, k: int) -> bytes:
    """Return input `k`: the same wherever it is asked for."""
    rng = random.Random(f"{target.name} {seed} {k}")
    return target.pack(mutate(rng.choice(target.seeds), target.seeds, rng))


def fault(target: Target, path: Path) -> str | None:
    """Read a file; return what is wrong with how that went, or None."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            target.check(target.read(path))
    except ValueError as error:
        text = str(error)
        if path.name not in text or "\n" in text or len(text) > LONGEST:
            return f"message: {text[:300]!r}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:300]}"
    return None


def jobs(names: list[str], count: int) -> list[tuple[Target, int]]:
    """Return every input as its target and its number."""
    chosen = [t for t in (*targets(), *controls()) if t.name in names]
    return [(t, k) for t in chosen for k in range(max(1, round(count * t.share)))]


def work(first: int, count: int, seed: int, hang: int, folder: Path, names: list[str]) -> None:
    """Read inputs from job `first` on; print the number of each job before it is read, and its fault after."""
    todo = jobs(names, count)
    for target in {t.name: t for t, _ in todo[first:]}.values():
        (folder / target.name).parent.mkdir(exist_ok=True)
        for data in target.seeds:  # also imports what reading needs, before memory is bound
            (folder / target.name).write_bytes(target.pack(data))
            target.check(target.read(folder / target.name))
    _bound_memory()
    for at, (target, k) in enumerate(todo[first:], first):
        path = folder / target.name
        path.write_bytes(damaged(target, seed, k))
        print(at, flush=True)
        signal.alarm(hang)
        found = fault(target, path)
        signal.alarm(0)
        if found is not None:
            print(json.dumps([at, found]), flush=True)


def _bound_memory() -> None:
    import resource

    taken = 4 * MEMORY
    if sys.platform == "linux":
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))


def fuzz(names: list[str], count: int, seed: int, hang: int) -> dict[int, str]:
    """Return the faults by the number of their job. What ends the process is the fault of the last job it began."""
    faults: dict[int, str] = {}
    first = 0
    with tempfile.TemporaryDirectory() as folder:
        while first < len(jobs(names, count)):
            numbers = map(str, (first, count, seed, hang))
            command = [sys.executable, __file__, "--work", *numbers, folder, *names]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            lines = [json.loads(line) for line in done.stdout.splitlines()]
            faults |= {line[0]: line[1] for line in lines if isinstance(line, list)}
            if done.returncode == 0:
                break
            begun = [line for line in lines if isinstance(line, int)]
            if not begun:
                raise RuntimeError(f"a reader could not start: {done.stderr[-2000:]}")
            stopped = done.returncode == -signal.SIGALRM
            faults[begun[-1]] = "hang" if stopped else f"crash ({done.returncode}): {done.stderr[-300:]}"
            first = begun[-1] + 1
    return faults


def main() -> int:
    """Fuzz every target, or those named."""
    if sys.argv[1:2] == ["--work"]:
        first, count, seed, hang, folder, *names = sys.argv[2:]
        work(int(first), int(count), int(seed), int(hang), Path(folder), names)
        return 0
    known = [t.name for t in targets()]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20_000, help="inputs of each reader; slow readers get a share")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hang", type=int, default=40, help="seconds after which a reader hangs")
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"), help="folder for files that cause a fault")
    parser.add_argument("names", nargs="*", metavar="TARGET", help=", ".join(known))
    given = parser.parse_args()
    names = given.names or known
    faults = fuzz(names, given.count, given.seed, given.hang)
    todo = jobs(names, given.count)
    for name in dict.fromkeys(t.name for t, _ in todo):
        own = [at for at, (t, _) in enumerate(todo) if t.name == name]
        print(f"{name}: {len(own)} inputs, {sum(at in faults for at in own)} faults")
    for at, what in faults.items():
        target, k = todo[at]
        given.keep.mkdir(parents=True, exist_ok=True)
        kept = given.keep / f"{Path(target.name).stem}-{given.seed}-{k}{Path(target.name).suffix}"
        kept.write_bytes(damaged(target, given.seed, k))
        print(f"{kept}: {what}")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
