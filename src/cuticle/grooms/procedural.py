"""Grooms without a file: a ball, a lock, a head of hair."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle.grooms.bust import Bust
from cuticle.grooms.groom import Groom, join_grooms
from cuticle.grooms.interpolation import cut

__all__ = ["hair_ball", "hair_head", "head_bust", "wavy_lock"]

Array = NDArray[np.float64]
_SKULL = np.array([0.78, 1.0, 0.92])  # half its width, height and depth; while it is made the face looks along +z
_PART = 0.2  # where hair parts, to the right of the middle
_CROWN = -0.25  # as far back as that
_GUIDES, _LOCKS = 2500, 160
_AROUND = 1.0  # what a strand over the head takes more than straight down, at most
_DRAWN = 0.45  # how far tips of a lock are drawn together
_FRIZZ, _FLYAWAYS = 0.01, 0.015  # a strand's offset at its tip, in lengths; the share of strands that stray further


def hair_ball(
    strands: int = 10_000, *, points: int = 8, radius: float = 1.0, length: float = 1.0, curl: float = 0.25, seed: int = 1
) -> Groom:
    """Return a ball of hair: roots on a sphere, strands outward, bent by a smooth field. Needs no file.

    Parameters
    ----------
    strands
        1 to 10 million.
    points
        Of a strand, 2 to 256.
    radius
        Of the ball the roots sit on.
    length
        Of a strand.
    curl
        How far the field bends a strand: 0 leaves it straight.
    seed
        Of where the roots are.
    """
    strands, points = _sizes(strands, points, 2, 256, radius=radius, length=length)
    curl = validate.number("curl", curl, 0, 100)
    rng = validate.random_numbers(seed)
    normal = _unit(rng.standard_normal((strands, 3)))
    position = radius * normal
    direction = normal * (1 + 0.05 * rng.standard_normal((strands, 1)))
    step = length / (points - 1)
    rows = [position]
    for k in range(1, points):
        at = position / radius
        field = np.stack([np.sin(3 * at[:, 1] + 1), np.sin(3 * at[:, 2] + 2), np.sin(3 * at[:, 0] - 1)], axis=1)
        direction = _unit(direction + curl * (k / points) * field)
        position = position + step * direction
        rows.append(position)
    all_points = np.stack(rows, axis=1).reshape(-1, 3).astype(np.float32)
    return Groom(all_points, np.arange(strands + 1) * points, np.zeros(1, np.float32)).with_thickness(
        0.0015 * radius, 0.0005 * radius
    )


def wavy_lock(
    strands: int = 1000, *, points: int = 32, length: float = 1.0, width: float = 0.15, waves: float = 4.0, seed: int = 1
) -> Groom:
    """Return a lock that hangs along -y in waves: strands around one curve, wider in the middle. Needs no file.

    Parameters
    ----------
    strands
        1 to 10 million.
    points
        Of a strand, 2 to 1024.
    length
        Of the lock.
    width
        Radius of the lock where it is widest.
    waves
        Number of waves along it.
    seed
        Of where the strands are.
    """
    strands, points = _sizes(strands, points, 2, 1024, length=length, width=width)
    waves = validate.number("waves", waves, 0, 1000)
    rng = validate.random_numbers(seed)
    s = np.linspace(0, 1, points)
    angle, distance = 2 * np.pi * rng.random(strands), np.sqrt(rng.random(strands))
    phase = 0.3 * rng.standard_normal(strands)
    bulge = width * (0.35 + 0.65 * np.sin(np.pi * np.minimum(s * 1.15, 1)) ** 0.8)
    turn = 2 * np.pi * waves * s[None, :] + phase[:, None]
    x = distance[:, None] * np.cos(angle)[:, None] * bulge + 0.25 * width * np.sin(turn)
    z = distance[:, None] * np.sin(angle)[:, None] * bulge + 0.25 * width * np.cos(turn)
    y = np.broadcast_to(-length * s, x.shape)
    return Groom(
        np.stack([x, y, z], axis=2).reshape(-1, 3).astype(np.float32),
        np.arange(strands + 1) * points,
        np.zeros(1, np.float32),
    ).with_thickness(0.006 * width, 0.002 * width)


def head_bust() -> Bust:
    """Return the head and shoulders that `hair_head` grows on and falls about."""
    return Bust(np.zeros(3), _SKULL, facing=-1)


def hair_head(
    strands: int = 30_000, *, points: int = 32, length: float = 2.6, waves: float = 1.5, frizz: float = 1.0, seed: int = 1
) -> Groom:
    """Return long, parted hair as it falls about a head that is one unit high from its middle and looks along -z, so that
    a camera at +z sees its back. Needs no file.

    Guides leave the scalp away from the parting, bend under their weight, rest on head, neck and shoulders and on each
    other, draw together into locks toward their tips and end at one hemline. Strands are interpolated between them.

    Parameters
    ----------
    strands
        1 to 10 million.
    points
        Of a strand, 8 to 1024.
    length
        How far below the crown the hemline lies.
    waves
        Number of waves along a strand over that length; 0 is straight hair.
    frizz
        How far strands stray from their guides: 0 combed, 1 usual; at most 20.
    seed
        Of everything random.
    """
    from scipy.spatial import cKDTree

    strands, points = _sizes(strands, points, 8, 1024)
    length = validate.number("length", length, 0.3, 20)
    waves = validate.number("waves", waves, 0, 1000)
    frizz = validate.number("frizz", frizz, 0, 20)
    rng = validate.random_numbers(seed)
    body = replace(head_bust(), facing=1)
    root = _scalp(_GUIDES, rng)
    longest = length + _AROUND
    path, margin = _fall(root, points, longest, body, rng)
    lock = rng.choice(_GUIDES, _LOCKS, replace=False)
    middle = lock[cKDTree(root[lock]).query(root)[1]]
    s = np.linspace(0, 1, points)[None, :, None]
    path += _DRAWN * s * (path[middle] - path)
    # Neighbours wave together, and not all at one height: each lock on its own would catch the light as a patch, all
    # together as a band.
    side = np.arctan2(root[:, 0], root[:, 2])
    path += _waves(
        path,
        s * longest / length,
        waves,
        3 * np.sin(side) + 2 * np.cos(3 * side) + 0.25 * rng.standard_normal(_GUIDES)[middle],
    )
    path = body.kept_out(path, np.minimum(margin, 0.25 * s[..., 0]))
    # One hemline, lower at the back, where strands end and not at the point before.
    above = path[:, :, 1] - (1 - length + 0.12 * path[:, :, 2])
    last = np.maximum((above > 0).cumprod(axis=1).sum(axis=1) - 1, 1)
    row, after = np.arange(_GUIDES), np.minimum(last + 1, points - 1)
    rest = np.clip(above[row, last] / np.maximum(above[row, last] - above[row, after], 1e-9), 0, 1)
    path = cut(path, (last + rest) / (points - 1)) * np.array([-1.0, 1.0, -1.0])  # seen from behind
    guides = Groom(path.reshape(-1, 3).astype(np.float32), np.arange(_GUIDES + 1) * points, np.zeros(1, np.float32))
    away = int(_FLYAWAYS * min(frizz, 1) * strands)
    parts = [guides.interpolated(strands - away, clumping=0.3, frizz=_FRIZZ * frizz, length_variation=0.08, seed=seed)]
    if away:
        parts.append(guides.interpolated(away, frizz=4 * _FRIZZ * frizz, length_variation=0.5, seed=seed + 1))
    return join_grooms(parts).with_thickness(0.0016, 0.0006)


def _unit(vectors: Array, least: float = 0.0) -> Array:
    """Vectors (..., 3) over their lengths, which are taken to be at least `least`."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), least)


def _sizes(strands: int, points: int, least: int, most: int, **lengths: float) -> tuple[int, int]:
    """The numbers of strands and of a strand's points, and lengths, held to what they may be."""
    for name, value in lengths.items():
        validate.number(name, value, 0, 1e6, above=True)
    return validate.integer("strands", strands, 1, 10_000_000), validate.integer("points", points, least, most)


def _scalp(count: int, rng: np.random.Generator) -> Array:
    """Roots, evenly over what of the skull grows hair: down to the forehead, the ears, the nape."""
    found: list[Array] = []
    while sum(map(len, found)) < count:
        d = _unit(rng.standard_normal((4 * count + 64, 3)))
        front = d[:, 2] / np.maximum(np.hypot(d[:, 0], d[:, 2]), 1e-9)
        hairline = np.where(front > 0, 0.05 + 0.5 * np.abs(front) ** 1.5, 0.05 - 0.55 * np.abs(front) ** 0.8)
        found.append(d[d[:, 1] > hairline])
    return np.concatenate(found)[:count] * _SKULL


def _fall(root: Array, points: int, length: float, body: Bust, rng: np.random.Generator) -> tuple[Array, Array]:
    """Strands of the full length from their roots, under their own weight, outside the body: (strands, points, 3), and how
    far outside they are kept, (strands, 1).
    """
    up = _unit(root / _SKULL**2)
    top = np.clip((root[:, 1] - 0.1) / 0.6, 0, 1)[:, None]
    # Away from the parting, a line from the forehead to the crown, and around its end.
    away = np.stack([root[:, 0] - _PART, np.zeros(len(root)), np.minimum(root[:, 2] - _CROWN, 0)], axis=1)
    away = _unit(away, 1e-3)
    combed = top * (0.9 * away + np.array([0.0, -0.2, -0.25])) + (1 - top) * np.array([0.0, -1.0, -0.15])
    combed -= (combed * up).sum(axis=1, keepdims=True) * up
    direction = _unit(_unit(combed, 1e-9) + 0.7 * up + 0.12 * rng.standard_normal(root.shape))
    # Layers: hair from higher up lies on hair from below it.
    margin = 0.03 + 0.1 * np.clip(root[:, 1:2] + 0.5, 0, 1.5) / 1.5 + 0.03 * rng.random((len(root), 1))
    step = length / (points - 1)
    position, rows = root, [root]
    weight = (5.0 + rng.random((len(root), 1))) * np.array([0.0, -1.0, 0.0])
    for k in range(1, points):
        direction = _unit(direction + step * weight * min(1.0, 0.35 + k / points))
        position = position + step * direction
        depth = margin[:, 0] - body.distance(position)
        inside = depth > 0
        outward = body.outward(position[inside])
        position[inside] += min(1.0, 4 * k / points) * depth[inside, None] * outward
        direction[inside] -= np.minimum((direction[inside] * outward).sum(axis=1, keepdims=True), 0) * outward
        rows.append(position)
    return np.stack(rows, axis=1), margin


def _waves(path: Array, s: Array, waves: float, phase: Array) -> Array:
    """Offsets of a helix about each strand, growing from the root."""
    along = _unit(np.gradient(path, axis=1), 1e-9)
    outward = path * np.array([1.0, 0.0, 1.0])
    outward -= (outward * along).sum(axis=2, keepdims=True) * along
    outward = _unit(outward, 1e-9)
    turn = 2 * np.pi * waves * s + phase[:, None, None]
    size = 0.06 * (waves > 0) * np.clip(1.3 * s, 0, 1) ** 1.5
    return size * (np.cos(turn) * outward + 0.8 * np.sin(turn) * np.cross(along, outward))
