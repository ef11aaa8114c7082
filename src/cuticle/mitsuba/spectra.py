"""Absorptions and tables as Mitsuba takes them."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

# Where a spectrum of three values turns from blue to green and from green to red, nm.
PRIMARY_EDGES = (453.5, 512.9, 587.6, 598.4)
_WAVELENGTHS = (360.0, *PRIMARY_EDGES, 830.0)


def spectrum(values: tuple[float, ...]) -> Any:
    """One value, or one for each primary, as Mitsuba takes it: a number, a colour or, in spectral variants, a spectrum.

    Mitsuba would make a smooth spectrum of a colour, which leaves dark hair with too much blue: what is seen is
    exp(-sigma_a), not sigma_a. One value a primary, between PRIMARY_EDGES, gives the colour back
    (benchmarks/spectrum.py).
    """
    if len(values) == 1:
        return values[0]
    if mi.is_rgb:
        return mi.ScalarColor3d(*values)
    red, green, blue = np.maximum(values, 1e-20)  # Mitsuba takes no spectrum of 0
    steps = (blue, blue, green, green, red, red)
    # Not mi.load_dict: this runs while a scene loads, in one thread of several, and load_dict puts a file resolver of its
    # own in the place of the one that the others are reading, then frees it.
    props = mi.Properties("irregular")
    props["wavelengths"], props["values"] = ", ".join(map(str, _WAVELENGTHS)), ", ".join(map(str, steps))
    return mi.PluginManager.instance().create_object(props)


def tensor(values: NDArray[np.floating[Any]]) -> Any:
    """Return an array as Mitsuba takes it, in single precision."""
    return mi.TensorXf(np.ascontiguousarray(values, np.float32))
