"""Mitsuba scenes of hair: a groom, its fibre, a camera that frames it, and a light."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.backends import check_backend
from cuticle.fitting.samplings import SAMPLINGS
from cuticle.grooms.bust import Bust
from cuticle.grooms.groom import Groom, checked_groom
from cuticle.scattering.any_fibre import ABSORPTION, TEXTURED

__all__ = ["INTEGRATORS", "LIGHTS", "Light", "View", "bsdf", "bust_shape", "integrator", "load_scene", "mitsuba"]

LIGHTS = ("env", "studio", "area", "point", "sun")
INTEGRATORS = ("path", "direct", "dual")
MAX_PIXELS = 8192
SMALLEST = 1e-3  # Mitsuba's frames on curves of radius 1e-7 and less are NaN


def mitsuba(variant: str = "scalar_rgb") -> Any:
    """Return the module `mitsuba`, set to a variant, with `cuticle` and `dual_scattering` registered.

    Raises
    ------
    ImportError, RuntimeError
        Mitsuba is missing or has another version, or the variant cannot run here. The message names the remedy.
    """
    import mitsuba as mi

    from cuticle import mitsuba as plugins

    if variant not in plugins.VARIANTS:
        raise ValueError(f"variant must be one of {', '.join(plugins.VARIANTS)}; got {variant!r}")
    check_backend(variant)
    mi.set_variant(variant)
    return mi


@dataclass(frozen=True)
class View:
    """The camera.

    Parameters
    ----------
    azimuth, elevation
        Degrees around +y from +z, and above the horizon.
    fov
        Field of view across the picture, degrees.
    width, height
        Pixels.
    zoom
        1 fits the whole groom into the picture; 2 shows half of it.
    """

    azimuth: float = 25.0
    elevation: float = 10.0
    fov: float = 30.0
    width: int = 512
    height: int = 512
    zoom: float = 1.0

    def __post_init__(self) -> None:
        validate.number("azimuth", self.azimuth, -360, 360, unit="degrees")
        validate.number("elevation", self.elevation, -89, 89, unit="degrees")
        validate.number("fov", self.fov, 1, 120, unit="degrees")
        validate.integer("width", self.width, 1, MAX_PIXELS)
        validate.integer("height", self.height, 1, MAX_PIXELS)
        validate.number("zoom", self.zoom, 0.1, 100)

    def axes(self) -> NDArray[np.float64]:
        """Return the camera's right, up and backward directions, rows of a matrix."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        back = np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)])
        right = np.array([math.cos(a), 0.0, -math.sin(a)])
        return np.stack([right, np.cross(back, right), back])

    def place(self, groom: Groom, margin: float = 1.06) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the camera's position and the point it looks at, such that every point of the groom is seen."""
        axes = self.axes()
        seen = groom.points[:: max(1, len(groom.points) // 200_000)].astype(np.float64) @ axes.T
        centre = (seen.min(axis=0) + seen.max(axis=0)) / 2
        relative = seen - centre
        tangents = math.tan(math.radians(self.fov) / 2) * np.array([1, self.height / self.width])
        distance = float((np.abs(relative[:, :2]) * margin / tangents + relative[:, 2:]).max())
        target = centre @ axes
        return target + axes[2] * distance / self.zoom, target


@dataclass(frozen=True)
class Light:
    """The light of a scene.

    Parameters
    ----------
    kind
        "env": equal light from everywhere. "studio": three softboxes in a dim room. "area": one square panel above and to
        the left of the camera. "point" and "sun" (parallel light): from the same place.
    strength
        Factor on the radiance.
    """

    kind: str = "env"
    strength: float = 1.0

    def __post_init__(self) -> None:
        validate.choice("light", self.kind, LIGHTS)
        validate.number("strength", self.strength, 0, 1e6, above=True)

    def plugin(self, mi: Any, groom: Groom, view: View) -> dict[str, Any]:
        """Return the emitter as Mitsuba's dictionary."""
        axes = view.axes()
        low, high = groom.bounds
        size = float(np.linalg.norm(high - low))
        target = (low + high).astype(np.float64) / 2
        toward = axes.T @ _unit([-0.55, 0.6, 0.6])
        position = target + 1.5 * size * toward
        look = mi.ScalarTransform4f().look_at(origin=position.tolist(), target=target.tolist(), up=axes[1].tolist())
        if self.kind == "env":
            return {"type": "constant", "radiance": {"type": "rgb", "value": [self.strength] * 3}}
        if self.kind == "studio":
            return {"type": "envmap", "bitmap": mi.Bitmap(_softboxes(axes) * np.float32(self.strength))}
        if self.kind == "area":
            panel = look @ mi.ScalarTransform4f().scale(0.45 * size)
            radiance = {"type": "rgb", "value": [12.0 * self.strength] * 3}
            return {"type": "rectangle", "to_world": panel, "emitter": {"type": "area", "radiance": radiance}}
        if self.kind == "point":
            power = 25.0 * self.strength * size**2
            return {"type": "point", "position": position.tolist(), "intensity": {"type": "rgb", "value": [power] * 3}}
        irradiance = {"type": "rgb", "value": [8.0 * self.strength] * 3}
        return {"type": "directional", "direction": (-toward).tolist(), "irradiance": irradiance}


def _unit(v: Any) -> NDArray[np.float64]:
    x = np.asarray(v, np.float64)
    return x / np.linalg.norm(x)


def _softboxes(axes: NDArray[np.float64]) -> NDArray[np.float32]:
    """An environment: key, fill and rim light as soft patches over a dim room; latitude-longitude, Mitsuba's axes."""
    height = 128
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(2 * height) + 0.5) / (2 * height), indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    direction = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1)
    image = np.broadcast_to(np.array([0.06, 0.066, 0.078]), direction.shape).copy()
    image += (0.08 * np.clip(direction @ axes[1], 0, 1))[..., None]
    # toward (right, up, back), half width in degrees, radiance
    for toward, width, colour in (
        ((-0.7, 0.6, 0.65), 16, (44.0, 41.0, 37.5)),
        ((0.95, 0.15, 0.5), 30, (1.8, 1.95, 2.25)),
        ((0.55, 0.6, -0.9), 16, (16.0, 16.2, 17.0)),
    ):
        angle = np.degrees(np.arccos(np.clip(direction @ (axes.T @ _unit(toward)), -1, 1)))
        image += (1 / (1 + np.exp((angle - width) / 1.5)))[..., None] * np.array(colour)
    return image.astype(np.float32)


def bust_shape(mi: Any, bust: Bust, grey: float = 0.06) -> Any:
    """Return the shape of a bust, matte grey of that reflectance."""
    vertices, normals, triangles = bust.mesh()
    properties = mi.Properties()
    skin = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [grey] * 3}}
    properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": skin})
    mesh = mi.Mesh("bust", len(vertices), len(triangles), has_vertex_normals=True, props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel().astype(np.float32)
    parameters["vertex_normals"] = normals.ravel().astype(np.float32)
    parameters["faces"] = triangles.ravel().astype(np.uint32)
    parameters.update()
    return mesh


def bsdf(fibre: str, sampling: str | None = None, **parameters: Any) -> dict[str, Any]:
    """Return the BSDF as Mitsuba's dictionary; `fibre` is a preset, a TOML file, a table or a sampler's JSON file.

    Without `sampling` directions are drawn from the function itself where it has a closed form, otherwise from lobes.
    """
    if sampling is not None:
        parameters["sampling"] = validate.choice("sampling", sampling, SAMPLINGS)
    key = "filename" if str(fibre).endswith(".json") else "fibre"
    return {"type": "cuticle", key: str(fibre), **parameters}


def integrator(kind: str, *, depth: int = 32, hide: bool = True, **parameters: Any) -> dict[str, Any]:
    """Return the integrator as Mitsuba's dictionary.

    "path": Mitsuba's path tracer to `depth` segments; "direct": its direct light; "dual": `dual_scattering`.
    """
    validate.choice("integrator", kind, INTEGRATORS)
    if kind == "path":
        depth = validate.integer("depth", depth, 1, 100_000)
        parameters = {"max_depth": depth, "rr_depth": depth, **parameters}
    name = {"path": "path", "direct": "direct", "dual": "dual_scattering"}[kind]
    return {"type": name, "hide_emitters": hide, **parameters}


def load_scene(
    mi: Any,
    groom: Groom,
    material: dict[str, Any],
    *,
    view: View | None = None,
    light: Light | None = None,
    technique: dict[str, Any] | None = None,
    others: dict[str, Any] | None = None,
    framed: Groom | None = None,
) -> Any:
    """Return Mitsuba's scene of a groom.

    Parameters
    ----------
    mi
        Mitsuba, as `mitsuba()` returns it.
    groom
        The hair.
    material
        Its BSDF, a dictionary or an object. A dictionary of `cuticle` takes from the groom's attributes what it leaves open.
    view, light
        The camera and the light. Default: three quarters from the front, and light from everywhere.
    technique
        The integrator, a dictionary. Default: the path tracer.
    others
        Further shapes by name, dictionaries or objects.
    framed
        What the camera and the light are placed for. Default: the groom.

    Raises
    ------
    ValueError
        The groom is less than 1e-3 across.
    """
    view, light = view or View(), light or Light()
    low, high = checked_groom("groom", groom).bounds
    if not (size := float((high - low).max())) >= SMALLEST:
        raise ValueError(f"the groom must be at least {SMALLEST:g} across to be rendered, got {size:.3g}; scale it up")
    framed = groom if framed is None else framed
    origin, target = view.place(framed)
    distance = float(np.linalg.norm(origin - target))  # Mitsuba's camera sees from .01 to 10,000, in whatever unit
    camera = mi.ScalarTransform4f().look_at(origin=origin.tolist(), target=target.tolist(), up=view.axes()[1].tolist())
    with tempfile.TemporaryDirectory() as folder:
        material = _with_attributes(groom, material)
        curves = Path(folder) / "groom.txt"
        groom.save(curves)
        return mi.load_dict(
            {
                "type": "scene",
                "integrator": technique or integrator("path"),
                "sensor": {
                    "type": "perspective",
                    "fov": view.fov,
                    "fov_axis": "x",
                    "near_clip": 1e-4 * distance,
                    "far_clip": 1e4 * distance,
                    "to_world": camera,
                    "film": {
                        "type": "hdrfilm",
                        "width": view.width,
                        "height": view.height,
                        "pixel_format": "rgba",
                        "rfilter": {"type": "box"},
                    },
                    "sampler": {"type": "independent"},
                },
                "hair": {"type": "bsplinecurve", "filename": str(curves), "bsdf": material},
                "light": light.plugin(mi, framed, view),
                **(others or {}),
            }
        )


def varies(groom: Groom) -> set[str]:
    """Return which parameters of the BSDF `cuticle` a groom's attributes have values for."""
    return set(TEXTURED) & groom.attributes.keys()


def _with_attributes(groom: Groom, material: Any) -> Any:
    if not isinstance(material, dict) or material.get("type") != "cuticle":
        return material
    from cuticle.mitsuba import strand_texture

    names = varies(groom) - material.keys()
    if material.keys() & set(ABSORPTION):
        names -= set(ABSORPTION)
    return {**material, **{name: strand_texture(groom, name) for name in sorted(names)}}
