"""Run the code blocks of one documentation page, in order, in one folder and one namespace.

    python docs_page.py PAGE FOLDER [--slow]

Each page has a process of its own: what it registers or configures ends with it. Each imports what its own blocks need.

- `python` blocks share a namespace.
- `sh` blocks run line by line: `cuticle …` through the entry point in this process, anything else in bash.
- `cpp` blocks are compiled against the headers; one that defines `main` is run.

An HTML comment directly before a block changes that:

- `<!-- slow -->` runs it with --slow only.
- `<!-- not run: REASON -->` never runs it.
- `<!-- file: src/cuticle/PACKAGE/NAME.py -->` makes it a module of that package.
- `<!-- file: tests/NAME.py -->` makes it a file of tests, which pytest runs.
"""

from __future__ import annotations

import importlib
import os
import re
import shlex
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

LANGUAGES = ("python", "sh", "cpp")
COMPILE = ("c++", "-std=c++17", "-O0", "-Wall", "-Wextra", "-Werror")
_BLOCK = re.compile(r"(?:^<!--(?P<mark>[^\n]*)-->\n)?^```(?P<language>\w+)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
_MARK = re.compile(r"(?P<slow>slow)|not run: *(?P<reason>\S.*)|file: *(?P<file>(src/cuticle/\w+|tests)/\w+\.py)|")


@dataclass(frozen=True)
class Block:
    """A code block: the line it begins after, what it holds, and what the comment before it asks for."""

    line: int
    language: str
    code: str
    slow: bool
    reason: str | None
    file: str | None


def blocks(text: str) -> list[Block]:
    """Return the blocks in the languages that run, or raise ValueError for a comment that is none of the marks."""
    found = []
    for match in _BLOCK.finditer(text):
        if match["language"] not in LANGUAGES:
            continue
        line, comment = text.count("\n", 0, match.start("code")), (match["mark"] or "").strip()
        mark = _MARK.fullmatch(comment)
        if mark is None:
            known = "`slow`, `not run: REASON` or `file: PATH`"
            raise ValueError(f"line {line}: a comment before a block must be {known}, got {comment!r}")
        found.append(Block(line, match["language"], match["code"], mark["slow"] is not None, mark["reason"], mark["file"]))
    return found


def run(block: Block, namespace: dict[str, object], folder: Path, name: str) -> None:
    """Run one block, or raise."""
    if block.file is not None:
        _install(block.code, folder / block.file)
    elif block.language == "python":
        # The blank lines make errors name the line of the page.
        exec(compile("\n" * block.line + block.code, name, "exec"), namespace)
    elif block.language == "sh":
        for line in block.code.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words[:1] == ["cuticle"]:
                import command

                done = command.run(*words[1:], cwd=folder)
            else:
                done = subprocess.run(["bash", "-ec", line], cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise RuntimeError(f"exit code {done.returncode} of: {line}\n{done.stdout}{done.stderr}")
    else:
        from cuticle.export.headers import include_dir

        source = folder / f"line_{block.line}.cpp"
        source.write_text(block.code, encoding="utf-8")
        whole = "int main(" in block.code
        output = ["-o", source.stem] if whole else ["-c", "-o", f"{source.stem}.o"]
        subprocess.run([*COMPILE, "-I", str(include_dir()), "-I.", source.name, *output], cwd=folder, check=True)
        if whole:
            subprocess.run([str(folder / source.stem)], cwd=folder, check=True)


def _install(code: str, path: Path) -> None:
    """Write a file of the package or of the tests, and make it a module, or run it."""
    import pytest

    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(code, encoding="utf-8")
    if path.parent.name != "tests":
        importlib.import_module(f"cuticle.{path.parent.name}").__path__.append(str(path.parent))
    elif pytest.main(["-q", "-p", "no:cacheprovider", "--rootdir", str(path.parent), str(path)]) != 0:
        raise RuntimeError(f"{path.name} fails")


def main() -> None:
    page, folder, slow = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve(), "--slow" in sys.argv
    namespace: dict[str, object] = {"__name__": page.stem}
    warnings.simplefilter("error")
    os.chdir(folder)
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.reason is None and (slow or not block.slow):
            try:
                run(block, namespace, folder, str(page))
            except BaseException:
                print(f"{page.name}, the {block.language} block at line {block.line}:\n{block.code}", file=sys.stderr)
                raise


if __name__ == "__main__":
    main()
