"""Scattering functions by name: what the command line takes, and what a sampler's file says it was fitted to."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cuticle.chiang import Chiang
from cuticle.fibre import Fibre
from cuticle.files import read_text
from cuticle.models import Bcsdf, DualScattering, Marschner
from cuticle.presets import PRESETS
from cuticle.sampler import Sampler
from cuticle.sources import Tabulated, from_mitsuba
from cuticle.sources.functions import Progress
from cuticle.strands import Strands

MITSUBA = "mitsuba:"
WHAT = f"a preset ({', '.join(PRESETS)}), a .toml with [fibre] or [chiang], a table (.npz, .csv), or {MITSUBA}PLUGIN"


def is_fibre(name: str) -> bool:
    """Whether a name is that of a `Fibre`: a preset, or a file that is no table and has no [chiang]."""
    if name in PRESETS:
        return True
    if name.startswith(MITSUBA) or Path(name).suffix.lower() in (".npz", ".csv"):
        return False
    return not _has_chiang(read_text(name, "fibre")) if Path(name).exists() else True


def _has_chiang(text: str) -> bool:
    return any(line.strip() == "[chiang]" for line in text.splitlines())


def read_model(name: str, parameters: Sequence[str] = (), *, progress: Progress | None = None) -> Any:
    """Return the scattering function that a command line names.

    Parameters
    ----------
    name
        A preset, a TOML file with a table [fibre] or [chiang], a table of values (.npz, .csv), or mitsuba:PLUGIN.
    parameters
        key=value of the plugin: numbers, colours with commas, true or false, or words.
    progress
        Called with a phase and a fraction, where it takes long.

    Raises
    ------
    ValueError
        One line: what the name may be, or what is wrong with the file.
    """
    if name.startswith(MITSUBA):
        return from_mitsuba(name[len(MITSUBA) :], progress=progress, **read_parameters(parameters))
    if parameters:
        raise ValueError(f"key=value parameters go with {MITSUBA}PLUGIN, got {parameters[0]!r} with {name!r}")
    if name in PRESETS:
        return DualScattering(Fibre.preset(name))
    if Path(name).suffix.lower() in (".npz", ".csv"):
        return Tabulated.load(name)
    if Path(name).suffix.lower() == ".toml" or Path(name).exists():
        text = read_text(name, "model")
        if _has_chiang(text):
            return Chiang.from_toml(text, source=name)
        return DualScattering(Fibre.from_toml(text, source=name))
    raise ValueError(f"a scattering function must be {WHAT}; got {name!r}")


def read_parameters(pairs: Sequence[str]) -> dict[str, Any]:
    """Return a plugin's parameters from key=value texts."""
    out: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key:
            raise ValueError(f"parameters must be key=value, such as eumelanin=1.3; got {pair!r}")
        out[key] = _value(text)
    return out


def _value(text: str) -> Any:
    if text in ("true", "false"):
        return text == "true"
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return text
    return numbers[0] if len(numbers) == 1 else numbers


def provenance(model: Any) -> dict[str, Any]:
    """Return what a sampler's file says of a model, so that `model_of` finds it again; JSON can hold it."""
    fibre = getattr(model, "fibre", None)
    if isinstance(fibre, Fibre):
        about = {k: getattr(model, k) for k in ("formulation", "longitudinal") if hasattr(model, k)}
        return {"fibre": fibre.model_dump(exclude_none=True, mode="json"), **about}
    if isinstance(model, Chiang):
        return {"chiang": model.model_dump(exclude_none=True, mode="json")}
    if isinstance(model, Strands):
        single = {"single": type(model.model).__name__}
        return provenance(model.model) | single | {"among": {"d_f": model.d_f, "d_b": model.d_b}}
    source = getattr(model, "source", None)
    return {"source": source} if source else {}


def model_of(sampler: Sampler, name: str | None = None, *, progress: Progress | None = None) -> Bcsdf:
    """Return the model that a sampler was fitted to, or the one named instead, among strands where the sampler's was.

    Raises
    ------
    ValueError
        The sampler does not say which it was, or the table it names is gone or another.
    """
    about = sampler.about
    single = _single(about, sampler) if name is None else read_model(name, progress=progress)
    if "among" in about and not hasattr(single, "with_strands"):
        return Strands(single, sampler.covers[0], **about["among"])
    return single


def _single(about: dict[str, Any], sampler: Sampler) -> Bcsdf:
    fibre = sampler.fibre
    if isinstance(fibre, Fibre):
        if "Marschner" in (about.get("model"), about.get("single")):
            return Marschner(fibre, about.get("longitudinal", "gaussian"))
        return DualScattering(fibre, sampler.covers[0], about.get("formulation"))
    if "chiang" in about:
        return Chiang(**about["chiang"])
    source = about.get("source", {})
    if "path" in source:
        return _table(source)
    if "parameters" in source:
        options: dict[str, Any] = {"grid": tuple(source["grid"])} if "grid" in source else {}
        return from_mitsuba(source["parameters"], source.get("h"), **options)
    raise ValueError(
        "this sampler does not say which scattering function it is for: it was fitted to a function of your own, or to none;"
        " name one with --model"
    )


def _table(source: dict[str, str]) -> Tabulated:
    path = Path(source["path"])
    if not path.exists():
        raise ValueError(f"this sampler was fitted to {path}, which is not there; name the table with --model")
    if hashlib.sha256(path.read_bytes()).hexdigest() != source.get("sha256"):
        raise ValueError(
            f"this sampler was fitted to {path}, which has changed since; fit again, or name another with --model"
        )
    return Tabulated.load(path)
