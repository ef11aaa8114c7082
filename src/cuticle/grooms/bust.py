"""A plain head with neck and shoulders, for hair to grow on and fall about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cuticle.grooms.groom import Groom, checked_groom

__all__ = ["Bust"]

Array = NDArray[np.float64]
# Ellipsoids below the skull: how far their centres lie below the crown and before its middle, and their radii across, up
# and forward. All in half widths of the head, which is 2.7 of them high, after what adults measure.
_PARTS = (
    (1.7, 0.3, (0.72, 1.0, 0.8)),  # face and jaw
    (3.0, -0.14, (0.56, 2.2, 0.56)),  # neck
    (4.42, -0.3, (2.1, 0.72, 0.78)),  # shoulders
    (5.6, -0.1, (1.65, 1.9, 1.0)),  # chest
)
_LEAN = 0.22  # of the neck: how far it goes back for what it goes down
_BLEND = (0.3, 0.3, 0.75, 0.5)  # how far from where a part meets the others they become one
_BOTTOM = 6.0
_GRID = (48, 96)  # over directions, of what the skull departs from its ellipsoid
_NEAR, _REACH = 24, 0.12  # roots that a direction asks, and how far (radians) what they say holds


@dataclass(frozen=True, eq=False)
class Bust:
    """A head with neck and shoulders, upright along +y.

    The skull is an ellipsoid, or what `fitted` makes of one. Whatever is below it is blended ellipsoids.

    Parameters
    ----------
    centre
        The middle of the skull.
    radii
        Half its width, height and depth.
    relief
        What the skull's radius is multiplied with, shape (48, 96): over the angle from the crown, 0 to pi, and azimuth, -pi
        to pi, 0 at the face. Default: 1.
    facing
        1 where the face looks along +z, -1 where it looks along -z: half a turn around the middle.
    """

    centre: Array
    radii: Array
    relief: Array | None = None
    facing: int = 1

    @classmethod
    def fitted(cls, groom: Groom) -> Bust:
        """Return the bust whose skull passes through the roots of a head of hair."""
        from scipy.spatial import cKDTree

        roots = checked_groom("groom", groom).points[groom.offsets[:-1]].astype(np.float64)
        middle = (roots.min(axis=0) + roots.max(axis=0)) / 2  # a point within: else the equation's signs may turn
        from_middle = roots - middle
        k, _, rank, _ = np.linalg.lstsq(np.hstack([from_middle**2, from_middle]), np.ones(len(roots)), rcond=None)
        if rank < 6 or not (k[:3] > 0).all():
            raise ValueError("groom must have roots about a head, got some that no ellipsoid passes through")
        centre = -k[3:] / (2 * k[:3])
        radii = np.sqrt((1 + (k[:3] * centre**2).sum()) / k[:3])
        centre += middle
        within = (roots - centre) / radii
        distance = np.linalg.norm(within, axis=1)
        theta, phi = np.meshgrid(np.linspace(0, np.pi, _GRID[0]), np.linspace(-np.pi, np.pi, _GRID[1]), indexing="ij")
        asked = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1)
        apart, near = cKDTree(within / distance[:, None]).query(asked, min(_NEAR, len(roots)))
        weight = np.exp(-0.5 * (apart / _REACH) ** 2)
        return cls(centre, radii, 1 + (weight * (distance[near] - 1)).sum(axis=-1) / (weight.sum(axis=-1) + 1))

    def distance(self, points: Array) -> Array:
        """Return about how far points (..., 3) are from the surface, negative within."""
        from scipy.ndimage import map_coordinates

        p = (points - self.centre) / self.radii[0] * [self.facing, 1, self.facing]
        skull = self.radii / self.radii[0]
        crown = skull[1]
        radius = np.linalg.norm(p / skull, axis=-1)
        relief = 1.0
        if self.relief is not None:
            q = p / skull / np.maximum(radius, 1e-9)[..., None]
            rows, columns = (
                np.arccos(np.clip(q[..., 1], -1, 1)) / np.pi,
                np.arctan2(q[..., 0], q[..., 2]) / (2 * np.pi) + 0.5,
            )
            at = [rows * (self.relief.shape[0] - 1), columns * (self.relief.shape[1] - 1)]
            relief = map_coordinates(self.relief, at, order=1)
        out = _to_ellipsoid(p, skull, relief)
        for (below, before, radii), lean, blend in zip(_PARTS, (0, _LEAN, 0, 0), _BLEND, strict=True):
            q = p - [0, crown - below, before]
            q[..., 2] -= lean * q[..., 1]
            other = _to_ellipsoid(q, np.array(radii), 1.0)
            h = np.maximum(blend - np.abs(out - other), 0) / blend
            out = np.minimum(out, other) - h * h * blend / 4  # a smooth minimum
        return out * self.radii[0]

    def outward(self, points: Array) -> Array:
        """Return the directions (..., 3) in which the distance grows fastest."""
        step = 1e-3 * self.radii[0]
        slope = np.stack([self.distance(points + e) - self.distance(points - e) for e in step * np.eye(3)], axis=-1)
        return slope / np.maximum(np.linalg.norm(slope, axis=-1, keepdims=True), 1e-12)

    def kept_out(self, points: Array, margin: float | Array = 0.0) -> Array:
        """Return points (..., 3) with those within `margin` of the surface, or below it, lifted to that height."""
        out = points.astype(np.float64)
        for _ in range(3):  # the distance is exact at the surface only
            depth = margin - self.distance(out)
            below = depth > 0
            if not below.any():
                break
            out[below] += depth[below, None] * self.outward(out[below])
        return out

    def mesh(self, rows: int = 180, columns: int = 128) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return its surface: vertices and normals (N, 3), and triangles (M, 3).

        Each row of vertices lies at one height, found along rays from an axis inside; the bottom is open.
        """
        unit = self.radii[0]
        crown = self.centre[1] + self.radii[1] * (1 if self.relief is None else self.relief[0].mean())
        t = np.linspace(0, 1, rows)
        height = crown - unit * _BOTTOM * np.minimum(t, 0.25 * t + t * t)  # closer rows where the crown is round
        azimuth = np.linspace(0, 2 * np.pi, columns, endpoint=False)
        away = np.stack([np.sin(azimuth), np.zeros(columns), np.cos(azimuth)], axis=-1)
        behind = -self.facing * unit * np.interp(t, [0, 0.55], [0, 0.3])
        axis = self.centre + np.stack([0 * height, height - self.centre[1], behind], axis=-1)
        near, far = np.zeros((rows, columns)), np.full((rows, columns), 2.6 * unit)
        for _ in range(22):
            middle = (near + far) / 2
            inside = self.distance(axis[:, None] + middle[..., None] * away) < 0
            near, far = np.where(inside, middle, near), np.where(inside, far, middle)
        vertices = (axis[:, None] + far[..., None] * away).reshape(-1, 3)
        a = np.arange((rows - 1) * columns).reshape(rows - 1, columns)
        b = np.roll(a, -1, axis=1)
        triangles = np.stack([a, a + columns, b, b, a + columns, b + columns], axis=-1).reshape(-1, 3)
        return vertices, self.outward(vertices), triangles


def _to_ellipsoid(p: Array, radii: Array, relief: float | Array) -> Array:
    """About the distance to an ellipsoid around the origin: exact at its surface to first order."""
    one, two = np.linalg.norm(p / radii, axis=-1) / relief, np.linalg.norm(p / radii**2, axis=-1) / relief
    return one * (one - 1) / np.maximum(two, 1e-9)
