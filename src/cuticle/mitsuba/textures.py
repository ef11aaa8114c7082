"""Parameters of the BSDF `cuticle` that are textures, and the numbers that stand for them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from cuticle.mitsuba.strand_values import attribute_values
from cuticle.scattering.any_fibre import FORMS, TEXTURED, Parameter

PIGMENTS = ("eumelanin", "pheomelanin")
COLOURS = {"sigma_a": (0, 1000), "color": (1e-4, 1)}  # of three channels, and what the plugin holds them to
_RANGES = {name: p for form in FORMS.values() for name, p in form.items()} | dict.fromkeys(PIGMENTS, Parameter(0, 100, 0.0))
_GRID = (np.arange(16) + 0.5) / 16  # where a texture is looked at, over uv
_PRIMARIES = (610.0, 550.0, 450.0, 450.0)  # nm: red, green, blue


def textures_of(props: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return those parameters of a plugin that are textures or, in spectral variants, spectra.

    Raises
    ------
    ValueError
        A parameter that must be a number is one, or a texture reads a mesh.
    """
    found = {name: value for name, value in given.items() if props.type(name) == mi.Properties.Type.Object}
    spectra = [name for name in given if props.type(name) == mi.Properties.Type.Spectrum]
    found |= {name: props.get_unbounded_texture(name) for name in spectra}
    for name, texture in found.items():
        if name not in TEXTURED:
            raise ValueError(f"{name} must not be a texture; these may: scale, {', '.join(TEXTURED)}")
        if not isinstance(texture, mi.Texture):
            raise ValueError(f"{name} must be a number or a texture, got {texture.class_name()}")
        refuse_mesh(name, texture)
        if name == "sigma_a":
            refuse_reflectances(name, texture)
    return found


def refuse_mesh(name: str, texture: Any) -> None:
    """Raise ValueError for what reads a mesh, in another texture, too: without its shape Mitsuba crashes."""
    if "MeshAttribute" in str(texture):
        raise ValueError(f"{name} must not be a mesh_attribute, which no curve has; use cuticle_strands")


def refuse_reflectances(name: str, texture: Any) -> None:
    """Raise ValueError for a bitmap of colours in a spectral variant, which Mitsuba takes for reflectances, at most 1."""
    if not mi.is_spectral or "Bitmap" not in type(texture).__name__ + str(texture):
        return
    data = next((x for key, x in mi.traverse(texture) if key.rpartition(".")[2] == "data"), None)
    if data is not None and np.shape(data)[-1] == 3:
        raise ValueError(
            f"{name} must not be a bitmap of colours in a spectral variant: Mitsuba makes reflectances of them, at most 1;"
            " use an RGB variant, or a bitmap of one channel"
        )


def mean_of(name: str, texture: Any) -> Any:
    """Return the mean of a texture over a strand's files or over uv, as a scene would give it: a number or a colour."""
    found = attribute_values(texture)
    if found is not None and found.shape[-1] > 1 and name not in COLOURS:
        raise ValueError(f"{name} takes one value a strand or a point, this attribute has {found.shape[-1]}")
    values = (_over_uv(texture, name in COLOURS) if found is None else found).astype(np.float64)
    if name not in COLOURS:
        one = values[..., 0]
        if texture.is_spatially_varying():  # held to the range, as it is at each point; a constant is refused outside
            one = np.clip(np.nan_to_num(one, nan=_RANGES[name].low), _RANGES[name].low, _RANGES[name].high)
        return float(one.mean())
    mean = np.clip(values, *COLOURS[name]).reshape(-1, values.shape[-1]).mean(axis=0)
    return mi.ScalarColor3d(*np.broadcast_to(mean, 3).tolist())


def warn_outside(name: str, texture: Any, allowed: Parameter) -> None:
    """Warn of a groom's values that will be held to a parameter's range; of other textures none can be told."""
    if (values := attribute_values(texture)) is None:
        return
    outside = int(((values < allowed.low) | (values > allowed.high)).any(axis=(1, 2)).sum())
    if outside:
        warnings.warn(
            f"{name}: on {outside:,} of {len(values):,} segments it lies outside [{allowed.low:g}, {allowed.high:g}] and is"
            " held to that range",
            stacklevel=2,
        )


def _over_uv(texture: Any, colour: bool) -> NDArray[np.floating[Any]]:
    """What the plugin asks of a texture, (points, channels)."""
    points = [(0.5, 0.5)] if not texture.is_spatially_varying() else [(float(u), float(v)) for u in _GRID for v in _GRID]
    values = []
    for u, v in points:
        si = mi.SurfaceInteraction3f()
        si.uv = mi.Point2f(u, v)
        if mi.is_spectral:
            si.wavelengths = type(si.wavelengths)(*_PRIMARIES)
        values.append(np.ravel(np.array(texture.eval(si) if colour else texture.eval_1(si)))[:3])
    return np.array(values)
