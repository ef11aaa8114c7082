"""Instances of hair in `dual_scattering`: as the hair that they repeat, or refused."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cuticle.grooms.groom import Groom
from cuticle.grooms.procedural import hair_ball
from cuticle.render.scene import integrator
from rendered import UseVariant

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'", allow_module_level=True)


def test_instances_are_the_hair_that_they_repeat(tmp_path: Path, use_variant: UseVariant) -> None:
    mi = use_variant("scalar_rgb")
    ball = hair_ball(1500)
    moves = [
        (mi.ScalarTransform4f().translate([0.6, 0, 0]).rotate([0.6, 0.8, 0], 50), 0.5),
        (mi.ScalarTransform4f().translate([-0.6, 0.2, 0]), 0.7),
    ]
    fibre = {"type": "cuticle", "fibre": "blond"}
    ball.save(tmp_path / "ball.txt")
    curves = {"type": "bsplinecurve", "filename": str(tmp_path / "ball.txt"), "bsdf": fibre}
    group = {"type": "shapegroup", "curves": curves}
    other = {"type": "shapegroup", "a": {"type": "sphere", "radius": 0.1}}
    instances: dict[str, Any] = {"group": group, "other": other}
    copies: dict[str, Any] = {}
    for k, (move, scale) in enumerate(moves):
        instances[f"i{k}"] = {
            "type": "instance", "group": {"type": "ref", "id": "group"}, "to_world": move.scale(scale)
        }  # fmt: skip
        # Mitsuba moves a curve's points, and leaves its radii as they are.
        name = str(tmp_path / f"ball_{k}.txt")
        Groom(ball.points * scale, ball.offsets, ball.radius * scale).save(name)
        copies[f"c{k}"] = {**curves, "filename": name, "to_world": move}
    # An instance of something else casts a shadow, as the thing itself does.
    up = mi.ScalarTransform4f().translate([0, 1.2, 0])
    instances["o"] = {"type": "instance", "group": {"type": "ref", "id": "other"}, "to_world": up}
    copies["o"] = {"type": "sphere", "radius": 0.1, "to_world": up}
    for counter in ("grid", "trace"):
        how = integrator("dual", counter=counter, correction_paths=0)
        scene = {
            "type": "scene", "integrator": how, "light": {"type": "directional", "direction": [0, -1, 0.2]},
            "sensor": {
                "type": "perspective", "fov": 40,
                "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 4], target=[0, 0, 0], up=[0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 32, "height": 32, "pixel_format": "rgb"},
            },
        }  # fmt: skip
        seen = [np.array(mi.render(mi.load_dict(scene | hair), spp=128)) for hair in (instances, copies)]
        assert np.abs(seen[0].mean(axis=(0, 1)) / seen[1].mean(axis=(0, 1)) - 1).max() <= 0.02
    # Of what is no hair any group will do.
    red = {"type": "shapegroup", "a": {"type": "sphere", "radius": 0.1, "bsdf": {"type": "diffuse"}}}
    spheres = instances | {"red": red, "r": {"type": "instance", "group": {"type": "ref", "id": "red"}, "to_world": up}}
    assert np.isfinite(np.array(mi.render(mi.load_dict(scene | spheres), spp=1))).all()
    twin = {"type": "shapegroup", "curves": curves | {"bsdf": fibre | {"fibre": "black"}}}
    pair = instances | {"twin": twin, "t": {"type": "instance", "group": {"type": "ref", "id": "twin"}}}
    with pytest.raises(RuntimeError, match="instances cannot be told apart"):
        mi.render(mi.load_dict(scene | pair), spp=1)
    mixed = instances | {"group": group | {"b": {"type": "sphere", "radius": 0.1}}}
    with pytest.raises(RuntimeError, match="a shapegroup must hold hair or other shapes, not both"):
        mi.render(mi.load_dict(scene | mixed), spp=1)
