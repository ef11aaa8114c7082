"""Pictures that tests look at as a number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cuticle.grooms.groom import Groom
from cuticle.render.picture import render
from cuticle.render.scene import View, load_scene

UseVariant = Callable[[str], Any]
SMALL = View(width=48, height=48)


def mean(mi: Any, groom: Groom, material: Any, how: dict[str, Any], spp: int = 64, **scene: Any) -> np.ndarray:
    """Mean colour of the covered part, so that a thin groom's does not depend on the empty part's size."""
    image = render(load_scene(mi, groom, material, view=scene.pop("view", SMALL), technique=how, **scene), spp).image
    assert np.isfinite(image).all()
    return image[..., :3].sum(axis=(0, 1)) / image[..., 3].sum()
