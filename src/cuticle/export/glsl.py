"""A sampler as GLSL or HLSL, and the texels its scattering function reads."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from cuticle.export import Export, environment
from cuticle.export.frames import Frame
from cuticle.export.literals import singles
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.compact_table import FunctionTable
from cuticle.scattering.fibre_tables import AVERAGE_LIMIT, FibreTables

TEXTURE_WIDTH = 1024  # every device of OpenGL ES 3.0 has 2048
_TYPES = ("float", "vec2", "vec3", "vec4")
_HLSL = {r"\bivec([234])\b": r"int\1", r"\bvec([234])\b": r"float\1", r"\bmix\(": "lerp(", r"\batan\(": "atan2("}


def shader(
    sampler: Sampler,
    tables: FibreTables | FunctionTable | None,
    frame: Frame,
    name: str,
    about: list[str],
    *,
    hlsl: bool = False,
    inline: bool = True,
) -> Export:
    """Return the GLSL (or HLSL) of a sampler; with `tables` that of its scattering function, too.

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
        model=tables, texture_width=TEXTURE_WIDTH, hlsl=hlsl, constant="static const" if hlsl else "const",
    )  # fmt: skip
    data = b""
    if tables is not None:
        values |= _model_values(tables)
        data = model_texels(tables).tobytes()
    text = environment().get_template("sampler.glsl.j2").render(values)
    if hlsl:
        for glsl, name_there in _HLSL.items():
            text = re.sub(glsl, name_there, text)
    return Export(text, texels.nbytes + sampler.energy.size * 4, data, tables)


def lobe_texels(sampler: Sampler) -> NDArray[np.float32]:
    """Return the table as it is fetched: shape (rows, theta nodes, 5 groups, 4), lobes of weight 0 added to fill a group."""
    rows, nodes, parameters, lobes = sampler.nodes.shape
    padded = np.ones((rows, nodes, parameters, -(-lobes // 4) * 4), np.float32)
    padded[:, :, 0] = 0
    padded[..., :lobes] = sampler.nodes
    return padded.reshape(rows, nodes, -1, 4)


def model_texels(tables: FibreTables | FunctionTable) -> NDArray[np.float32]:
    """Return the scattering function's tables as rows of texels, shape (height, width, 4).

    Of a fibre N, then the spread N and the averages, or the energies past TRT; of a table its shape, then its energies.
    """
    if isinstance(tables, FunctionTable):
        parts = [tables.shape, tables.log_energy]
    else:
        parts = [tables.direct]
        if tables.spread is not None and tables.averages is not None:
            parts += [tables.spread, tables.averages.swapaxes(1, 2)]  # channels last
        if tables.rest is not None:
            parts.append(tables.rest)
    texels = np.concatenate([p.reshape(-1, p.shape[-1]) for p in parts])
    height = -(-len(texels) // TEXTURE_WIDTH)
    out = np.zeros((height * TEXTURE_WIDTH, 4), np.float32)
    out[: len(texels), : texels.shape[1]] = texels
    return out.reshape(height, TEXTURE_WIDTH, 4)


def _model_values(tables: FibreTables | FunctionTable) -> dict[str, object]:
    channels = tables.channels
    if channels > 4:
        raise ValueError(f"a texel holds 4 channels, this fibre has {channels}: leave --with-model out, or use cpp")
    types: dict[str, object] = {
        "C": _TYPES[channels - 1],
        "channel_swizzle": "." + "xyzw"[:channels] if channels < 4 else "",
    }
    if isinstance(tables, FunctionTable):
        counts, viewers, rows, columns, _ = tables.shape.shape
        step = rows * columns
        return types | {
            "counts": counts, "viewers": viewers, "rows": rows, "columns": columns, "viewer_step": step,
            "count_step": viewers * step, "energies": tables.log_energy.shape[1], "first_energy": counts * viewers * step,
        }  # fmt: skip
    rows, columns = tables.direct.shape[:2]
    exact = tables.formulation == "exact"
    back = (1 if exact else 2) / np.pi  # what the printed formulas leave in
    return types | {
        "rows": rows,
        "columns": columns,
        "variances": tables.beta**2,
        "dual": tables.kind == "dual",
        "exact": exact,
        "first_spread": 3 * rows * columns,
        "first_average": 6 * rows * columns,
        "first_rest": 3 * rows * columns,
        "average_rows": 0 if tables.averages is None else len(tables.averages),
        "average_limit": AVERAGE_LIMIT,
        "d_b": singles(tables.d_b, "")[0],
        "back_factor": singles(back, "")[0],
        "density": singles(tables.d_f if exact else tables.d_f**2, "")[0],
        "spread_back": singles(tables.d_b * back * (1 if exact else np.pi), "")[0],
    }
