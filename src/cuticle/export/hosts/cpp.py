"""C++17."""

from __future__ import annotations

from cuticle.export.cpp_header import header
from cuticle.export.family import family_header
from cuticle.export.registry import Host
from cuticle.export.reserved_words import CPP, ENDINGS, PREFIXES

HOST = Host(
    "C++17 with the core's headers in it, for float and double",
    lambda job: header(job, cuda=False),
    lambda job: family_header(job, cuda=False),
    reserved=CPP,
    reserved_prefixes=PREFIXES,
    reserved_endings=ENDINGS,
)
