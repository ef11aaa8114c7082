"""The frames of hosts: which axis is the strand, and what the two directions are called."""

from __future__ import annotations

from typing import NamedTuple

from cuticle._support import validate


class Frame(NamedTuple):
    """A local frame.

    `axes` names the components along the strand, along phi = 0 and along phi = 90°; `viewer` and `light` are the host's
    names for the given and the sampled direction, both away from the strand.
    """

    axes: str
    viewer: str
    light: str
    about: str


FRAMES = {
    "pbrt": Frame("xyz", "wo", "wi", "pbrt-v4's for BxDFs: the strand along x, wo toward the viewer, wi toward the light"),
    "mitsuba": Frame("yxz", "wi", "wo", "Mitsuba 3's for BSDFs: the strand along y, wi toward the viewer, wo the light"),
    "local-x": Frame("xyz", "w_r", "w_i", "the strand along x, w_r toward the viewer, w_i toward the light"),
    "local-y": Frame("yzx", "w_r", "w_i", "the strand along y, w_r toward the viewer, w_i toward the light"),
    "local-z": Frame("zxy", "w_r", "w_i", "the strand along z, w_r toward the viewer, w_i toward the light"),
}
DEFAULT_FRAME = "local-x"


def frame(name: str) -> Frame:
    """Return a frame by name."""
    return FRAMES[validate.choice("frame", name, FRAMES)]
