"""A page to turn a sampler in: one self-contained file, drawn by the exported GLSL itself."""

from __future__ import annotations

import base64
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cuticle._support.progress import expect
from cuticle.export.hosts.glsl import DIALECT
from cuticle.export.registry import Export, Host, Job
from cuticle.export.shader import TEXTURE_WIDTH, lobe_texels, shader
from cuticle.export.source import environment
from cuticle.fitting.fit import fit
from cuticle.scattering.frames import FRAMES

LOBES = (1, 2, 4, 8)
# What a fit takes, in fits of one lobe: for up to two strand counts, and for more. Measured with two fibres.
_COSTS = {1: (1.0, 1.0), 2: (1.0, 1.1), 4: (1.3, 1.6), 8: (2.6, 12.0)}
TABLES, FITS = 0.1, 0.8  # shares of all the work
TOLERANCE = 0.02  # of ∫ f cos: a page is loaded whole
_COLOR = {1: "vec3(f)", 2: "vec3(f, 0.0)", 3: "f", 4: "f.rgb"}


def page(job: Job) -> Export:
    """Return the page of a sampler and of 1, 2, 4 and 8 lobes fitted to the same fibre.

    Raises
    ------
    ValueError
        More than four channels, or a function too sharp for a table.
    """
    sampler, model, progress, tables = job.sampler, job.model, job.progress, job.tables
    assert model is not None
    assert tables is not None
    channels = tables.channels
    samplers = {sampler.lobes: sampler}
    objective = sampler.about.get("objective", "luminance")
    counts = sampler.covers if hasattr(model, "with_strands") and len(sampler.covers) > 1 else None
    costs = {k: _COSTS[k][len(counts or ()) > 2] for k in LOBES if k != sampler.lobes}
    done, whole, begin = 0.0, sum(costs.values()), time.perf_counter()
    for k, cost in costs.items():
        progress(f"fitting {k} lobes", TABLES + FITS * done / whole)
        samplers[k] = fit(model, k, strands=counts, objective=objective).sampler
        if not done:  # the cheapest, and the measure of the others
            expect(progress, (time.perf_counter() - begin) * whole / cost / FITS)
        done += cost
    progress("writing", TABLES + FITS)
    ordered = dict(sorted(samplers.items()))
    own = replace(job, name="fibre", frame=FRAMES["local-x"], about=list)
    scattering = shader(own, DIALECT, inline=False)
    luminance = "dot(f, vec3(0.2126, 0.7152, 0.0722))" if channels == 3 else f"dot(f, {_ones(channels)})"
    data = {
        "width": TEXTURE_WIDTH,
        "even": bool(sampler.even),
        "strands": list(sampler.covers),
        "lobes": list(ordered),
        "chosen": sampler.lobes,
        "model": scattering.text,
        "color": _COLOR[channels],
        "luminance": luminance,
        "texels": _packed(np.frombuffer(scattering.data, np.float32).reshape(-1, 4)),
        "samplers": {
            str(k): {
                "shader": shader(replace(own, sampler=s, tables=None), DIALECT, inline=False).text,
                "texels": _packed(lobe_texels(s).reshape(-1, 4)),
            }
            for k, s in ordered.items()
        },
    }
    text = environment().get_template("page.html.j2").render(data=data, name=job.name, about=job.about())
    return Export(text, 4 * (sampler.nodes.size + sampler.energy.size))


def _ones(channels: int) -> str:
    return "1.0" if channels == 1 else f"vec{channels}({1 / channels!r})"


def _packed(texels: NDArray[np.float32]) -> str:
    """Texels in base64, filled up to whole rows of a texture."""
    rows = -(-len(texels) // TEXTURE_WIDTH)
    out = np.zeros((rows * TEXTURE_WIDTH, 4), "<f4")
    out[: len(texels)] = texels
    return base64.b64encode(out.tobytes()).decode()


HOST = Host(
    "a page in which to turn viewer, strands and number of lobes", page, model="always", tolerance=TOLERANCE, tables=TABLES,
    framed=False,
)  # fmt: skip
