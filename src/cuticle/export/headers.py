"""Where the C++ headers lie, and all of them as one file."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from cuticle import _core
from cuticle._support.files import read_text
from cuticle._support.version import __version__

_OWN = re.compile(r'^#include "cuticle/([a-z_/]+\.h)".*\n', re.MULTILINE)


def include_dir() -> Path:
    """Return the folder to give a compiler: `#include "cuticle/cuticle.h"` is found there."""
    return Path(_core.__file__).parent / "include"


def cmake_dir() -> Path:
    """Return the folder of cuticleConfig.cmake, for -Dcuticle_ROOT or CMAKE_PREFIX_PATH."""
    return Path(_core.__file__).parent / "cmake"


def amalgamate(roots: Iterable[str] = ("cuticle.h",)) -> str:
    """Return headers and all they need as one text, each once, in an order that compiles.

    Every header keeps its guard, so that the result can stand beside the headers themselves, or beside another such
    text, in one translation unit.

    Parameters
    ----------
    roots
        Names in include/cuticle, such as "math/erf.h".
    """
    bodies: dict[str, str] = {}

    def visit(name: str) -> None:
        if name in bodies:
            return
        text = read_text(include_dir() / "cuticle" / name, "header")
        for needed in _OWN.findall(text):
            visit(needed)
        bodies[name] = re.sub(r"\n{3,}", "\n\n", _OWN.sub("", text)).strip()

    for root in roots:
        visit(root)
    notice = f"// Cuticle {__version__}, the core: importance samplers for hair fibres. BSD-3-Clause, the Cuticle authors.\n"
    return notice + "\n" + "\n\n".join(filter(None, bodies.values())) + "\n"
