"""Where templates are read, with what turns numbers and comments into source code."""

from __future__ import annotations

import textwrap
import zlib

from cuticle._support.extras import needed
from cuticle.export.literals import single, singles, wrapped

with needed("cuticle.export"):
    import jinja2


def environment() -> jinja2.Environment:
    """Return Jinja's environment of the templates."""
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("cuticle.export"), undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    made.globals["checksum"] = _CHECKSUM
    made.filters.update(single=single, singles=singles, wrapped=wrapped, comment=comment, double="Float({})".format)
    return made


_CHECKSUM = "@checksum@"


def signed(text: str) -> str:
    """Return a file's text with its checksum where the templates ask for it: by that, two exports of one name differ."""
    return text.replace(
        _CHECKSUM, str(zlib.crc32(text.encode(errors="backslashreplace")) & 0x7FFFFFFF)
    )  # a GLSL integer is signed


def comment(lines: list[str], width: int = 122) -> str:
    """Return lines as comments of C++."""
    return "\n".join(f"// {part}" for line in lines for part in (textwrap.wrap(line, width) or [""])).replace(
        "// \n", "//\n"
    )
