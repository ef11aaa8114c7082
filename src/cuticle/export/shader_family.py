"""A family in a shading language."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle.export.formulas import Printer, Vector, print_formulas
from cuticle.export.formulas.tree import Record
from cuticle.export.registry import Export, FamilyJob, Host
from cuticle.export.shader import TEXTURE_WIDTH, Dialect, shader, texture_rows, through_table
from cuticle.export.source import environment, signed
from cuticle.scattering.bcsdf import REC709
from cuticle.scattering.family_among import FamilyAmong
from cuticle.scattering.mean_strands import MeanStrands

# In shaders: D, the fibre's parameters, and the fibre made of them.
_OF_SHADER = {
    "chiang": (
        "Azimuthal::logistic", "float beta_m, float beta_n, float alpha, float eta",
        "chiang_fibre(beta_m, beta_n, alpha, eta)",
    ),
    "marschner": (
        "Azimuthal::normal", "float3 alpha, float3 beta, float beta_n, float eta",
        "marschner_fibre(alpha.x, alpha.y, alpha.z, beta.x, beta.y, beta.z, beta_n, eta)",
    ),
}  # fmt: skip
_EXTERNALS = {"edge": Vector("float", 2), "middle": Vector("float", 3), "model": Vector("float", 4)}


def shader_host(about: str, dialect: Dialect, *, reserved: frozenset[str], reserved_prefixes: tuple[str, ...]) -> Host:
    """Return the host of a shading language, which takes samplers and families."""
    return Host(
        about, lambda job: shader(job, dialect), lambda job: family_shader(job, dialect), textured=True,
        reserved=reserved, reserved_prefixes=reserved_prefixes,
    )  # fmt: skip


def family_shader(job: FamilyJob, dialect: Dialect) -> Export:
    """Return a family in a shading language, of linear RGB."""
    edges, middles = _cells()
    printer: Printer = dialect.printer(job.name)
    jinja = environment()
    among = [] if job.among is None else ["float strands"]
    azimuthal, parameters, fibre = _OF_SHADER[job.form]
    data = b"" if job.among is None else among_texels(job.among.around).tobytes()
    values = dict(
        azimuthal=azimuthal, parameters=parameters, fibre=fibre, edges=edges, middles=middles, luminance=REC709,
        frame=job.frame, back=["xyz"[job.frame.axes.index(a)] for a in "xyz"], among=job.among,
        **({} if job.among is None else _among_values(job.among, parameters)),
    )  # fmt: skip
    formulas = jinja.get_template("family.formulas.j2").render(values)
    text = jinja.get_template("family_shader.j2").render(
        values, heading=[*job.about, "", dialect.about], n=job.name, N=job.name.upper(), dialect=dialect, p=printer,
        texture_width=TEXTURE_WIDTH, float4=Vector("float", 4), two=Vector("float", 2), three=Vector("float", 3),
        Field=Record("Field", ()),
        arguments=[
            (name, Vector("float", 3 if kind == "float3" else 1), False)
            for kind, name in map(str.split, ["float theta_r", *parameters.split(", "), "float3 sigma_a", *among])
        ],
        functions=print_formulas(formulas, printer, externals=_EXTERNALS),
    )  # fmt: skip
    return Export(signed(text), edges.nbytes + middles.nbytes, data)


def among_texels(around: MeanStrands) -> NDArray[np.float32]:
    """Return the tables of the strands around as rows of texels, shape (height, width, 4).

    A texel of all but the last holds the four parts of one channel; of the last, all channels.
    """
    *of_parts, behind = around[:4]
    ends = np.zeros((behind.shape[0] * behind.shape[1], 4))
    ends[:, : behind.shape[2]] = behind.reshape(-1, behind.shape[2])
    parts = (*(t.swapaxes(-1, -2) for t in of_parts), ends)
    return texture_rows(np.concatenate([p.reshape(-1, 4) for p in parts]))


def _among_values(among: FamilyAmong, parameters: str) -> dict[str, object]:
    """What the template asks for of the strands around."""
    around = among.around
    return dict(
        names=", ".join(p.split()[-1] for p in parameters.split(", ")), through=through_table(around, 0, 4, 3),
        columns=around.azimuth.shape[3], tilt=around.tilt, variance=around.variance, d_f=among.d_f, d_b=among.d_b,
    )  # fmt: skip


def _cells() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rows of cells, R's first: gamma and its sine at their edges; sine, cosine and width in h at their middles."""
    of = np.empty((2, _core.far_cells + 1, 5))
    _core.cell_geometry(True, of[0])
    _core.cell_geometry(False, of[1])
    edges, middles = of[:, :, :2].reshape(-1, 2), of[:, :-1, 2:].reshape(-1, 3)
    return edges.astype(np.float32), middles.astype(np.float32)
