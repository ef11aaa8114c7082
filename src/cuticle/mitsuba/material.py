"""The material behind a BSDF `cuticle`: a scattering function and its samplers, from the plugin's parameters."""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache
from typing import Any, NamedTuple

from cuticle._support import validate
from cuticle.fitting.closed_forms import DRAFT, DocumentFunctions
from cuticle.fitting.samplings import OWN, SAMPLINGS
from cuticle.mitsuba.function import DENSITIES, read_function, read_sampler
from cuticle.mitsuba.parameters import Parameters
from cuticle.sampling.combining import combine
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.among_strands import Strands
from cuticle.scattering.any_fibre import Family
from cuticle.scattering.bcsdf import Bcsdf
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.marschner import LONGITUDINAL_OF, Marschner


class Material(NamedTuple):
    """The scattering function and the samplers of a BSDF `cuticle`.

    Attributes
    ----------
    fibre
        The function of a single strand. A `Fibre` also defines dual scattering.
    single
        The sampler of a single strand; None samples the uniform sphere.
    combined
        The sampler of a strand among others, for any number in between; None if that is unknown.
    among
        The function among strands, if `fibre` is not a `Fibre`.
    own
        Whether directions are drawn from the function's own density, in closed form: then no sampler is fitted.
    near
        Whether it is Chiang's near field.
    densities
        d_f and d_b of a function in closed form.
    direct_share
        Of directions among strands, how many are drawn as for a single strand.
    """

    fibre: Fibre | Chiang | Bcsdf
    single: Sampler | None
    combined: Sampler | None
    among: Strands | None = None
    own: bool = False
    near: bool = False
    densities: tuple[float, float] = (1.0, 1.0)
    direct_share: float = 0.5


def read_material(given: dict[str, Any], textures: Collection[str] = (), *, scaled: bool = False) -> Material:
    """Return the scattering function and the samplers that a plugin's parameters describe; the rest as in `material_of`."""
    return material_of(Parameters(**given), textures, scaled=scaled)


def material_of(asked: Parameters, textures: Collection[str] = (), *, scaled: bool = False) -> Material:
    """Return the scattering function and the samplers that a scene asks for.

    `textures` are the names of parameters that are textures, each of which has a number in `asked`; `scaled`, whether there
    is a `scale`.

    Raises
    ------
    ValueError
        One line: the parameter, the values it may have, the value received.
    """
    loaded = read_sampler(asked)
    function = read_function(asked, loaded)
    if asked.near:
        return _near(function, asked)
    if asked.sampling == OWN or (asked.sampling is None and loaded is None):
        single: Any = function.model if isinstance(function, Strands) else function
        if (reason := _no_closed_form(single)) is None:
            _check_channels(single.channels)
            d_f, d_b = (validate.number(n, asked.own.get(n, getattr(single, n, 1.0)), 0, 1) for n in DENSITIES)
            return Material(single, None, None, own=True, densities=(d_f, d_b), direct_share=asked.direct_share)
        if asked.sampling == OWN:
            raise ValueError(f"sampling {OWN}: {reason}; use lobes")
    # Before any fit:
    if scaled and not isinstance(function, (Fibre, Chiang)):
        raise ValueError("scale multiplies a fibre's absorption (a Fibre's, or Chiang's on its own); a table has none")
    if textures:
        raise ValueError(
            f"{min(textures)} as a texture needs a closed form: a Fibre's of the exact formulation or Chiang's, and sampling"
            " function; of any other, tables and lobes are made for numbers"
        )
    return (_of_fibre if isinstance(function, Fibre) else _of_function)(function, asked, loaded)


def samplings_of(given: dict[str, Any]) -> tuple[str, ...]:
    """Return from what directions may be drawn for a plugin's parameters, in the order of SAMPLINGS."""
    asked = Parameters(**given)
    function = read_function(asked, read_sampler(asked))
    without = set() if isinstance(function, Fibre) else {"document"}
    if _no_closed_form(function.model if isinstance(function, Strands) else function) is not None:
        without.add(OWN)
    return tuple(name for name in SAMPLINGS if name not in without)


def _no_closed_form(function: Any) -> str | None:
    """Why a function's far field has none to draw from."""
    if isinstance(function, Fibre) and function.formulation != "exact":
        return f"formulation {function.formulation} has no density of its own"
    if not isinstance(function, (Fibre, Chiang)):
        return f"a {type(function).__name__} is no fibre of R, TT and TRT"
    try:
        Family("marschner" if isinstance(function, Fibre) else "chiang").sampler_at(function)
    except ValueError as error:
        return str(error)
    return None


def _near(function: Any, asked: Parameters) -> Material:
    if not isinstance(function, Chiang):
        raise ValueError(
            f"near needs Chiang's function (beta_m, beta_n and an absorption, or a TOML file with [chiang]); got a"
            f" {type(function).__name__}"
        )
    if asked.sampling not in (None, OWN):
        raise ValueError(f"near draws from its own function: leave sampling out, got {asked.sampling!r}")
    _check_channels(function.channels)
    return Material(function, None, None, own=True, near=True)


def _of_fibre(fibre: Fibre, asked: Parameters, loaded: Sampler | None) -> Material:
    _check_channels(fibre.channels)
    if asked.sampling == "uniform":
        return Material(fibre, None, None)
    if loaded is not None and asked.sampling in (None, "lobes"):
        return Material(fibre, *_rows(loaded, asked.direct_share))
    return Material(fibre, *_samplers(fibre, asked.lobes, asked.sampling or "lobes", asked.direct_share))


def _of_function(function: Any, asked: Parameters, loaded: Sampler | None) -> Material:
    if asked.sampling == "document":
        raise ValueError(
            "sampling document needs a fibre of R, TT and TRT (a preset, or a TOML file with [fibre]); use lobes"
        )
    among = function if isinstance(function, Strands) else None
    single: Any = function if among is None else among.model
    _check_channels(len(single.eval(0.0, 0.0, 3.0)))
    if asked.sampling == "uniform":
        return Material(single, None, None, among)
    if loaded is not None and (among is None or "among" in loaded.about):
        alone, combined = _rows(loaded, asked.direct_share)
        return Material(single, alone, None if among is None else combined, among)
    mixed = None if among is None else _mixed(among, asked.lobes, asked.direct_share)
    return Material(single, _fitted(single, asked.lobes), mixed, among)


def _check_channels(channels: int) -> None:
    if channels not in (1, 3):
        raise ValueError(f"a fibre must have 1 or 3 channels (linear RGB) in a render, got {channels}")


@lru_cache(maxsize=16)
def _fitted(function: Any, lobes: int) -> Sampler:
    from cuticle.fitting.fit import fit  # a fibre with closed forms is drawn from without a fit, and loads at once

    return fit(function, lobes).sampler


@lru_cache(maxsize=16)
def _mixed(model: Any, lobes: int, share: float) -> Sampler:
    """The sampler where n is not known: `share` of that for no strands in between, and the rest of that for 2."""
    from cuticle.fitting.fit import fit

    both = fit(model, lobes, strands=(0, 2)).sampler
    return combine(both, both, share, strands=2)


def _rows(sampler: Sampler, share: float) -> tuple[Sampler, Sampler]:
    """What a sampler from a file serves: its row for no strands, and the mixture with the row nearest to 2 strands."""
    single = sampler.row(0.0) if 0 in sampler.strands else sampler.row(sampler.strands[0])
    several = [n for n in sampler.strands if n > 0]
    if not several:
        return single, single
    return single, combine(single, sampler, share, strands=min(several, key=lambda n: abs(n - 2)))


@lru_cache(maxsize=16)
def _samplers(fibre: Fibre, lobes: int, form: str, share: float) -> tuple[Sampler, Sampler | None]:
    model = among_others(fibre)
    if form == "document":
        if model is None:
            raise ValueError("sampling document needs a fibre whose multiple scattering has a sum: raise sigma_a")
        from cuticle.fitting.fit import fit

        both = fit(model, strands=(0, 2), form="document", functions=_document_functions(model)).sampler
        return both.row(0.0), combine(both, both, share, strands=2)
    single = _fitted(alone(fibre), lobes)
    if model is None:
        return single, None
    return single, _mixed(model, lobes, share)


def _document_functions(model: DualScattering) -> DocumentFunctions:
    """The draft's functions as found for this fibre, or the draft's own numbers where no Gaussian describes it."""
    from cuticle.draft.functions import find_functions
    from cuticle.draft.tables import highlight_axis, table_2, table_3

    try:
        return find_functions(table_2(model), table_3(model), highlight_axis(model)).functions
    except ValueError:
        return DRAFT


def alone(fibre: Fibre) -> Marschner:
    """Return the fibre's function on its own."""
    return Marschner(fibre, LONGITUDINAL_OF[fibre.formulation])


def among_others(fibre: Fibre) -> DualScattering | None:
    """Return the fibre among strands; None where light that is never absorbed leaves multiple scattering without a sum."""
    try:
        return DualScattering(fibre)
    except ValueError:
        return None
