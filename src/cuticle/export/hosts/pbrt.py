"""pbrt-v4: a header with the sampler, its scattering function, and the BxDF and Material that call them."""

from __future__ import annotations

from dataclasses import replace

from cuticle.export.cpp_header import header
from cuticle.export.frames import FRAMES
from cuticle.export.registry import Export, Host, Job
from cuticle.export.reserved_words import MACRO_PREFIXES, PBRT
from cuticle.export.source import environment

CHANNELS = (1, 3)


def write(job: Job) -> Export:
    """Return the header, and the lines that pbrt's own files need.

    Raises
    ------
    ValueError
        The function has neither one channel nor linear RGB.
    """
    assert job.tables is not None
    if job.tables.channels not in CHANNELS:
        raise ValueError(f"pbrt takes one channel or linear sRGB, got a function of {job.tables.channels} channels")
    core = header(replace(job, frame=FRAMES["pbrt"]), cuda=False)
    values = {"name": job.name, "prefix": "".join(part.capitalize() for part in job.name.split("_")), "create": ""}
    templates = environment()
    classes = templates.get_template("pbrt.h.j2").render(**values, guard=f"{job.name.upper()}_PBRT_H")
    lines = templates.get_template("pbrt.txt.j2").render(**values)
    return replace(core, text=f"{core.text}\n{classes}", remarks=lines)


HOST = Host(
    "a header for pbrt-v4 with a BxDF and a Material, and the lines to add to pbrt's files", write, model="always",
    framed=False, reserved=PBRT, reserved_prefixes=MACRO_PREFIXES,
)  # fmt: skip
