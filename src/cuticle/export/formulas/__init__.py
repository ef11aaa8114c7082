"""Formulas once: the functions of the C++ headers, printed in shading languages.

`formulas` reads what a host's own functions, themselves written in the headers' language, need of the headers, and prints
all of it. docs/export.md says which part of C++ that is and why it is done in this way.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from cuticle._support.files import read_text
from cuticle.export.formulas.instances import Instances
from cuticle.export.formulas.library import Library
from cuticle.export.formulas.printer import Printer
from cuticle.export.formulas.syntax import SubsetError
from cuticle.export.formulas.tree import FLOAT, INT, Type, Vector
from cuticle.export.headers import include_dir

__all__ = ["FLOAT", "INT", "Library", "Printer", "SubsetError", "Vector", "headers", "print_formulas"]

FOLDERS = ("math", "sampler", "scattering")


@lru_cache(maxsize=1)
def headers() -> Library:
    """Return the declarations of the headers that hold formulas."""
    root = include_dir() / "cuticle"
    return Library.of(read_text(path, "header") for folder in FOLDERS for path in sorted((root / folder).glob("*.h")))


def print_formulas(
    text: str,
    printer: Printer,
    *,
    types: Mapping[str, Type] | None = None,
    externals: Mapping[str, Type] | None = None,
    library: Library | None = None,
) -> str:
    """Return a host's functions, and all that they need of the headers, in a shading language.

    Parameters
    ----------
    text
        The functions, in the subset of C++ that the headers' formulas are written in.
    printer
        The language's.
    types
        What names of types mean in `text`, beside float, float2 to float4, int and bool.
    externals
        What the host's macros return that `text` calls as functions: table(i) is printed as NAME_TABLE(i).
    library
        Other declarations than the headers'.

    Raises
    ------
    SubsetError
        A function that is needed uses what is outside the subset.
    """
    instances = Instances((library or headers()).copy(), types or {}, externals or {})
    instances.add(text)
    return printer.text(instances.items)
