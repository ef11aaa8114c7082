"""The material behind a BSDF `cuticle`: a scattering function and its samplers, from the plugin's parameters."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import mitsuba as mi

from cuticle._support import validate
from cuticle.draft.functions import find_functions
from cuticle.draft.tables import highlight_axis, table_2, table_3
from cuticle.fitting.closed_forms import DRAFT, DocumentFunctions
from cuticle.fitting.fit import SAMPLINGS, fit
from cuticle.sampling.combining import combine
from cuticle.sampling.families import NORMAL
from cuticle.sampling.lobe_table import MAX_LOBES
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.among_strands import Strands
from cuticle.scattering.bcsdf import Bcsdf
from cuticle.scattering.by_name import known_names, model_of, read_parameters_or_model
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.marschner import LONGITUDINAL_OF, Marschner
from cuticle.scattering.presets import PRESETS

PARAMETERS = ("fibre", "filename", "near", "strands", "sampling", "lobes", "direct_share", "scale")
_CHIANG = frozenset(Chiang.model_fields) - frozenset(Fibre.model_fields)
_DENSITIES = ("d_f", "d_b")


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
    near
        Whether it is Chiang's near field, which has a sampler of its own.
    """

    fibre: Fibre | Chiang | Bcsdf
    single: Sampler | None
    combined: Sampler | None
    among: Strands | None = None
    near: bool = False


def read_material(given: dict[str, Any]) -> Material:
    """Return the scattering function and the samplers that a plugin's parameters describe.

    Raises
    ------
    ValueError
        One line: the parameter, the values it may have, the value received.
    """
    known = (*PARAMETERS, *Fibre.model_fields, *sorted(_CHIANG))
    for name in given:
        if name not in known:
            raise ValueError(f"cuticle has no parameter {name!r}; it has {', '.join(PARAMETERS)}, or a fibre's own")
    sampling = validate.choice("sampling", given.get("sampling", "lobes"), SAMPLINGS)
    lobes = validate.integer("lobes", given.get("lobes", 4), 1, MAX_LOBES // 2)
    share = validate.number("direct_share", given.get("direct_share", 0.5), 0.01, 0.99)
    loaded = _load(_resolve(given["filename"])) if "filename" in given else None
    own = {name: _plain(value) for name, value in given.items() if name in known[len(PARAMETERS) :]}
    near = bool(given.get("near", False))
    function = _read_function(given.get("fibre"), own, loaded, bool(given.get("strands", False)) and not near)
    if near:
        if not isinstance(function, Chiang):
            raise ValueError(
                f"near needs Chiang's function (beta_m, beta_n and an absorption, or a TOML file with [chiang]); got a"
                f" {type(function).__name__}"
            )
        if sampling != "lobes":
            raise ValueError(f"near draws from its own function: leave sampling out, got {sampling!r}")
        _check_channels(function.channels)
        return Material(function, None, None, near=True)
    if isinstance(function, Fibre):
        fibre = _with_own(function, own)
        if sampling == "uniform":
            return Material(fibre, None, None)
        if loaded is not None and sampling == "lobes":
            return Material(fibre, *_rows(loaded, share))
        return Material(fibre, *_samplers(fibre, lobes, sampling, share))
    if sampling == "document":
        raise ValueError(
            "sampling document needs a fibre of R, TT and TRT (a preset, or a TOML file with [fibre]); use lobes"
        )
    among = function if isinstance(function, Strands) else None
    single: Any = among.model if among is not None else function
    _check_channels(len(single.eval(0.0, 0.0, 3.0)))
    if sampling == "uniform":
        return Material(single, None, None, among)
    if loaded is not None and (among is None or "among" in loaded.about):
        alone, combined = _rows(loaded, share)
        return Material(single, alone, combined if among is not None else None, among)
    mixed = _mixed(among, lobes, share) if among is not None else None
    return Material(single, _fitted(single, lobes), mixed, among)


def _resolve(name: Any) -> str:
    """A file's path as Mitsuba finds it: beside the scene, too."""
    return str(mi.file_resolver().resolve(str(name)))


def _read_function(name: Any, own: dict[str, Any], loaded: Sampler | None, strands: bool) -> Any:
    """Return the scattering function: by name, from the sampler's record, or from its own parameters.

    A function other than a `Fibre` is wrapped in `Strands` if `strands` is set or the sampler was fitted among strands.
    """
    function: Any = None
    if name is not None:
        function = _named(str(name), _stamp(str(name)))
        strands = strands or (loaded is not None and "among" in loaded.about)
    elif loaded is not None:
        function = loaded.fibre if loaded.fibre is not None else _of_sampler(loaded)
    elif not own:
        raise ValueError(f"cuticle needs a fibre: fibre ({known_names()}), filename, or sigma_a")
    if isinstance(function, Fibre) or (function is None and not _CHIANG & own.keys()):
        _no_others(own, Fibre)
        return function if function is not None else Fibre(**own)
    strands = strands or isinstance(function, Strands)
    # These stand for gaps between strands. Here strands are counted, gaps and all: 0.7 would take them off twice.
    densities = [own.pop(key, 1.0) for key in _DENSITIES] if strands else []
    if function is None or isinstance(function, Chiang):
        _no_others(own, Chiang)
        function = Chiang(**({} if function is None else function.model_dump(exclude_none=True)) | own)
    elif own:
        raise ValueError(
            f"{min(own)} is not a parameter of this scattering function ({type(function).__name__}); change its source"
        )
    single: Any = function.model if isinstance(function, Strands) else function
    return _among(single, *densities) if strands else function


def _no_others(own: dict[str, Any], kind: type[Fibre] | type[Chiang]) -> None:
    other = min(own.keys() - set(kind.model_fields), default=None)
    if other is not None:
        raise ValueError(f"{other} is not a parameter of this scattering function ({kind.__name__})")


def _stamp(name: str) -> int:
    """What tells whether a file has changed since it was read."""
    path = Path(_resolve(name))
    return path.stat().st_mtime_ns if path.is_file() else 0


@lru_cache(maxsize=16)
def _named(name: str, _: int) -> Any:
    path = name if name in PRESETS else _resolve(name)
    return read_parameters_or_model(name if path == name or not Path(path).exists() else path)


def _load(path: str) -> Sampler:
    return _loaded(path, _stamp(path))


@lru_cache(maxsize=16)
def _loaded(path: str, _: int) -> Sampler:
    sampler = Sampler.load(path)
    if sampler.family != NORMAL:
        raise ValueError(
            f"Mitsuba's plugins draw from normal lobes, {path} has {sampler.family} ones: fit it with family normal"
        )
    return sampler


@lru_cache(maxsize=16)
def _of_sampler(loaded: Sampler) -> Any:
    """The function that a sampler was fitted to."""
    try:
        return model_of(loaded)
    except ValueError as error:
        raise ValueError(f"{error}; or give fibre, too") from None


@lru_cache(maxsize=16)
def _among(single: Any, d_f: float, d_b: float) -> Strands:
    return Strands(single, d_f=d_f, d_b=d_b)


@lru_cache(maxsize=16)
def _fitted(function: Any, lobes: int) -> Sampler:
    return fit(function, lobes).sampler


@lru_cache(maxsize=16)
def _mixed(model: Any, lobes: int, share: float) -> Sampler:
    """The sampler where n is not known: `share` of that for no strands in between, and the rest of that for 2."""
    both = fit(model, lobes, strands=(0, 2)).sampler
    return combine(both, both, share, strands=2)


def _with_own(fibre: Fibre, own: dict[str, Any]) -> Fibre:
    if fibre.formulation == "exact":
        own = {**dict.fromkeys(_DENSITIES, 1.0), **own}  # as in _read_function
    if own:
        fibre = fibre.replace(**own)
    _check_channels(fibre.channels)
    return fibre


def _check_channels(channels: int) -> None:
    if channels not in (1, 3):
        raise ValueError(f"a fibre must have 1 or 3 channels (linear RGB) in a render, got {channels}")


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
        both = fit(model, strands=(0, 2), form="document", functions=_document_functions(model)).sampler
        return both.row(0.0), combine(both, both, share, strands=2)
    single = _fitted(alone(fibre), lobes)
    if model is None:
        return single, None
    return single, _mixed(model, lobes, share)


def _document_functions(model: DualScattering) -> DocumentFunctions:
    """The draft's functions as found for this fibre, or the draft's own numbers where no Gaussian describes it."""
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


def _plain(value: Any) -> Any:
    """A plugin's parameter as a fibre takes it: colours and vectors become lists."""
    return value if isinstance(value, (str, int, float)) else [float(x) for x in value]
