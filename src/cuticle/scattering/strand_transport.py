"""Light among parallel strands, by transmission and reflection operators over directions (adding and doubling).

Importance is followed from a viewed strand toward the light. Its direction of travel is an inclination, one of the rows of
cells over [-pi/2, pi/2], and an azimuth, one of the columns over the half turn toward the light (up) or away from it (down).
A layer of strands sends it on (T) or back (R). A strand looks the same from above and below, so both halves share T and R:
down is up turned by pi. One more azimuth stands for the beam: azimuth 0 exactly, where the light is. Columns for it hold
densities per radian.

Three arrangements of strands are solved. In sheets every layer is one strand thick, however it is crossed. In a lock the
number of sheets is Poisson distributed. In a medium strands stand at random, endless to the sides: a path at azimuth phi
meets 1/cos phi strands for one that the beam meets.

Adding and doubling: van de Hulst 1980; the half space below is the fixed point of its own doubling. With R of the half
space, importance passes one sheet as S = (1 - R_1 R)^-1 T_1, and tau strands of a lock or of a medium as exp(-tau G):
G = 1 - S, and G = M^-1 (1 - T_1 - R_1 R) with M = diag(cos phi). Nothing is assumed of the azimuth at which light meets a
strand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_STEP = 1 / 16  # strands in the thinnest layer: its second-order error is below a thousandth
_DOUBLINGS = 14
PASSED = 6  # doublings of sheets of which what they pass on is told
_SETTLED = 1e-4  # of the energy that a half space reflects


@dataclass(frozen=True)
class Directions:
    """Cells of directions.

    Attributes
    ----------
    rows
        Of inclination, over [-pi/2, pi/2].
    columns
        Of azimuth, over a quarter turn.
    even
        Whether f is even in phi: then the cells on both sides of the beam are one.
    fine_rows, fine_columns
        Samples of f in a cell.
    """

    rows: int = 45
    columns: int = 6
    even: bool = True
    fine_rows: int = 3
    fine_columns: int = 12

    @property
    def theta(self) -> Array:
        """The rows' centres."""
        return (np.arange(self.rows) + 0.5) * np.pi / self.rows - np.pi / 2

    @property
    def fine_theta(self) -> Array:
        """Where f is sampled within rows."""
        count = self.rows * self.fine_rows
        return (np.arange(count) + 0.5) * np.pi / count - np.pi / 2

    @property
    def step(self) -> float:
        """A column's width, radians."""
        return np.pi / 2 / self.columns

    @property
    def half_turn(self) -> int:
        """Columns in a half turn."""
        return 2 * self.columns

    @property
    def cells(self) -> NDArray[np.int_]:
        """The first edge of each column toward the light, in columns from the beam."""
        return np.arange(0 if self.even else -self.columns, self.columns)

    @property
    def fine_phi(self) -> Array:
        """Where f is sampled: azimuths phi over the whole turn from -pi, those of [0, pi] where f is even."""
        count = self.half_turn * self.fine_columns
        phi = (np.arange(count) + 0.5) * np.pi / count
        return phi if self.even else np.concatenate([-phi[::-1], phi])

    @property
    def nodes(self) -> NDArray[np.int_]:
        """The viewer's azimuths, in columns: [0, pi] where f is even, else (-pi, pi]."""
        return np.arange(0 if self.even else 1 - self.half_turn, self.half_turn + 1)

    @property
    def node_weights(self) -> Array:
        """Weights of the nodes in an integral over the whole turn."""
        inside = 2 if self.even else 1
        return self.step * np.array([1 if self.even and n in (0, self.half_turn) else inside for n in self.nodes])


@dataclass(frozen=True, eq=False)
class Scattering:
    """One scattering, from a row's centre into a row, by how far travel turns in azimuth, in columns over the whole turn.

    `cell` is the energy from a column into the one so many further on, shape (turns, rows, rows); `point` the energy per
    radian, averaged over turns from so many columns to one more.
    """

    directions: Directions
    cell: Array
    point: Array

    @staticmethod
    def of(directions: Directions, density: Array) -> Scattering:
        """Return it from the energy per radian of phi at `fine_phi`, shape (rows, rows, fine_phi)."""
        return Scattering(directions, *azimuth_cells(directions, density))

    @property
    def energy(self) -> Array:
        """What a row scatters in all, out of 1."""
        return self.cell.sum(axis=(0, 2))

    def __add__(self, other: Scattering) -> Scattering:
        return Scattering(self.directions, self.cell + other.cell, self.point + other.point)

    def _turned(self, table: Array, columns: NDArray[np.int_]) -> Array:
        half = self.directions.half_turn
        return table[(columns + half) % (2 * half)]

    def operator(self, turn: int) -> Array:
        """Return the operator over (beam and columns) × rows; `turn` 0 goes on, a half turn goes back."""
        d, cells = self.directions, self.directions.cells
        out = np.zeros((len(cells) + 1, len(cells) + 1, d.rows, d.rows))
        out[1:, 1:] = self._turned(self.cell, cells[None, :] - cells[:, None] + turn)
        if d.even:  # the cell on the beam's other side
            out[1:, 1:] += self._turned(self.cell, -cells[None, :] - 1 - cells[:, None] + turn)
        out[1:, 0] = self._turned(self.point, -cells - 1 + turn)
        size = (len(cells) + 1) * d.rows
        return out.transpose(0, 2, 1, 3).reshape(size, size)

    def viewed(self, turn: int, columns: Array) -> Array:
        """Return what viewers see of the columns of a matrix over directions, shape (nodes, rows, ...).

        Rows are the viewers' directions of travel: a viewer at theta_r looks along -theta_r.
        """
        d = self.directions
        into = columns.reshape(-1, d.rows, columns.shape[1])[1:].reshape(-1, columns.shape[1])
        seen = np.empty((len(d.nodes), d.rows, columns.shape[1]))
        for k, node in enumerate(d.nodes):
            density = self._turned(self.point, d.cells - node - d.half_turn + turn)
            if d.even:
                density = density + self._turned(self.point, -d.cells - 1 - node - d.half_turn + turn)
            seen[k] = density.transpose(1, 0, 2).reshape(d.rows, -1) @ into * d.step
        return seen


def azimuth_cells(d: Directions, density: Array) -> tuple[Array, Array]:
    """Return `Scattering`'s cells and points of densities over phi, the last axis; turns come first."""
    whole = np.concatenate([density[..., ::-1], density], axis=-1) if d.even else density
    q = d.fine_columns
    turned = np.roll(whole, whole.shape[-1] // 2, axis=-1)  # travel turns by phi - pi
    parts = np.moveaxis(turned.reshape(*turned.shape[:-1], -1, q), -2, 0)
    rise = (np.arange(q) + 0.5) / q  # from anywhere in a column: the overlap of it, moved, with another
    cell = (np.roll(parts, 1, axis=0) @ rise + parts @ rise[::-1]) * (d.step / q)
    return cell, parts.mean(axis=-1)


def _doubled(on: Array, back: Array) -> tuple[Array, Array]:
    """T and R of two layers like one."""
    between = np.linalg.solve(np.eye(len(on)) - back @ back, on)
    return on @ between, back + on @ (back @ between)


def _half_space(on: Array, back: Array) -> Array:
    """R of endless layers."""
    for _ in range(_DOUBLINGS):
        on, more = _doubled(on, back)
        settled = np.abs(more - back).sum(axis=1).max() < _SETTLED
        back = more
        if settled:
            break
    return back


def _thin(on: Array, back: Array, slant: Array) -> tuple[Array, Array]:
    """T and R of a layer of a random medium, to second order: each flux by its mean within the layer."""
    one = np.eye(len(on))
    loss, turned = 0.5 * _STEP * slant * (one - on), 0.5 * _STEP * slant * back
    returned = np.linalg.solve((one + loss).T, turned.T).T
    twice = returned @ turned
    through = np.linalg.solve((one + loss - twice).T, (one - loss + twice).T).T
    return through, (one + through) @ returned


class StrandTransport:
    """What reaches the beam from a strand behind others, and with an endless number of them behind it.

    Parameters
    ----------
    parts
        A strand's scattering, whole or in parts that are to be told apart; one channel.
    """

    def __init__(self, parts: Sequence[Scattering]) -> None:
        self.parts = parts
        self.directions = parts[0].directions
        self._all = sum(parts[1:], start=parts[0])
        self._on = self._all.operator(0)
        self._back = self._all.operator(self.directions.half_turn)

    @cached_property
    def _sheets(self) -> tuple[Array, Array]:
        """R of the half space, and S."""
        below = _half_space(self._on, self._back)
        return below, np.asarray(np.linalg.solve(np.eye(len(below)) - self._back @ below, self._on), np.float64)

    @cached_property
    def _medium(self) -> tuple[Array, Array]:
        """R of the half space, and G."""
        d = self.directions
        slant = np.repeat(np.concatenate([[1.0], 1 / np.cos((d.cells + 0.5) * d.step)]), d.rows)[:, None]
        below = _half_space(*_thin(self._on, self._back, slant))
        return below, slant * (np.eye(len(below)) - self._on - self._back @ below)

    def _beam(self, functions: Array) -> Array:
        arrived = np.zeros((len(self._on), functions.shape[1]))
        arrived[: self.directions.rows] = functions
        return arrived

    def through_sheets(self, functions: Array, counts: Sequence[int]) -> Array:
        """Return what comes from each part, and last from the strands behind, through whole numbers of sheets.

        Parameters
        ----------
        functions
            Of the inclination theta_i at which light falls in, at the rows' centres: shape (rows, k).
        counts
            Of 0, the parts are 0: their light is direct.

        Returns
        -------
        ndarray
            Integrals of f cos² theta_i and the functions over theta_i, shape (counts, parts + 1, nodes, rows, k).
        """
        below, step = self._sheets
        beam = self._beam(functions)
        arrived = [np.linalg.matrix_power(step, n) @ beam for n in counts]
        scattered = [x if n else 0 * x for n, x in zip(counts, arrived, strict=True)]
        return self._seen(scattered, below @ step @ np.hstack(arrived))

    def through_random(self, functions: Array, depths: Sequence[float], *, medium: bool) -> Array:
        """Return the same for mean numbers of strands, multiples of 1/16, of a medium or a lock.

        The parts leave out light that no other strand scattered.
        """
        if medium:
            below, loss = self._medium
        else:
            below, sheet = self._sheets
            loss = np.eye(len(sheet)) - sheet
        one = np.eye(len(loss))
        powers: dict[int, NDArray[Any]] = {0: one, 1: np.linalg.solve(one + 0.5 * _STEP * loss, one - 0.5 * _STEP * loss)}

        def power(n: int) -> NDArray[Any]:
            if n not in powers:
                powers[n] = power(n // 2) @ power(n - n // 2)
            return powers[n]

        at, done, scattered, arrived = self._beam(functions), 0, [], []
        for n in (round(x / _STEP) for x in depths):
            at, done = power(n - done) @ at, n
            arrived.append(at)
            scattered.append(at.copy())
            scattered[-1][: self.directions.rows] = 0
        return self._seen(scattered, (below if medium else below @ sheet) @ np.hstack(arrived))

    def passed(self) -> Array:
        """Return what 1, 2, 4, ... sheets pass on of light that falls in at azimuth 0, shape (PASSED + 1, rows).

        Energy, out of 1, in all directions on: f is the same for light's way back, which the columns about azimuth 0 follow.
        Nothing stands behind the sheets.
        """
        d = self.directions
        about = slice(1, 2) if d.even else slice(d.columns, d.columns + 2)
        on, back, into = self._on, self._back, []
        for k in range(PASSED + 1):
            on, back = _doubled(on, back) if k else (on, back)
            into.append(on[:, d.rows :].sum(axis=1).reshape(-1, d.rows)[about].mean(axis=0))
        return np.array(into)

    def one_behind(self) -> Array:
        """Return what changes where sheets have an end, shape (3, rows).

        The share of the half space's backscatter that one sheet behind sends back, of direct light and of light through
        one sheet; and, with none behind, what the parts carry through one sheet of what they do before a half space.
        """
        below, sheet = self._sheets
        beam = self._beam(np.ones((self.directions.rows, 1)))
        light = np.hstack([beam, sheet @ beam])
        two = np.linalg.solve(np.eye(len(sheet)) - self._back @ self._back, self._on)  # to and fro between two sheets
        turn = self.directions.half_turn
        seen = [
            np.einsum("nrk,n->kr", self._all.viewed(way, x), self.directions.node_weights)
            for way, x in (
                (turn, self._back @ two @ light), (turn, below @ sheet @ light), (0, two @ beam), (0, sheet @ beam),
            )
        ]  # fmt: skip
        return np.array([*(seen[0] / seen[1]), seen[2][0] / seen[3][0]])

    def _seen(self, scattered: list[Array], returned: Array) -> Array:
        """What viewers see of it, shape (len(scattered), parts + 1, nodes, rows, k)."""
        seen = np.array(
            [
                *(p.viewed(0, np.hstack(scattered)) for p in self.parts),
                self._all.viewed(self.directions.half_turn, returned),
            ]
        )
        return np.moveaxis(seen.reshape(*seen.shape[:3], len(scattered), -1), 3, 0)
