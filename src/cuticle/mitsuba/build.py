"""Builds Mitsuba's BSDF from a material: the tables that the plugin reads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from cuticle.mitsuba.closed_forms import closed_form
from cuticle.mitsuba.material import Material, alone, among_others
from cuticle.mitsuba.parameters import changeable
from cuticle.mitsuba.spectra import spectrum, tensor
from cuticle.sampling.families import padded
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.compact_table import FunctionTable, tabulate_function
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.host_tables import TOLERANCE
from cuticle.scattering.marschner import Marschner
from cuticle.scattering.through_strands import passed_through, through_tables

_RATIO = 1.3  # between neighbouring absorptions of the tables
_MOST = 32  # absorptions of a table
_REACH = 8.0  # how far beyond the fibre's own absorption they go, either way
COUNTS = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0)  # strands that a table among others is for


class _Tables(NamedTuple):
    absorption: tuple[float, ...]  # one a column: the fibre's own, then the range
    low: float
    model: DualScattering | None
    single: Marschner | Chiang


@lru_cache(maxsize=8)
def _tables(fibre: Fibre | Chiang, ranged: bool) -> _Tables:
    """Tables of the fibre's own absorption, and those of a range about it where another will be asked for."""
    own = fibre.absorption
    if not ranged:
        single = fibre if isinstance(fibre, Chiang) else alone(fibre)
        return _Tables(own, 0.1, among_others(fibre) if isinstance(fibre, Fibre) else None, single)
    positive = [x for x in own if x > 0] or [0.1]
    high = min(max(positive) * _REACH, 500.0)
    low = max(min(positive) / _REACH, high / _RATIO ** (_MOST - 1 - len(own)))
    with_others = isinstance(fibre, Fibre) and among_others(fibre) is not None
    # As printed, little absorption leaves multiple scattering without a sum: the range begins above that. One column tells.
    if isinstance(fibre, Fibre) and with_others:
        while among_others(fibre.replace(sigma_a=low)) is None:
            low *= _RATIO
    steps = min(max(math.ceil(math.log(high / low, _RATIO)) + 1, 2), _MOST - len(own))  # rounding may ask for one more
    absorption = (*own, *(low * _RATIO**k for k in range(steps)))
    if isinstance(fibre, Chiang):
        return _Tables(absorption, low, None, fibre.with_absorption(absorption))
    wide = fibre.replace(sigma_a=absorption)
    return _Tables(absorption, low, among_others(wide) if with_others else None, alone(wide))


def build(
    material: Material, *, scale: Any = None, textures: Mapping[str, Any] | None = None,
    scene: Mapping[str, Any] | None = None, tables: Any = None,
) -> Any:  # fmt: skip
    """Return Mitsuba's BSDF for a material.

    `scale`, a number or a texture, multiplies the absorption. `textures` take the place of parameters of a material in
    closed form. `scene` are the parameters that the material was read from, by which the plugin makes itself again when a
    number is changed; without them it shows none. `tables`, a texture of the absorption or True, asks for what a material in
    closed form needs among strands.
    """
    fibre, textures = material.fibre, textures or {}
    closed = isinstance(fibre, (Fibre, Chiang)) and material.among is None
    if material.own:
        props = closed_form(material, textures, scale, tables)
    else:
        props = mi.Properties("cuticle_bsdf" if closed else "cuticle_table")
        if isinstance(fibre, (Fibre, Chiang)) and closed:
            _fibre_tables(props, fibre, scale is not None or scene is None or (mi.is_spectral and fibre.channels > 1))
        else:
            _function_tables(props, material)
        if scale is not None:
            props["scale"] = scale
        for name, sampler in (("single", material.single), ("combined", material.combined)):
            if sampler is not None:
                props[name] = tensor(padded(sampler.nodes[0]))
                props[f"{name}_even"] = sampler.even
    if scene is not None:
        props["scene"], props["numbers"] = _properties(scene), _properties({} if material.own else changeable(fibre))
    props["about"] = _describe(material)
    return mi.PluginManager.instance().create_object(props)


def _properties(values: Mapping[str, Any]) -> Any:
    out = mi.Properties("cuticle")
    for name, value in values.items():
        out[name] = value
    return out


def _fibre_tables(props: Any, fibre: Fibre | Chiang, ranged: bool) -> None:
    tables = _tables(fibre, ranged)
    lobes = fibre.half_angle_lobes if isinstance(fibre, Chiang) else (fibre.alpha, fibre.beta)
    for name, radians in zip(("alpha", "beta"), lobes, strict=True):
        props[name] = mi.ScalarVector3d(*radians)
    props["exact"] = isinstance(fibre, Chiang) or fibre.formulation == "exact"
    for name in ("d_f", "d_b"):
        props[name] = getattr(fibre, name, 1.0)
    props["exact_channels"] = fibre.channels
    props["sigma_a_low"] = tables.low
    props["sigma_a_ratio"] = _RATIO
    props["direct"] = tensor(tables.single.tables.direct)
    if tables.model is not None:
        passed, limit = passed_through(tables.model.fibre)
        props["transmittance"], props["transmittance_limit"] = tensor(passed), limit
        if tables.model.formulation == "exact":
            through = through_tables(tables.model.fibre)
            for name in ("energy", "along", "azimuth", "behind"):
                props[f"through_{name}"] = tensor(getattr(through, name))
            props["through_limit"] = through.limit
        else:
            props["spread"] = tensor(tables.model.single.tables.spread)
            props["averages"] = tensor(tables.model.average_table)
    if isinstance(tables.single, Chiang):
        props["rest"] = tensor(tables.single.rest)
        props["rest_variance"] = float(tables.single.variance[3])
    props["sigma_a"], props["absorption"] = spectrum(fibre.absorption), str(fibre.absorption)


def _function_tables(props: Any, material: Material) -> None:
    functions: dict[str, Any] = {"alone_": material.fibre, "among_": material.among}
    for prefix, function in functions.items():
        if function is None:
            continue
        table = function_table(function, COUNTS if prefix == "among_" else (0.0,))
        props[f"{prefix}strands"] = " ".join(map(str, table.strands))
        for name in ("shape", "log_energy"):
            props[prefix + name] = tensor(getattr(table, name))
        for name in ("reach", "stretch", "even"):
            props[prefix + name] = getattr(table, name)
    if material.among is not None:
        passed, limit = material.among.passed
        props["transmittance"], props["transmittance_limit"] = tensor(passed), limit
    if mi.is_spectral and table.channels == 3:
        for name, primary in zip(("red", "green", "blue"), np.eye(3).tolist(), strict=True):
            props[name] = spectrum(tuple(primary))


@lru_cache(maxsize=8)
def function_table(function: Any, counts: tuple[float, ...]) -> FunctionTable:
    """Return the table that stands for a function in the plugin."""
    return tabulate_function(function, counts, TOLERANCE)


def _describe(material: Material) -> str:
    def text(name: str, sampler: Sampler | None) -> str:
        if sampler is None:
            return f"{name} = uniform sphere"
        form = sampler.about.get("form", "lobes")
        return f"{name} = {form}, {sampler.lobes} lobes, {sampler.nodes.shape[1]} nodes in theta_r"

    fibre = repr(material.fibre if material.among is None else material.among)
    if isinstance(material.fibre, Fibre):
        values = ", ".join(f"{k}={v}" for k, v in material.fibre.values().items())
        fibre = f"[{values}]"
    if material.own:
        return f"fibre = {fibre},\nsampling = {'near' if material.near else 'far'} field, its own density"
    lines = [f"fibre = {fibre}", text("sampling", material.single)]
    if material.combined is not None:
        lines.append(text("sampling among strands", material.combined))
    return ",\n".join(lines)
