"""pbrt-v4: a header with the sampler, its scattering function, and the BxDF and Material that call them."""

from __future__ import annotations

import math
from dataclasses import replace

from cuticle.export.cpp_header import header
from cuticle.export.family import family_header
from cuticle.export.registry import Export, FamilyJob, Host, Job
from cuticle.export.reserved_words import ENDINGS, PBRT, PREFIXES
from cuticle.export.source import environment
from cuticle.scattering import conventions
from cuticle.scattering.frames import FRAMES

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
    return _with_classes(core, job.name, "pbrt.h.j2", create="")


def write_family(job: FamilyJob) -> Export:
    """Return the header of a family, with classes that take all of the parameters of pbrt's `hair`."""
    weights = (0.25,) * 4  # a channel is a wavelength there
    core = family_header(replace(job, frame=FRAMES["pbrt"]), weights=weights, colour="pbrt's wavelengths")
    return _with_classes(
        core, job.name, "pbrt_family.h.j2", create="parameters, loc, ",
        tilt=math.radians(conventions.HOSTS["pbrt-v4"].tilt), pigments=conventions.PIGMENTS["deon2011"],
    )  # fmt: skip


def _with_classes(core: Export, name: str, template: str, **values: object) -> Export:
    """A header with pbrt's classes behind it, and the lines that pbrt's own files need."""
    values |= {"name": name, "prefix": "".join(part.capitalize() for part in name.split("_"))}
    templates = environment()
    classes = templates.get_template(template).render(values, guard=f"{name}_PBRT_H")
    lines = templates.get_template("pbrt.txt.j2").render(values)
    return replace(core, text=f"{core.text}\n{classes}", remarks=lines)


HOST = Host(
    "a header for pbrt-v4 with a BxDF and a Material, and the lines to add to pbrt's files", write, write_family,
    forms=("chiang",), model="always",
    framed=False, reserved=PBRT, reserved_prefixes=PREFIXES, reserved_endings=ENDINGS,
)  # fmt: skip
