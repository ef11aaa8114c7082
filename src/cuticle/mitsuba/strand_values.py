"""The texture `cuticle_strands`: an attribute of a groom, strand by strand and along a strand."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from cuticle.grooms.groom import Groom, checked_groom, read_groom
from cuticle.mitsuba.spectra import tensor

_PARAMETERS = ("filename", "attribute")


def strand_texture(groom: Groom, attribute: str) -> Any:
    """Return Mitsuba's texture of a groom's attribute, for the `bsplinecurve` of the file that `groom.save` writes.

    A value a strand is constant along it; values at points run linearly from one to the next. Of one channel, or of three,
    linear RGB, in variants that are not spectral.

    Parameters
    ----------
    groom
        The hair.
    attribute
        A name in `groom.attributes`.

    Raises
    ------
    ValueError
        The groom has no such attribute, or it has neither one channel nor three.
    """
    values = checked_groom("groom", groom).on_segments(attribute)
    if values.shape[-1] not in (1, 3):
        raise ValueError(f"a texture has 1 or 3 channels, the attribute {attribute!r} has {values.shape[-1]}")
    props = mi.Properties("cuticle_values")
    props["values"] = tensor(values)
    return mi.PluginManager.instance().create_object(props)


def make_texture(props: Any) -> Any:
    """Return the texture of a scene's parameters: `filename`, a groom as `read_groom` reads it, and `attribute`."""
    given = {name: props[name] for name in props.keys()}  # noqa: SIM118 - Mitsuba's, not a dict
    for name in given:
        if name not in _PARAMETERS:
            raise ValueError(f"cuticle_strands has no parameter {name!r}; it has {' and '.join(_PARAMETERS)}")
    if len(given) < len(_PARAMETERS):
        raise ValueError(f"cuticle_strands needs {' and '.join(_PARAMETERS)}: a groom's file, and a name in it")
    path = Path(str(mi.file_resolver().resolve(str(given["filename"]))))
    return strand_texture(_groom(str(path), path.stat().st_mtime_ns if path.is_file() else 0), str(given["attribute"]))


@lru_cache(maxsize=2)  # an attribute after the other
def _groom(path: str, _: int) -> Groom:
    return read_groom(path)


def attribute_values(texture: Any) -> NDArray[np.float32] | None:
    """Return what a texture of this kind holds, (segments, 2, channels); of any other None."""
    if not isinstance(texture, mi.Texture) or texture.class_name() != "CuticleValues":
        return None
    return np.array(mi.traverse(texture)["values"])
