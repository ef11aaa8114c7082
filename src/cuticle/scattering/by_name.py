"""Scattering functions by name: what the command line takes, and what a sampler's file says it was fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from pathlib import Path
from typing import Any, Protocol

from cuticle._support.files import read_text, toml_tables
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
    """What says which scattering function it was made for: a sampler."""

    @property
    def about(self) -> Mapping[str, Any]:
        """What it was made from."""
        ...

    @property
    def covers(self) -> tuple[float, ...]:
        """The strand counts that it serves."""
        ...


def known_names() -> str:
    """Return what a name may be, in words."""
    tables = [f"[{name}]" for name in _toml_readers()]
    return f"a preset ({', '.join(PRESETS)}), a .toml with {' or '.join(tables)}, {_endings()}, or {MITSUBA}PLUGIN"


def read_parameters_or_model(name: str, parameters: Sequence[str] = (), *, progress: Progress | None = None) -> Any:
    """Return what a name stands for: a `Fibre`, or a scattering function that no `Fibre` describes.

    Parameters
    ----------
    name
        A preset, a TOML file with one table, a table of values (.npz, .csv), or mitsuba:PLUGIN.
    parameters
        key=value of the plugin, or of a table (even, smooth): numbers, colours with commas, true or false, or words.
    progress
        Called with a phase and a fraction, where it takes long.

    Raises
    ------
    ValueError
        One line: what the name may be, or what is wrong with the file.
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
    if suffix == ".toml" or Path(name).exists():
        text = read_text(name, "model")
        readers = _toml_readers()
        return readers[next((t for t in toml_tables(text) if t in readers), Fibre.table_name)].from_toml(text, source=name)
    raise ValueError(f"a scattering function must be {known_names()}; got {name!r}")


def read_model(name: str, parameters: Sequence[str] = (), *, progress: Progress | None = None) -> Any:
    """Return the scattering function that a name stands for, a `Fibre` among strands; see `read_parameters_or_model`."""
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
    """Return what reads itself from a TOML file, by its table's name."""
    return {c.table_name: c for c in (Fibre, *classes().values()) if hasattr(c, "table_name")}


def _file_readers() -> dict[str, Any]:
    """Return what reads itself from a file, by the file's ending."""
    return {suffix: c for c in classes().values() for suffix in getattr(c, "suffixes", ())}


def _endings() -> str:
    return f"a table ({', '.join(_file_readers())})"


def provenance(model: Any) -> dict[str, Any]:
    """Return what a sampler's file says of a model, so that `model_of` finds it again; JSON can hold it."""
    known = classes().get(type(model).__name__)
    return {"model": type(model).__name__} | (model.to_dict() if known is not None and isinstance(model, known) else {})


def model_of(sampler: MadeOf, name: str | None = None, *, progress: Progress | None = None) -> Bcsdf:
    """Return the model that a sampler was fitted to, or the one named instead, among strands where the sampler's was.

    Raises
    ------
    ValueError
        The sampler does not say which it was, or the table it names is gone or another.
    """
    about = sampler.about
    model = _restored(about) if name is None else read_model(name, progress=progress)
    if "among" in about and not hasattr(model, "with_strands"):
        model = Strands(model, **about["among"])
    return with_strands(model, sampler.covers[0])


def _restored(about: Mapping[str, Any]) -> Any:
    """Return the function of a single strand, or of a fibre among others, that `about` tells."""
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
