"""Counts the strands between a point and the light, with a grid of hair density."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle._support.values import Value
from cuticle.grooms.groom import Groom, checked_groom

MAX_RESOLUTION = 512


@dataclass(frozen=True, eq=False)
class DensityGrid(Value):
    """Hair density and direction per cell, to count the strands along a ray without tracing them.

    Attributes
    ----------
    cells
        Σ 2 r l t tᵀ over the cell's volume, of pieces of strand of radius r, length l, direction t: xx, yy, zz, xy, xz, yz
        in one over the points' unit, shape (z, y, x, 6).
    lower
        Corner of the box, shape (3,).
    cell
        Widths of a cell, shape (3,).
    """

    cells: NDArray[np.float32]
    lower: NDArray[np.float32]
    cell: NDArray[np.float32]

    @classmethod
    def build(cls, groom: Groom, resolution: int = 64) -> DensityGrid:
        """Build the grid of a groom, with `resolution` cells along its longest side. Cells are nearly cubes.

        Examples
        --------
        >>> from cuticle.grooms.density_grid import DensityGrid
        >>> from cuticle.grooms.procedural import hair_ball
        >>> grid = DensityGrid.build(hair_ball(1000))
        >>> max(grid.cells.shape)
        64
        """
        checked_groom("groom", groom)
        resolution = validate.integer("resolution", resolution, 1, MAX_RESOLUTION)
        low, high = (x.astype(np.float64) for x in groom.bounds)
        room = float(groom.radius.max()) + 1e-4 * float((high - low).max()) + 1e-12
        low, high = low - room, high + room
        width = float((high - low).max()) / resolution
        size = np.maximum(np.ceil((high - low) / width - 1e-6), 1).astype(int)
        cell = ((high - low) / size).astype(np.float32)
        cells = np.zeros((*size[::-1], _core.density_columns), np.float32)
        lower = low.astype(np.float32)
        _core.density_grid(groom.points, groom.radius, groom.offsets, lower, cell, cells)
        cells.setflags(write=False)
        return cls(cells, lower, cell)

    def __repr__(self) -> str:
        z, y, x, _ = self.cells.shape
        used = float((self.cells[..., :3].sum(axis=-1) > 0).mean())
        return f"DensityGrid({x} x {y} x {z} cells of {self.cell.max():.3g}, {100 * used:.0f} % of them with hair)"

    def strands(self, origin: ArrayLike, direction: ArrayLike, distance: ArrayLike = math.inf) -> NDArray[np.float32]:
        """Return the expected number of strands that a ray crosses.

        Parameters
        ----------
        origin
            Shape (..., 3), in the groom's unit; may lie outside the box.
        direction
            Unit vectors, shape (..., 3).
        distance
            How far to count, shape (...), at least 0. Default: to the end of the box.

        Raises
        ------
        ValueError
            Shapes do not broadcast, a direction is not a unit vector, or a number is not finite.
        """
        o, d, far = (
            validate.real(name, x).astype(np.float32)
            for name, x in (("origin", origin), ("direction", direction), ("distance", distance))
        )
        for name, value in (("origin", o), ("direction", d)):
            if value.ndim < 1 or value.shape[-1] != 3:
                raise ValueError(f"{name} must have shape (..., 3), got {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} must be finite numbers")
        norm = np.linalg.norm(d, axis=-1)
        if d.size and not (np.abs(norm - 1) <= 1e-3).all():
            worst = float(norm.flat[int(np.argmax(np.abs(norm - 1)))])
            raise ValueError(f"direction must be unit vectors, got one of length {worst:.4g}; divide by its norm")
        if not (far >= 0).all():
            raise ValueError(f"distance must be at least 0, got {float(far.min()):g}")
        shape = validate.broadcast(origin=o[..., 0], direction=d[..., 0], distance=far)
        out = np.empty(math.prod(shape), np.float32)
        if out.size:
            from_, along = (np.ascontiguousarray(np.broadcast_to(v, (*shape, 3))).reshape(-1, 3) for v in (o, d))
            _core.count_strands(self.cells, self.lower, self.cell, from_, along, validate.flat(far, shape), out)
        return out.reshape(shape)
