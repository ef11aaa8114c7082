"""A fitted sampler as a file for another host: C++, CUDA, GLSL, HLSL, JSON, or a web page to look at it."""

from __future__ import annotations

import json
import re
import textwrap
from dataclasses import dataclass
from typing import Any

import jinja2
import numpy as np

from cuticle._support import validate
from cuticle._support.progress import Progress
from cuticle._support.version import __version__
from cuticle.export.frames import FRAMES, Frame, frame
from cuticle.export.headers import amalgamate
from cuticle.export.literals import single, singles, wrapped
from cuticle.sampling.quality import MEASURED_AT, measure
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import Bcsdf, with_strands
from cuticle.scattering.by_name import model_of
from cuticle.scattering.compact_table import FunctionTable
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.fibre_tables import AVERAGE_LIMIT, FibreTables
from cuticle.scattering.host_tables import reduce_tables

__all__ = ["FRAMES", "HOSTS", "Export", "amalgamate", "export"]

HOSTS = ("cpp", "cuda", "glsl", "hlsl", "json", "web")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_RESERVED = {"cuticle", "std", "main"}
_ROOTS = {"dual": ["dual_scattering.h"], "strand": ["marschner.h"], "chiang": ["chiang.h"], "table": ["tabulated.h"]}
MAX_TABLE = 16 * 1024  # bytes: what every OpenGL ES 3.0 device takes as a block


@dataclass(frozen=True)
class Export:
    """What an export is: the file's text, and for GLSL with a model the texels that go with it.

    Attributes
    ----------
    text
        The file.
    data
        Single-precision values, four a texel, for the texture that GLSL or HLSL with a model reads; empty elsewhere.
    table_bytes
        Size of the lobe table in it.
    model
        The scattering function's tables, where they are in it.
    """

    text: str
    table_bytes: int
    data: bytes = b""
    model: FibreTables | FunctionTable | None = None


def export(
    sampler: Sampler,
    to: str,
    *,
    frame: str = "local-x",
    name: str = "fibre",
    with_model: bool = False,
    model: Bcsdf | None = None,
    progress: Progress | None = None,
) -> Export:
    """Return a sampler as a source file of its own, its table inlined.

    Parameters
    ----------
    sampler
        The sampler.
    to
        "cpp" and "cuda": C++17 with the core's headers in it, for float and double, on the host and on a GPU. "glsl": for
        GLSL ES 3.00 and 4.50, without loops of varying length; "hlsl": the same in HLSL. "json": the sampler's file. "web":
        a page in which to turn viewer, strands and number of lobes.
    frame
        Whose local frame the functions that take directions are written for: pbrt, mitsuba, local-x, local-y, local-z.
    name
        C++ namespace, or prefix in GLSL and HLSL.
    with_model
        Put the scattering function in, too: f beside sample and pdf. A `Fibre`'s and Chiang's keep their closed forms, with
        tables thinned to within 1 % of ∫ f cos; any other is written as a table, to within 1 % where a million values are
        enough.
    model
        The scattering function, where the sampler does not know it: it was fitted to a function of your own, or the table
        it was fitted to has moved.
    progress
        Called with a phase and a fraction from 0 to 1.

    Returns
    -------
    Export
        Text that depends on nothing but the arguments and the version.

    Raises
    ------
    ValueError
        An unknown host or frame; a name that is no identifier; a scattering function asked for of a sampler that does not
        know it, or one too sharp for a table.

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

        return page(sampler, model or model_of(sampler), name=name, progress=report)
    known = model or _known(sampler)
    tables = None
    if with_model:
        report("tables", 0.0)
        tables = reduce_tables(
            known or model_of(sampler), sampler.covers, progress=lambda done: report("tables", 0.5 * done)
        )
    if to == "json":
        return _json(sampler, tables)
    report("measuring", 0.5)
    about = describe(sampler, known)
    report("writing", 0.9)
    if to in ("glsl", "hlsl"):
        from cuticle.export.glsl import shader

        return shader(sampler, tables, host_frame, name, about, hlsl=to == "hlsl")
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


def _known(sampler: Sampler) -> Bcsdf | None:
    """The scattering function that a sampler was fitted to, where it can be found."""
    try:
        return model_of(sampler)
    except ValueError:
        return None


def describe(sampler: Sampler, model: Bcsdf | None) -> list[str]:
    """Return lines that say which fibre, which fit and how good it is; measured, where the fibre is known."""
    lines = [f"Made by Cuticle {__version__}: {sampler.lobes} lobes for strand counts {_counts(sampler)}."]
    if model is None:
        return [*lines, "Fitted to a scattering function of the user's own; its ESS is not known here."]
    lines.append(f"{_of_what(sampler, model)}; objective {sampler.about.get('objective')}.")
    inner = MEASURED_AT[np.abs(MEASURED_AT) <= np.radians(75.01)]
    found = []
    for n in sampler.covers:
        own = with_strands(model, n)
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


def _cpp(
    sampler: Sampler, tables: FibreTables | FunctionTable | None, frame: Frame, name: str, about: list[str], *, cuda: bool
) -> Export:
    roots = ["angles.h", "batch.h", *(_ROOTS[tables.kind] if tables is not None else [])]
    nodes = sampler.padded_nodes.astype(np.float32)
    energy = sampler.energy.astype(np.float32)
    text = environment().get_template("sampler.h.j2").render(
        about=about, core=amalgamate(roots), name=name, guard=f"{name.upper()}_CUTICLE_H", frame=frame,
        version=__version__.split("."), lobes=nodes.shape[3], theta_nodes=nodes.shape[1], strands=sampler.strands,
        even=sampler.even, nodes=nodes, energy=energy, model=tables, kind=tables.kind if tables is not None else "",
        average_limit=AVERAGE_LIMIT, cuda=cuda,
    )  # fmt: skip
    return Export(text, nodes.nbytes + energy.nbytes, model=tables)


def _json(sampler: Sampler, tables: FibreTables | FunctionTable | None) -> Export:
    text = sampler.to_json()
    size = sampler.nodes.size * 4 + sampler.energy.size * 4
    if tables is None:
        return Export(text, size)
    values: dict[str, Any] = {"kind": tables.kind}
    names: tuple[str, ...] = ("strands", "shape", "log_energy", "reach", "even")
    if isinstance(tables, FibreTables):
        values["longitudinal"] = "energy_conserving" if tables.conserving else "gaussian"
        dual = ("formulation", "d_f", "d_b", "spread", "averages")
        own: dict[str, tuple[str, ...]] = {"dual": dual, "chiang": ("rest", "rest_variance")}
        names = ("alpha", "beta", "direct", *own.get(tables.kind, ()))
        if tables.kind == "dual":
            values["average_limit"] = AVERAGE_LIMIT
    for name in names:
        value = getattr(tables, name)
        values[name] = value.tolist() if name in ("alpha", "beta") else _rounded(value)
    values["error"] = round(tables.error, 6)
    material = {"format": "cuticle-material", "version": 1, "sampler": json.loads(text), "model": values}
    return Export(json.dumps(material, allow_nan=False) + "\n", size, model=tables)


def _rounded(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return value
    distinct, where = np.unique(value, return_inverse=True)
    return np.array([float(f"{x:.7g}") for x in distinct.tolist()])[where].reshape(value.shape).tolist()


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
