"""Rendering in passes, with progress, and writing pictures."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.files import write_bytes
from cuticle._support.progress import Progress

__all__ = ["FORMATS", "Pass", "expected_seconds", "over_backdrop", "passes", "rel_mse", "render", "save_picture", "srgb"]

FORMATS = (".exr", ".png")
MAX_SPP = 1 << 20
MAX_SEED = 10_000
MAX_EXPOSURE = 32  # stops, either way: all of single precision's is white or black then
_PASS_SECONDS = 0.5
_PASS_PATHS = 1 << 25

Image = NDArray[np.float64]


class Pass(NamedTuple):
    """An intermediate picture: the mean of `spp` samples per pixel, after `seconds` of rendering."""

    image: Image  # (height, width, 4): linear RGB, premultiplied, and coverage
    spp: int
    seconds: float


def passes(scene: Any, spp: int, *, seed: int = 0, step: int | None = None) -> Iterator[Pass]:
    """Render `spp` samples per pixel in passes, and yield the mean after each. Times are those of rendering only.

    Parameters
    ----------
    scene
        Mitsuba's scene.
    spp
        Samples per pixel in total.
    seed
        Seed of the random numbers, 0 to 10,000; each pass derives its own.
    step
        Samples per pixel of a pass. Default: doubled while a pass takes less than half a second and has less than 2^25
        paths, which traced variants hold in memory at once.
    """
    import mitsuba as mi

    spp = validate.integer("spp", spp, 1, MAX_SPP)
    seed = validate.integer("seed", seed, 0, MAX_SEED)
    total: Any = 0.0
    done, seconds, number, size = 0, 0.0, 0, step or 1
    while done < spp:
        size = min(size, spp - done)
        begin = time.perf_counter()
        image = np.array(mi.render(scene, spp=size, seed=(seed << 16) + number), np.float64)
        took = time.perf_counter() - begin
        total = total + image * size
        done, seconds, number = done + size, seconds + took, number + 1
        yield Pass(total / done, done, seconds)
        if step is None and took < _PASS_SECONDS and 2 * size * image.shape[0] * image.shape[1] <= _PASS_PATHS:
            size *= 2


_PROBES = (32, 64, 128)  # pixels across; Mitsuba gives each thread 32 x 32


def expected_seconds(scene: Any, spp: int) -> float | None:
    """Return about how long `render` takes, from small pictures of the same view; None in variants that compile for each.

    The first of them does what only a first one does. The time of the others is a constant and a part that grows with
    pixels.
    """
    import mitsuba as mi

    if not mi.variant().startswith("scalar"):
        return None
    parameters = mi.traverse(scene.sensors()[0])
    names = ("film.size", "film.crop_size")
    before = {name: mi.ScalarVector2u(parameters[name]) for name in names}
    width, height = (int(n) for n in before["film.size"])
    took = []
    try:
        for across in _PROBES:
            size = mi.ScalarVector2u(min(across, width), max(1, round(min(across, width) * height / width)))
            parameters.update(dict.fromkeys(names, size))
            begin = time.perf_counter()
            mi.render(scene, spp=1)
            took.append((int(size[0]) * int(size[1]), time.perf_counter() - begin))
    finally:
        parameters.update(before)
    (few, short), (many, long) = took[1:]
    if many == width * height or long <= short:  # the picture itself is small
        return spp * width * height * long / many
    return spp * width * height * (long - short) / (many - few)


def render(scene: Any, spp: int, *, seed: int = 0, progress: Progress | None = None) -> Pass:
    """Render a scene and report the progress; arguments as in `passes`."""
    last: Pass | None = None
    for last in passes(scene, spp, seed=seed):
        if progress is not None:
            progress(f"rendering, {last.spp} of {spp} samples", last.spp / spp)
    assert last is not None
    return last


def rel_mse(image: Image, reference: Image) -> float:
    """Return the relative mean square error of the colours: the mean of (I - R)²/(R² + 0.01) over pixels and channels."""
    i, r = image[..., :3], reference[..., :3]
    return float(np.mean((i - r) ** 2 / (r**2 + 0.01)))


def over_backdrop(image: Image) -> Image:
    """Return the picture over a plain grey that darkens downward, shape (height, width, 3), linear."""
    ramp = np.linspace(0.14, 0.045, image.shape[0])[:, None, None] * np.array([0.92, 1.0, 1.12])
    return image[..., :3] + (1 - np.clip(image[..., 3:], 0, 1)) * ramp


def srgb(linear: Image) -> NDArray[np.uint8]:
    """Return linear colours as 8 bits of sRGB."""
    x = np.clip(linear, 0, 1)
    return np.round(255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)).astype(np.uint8)


def save_picture(path: str | os.PathLike[str], image: Image, *, exposure: float = 0.0) -> Path:
    """Write a picture, whole or not at all: .exr as it is (linear, with coverage), .png over a grey backdrop.

    Parameters
    ----------
    path
        The file; its ending tells the format.
    image
        Shape (height, width, 4), as `render` gives it.
    exposure
        Stops by which a PNG is brightened.
    """
    target = picture_path(path)
    exposure = validate.number("exposure", exposure, -MAX_EXPOSURE, MAX_EXPOSURE, unit="stops")
    import mitsuba as mi

    if target.suffix.lower() == ".exr":
        bitmap = mi.Bitmap(np.ascontiguousarray(image, np.float32))
    else:
        bitmap = mi.Bitmap(srgb(over_backdrop(image * np.array([2**exposure] * 3 + [1.0]))))
    with tempfile.TemporaryDirectory() as folder:
        inner = Path(folder) / f"picture{target.suffix.lower()}"
        bitmap.write(str(inner))
        return write_bytes(target, inner.read_bytes())


def picture_path(path: str | os.PathLike[str]) -> Path:
    """Return the path, or raise ValueError where its ending is none that can be written."""
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise ValueError(f"a picture's name must end in {' or '.join(FORMATS)}, got {target.name!r}")
    return target
