"""A fitted sampler, or a family, as a file for another host: `HOSTS` has their names."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from cuticle._support import validate
from cuticle._support.plain_values import plain
from cuticle._support.progress import Progress, silent
from cuticle._support.values import Value
from cuticle._support.version import __version__
from cuticle.export.family import about_family, family_writer
from cuticle.export.headers import amalgamate
from cuticle.export.registry import HOSTS, Export, FamilyJob, Job, host
from cuticle.export.reserved_words import OURS
from cuticle.sampling.quality import MEASURED_AT, measure
from cuticle.sampling.sampler import Sampler, fitted
from cuticle.scattering.bcsdf import Bcsdf, check_model, with_strands
from cuticle.scattering.by_name import model_of
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.family_among import FamilyAmong
from cuticle.scattering.family_among import family as make_family
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.frames import DEFAULT_FRAME, FRAMES
from cuticle.scattering.frames import frame as check_frame
from cuticle.scattering.host_tables import reduce_tables

__all__ = ["FRAMES", "HOSTS", "Export", "amalgamate", "export", "export_family"]

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
MAX_TABLE = 16 * 1024  # bytes: what every OpenGL ES 3.0 device takes as a block


def export(
    sampler: Sampler,
    to: str,
    *,
    frame: str = DEFAULT_FRAME,
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
        GLSL ES 3.00 and 3.30 to 4.60, without loops of varying length; "hlsl", "metal", "slang", "wgsl": the same. "json":
        the sampler's file. "web": a page in which to turn viewer, strands and number of lobes.
    frame
        Whose local frame the functions that take directions are written for: pbrt, mitsuba, local-x, local-y, local-z.
    name
        C++ namespace, or prefix in shading languages.
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
    fitted("sampler", sampler, "cuticle.fit makes one, export_family exports families")
    target = host(validate.choice("to", to, HOSTS))
    host_frame = check_frame(frame)  # the parameter hides the function of its name
    check_name(name, to)
    if with_model and target.model == "never":
        raise ValueError(f"--to {to} writes the sampler alone: leave --with-model out (with_model=False)")
    if model is not None:
        check_model(model)
    report = progress or silent
    wanted = with_model or target.model == "always"
    known = model if model is not None else (model_of(sampler) if wanted else _known(sampler))
    tables = None
    if wanted and known is not None:
        report("tables", 0.0)
        tables = reduce_tables(known, sampler.covers, target.tolerance, lambda done: report("tables", target.tables * done))

    def about() -> list[str]:
        report("measuring", 1 - target.tables)
        return describe(sampler, known)

    return target.write(Job(sampler, name, host_frame, about, tables, known, report))


def export_family(
    form: str, to: str, *, frame: str = DEFAULT_FRAME, name: str = "fibre", among: FamilyAmong | Fibre | Chiang | None = None
) -> Export:
    """Return the far field of any fibre of a model as a source file of its own: f, its density and exact samples.

    The fibre's parameters are arguments there, as in `cuticle.family`; no fit and no texture is needed.

    Parameters
    ----------
    form
        "chiang", "marschner" or "dual_scattering", see `cuticle.family`.
    to
        "cpp", "cuda", "glsl", "hlsl", "metal", "slang" or "wgsl", of linear RGB; or, of "chiang", "pbrt", of its
        wavelengths and in its frame. Of "dual_scattering", shaders read a texture, the result's `data`.
    frame, name
        As in `export`.
    among
        Of "dual_scattering": the family, or the mean fibre of the strands around.

    Raises
    ------
    ValueError
        An unknown family, host or frame; a name that is no identifier; "dual_scattering" without `among`, or with a mean
        fibre of other than three channels.
    """
    write = family_writer(form, to)
    host_frame, name = check_frame(frame), check_name(name, to)
    if not isinstance(among, FamilyAmong):
        made = make_family(form, among)
        among = made if isinstance(made, FamilyAmong) else None
    elif form != "dual_scattering":
        make_family(form, among.among)  # which refuses it
    if among is not None and among.channels != 3:
        raise ValueError(f"{to} has three channels, so among must have an absorption for each, got {among.channels}")
    own = form if among is None else among.form
    return write(FamilyJob(own, name, host_frame, about_family(own, among), among))


def check_name(name: str, to: str) -> str:
    """Return a name that can be a namespace or a prefix in a host's language, or raise ValueError."""
    target = host(to)
    if not _NAME.fullmatch(name) or "__" in name or name.endswith("_"):
        raise ValueError(
            "name must be letters, digits and single underscores, begin with a letter and not end in an underscore; got"
            f" {name!r}"
        )
    if name in OURS or name in target.reserved:
        raise ValueError(f"name must not be a word that {to} keeps for itself, got {name!r}; {name}_fibre would do")
    for does, verb, kept in (
        (name.startswith, "begin with", target.reserved_prefixes),
        (name.endswith, "end in", target.reserved_endings),
    ):
        if found := next((text for text in kept if does(text)), None):
            raise ValueError(f"name must not {verb} {found}, which {to} keeps for itself; got {name!r}")
    return name


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
    ess_of: Callable[..., str] = _ess if isinstance(model, Value) else _ess.__wrapped__
    found = [f"{n:g} strands {ess_of(sampler, model, n)}" for n in sampler.covers]
    return [*lines, f"ESS for |theta_r| <= 75 degrees, mean (worst): {', '.join(found)}."]


@lru_cache(maxsize=16)  # one host is often written after another
def _ess(sampler: Sampler, model: Bcsdf, n: float) -> str:
    """Mean and worst ESS through n strands."""
    own = with_strands(model, n)
    inner = MEASURED_AT[np.abs(MEASURED_AT) <= np.radians(75.01)]
    ess = [measure(sampler, own, float(t), n).ess for t in inner]
    return f"{np.mean(ess):.4f} ({min(ess):.4f})"


def _of_what(sampler: Sampler, model: Bcsdf) -> str:
    fibre = sampler.fibre
    if fibre is None:
        return f"Scattering function: {model!r}"
    values = plain(fibre.values(without_defaults=True))
    text = ", ".join(f"{k} {_plain(v)}" for k, v in values.items())
    kind = f"dual scattering, {model.formulation}" if isinstance(model, DualScattering) else "strand on its own"
    return f"Fibre: {text or 'the defaults'} (degrees, per radius); {kind}"


def _counts(sampler: Sampler) -> str:
    return ", ".join(f"{n:g}" for n in sampler.covers)


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return "(" + ", ".join(map(_plain, value)) + ")"
    return f"{value:g}" if isinstance(value, float) else str(value)
