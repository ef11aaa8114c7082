"""The parameters of the BSDF `cuticle`, checked at the door."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import mitsuba as mi
import numpy as np

from cuticle._support import validate
from cuticle.fitting.samplings import SAMPLINGS
from cuticle.sampling.lobe_table import MAX_LOBES
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.fibre import LOBES, Fibre
from cuticle.scattering.presets import PRESETS


@dataclass(frozen=True, init=False)
class Parameters:
    """What a scene asks of the BSDF, each value in its range.

    Attributes
    ----------
    fibre
        The name of a scattering function; None if the others define it.
    filename
        The path of a fitted sampler, found as Mitsuba finds files.
    near
        Whether the near field of Chiang's function is asked for.
    strands
        Whether a function of one strand is to be put among strands.
    sampling, lobes, direct_share
        How directions are drawn. Without `sampling`, from the function where it has closed forms, else from lobes.
    own
        The parameters of a `Fibre` or a `Chiang` that the scene sets itself.

    Raises
    ------
    ValueError, TypeError
        One line: the parameter, its range, the value received.
    """

    fibre: str | None
    filename: str | None
    near: bool
    strands: bool
    sampling: str | None
    lobes: int
    direct_share: float
    own: dict[str, Any]

    def __init__(self, **given: Any) -> None:
        for name in given:
            if name not in _NAMES and name not in _OWN:
                raise ValueError(f"cuticle has no parameter {name!r}; it has {', '.join(_NAMES)}, or a fibre's own")
        own = {name: _plain(name, given[name]) for name in _OWN if name in given}
        sampling = validate.choice("sampling", given["sampling"], SAMPLINGS) if "sampling" in given else None
        if "lobes" in given and sampling not in (None, "lobes"):
            raise ValueError(f"lobes is their number, for sampling lobes; leave it out for sampling {sampling}")
        near = validate.flag("near", given.get("near", False))
        values: dict[str, Any] = {
            "fibre": _name(str(given["fibre"])) if "fibre" in given else None,
            "filename": _path(str(given["filename"])) if "filename" in given else None,
            "near": near,
            "strands": validate.flag("strands", given.get("strands", False)) and not near,
            "sampling": "lobes" if sampling is None and "lobes" in given else sampling,
            "lobes": validate.integer("lobes", given.get("lobes", 4), 1, MAX_LOBES // 2),
            "direct_share": validate.number("direct_share", given.get("direct_share", 0.5), 0.01, 0.99),
            "own": own,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)


_OWN = dict.fromkeys((*Fibre.names(), *sorted(Chiang.names())))
_NAMES = (*(f.name for f in fields(Parameters) if f.name != "own"), "scale")


def changeable(function: Any) -> dict[str, float]:
    """Return the parameters that `mi.traverse` shows beside textures, by their names in a scene, defaults filled in.

    Roughness, tilt and index of a `Fibre` or a `Chiang`, and its pigments where they make its absorption; of any other
    function none. Angles are in degrees.
    """
    if isinstance(function, Fibre):
        of_lobes = zip(("alpha", "beta"), np.degrees([function.alpha, function.beta]).tolist(), strict=True)
        values = {f"{name}_{lobe}": x for name, row in of_lobes for lobe, x in zip(LOBES, row, strict=True)}
        names = ["beta_N", "eta", "d_f", "d_b"]
    elif isinstance(function, Chiang):
        values, names = {}, ["beta_m", "beta_n", "alpha", "eta"]
    else:
        return {}
    if function.sigma_a is None and getattr(function, "color", None) is None:
        names += ["eumelanin", "pheomelanin"]
    return values | {name: getattr(function, name) or 0.0 for name in names}


def _name(name: str) -> str:
    return name if name in PRESETS else _path(name)


def _path(name: str) -> str:
    """A file as Mitsuba finds it, beside the scene, too; what is no file stays as it is."""
    return str(mi.file_resolver().resolve(name)) if name else name


def _plain(name: str, value: Any) -> Any:
    """A plugin's parameter as a fibre takes it: colours and vectors become lists."""
    if isinstance(value, (str, int, float)):
        return value
    try:
        return [float(x) for x in value]
    except TypeError:
        raise TypeError(f"{name} must be a number, a colour or a texture, got {type(value).__name__}") from None
