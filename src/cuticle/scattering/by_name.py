"""Scattering functions by name: for the command line, and for a sampler's record of what it was fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from pathlib import Path
from typing import Any, Protocol

from cuticle._support.files import read_text, read_toml, reading
from cuticle._support.progress import Progress
from cuticle.scattering.among_strands import Strands
from cuticle.scattering.bcsdf import Bcsdf, with_strands
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.from_mitsuba import from_mitsuba
from cuticle.scattering.presets import PRESETS
from cuticle.scattering.registry import classes, sources

MITSUBA = "mitsuba:"


class MadeOf(Protocol):
    """A sampler, as far as its record of the scattering function goes."""

    @property
    def about(self) -> Mapping[str, Any]:
        """The record of what it was fitted to."""
        ...

    @property
    def covers(self) -> tuple[float, ...]:
        """The strand counts it serves."""
        ...


def known_names() -> str:
    """Return the valid names, in words for a message."""
    return f"{known_fibres().replace(' or a .toml', ', a .toml')}, {_endings()}, or {MITSUBA}PLUGIN"


def known_fibres() -> str:
    """Return those that denote parameters of a fibre, in words for a message."""
    tables = [f"[{name}]" for name in _toml_readers()]
    return f"a preset ({', '.join(PRESETS)}) or a .toml with {' or '.join(tables)}"


def read_parameters_or_model(name: str, parameters: Sequence[str] = (), *, progress: Progress | None = None) -> Any:
    """Return what a name denotes: a `Fibre`, or a scattering function without a `Fibre`.

    Parameters
    ----------
    name
        A preset, a TOML file with one table, a table of values (.npz, .csv), or mitsuba:PLUGIN.
    parameters
        Options of the plugin, or of a table (even, smooth), as key=value: numbers, colours with commas, true, false, words.
    progress
        Called with a phase and a fraction.

    Raises
    ------
    ValueError
        The name is unknown (the message lists the valid ones), or the file is wrong.
    """
    if name.startswith(MITSUBA):
        return from_mitsuba(name[len(MITSUBA) :], progress=progress, **read_parameters(parameters))
    suffix = Path(name).suffix.lower()
    if suffix in (readers := _file_readers()):
        return _load(readers[suffix].load, name, read_parameters(parameters))
    if parameters:
        raise ValueError(
            f"key=value parameters go with {MITSUBA}PLUGIN or {_endings()}, got {parameters[0]!r} with {name!r}"
        )
    if name in PRESETS:
        return Fibre.preset(name)
    if suffix == ".toml" or Path(name).is_file():
        makers = {table: c.from_table for table, c in _toml_readers().items()}
        return read_toml(read_text(name, "model"), makers, source=name, remedy=Fibre.table_remedy)
    raise ValueError(f"a scattering function must be {known_names()}; got {name!r}")


def read_model(name: str, parameters: Sequence[str] = (), *, progress: Progress | None = None) -> Any:
    """Return the scattering function of a name; a `Fibre` becomes `DualScattering`. See `read_parameters_or_model`."""
    found = read_parameters_or_model(name, parameters, progress=progress)
    return DualScattering(found) if isinstance(found, Fibre) else found


def read_parameters(pairs: Sequence[str]) -> dict[str, Any]:
    """Return a plugin's parameters from key=value texts."""
    out: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key:
            raise ValueError(f"parameters must be key=value, such as eumelanin=1.3; got {pair!r}")
        out[key] = _value(text)
    return out


def _load(load: Callable[..., Any], name: str, options: dict[str, Any]) -> Any:
    """Read a file with the options that its reader has."""
    known = [p.name for p in signature(load).parameters.values() if p.kind is p.KEYWORD_ONLY]
    for key in options:
        if key not in known:
            raise ValueError(f"{name} has no option {key!r}; it has {', '.join(known) or 'none'}")
    return load(name, **options)


def _value(text: str) -> Any:
    if text in ("true", "false"):
        return text == "true"
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return text
    return numbers[0] if len(numbers) == 1 else numbers


def _toml_readers() -> dict[str, Any]:
    """Return the classes that read themselves from TOML, by the name of their table."""
    return {c.table_name: c for c in (Fibre, *classes().values()) if hasattr(c, "table_name")}


def _file_readers() -> dict[str, Any]:
    """Return the classes that read themselves from a file, by its ending."""
    return {suffix: c for c in classes().values() for suffix in getattr(c, "suffixes", ())}


def _endings() -> str:
    return f"a table ({', '.join(_file_readers())})"


def provenance(model: Any) -> dict[str, Any]:
    """Return the record of a model that a sampler's file holds, from which `model_of` restores it."""
    known = classes().get(type(model).__name__)
    return {"model": type(model).__name__} | (model.to_dict() if known is not None and isinstance(model, known) else {})


def model_of(sampler: MadeOf, name: str | None = None, *, progress: Progress | None = None) -> Bcsdf:
    """Return the model that a sampler was fitted to, or the named one instead.

    The model is put among strands if the sampler's was.

    Raises
    ------
    ValueError
        The sampler has no record of its model, or the table it names is missing or has changed.
    """
    if name is not None:
        return _among(read_model(name, progress=progress), sampler)
    with reading("this sampler", "the scattering function of"):
        return _among(_restored(sampler.about), sampler)


def _among(model: Any, sampler: MadeOf) -> Any:
    """Return the model among strands if the sampler's was, and for its first strand count."""
    if "among" in sampler.about and not hasattr(model, "with_strands"):
        model = Strands(model, **sampler.about["among"])
    return with_strands(model, sampler.covers[0])


def _restored(about: Mapping[str, Any]) -> Any:
    """Return the function that `about` records."""
    kind = about.get("single", about.get("model", DualScattering.__name__ if "fibre" in about else None))
    if "source" in about:
        for key, restore in sources().items():
            if key in about["source"]:
                return restore(about["source"])
    elif kind in classes():
        return classes()[kind].from_dict(about)
    raise ValueError(
        "this sampler does not say which scattering function it is for: it was fitted to a function of your own, or to none;"
        " name one with --model"
    )
