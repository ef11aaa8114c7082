"""The documentation: code blocks run as printed, links lead somewhere, and no page is left out of the index."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import docs_page

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*.md")])
TEXTS = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
RUN = {p: [b for b in docs_page.blocks(p.read_text(encoding="utf-8")) if b.reason is None] for p in PAGES}
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def play(page: Path, folder: Path, *options: str) -> None:
    text = page.read_text(encoding="utf-8")
    if "```cpp" in text and shutil.which("c++") is None:
        pytest.skip("no C++ compiler on the path")
    if re.search(r"mitsuba", text) and importlib.util.find_spec("mitsuba") is None:
        pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'")
    command = [sys.executable, str(ROOT / "tests/docs_page.py"), str(page), str(folder), *options]
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # `python` and `cuticle` of this environment
    environment = os.environ | {"PATH": programs, "OPENBLAS_NUM_THREADS": "1"}  # tests run side by side: one core a page
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


# Pages of which `make test-all` runs even what is quick: the README and the other pages show each command that they do.
LATER = {
    f"docs/{page}.md"
    for page in ("extending/fibre_model", "extending/verdict", "family", "grooms", "models", "sampler", "sources")
}


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, marks=pytest.mark.slow if name(p) in LATER else ())
        for p, found in RUN.items() if not all(b.slow for b in found)
    ],
    ids=name,
)  # fmt: skip
def test_code_blocks_run(page: Path, tmp_path: Path) -> None:
    play(page, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p, found in RUN.items() if any(b.slow for b in found)], ids=name)
def test_slow_code_blocks_run(page: Path, tmp_path: Path) -> None:
    play(page, tmp_path, "--slow")


@pytest.mark.parametrize(
    "block",
    [
        "```python\nassert cuticle\n```",
        pytest.param("```sh\ncuticle fit red -o red\n```", marks=pytest.mark.slow),
        pytest.param("```cpp\nint f() { return x; }\n```", marks=pytest.mark.slow),
    ],
)
def test_a_wrong_block_is_found(block: str, tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text(f"Text.\n\n{block}\n", encoding="utf-8")
    with pytest.raises(AssertionError, match="block at line 3"):
        play(tmp_path / "page.md", tmp_path)


def test_marks_are_obeyed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    slow, never = "<!-- slow -->\n```python\n1 / 0\n```\n", "<!-- not run: needs a GPU -->\n```sh\nfalse\n```\n"
    page.write_text(f"{slow}\n{never}", encoding="utf-8")
    play(page, tmp_path)
    with pytest.raises(AssertionError, match="ZeroDivisionError"):
        play(page, tmp_path, "--slow")


@pytest.mark.parametrize("mark", ["not run", "not run:", "not run: ", "skip: no need", "file: elsewhere.py"])
def test_a_block_is_left_out_for_a_reason_only(mark: str) -> None:
    with pytest.raises(ValueError, match="`not run: REASON`"):
        docs_page.blocks(f"<!-- {mark} -->\n```sh\nfalse\n```\n")


@pytest.mark.parametrize("page", TEXTS, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in _LINK.findall(re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)):
        if link.startswith(("http://", "https://")):
            continue
        place, _, anchor = link.partition("#")
        target = (page.parent / place).resolve() if place else page
        assert target.exists(), f"{name(page)} links to {link}"
        if anchor:
            assert anchor in anchors(target.read_text(encoding="utf-8")), f"{name(page)} links to {link}"


def anchors(text: str) -> set[str]:
    """Return the names that GitHub gives to a page's headings."""
    headings = re.findall(r"^#+ (.+)$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


def test_every_page_is_reachable_from_the_readme() -> None:
    seen, todo = set(), [ROOT / "README.md"]
    while todo:
        page = todo.pop()
        if page in seen:
            continue
        seen.add(page)
        places = [link.partition("#")[0] for link in _LINK.findall(page.read_text(encoding="utf-8"))]
        todo += [t for p in places if (t := (page.parent / p).resolve()).suffix == ".md" and t.exists()]
    assert set(TEXTS) - seen == set()


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120
