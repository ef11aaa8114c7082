"""A sampler as GLSL, and the texels its scattering function reads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cuticle.export import Export, environment
from cuticle.export.frames import Frame
from cuticle.export.literals import singles
from cuticle.export.tables import ModelTables
from cuticle.models import AVERAGE_LIMIT, DualScattering
from cuticle.sampler import Sampler

TEXTURE_WIDTH = 1024  # every device of OpenGL ES 3.0 has 2048
_TYPES = ("float", "vec2", "vec3", "vec4")


def shader(
    sampler: Sampler,
    tables: ModelTables | None,
    frame: Frame,
    name: str,
    about: list[str],
    *,
    inline: bool = True,
) -> Export:
    """Return the GLSL of a sampler; with `tables` that of its scattering function, too.

    `inline=False` leaves the table of lobes out: the host then defines NAME_TABLE(i).
    """
    texels = lobe_texels(sampler)
    counts = sampler.strands
    groups = texels.shape[2] // 5
    names = "xyzw"[: min(sampler.lobes, 4)]
    values = dict(
        about=about, n=name, frame=frame, axes=frame.axes, back="".join("xyz"[frame.axes.index(a)] for a in "xyz"),
        lobes=sampler.lobes, V=_TYPES[len(names) - 1], width=len(names), G=groups,
        swizzle=f".{names}" if len(names) < 4 else "",
        theta_nodes=texels.shape[1], strands=counts, even=sampler.even, row_step=texels.shape[1] * 5 * groups,
        blends=len(counts) > 1 and counts[0] == 0, energy=singles(sampler.energy[:2], ""),
        texels=[f"vec4({', '.join(singles(v, ''))})" for v in texels.reshape(-1, 4)] if inline else [],
        model=tables, texture_width=TEXTURE_WIDTH,
    )  # fmt: skip
    data = b""
    if tables is not None:
        values |= _model_values(tables)
        data = model_texels(tables).tobytes()
    text = environment().get_template("sampler.glsl.j2").render(values)
    return Export(text, texels.nbytes + sampler.energy.size * 4, data, tables)


def lobe_texels(sampler: Sampler) -> NDArray[np.float32]:
    """Return the table as it is fetched: shape (rows, theta nodes, 5 groups, 4), lobes of weight 0 added to fill a group."""
    rows, nodes, parameters, lobes = sampler.nodes.shape
    padded = np.ones((rows, nodes, parameters, -(-lobes // 4) * 4), np.float32)
    padded[:, :, 0] = 0
    padded[..., :lobes] = sampler.nodes
    return padded.reshape(rows, nodes, -1, 4)


def model_texels(tables: ModelTables) -> NDArray[np.float32]:
    """Return the scattering function's tables as rows of texels: N, the spread N, the averages; shape (height, width, 4)."""
    parts = [tables.direct]
    if tables.spread is not None and tables.averages is not None:
        parts += [tables.spread, tables.averages.swapaxes(1, 2)]  # channels last
    texels = np.concatenate([p.reshape(-1, p.shape[-1]) for p in parts])
    height = -(-len(texels) // TEXTURE_WIDTH)
    out = np.zeros((height * TEXTURE_WIDTH, 4), np.float32)
    out[: len(texels), : texels.shape[1]] = texels
    return out.reshape(height, TEXTURE_WIDTH, 4)


def _model_values(tables: ModelTables) -> dict[str, object]:
    model = tables.model
    rows, columns, _, channels = tables.direct.shape
    if channels > 4:
        raise ValueError(f"a texel holds 4 channels, this fibre has {channels}: leave --with-model out, or use cpp")
    fibre = model.fibre
    exact = isinstance(model, DualScattering) and model.formulation == "exact"
    back = (1 if exact else 2) / np.pi  # what the printed formulas leave in
    return {
        "C": _TYPES[channels - 1],
        "channel_swizzle": "." + "xyzw"[:channels] if channels < 4 else "",
        "rows": rows,
        "columns": columns,
        "fibre": fibre,
        "variances": fibre.beta**2,
        "dual": tables.spread is not None,
        "exact": exact,
        "first_spread": 3 * rows * columns,
        "first_average": 6 * rows * columns,
        "average_rows": 0 if tables.averages is None else len(tables.averages),
        "average_limit": AVERAGE_LIMIT,
        "d_b": singles(fibre.d_b, "")[0],
        "back_factor": singles(back, "")[0],
        "density": singles(fibre.d_f if exact else fibre.d_f**2, "")[0],
        "spread_back": singles(fibre.d_b * back * (1 if exact else np.pi), "")[0],
    }
