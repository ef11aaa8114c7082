"""The scattering function that a BSDF `cuticle` describes, and the sampler that it names."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from cuticle.mitsuba.parameters import Parameters
from cuticle.sampling.families import NORMAL
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.among_strands import Strands
from cuticle.scattering.by_name import known_names, model_of, read_parameters_or_model
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.fibre import Fibre

_CHIANG = frozenset(Chiang.names()) - frozenset(Fibre.names())
DENSITIES = ("d_f", "d_b")


def read_sampler(asked: Parameters) -> Sampler | None:
    """Return the sampler that `filename` names, if any."""
    return None if asked.filename is None else _loaded(asked.filename, _stamp(asked.filename))


def read_function(asked: Parameters, loaded: Sampler | None) -> Any:
    """Return the scattering function: by name, from the sampler's record, or from its own parameters.

    A function other than a `Fibre` is wrapped in `Strands` if `strands` is set or the sampler was fitted among strands.
    """
    own, function = asked.own, None
    among = asked.strands or (asked.fibre is not None and loaded is not None and "among" in loaded.about)
    if asked.fibre is not None:
        function = _named(asked.fibre, _stamp(asked.fibre))
    elif loaded is not None:
        function = loaded.fibre if loaded.fibre is not None else _of_sampler(loaded)
    elif not own:
        raise ValueError(f"cuticle needs a fibre: fibre ({known_names()}), filename, or sigma_a")
    if isinstance(function, Fibre) or (function is None and not _CHIANG & own.keys()):
        return _fibre(function, own)
    among = among or isinstance(function, Strands)
    # Chiang's far field has tables among strands as soon as they are asked for.
    other = among or (not asked.near and (function is None or isinstance(function, Chiang)))
    single = _changed(function, {k: v for k, v in own.items() if not (other and k in DENSITIES)})
    # These stand for gaps between strands. Here strands are counted, gaps and all: 0.7 would take them off twice.
    return _among(single, *(own.get(name, 1.0) for name in DENSITIES)) if among else single


def _fibre(fibre: Fibre | None, own: dict[str, Any]) -> Fibre:
    _no_others(own, Fibre)
    if fibre is None:
        fibre = Fibre(**own)
    if fibre.formulation == "exact":
        own = {**dict.fromkeys(DENSITIES, 1.0), **own}  # as in read_function
    return fibre.replace(**own) if own else fibre


def _changed(function: Any, own: dict[str, Any]) -> Any:
    """A function that is no `Fibre`, with some of its parameters set; None is Chiang's of these parameters alone."""
    if function is None or isinstance(function, Chiang):
        _no_others(own, Chiang)
        return Chiang(**({} if function is None else function.values()) | own)
    if own:
        raise ValueError(
            f"{min(own)} is not a parameter of this scattering function ({type(function).__name__}); change its source"
        )
    return function.model if isinstance(function, Strands) else function


def _no_others(own: dict[str, Any], kind: type[Fibre] | type[Chiang]) -> None:
    other = min(own.keys() - set(kind.names()), default=None)
    if other is not None:
        raise ValueError(f"{other} is not a parameter of this scattering function ({kind.__name__})")


def _stamp(name: str) -> int:
    """What tells whether a file has changed since it was read."""
    path = Path(name)
    return path.stat().st_mtime_ns if path.is_file() else 0


@lru_cache(maxsize=16)
def _named(name: str, _: int) -> Any:
    return read_parameters_or_model(name)


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
