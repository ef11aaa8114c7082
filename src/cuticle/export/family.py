"""A family as a file for another host: the far field of any fibre, parameters as arguments."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle._support.version import __version__
from cuticle.export.formulas import Printer, Vector, print_formulas
from cuticle.export.frames import FRAMES, Frame
from cuticle.export.headers import amalgamate
from cuticle.export.hosts.glsl import DIALECT as GLSL
from cuticle.export.hosts.hlsl import DIALECT as HLSL
from cuticle.export.registry import Export
from cuticle.export.shader import Dialect
from cuticle.export.source import environment
from cuticle.scattering import conventions
from cuticle.scattering.any_fibre import FORMS
from cuticle.scattering.bcsdf import REC709

FAMILY_HOSTS = ("cpp", "cuda", "glsl", "hlsl", "pbrt")
_DIALECTS = {"glsl": GLSL, "hlsl": HLSL}
_ABOUT = {
    "chiang": "Chiang et al. 2016, far field: beta_m and beta_n from 0.05 to 1, alpha in radians, positive toward the root.",
    "marschner": "Marschner 2003 with d'Eon's energy-conserving M: alpha, beta of R, TT, TRT in theta_h, beta_n; radians.",
}


def write_family(form: str, to: str, frame: str, name: str) -> Export:
    """Return a family for a host; the arguments are checked."""
    host_frame = FRAMES[frame]
    if to in _DIALECTS:
        return _shader(form, _DIALECTS[to], host_frame, name)
    spectral = to == "pbrt"  # a channel is a wavelength there
    text = environment().get_template("family.h.j2").render(
        name=name, guard=f"{name.upper()}_CUTICLE_H", frame=FRAMES["pbrt"] if spectral else host_frame, cuda=to == "cuda",
        chiang=form == "chiang", about=_about(form), core=amalgamate(["scattering/far_field.h"]),
        version=__version__.split("."), weights=(0.25,) * 4 if spectral else REC709,
        colour="pbrt's wavelengths" if spectral else "linear RGB",
    )  # fmt: skip
    return _pbrt(text, name) if spectral else Export(text, 0)


def check_family(form: str, to: str | None) -> None:
    """Raise ValueError for a family or a host that there is not."""
    validate.choice("family", form, FORMS)
    validate.choice("to", to, FAMILY_HOSTS)
    if to == "pbrt" and form != "chiang":
        raise ValueError(f"pbrt takes the family chiang, whose parameters its scenes have; got {form!r}; use cpp for it")


def _about(form: str) -> list[str]:
    return [f"Made by Cuticle {__version__}: the far field of any fibre. {_ABOUT[form]}"]


def _pbrt(header: str, name: str) -> Export:
    """With classes for pbrt-v4 that take all of its `hair`'s parameters."""
    jinja = environment()
    values = {"name": name, "prefix": "".join(part.capitalize() for part in name.split("_")), "create": "parameters, loc, "}
    tilt = conventions.HOSTS["pbrt-v4"].tilt
    classes = jinja.get_template("pbrt_family.h.j2").render(
        **values, guard=f"{name.upper()}_PBRT_H", tilt=math.radians(tilt), pigments=conventions.PIGMENTS["deon2011"]
    )
    return Export(f"{header}\n{classes}", 0, remarks=jinja.get_template("pbrt.txt.j2").render(values))


def _shader(form: str, dialect: Dialect, frame: Frame, name: str) -> Export:
    chiang = form == "chiang"
    edges, middles = _cells()
    printer: Printer = dialect.printer(name)
    jinja = environment()
    formulas = jinja.get_template("family.formulas.j2").render(
        chiang=chiang, edges=len(edges) // 2, middles=len(middles) // 2, luminance=REC709, frame=frame,
        back=["xyz"[frame.axes.index(a)] for a in "xyz"],
    )  # fmt: skip
    text = jinja.get_template("family_shader.j2").render(
        heading=[*_about(form), "", dialect.about], n=name, N=name.upper(), dialect=dialect, p=printer, edges=edges,
        middles=middles, chiang=chiang, frame=frame, float3=printer.type(Vector("float", 3)),
        float4=printer.type(Vector("float", 4)),
        functions=print_formulas(formulas, printer, externals={"edge": Vector("float", 2), "middle": Vector("float", 3)}),
    )  # fmt: skip
    return Export(text, edges.nbytes + middles.nbytes)


def _cells() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rows of cells, R's first: gamma and its sine at their edges; sine, cosine and width in h at their middles."""
    of = np.empty((2, _core.far_cells + 1, 5))
    _core.cell_geometry(True, of[0])
    _core.cell_geometry(False, of[1])
    edges, middles = of[:, :, :2].reshape(-1, 2), of[:, :-1, 2:].reshape(-1, 3)
    return edges.astype(np.float32), middles.astype(np.float32)
