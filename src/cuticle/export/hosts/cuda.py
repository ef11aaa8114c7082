"""CUDA and HIP."""

from __future__ import annotations

from cuticle.export.cpp_header import header
from cuticle.export.family import family_header
from cuticle.export.registry import Host
from cuticle.export.reserved_words import CUDA, ENDINGS, PREFIXES

HOST = Host(
    "the same for nvcc and hipcc, on the host and on a GPU",
    lambda job: header(job, cuda=True),
    lambda job: family_header(job, cuda=True),
    reserved=CUDA,
    reserved_prefixes=("cuda", "nv_", *PREFIXES),
    reserved_endings=ENDINGS,
)
