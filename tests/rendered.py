"""Pictures that tests look at as a number."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
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


def floor(mi: Any, hair: dict[str, Any], how: dict[str, Any], light: dict[str, Any], spp: int = 128) -> np.ndarray:
    """What comes to a dark floor, which the camera sees from below the hair."""
    above = mi.ScalarTransform4f().look_at(origin=[0, 0, 0.4], target=[0, 0, 0], up=[0, 1, 0])
    scene = {
        "type": "scene",
        "integrator": how,
        "floor": {
            "type": "rectangle", "to_world": mi.ScalarTransform4f().scale(20),
            "bsdf": {"type": "diffuse", "reflectance": 0.1},
        },
        "light": light,
        "sensor": {
            "type": "perspective", "fov": 30, "to_world": above,
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "pixel_format": "rgb"},
        },
    }  # fmt: skip
    return np.array(mi.render(mi.load_dict(scene | hair), spp=spp)).mean(axis=(0, 1))


def mat(path: Path, seed: int = 0) -> dict[str, Any]:
    """Parallel strands at random over a floor, two that a ray across them meets on average."""
    rng = np.random.default_rng(seed)
    x = np.array([-6.0, -5.0, 5.0, 6.0])
    points = [np.stack([x, np.full(4, rng.uniform(-5, 5)), np.full(4, rng.uniform(0.5, 0.9))], 1) for _ in range(1000)]
    Groom(np.concatenate(points).astype(np.float32), 4 * np.arange(1001), np.array(0.01, np.float32)).save(path)
    return {"type": "bsplinecurve", "filename": str(path)}
