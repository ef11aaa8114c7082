"""Parameters of the BSDF `cuticle` that are textures, and the numbers that stand for them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from cuticle.mitsuba.strand_values import attribute_values
from cuticle.scattering.any_fibre import TEXTURED, Parameter

PIGMENTS = ("eumelanin", "pheomelanin")
COLOURS = ("sigma_a", "color")  # of three channels
_GRID = (np.arange(16) + 0.5) / 16  # where a texture is looked at, over uv
_PRIMARIES = (610.0, 550.0, 450.0, 450.0)  # nm: red, green, blue


def textures_of(props: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return those parameters of a plugin that are textures or, in spectral variants, spectra.

    Raises
    ------
    ValueError
        A parameter that must be a number is one.
    """
    kinds = (mi.Properties.Type.Object, mi.Properties.Type.Spectrum)
    found = {name: value for name, value in given.items() if props.type(name) in kinds}
    for name in found:
        if name not in TEXTURED:
            raise ValueError(f"{name} must not be a texture; these may: scale, {', '.join(TEXTURED)}")
    return found


def mean_of(name: str, texture: Any) -> Any:
    """Return the mean of a texture over a strand's files or over uv, as a scene would give it: a number or a colour."""
    if not isinstance(texture, mi.Texture):  # a spectrum, as the scene's file has it
        mean = np.interp(_PRIMARIES[:3], texture.wavelengths, texture.values) if texture.wavelengths else texture.values[:1]
        return _as_given(name, np.array(mean))
    values = attribute_values(texture)
    mean = _over_uv(texture) if values is None else values.mean(axis=(0, 1))
    if values is not None and len(mean) > 1 and name not in COLOURS:
        raise ValueError(f"{name} takes one value a strand or a point, this attribute has {len(mean)}")
    return _as_given(name, mean)


def _as_given(name: str, mean: NDArray[np.float64]) -> Any:
    if name == "color":
        mean = np.clip(mean, 1e-4, 1)
    if name in COLOURS:
        return mi.ScalarColor3d(*np.broadcast_to(mean, 3).tolist())
    return float(mean.mean())


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


def _over_uv(texture: Any) -> NDArray[np.float64]:
    points = [(0.5, 0.5)] if not texture.is_spatially_varying() else [(float(u), float(v)) for u in _GRID for v in _GRID]
    total = np.zeros(3)
    for u, v in points:
        si = mi.SurfaceInteraction3f()
        si.uv = mi.Point2f(u, v)
        if mi.is_spectral:
            si.wavelengths = type(si.wavelengths)(*_PRIMARIES)
        total += np.ravel(np.array(texture.eval(si)))[:3]
    return total / len(points)
