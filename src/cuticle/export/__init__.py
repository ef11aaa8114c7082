"""A fitted sampler as a file for another host: C++, CUDA, GLSL, JSON, or a web page to look at it."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jinja2
import numpy as np

from cuticle import validate
from cuticle.export.frames import FRAMES, Frame, frame
from cuticle.export.literals import single, singles, wrapped
from cuticle.export.tables import ModelTables, reduce_tables
from cuticle.fit import MEASURED_AT
from cuticle.headers import amalgamate
from cuticle.models import AVERAGE_LIMIT, Bcsdf, DualScattering
from cuticle.origin import model_of
from cuticle.quality import measure
from cuticle.sampler import Sampler
from cuticle.version import __version__

__all__ = ["FRAMES", "HOSTS", "Export", "amalgamate", "export"]

HOSTS = ("cpp", "cuda", "glsl", "json", "web")
Progress = Callable[[str, float], None]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_RESERVED = {"cuticle", "std", "main"}
MAX_TABLE = 16 * 1024  # bytes: what every OpenGL ES 3.0 device takes as a block


@dataclass(frozen=True)
class Export:
    """What an export is: the file's text, and for GLSL with a model the texels that go with it.

    Attributes
    ----------
    text
        The file.
    data
        Single-precision values, four a texel, for the texture that GLSL with a model reads; empty elsewhere.
    table_bytes
        Size of the lobe table in it.
    model
        The scattering function's tables, where they are in it.
    """

    text: str
    table_bytes: int
    data: bytes = b""
    model: ModelTables | None = None


def export(
    sampler: Sampler,
    to: str,
    *,
    frame: str = "local-x",
    name: str = "fibre",
    with_model: bool = False,
    progress: Progress | None = None,
) -> Export:
    """Return a sampler as a source file of its own, its table inlined.

    Parameters
    ----------
    sampler
        The sampler.
    to
        "cpp" and "cuda": C++17 with the core's headers in it, for float and double, on the host and on a GPU. "glsl": for
        GLSL ES 3.00 and 4.50, without loops of varying length. "json": the sampler's file. "web": a page in which to turn
        viewer, strands and number of lobes.
    frame
        Whose local frame the functions that take directions are written for: pbrt, mitsuba, local-x, local-y, local-z.
    name
        C++ namespace, or prefix in GLSL.
    with_model
        Put the scattering function in, too: f beside sample and pdf. Its tables are thinned to within 1 % of ∫ f cos.
    progress
        Called with a phase and a fraction from 0 to 1.

    Returns
    -------
    Export
        Text that depends on nothing but the arguments and the version.

    Raises
    ------
    ValueError
        An unknown host or frame; a name that is no identifier; a model asked for of a sampler that does not know its fibre.

    Examples
    --------
    >>> import cuticle
    >>> sampler = cuticle.fit(cuticle.Marschner(cuticle.Fibre.preset("black")), lobes=2).sampler
    >>> "namespace black {" in export(sampler, "cpp", frame="pbrt", name="black").text
    True
    """
    validate.choice("to", to, HOSTS)
    host_frame = check_frame(frame)  # the parameter hides the function of its name
    check_name(name)
    report = progress or (lambda phase, fraction: None)
    if to == "web":
        from cuticle.export.web import page

        return page(sampler, name=name, progress=report)
    model = model_of(sampler) if with_model else None
    report("tables", 0.1)
    tables = reduce_tables(model) if model is not None else None
    if to == "json":
        return _json(sampler, tables)
    report("measuring", 0.5)
    about = describe(sampler)
    report("writing", 0.9)
    if to == "glsl":
        from cuticle.export.glsl import shader

        return shader(sampler, tables, host_frame, name, about)
    return _cpp(sampler, tables, host_frame, name, about, cuda=to == "cuda")


def check_name(name: str) -> str:
    """Return a name that can be a namespace or a prefix, or raise ValueError."""
    if not _NAME.fullmatch(name) or "__" in name or name in _RESERVED:
        raise ValueError(
            f"name must be letters, digits and single underscores, begin with a letter and not be"
            f" {', '.join(sorted(_RESERVED))}; got {name!r}"
        )
    return name


def check_frame(name: str) -> Frame:
    """Return a frame by name, or raise ValueError."""
    return frame(name)


def describe(sampler: Sampler) -> list[str]:
    """Return lines that say which fibre, which fit and how good it is; measured, where the fibre is known."""
    lines = [f"Made by Cuticle {__version__}: {sampler.lobes} lobes for strand counts {_counts(sampler)}."]
    try:
        model = model_of(sampler)
    except ValueError:
        return [*lines, "Fitted to a scattering function of the user's own; its ESS is not known here."]
    lines.append(f"{_of_what(sampler, model)}; objective {sampler.about.get('objective')}.")
    inner = MEASURED_AT[np.abs(MEASURED_AT) <= np.radians(75.01)]
    found = []
    for n in sampler.covers:
        own = model.with_strands(n) if isinstance(model, DualScattering) else model
        ess = [measure(sampler, own, float(t), n).ess for t in inner]
        found.append(f"{n:g} strands {np.mean(ess):.4f} ({min(ess):.4f})")
    return [*lines, f"ESS for |theta_r| <= 75 degrees, mean (worst): {', '.join(found)}."]


def _of_what(sampler: Sampler, model: Bcsdf) -> str:
    fibre = sampler.fibre
    if fibre is None:
        return f"Scattering function: {model!r}"
    values = fibre.model_dump(exclude_none=True, exclude_defaults=True, mode="json")
    text = ", ".join(f"{k} {_plain(v)}" for k, v in values.items())
    kind = f"dual scattering, {model.formulation}" if isinstance(model, DualScattering) else "strand on its own"
    return f"Fibre: {text or 'the defaults'} (degrees, per radius); {kind}"


def environment() -> jinja2.Environment:
    """Return where the templates are read, with what turns numbers into source code."""
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("cuticle.export"), undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    made.filters.update(single=single, singles=singles, wrapped=wrapped, comment=_comment)
    return made


def _cpp(sampler: Sampler, tables: ModelTables | None, frame: Frame, name: str, about: list[str], *, cuda: bool) -> Export:
    roots = ["angles.h", "batch.h"] + (["dual_scattering.h"] if tables is not None else [])
    nodes = sampler.padded_nodes.astype(np.float32)
    energy = sampler.energy.astype(np.float32)
    text = environment().get_template("sampler.h.j2").render(
        about=about, core=amalgamate(roots), name=name, guard=f"{name.upper()}_CUTICLE_H", frame=frame,
        version=__version__.split("."), lobes=nodes.shape[3], theta_nodes=nodes.shape[1], strands=sampler.strands,
        even=sampler.even, nodes=nodes, energy=energy, model=tables, dual=tables is not None and tables.spread is not None,
        average_limit=AVERAGE_LIMIT, cuda=cuda,
    )  # fmt: skip
    return Export(text, nodes.nbytes + energy.nbytes, model=tables)


def _json(sampler: Sampler, tables: ModelTables | None) -> Export:
    text = sampler.to_json()
    size = sampler.nodes.size * 4 + sampler.energy.size * 4
    if tables is None:
        return Export(text, size)
    fibre = tables.model.fibre
    material: dict[str, Any] = {
        "format": "cuticle-material",
        "version": 1,
        "sampler": json.loads(text),
        "model": {
            "alpha": fibre.alpha.tolist(),
            "beta": fibre.beta.tolist(),
            "longitudinal": tables.single.longitudinal,
            "direct": _rounded(tables.direct),
            "error": round(tables.error, 6),
        },
    }
    if isinstance(tables.model, DualScattering):
        material["model"] |= {
            "formulation": tables.model.formulation,
            "d_f": fibre.d_f,
            "d_b": fibre.d_b,
            "spread": _rounded(tables.spread),
            "averages": _rounded(tables.averages),
            "average_limit": AVERAGE_LIMIT,
        }
    return Export(json.dumps(material, allow_nan=False) + "\n", size, model=tables)


def _rounded(table: Any) -> Any:
    return json.loads(json.dumps(table.tolist(), allow_nan=False), parse_float=lambda text: float(f"{float(text):.7g}"))


def _counts(sampler: Sampler) -> str:
    return ", ".join(f"{n:g}" for n in sampler.covers)


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return "(" + ", ".join(map(_plain, value)) + ")"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _comment(lines: list[str], width: int = 122) -> str:
    return "\n".join(f"// {part}" for line in lines for part in (textwrap.wrap(line, width) or [""])).replace(
        "// \n", "//\n"
    )
