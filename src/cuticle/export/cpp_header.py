"""A sampler as a C++ header of its own, the core's headers in it: for C++ and for CUDA."""

from __future__ import annotations

import numpy as np

from cuticle._support.version import __version__
from cuticle.export.headers import amalgamate
from cuticle.export.registry import Export, Job
from cuticle.export.source import environment, signed

_ROOTS = {
    "dual": "scattering/dual_scattering.h", "strand": "scattering/marschner.h", "chiang": "scattering/chiang.h",
    "table": "scattering/function_table.h",
}  # fmt: skip


def header(job: Job, *, cuda: bool) -> Export:
    """Return the header of a sampler; with `job.tables` of its scattering function, too."""
    sampler, tables, name = job.sampler, job.tables, job.name
    roots = [
        "math/angles.h",
        f"sampler/{job.sampler.family}.h",
        "sampler/batch.h",
        *([_ROOTS[tables.kind]] if tables is not None else []),
    ]
    nodes = sampler.padded_nodes.astype(np.float32)
    energy = sampler.energy.astype(np.float32)
    text = environment().get_template("sampler.h.j2").render(
        about=job.about(), core=amalgamate(roots), name=name, guard=f"{name}_CUTICLE_H", frame=job.frame,
        version=__version__.split("."), lobes=nodes.shape[3], theta_nodes=nodes.shape[1], strands=sampler.strands,
        even=sampler.even, nodes=nodes, energy=energy, model=tables, kind=tables.kind if tables is not None else "",
        cuda=cuda, family=job.lobe_family,
    )  # fmt: skip
    return Export(signed(text), nodes.nbytes + energy.nbytes, model=tables)
