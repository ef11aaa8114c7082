"""Builds Mitsuba's BSDFs in closed form: what the plugins cuticle_far and cuticle_near read."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from cuticle.mitsuba.material import Material
from cuticle.mitsuba.parameters import changeable
from cuticle.mitsuba.spectra import spectrum, tensor
from cuticle.mitsuba.textures import COLOURS, PIGMENTS, mean_of, warn_outside
from cuticle.scattering import conventions
from cuticle.scattering.any_fibre import DEGREES, FORMS, OF_R, Parameter
from cuticle.scattering.bcsdf import luminance_weights
from cuticle.scattering.chiang import RANGES, Chiang
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.longitudinal_mixtures import in_rows, longitudinal_mixtures
from cuticle.scattering.mean_strands import mean_strands
from cuticle.scattering.strand_transport import Directions
from cuticle.scattering.through_strands import (
    ALONG_ROWS,
    AZIMUTH_ROWS,
    COUNTED_2,
    own_energies,
    passed_through,
    through_tables,
)

Array = NDArray[np.float64]
_LEAST = 1e-8  # mean absorption of the strands around, where they absorb in any channel: less than a color of .999 has


def closed_form(material: Material, textures: Mapping[str, Any], scale: Any, tables: Any) -> Any:
    """Return the properties of the plugin for a material in closed form.

    `textures` are those of its parameters that are textures; numbers of the material stand for them. `tables`, a texture of
    the absorption or True, asks for what the strand among others needs.
    """
    fibre = material.fibre
    assert isinstance(fibre, (Fibre, Chiang))
    form = "marschner" if isinstance(fibre, Fibre) else "chiang"
    props = mi.Properties("cuticle_near" if material.near else "cuticle_far")
    shape = FORMS[form]
    if material.near:  # whose closed forms hold beyond the far field's cells
        shape = {name: Parameter(*RANGES[name][:2], None, p.unit) for name, p in shape.items()}
    values, set_by_user = changeable(fibre), fibre.values()
    _absorption(props, fibre, textures)
    slots = dict(shape)
    if props["absorption_from"] == "pigments" or _of_pigments(fibre):
        slots |= dict.fromkeys(PIGMENTS, Parameter(0, 100, 0.0))
        values |= {name: getattr(fibre, name) or 0.0 for name in PIGMENTS}
    if not material.near:
        slots |= dict.fromkeys(("d_f", "d_b"), Parameter(0, 1, 1.0))
        values |= dict(zip(("d_f", "d_b"), material.densities, strict=True))
        props["logistic"], props["direct_share"] = form == "chiang", material.direct_share
    props["parameters"], props["shape_parameters"] = " ".join(slots), len(shape)
    for name, p in slots.items():
        unit = np.pi / 180 if p.unit == DEGREES else 1.0
        props[f"range_{name}"] = mi.ScalarVector3d(p.low, p.high, unit)
        props[f"number_{name}"] = float(values[name])
        if name in textures:
            warn_outside(name, textures[name], p)
            props[f"texture_{name}"] = textures[name]
        elif name in OF_R and name not in set_by_user:
            props[f"follows_{name}"] = OF_R[name]
    if scale is not None:
        props["scale"] = scale
    if tables is not None:
        _tables(props, fibre, scale, tables)
    return props


def _of_pigments(fibre: Fibre | Chiang) -> bool:
    return fibre.sigma_a is None and getattr(fibre, "color", None) is None


def _absorption(props: Any, fibre: Fibre | Chiang, textures: Mapping[str, Any]) -> None:
    pigments, color = _of_pigments(fibre), getattr(fibre, "color", None)
    props["absorption_from"] = (
        "pigments" if textures.keys() & set(PIGMENTS) else "color" if textures.keys() & {"color", "beta_n"} and color
        else "sigma_a"
    )  # fmt: skip
    if pigments:
        for name, each in zip(PIGMENTS, np.eye(2).tolist(), strict=True):
            props[f"{name}_absorption"] = spectrum(tuple(conventions.sigma_a_of_pigment(*each).tolist()))
    if color is not None:
        props["color"] = textures.get("color", spectrum(color))
    props["sigma_a"] = textures.get("sigma_a", spectrum(fibre.absorption))
    props["absorption"] = "" if textures.keys() & set(COLOURS) else str(fibre.absorption)


def _mean_absorption(fibre: Fibre | Chiang, scale: Any, tables: Any) -> Array:
    """Return the mean of the absorption as it is now, of the three primaries."""
    sigma_a = np.broadcast_to(fibre.absorption if tables is True else list(mean_of("sigma_a", tables)), 3)
    if scale is not None:
        sigma_a = sigma_a * (scale if isinstance(scale, (int, float)) else list(mean_of("sigma_a", scale)))
    if sigma_a.max() > 0:  # a channel without absorption alone would leave scattering among strands without a sum
        sigma_a = np.maximum(sigma_a, _LEAST)
    return np.clip(sigma_a, 0, 1000)


def _mean_fibre(fibre: Fibre | Chiang, sigma_a: Array) -> Fibre | Chiang:
    """Return the fibre that other strands are taken for: the material's, with a channel for each absorption."""
    if sigma_a.max() - sigma_a.min() < 1e-6:
        sigma_a = sigma_a[:1]
    elif mi.is_spectral:  # a wavelength falls between two of them
        sigma_a = np.sort(sigma_a) * [1, 1 + 1e-4, 1 + 2e-4] + [0, 1e-6, 2e-6]
    absorption = tuple(sigma_a.tolist())
    return fibre.with_absorption(absorption) if isinstance(fibre, Chiang) else fibre.replace(sigma_a=absorption)


def _tables(props: Any, fibre: Fibre | Chiang, scale: Any, tables: Any) -> None:
    sigma_a = _mean_absorption(fibre, scale, tables)
    mean = _mean_fibre(fibre, sigma_a)
    if min(mean.absorption) <= 0:  # light that is never absorbed leaves multiple scattering without a sum
        return
    around = mean_strands(mean)
    passed, limit = passed_through(mean)
    draw = draw_tables(mean, props["number_d_b"])
    for name, table in (
        ("through_energy", around.energy), ("through_along", around.along), ("through_azimuth", around.azimuth),
        ("through_behind", around.behind),
        ("draw_lobes", draw.lobes), ("draw_azimuth", draw.azimuth), ("transmittance", passed),
    ):  # fmt: skip
        props[name] = tensor(table)
    props["through_limit"], props["transmittance_limit"] = around.limit, limit
    props["mean_tilt"], props["mean_variance"] = mi.ScalarVector3d(*around.tilt), mi.ScalarVector3d(*around.variance)
    props["mean_sigma_a"] = mi.ScalarVector3d(*np.broadcast_to(mean.absorption, 3).tolist())
    props["mean_absorption"] = spectrum(tuple(sigma_a.tolist()))


class DrawTables(NamedTuple):
    """What the core's ThroughDraw views (through_draw.h).

    - `lobes`, (along rows, parts, 9): energy by luminance, of the strand's own parts out of their own; three M's, as in
      `ThroughTables.along`.
    - `azimuth`, (azimuth rows, parts, columns, 2): density of phi from 0 to pi, and its integral.
    """

    lobes: Array
    azimuth: Array


@lru_cache(maxsize=16)
def draw_tables(fibre: Fibre | Chiang, d_b: float) -> DrawTables:
    """Return the tables by which directions are drawn among strands: of light through 2 of them, in all colours."""
    through, own = through_tables(fibre), own_energies(fibre)
    weights = luminance_weights(fibre.channels)
    energy = np.exp(through.energy[0, COUNTED_2, ::ALONG_ROWS, 0]) * weights  # (along rows, parts, channels)
    energy[:, -1] *= d_b
    total = energy.sum(axis=2)
    # Without d_b nothing comes back: any density will do.
    share = np.where(total[..., None] > 0, energy / np.maximum(total, 1e-100)[..., None], weights)
    apart = np.append(own[::ALONG_ROWS] @ weights, np.ones((len(total), 1)), axis=1)
    lobes = np.concatenate([(total / apart)[..., None], _over_colours(share, through.along[0, COUNTED_2])], axis=2)

    density = (through.azimuth[0, COUNTED_2] * share[:: AZIMUTH_ROWS // ALONG_ROWS][:, None]).sum(axis=3).transpose(0, 2, 1)
    step = np.pi / (density.shape[2] - 1)
    integral = np.append(
        np.zeros((*density.shape[:2], 1)), np.cumsum(0.5 * step * (density[..., 1:] + density[..., :-1]), axis=2), axis=2
    )
    whole = 2 * integral[..., -1:]
    return DrawTables(lobes, np.stack([density / whole, integral / whole], axis=3))


def _over_colours(share: Array, along: Array) -> Array:
    """M's for all channels, (rows, parts, 8), from those of each: shares of light, and (rows, 8, parts, channels)."""
    of_each = np.moveaxis(along, 1, -1)
    if of_each.shape[2] == 1:
        return of_each[:, :, 0]
    theta = Directions().theta
    energy = (share[..., None] * in_rows(theta, of_each)).sum(axis=2)
    return longitudinal_mixtures(theta, theta[::ALONG_ROWS], energy[:, None, None], [0], [])[:, 0, 0]
