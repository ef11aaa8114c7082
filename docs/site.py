"""Stage the pages of the site in build/site/pages: the repository's own, and a reference of Python and of the headers.

    python docs/site.py && mkdocs build

Pages lie as they do in the repository, so that a link means the same in both; what they link to beside pages goes along.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from cuticle.export.formulas.library import Found, Library

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "build/site/pages"
_EXPORTED = re.compile(r"from \.([\w.]+) import (\w+) as (\w+)")
_LINK = re.compile(r"\]\(([^)#\s]+)")
# How the reference of Python is arranged: a heading, and the packages whose public names stand under it.
PARTS = {
    "What scatters": "scattering", "What is drawn": "sampling", "From one to the other": "fitting", "Proof": "checking",
    "The draft": "draft",
}  # fmt: skip
# What users import from modules below the root.
MODULES = {
    "Export": ("export.export", "export.export_family", "export.amalgamate"),
    "Grooms": (
        "grooms.groom.Groom", "grooms.groom.read_groom", "grooms.groom.join_grooms", "grooms.procedural.hair_ball",
        "grooms.procedural.wavy_lock", "grooms.procedural.hair_head", "grooms.variation.vary",
    ),
    "Reference values": ("reference.making.make", "reference.comparison.check"),
    "Rendering": (
        "render.scene.load_scene", "render.scene.View", "render.scene.Light", "render.scene.bsdf",
        "render.scene.integrator", "render.picture.render", "render.picture.save_picture",
        "render.compare.compare_samplings",
    ),
}  # fmt: skip


def main() -> None:
    """Write all pages anew."""
    shutil.rmtree(PAGES, ignore_errors=True)
    for source in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*"), *ROOT.glob("examples/*.md")):
        if (source.is_file() and source.suffix in (".md", ".png", ".svg")) or source.parent.name == "tutorials":
            place(source)
    for page in list(PAGES.rglob("*.md")):
        for link in _LINK.findall(page.read_text(encoding="utf-8")):
            target = (ROOT / page.relative_to(PAGES).parent / link).resolve()
            if ":" not in link and target.is_file() and not staged(target).exists():
                place(target)
    reference = PAGES / "reference"
    reference.mkdir()
    (reference / "python.md").write_text(python(), encoding="utf-8")
    (reference / "headers.md").write_text(headers(), encoding="utf-8")


def staged(source: Path) -> Path:
    """Where a file of the repository lies in the site."""
    return PAGES / source.relative_to(ROOT)


def place(source: Path) -> None:
    """Copy a file to its place."""
    staged(source).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, staged(source))


def python() -> str:
    """Return the page of the public Python names, as `cuticle/__init__.pyi` lists them."""
    stub = (ROOT / "src/cuticle/__init__.pyi").read_text(encoding="utf-8")
    names = [(module, name) for module, name, shown in _EXPORTED.findall(stub) if module[0] != "_" and name == shown]
    names.sort(key=lambda each: each[1] in ("conventions", "densities", "presets"))  # modules come last
    lines = ["# Python", "", "All of these are attributes of `cuticle`. Angles are radians unless a parameter says degrees."]
    for heading, package in PARTS.items():
        lines += ["", f"## {heading}"]
        for module, name in names:
            if module.split(".")[0] == package:
                lines += ["", f"::: cuticle.{module}.{name}"]
    for heading, shown in MODULES.items():
        lines += ["", f"## {heading}", "", *(line for name in shown for line in (f"::: cuticle.{name}", ""))]
    return "\n".join(lines) + "\n"


def headers() -> str:
    """Return the page of the C++ headers: what each is for, and what it declares."""
    lines = ["# C++ headers", "", '`#include "cuticle/cuticle.h"` has all of them; each stands alone, too. No dependency.']
    for path in sorted((ROOT / "include/cuticle").glob("*/*.h")):
        text = path.read_text(encoding="utf-8")
        lines += ["", f"## {path.relative_to(ROOT / 'include')}", "", *about(text)]
        for found in Library().add(text):
            if found.comment and found.scope in ("", "math"):
                lines += ["", f"### {found.name}", "", "```cpp", declaration(found), "```", "", spoken(found.comment)]
    return "\n".join(lines) + "\n"


def about(text: str) -> Iterator[str]:
    """The comment at a header's head."""
    for line in text.splitlines():
        if not line.startswith("//"):
            return
        yield line[2:].strip().replace("<", "&lt;")


def spoken(comment: str) -> str:
    """A comment as a paragraph."""
    return (
        " ".join(line.strip().lstrip("/").strip() for line in comment.splitlines()).replace("<", "&lt;").replace("|", "\\|")
    )


def declaration(found: Found) -> str:
    """A declaration without its body, on one line."""
    words = []
    for token in found.stream:
        if token.text == "{" or (token.text == ";" and found.kind != "struct"):
            break
        if token.kind not in ("comment", "directive"):
            words.append(token.text)
    text = re.sub(r"\s*(::|[<(\[])\s*", r"\1", " ".join(words))
    text = re.sub(r"\s+([>),;\]])", r"\1", text)
    return re.sub(r"^(CUTICLE_HD|CUTICLE_INLINE) ", "", re.sub(r"(> ?)(CUTICLE_HD|CUTICLE_INLINE) ", "> ", text)) + ";"


if __name__ == "__main__":
    main()
