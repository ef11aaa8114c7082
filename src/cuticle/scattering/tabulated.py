"""A scattering function given as a table: from a simulation, a goniometer, another program."""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.files import read_bytes, reading
from cuticle._support.interpolation import monotone
from cuticle._support.values import Value
from cuticle.scattering.bcsdf import Plotted, luminance
from cuticle.scattering.holes import farthest, fill_holes
from cuticle.scattering.noise import LEAST_SHARE, settle_noise
from cuticle.scattering.registry import first_class, restores
from cuticle.scattering.table_axes import azimuth, check_theta, increasing, shaped
from cuticle.scattering.table_files import read_table, write_table

FAR = np.radians(15)  # between any viewer and the nearest that is known, without a warning
FAR_HOLE = np.radians(5)  # between a hole and the nearest value, without a warning
MOST_HOLES = 0.2  # of one viewer's values
MOST_NEGATIVE = 0.01  # of the energy, once noise is averaged out
MOST_NOISE = 0.25  # of a viewer's largest f cos theta_i, its deviation
MOST_ENERGY = 1.02
_NOT_ENERGY = 100.0
_ALL_BUT_EVEN = 1e-3  # of f, rms: both sides are one
_CORRELATED = 0.2
_FINE = 720  # cells of theta_i in which energies are compared
_STEP = np.radians(2)  # between viewers at which they are, at most
_POLE = 1e-9  # least cosine; what is given for the pole itself, where f has no say, is not looked at


@first_class
class Tabulated(Value, Plotted):
    """A scattering function given as a table over viewers and directions.

    f cos(theta_i) is interpolated linearly; unlike f, it is finite at the poles. Between two viewers, both slices are first
    shifted along theta_i so that their highlights (theta_i = -theta_r) coincide. Beyond the last viewer, its slice is
    shifted alone. A shift changes the energy, since cos(theta_i) is another: what is between viewers is scaled, channel by
    channel, to the energy interpolated between them by monotone cubics.

    Parameters
    ----------
    theta_r
        The viewers' inclinations, radians, increasing, shape (R,); or one number. If all are on one side, the other side is
        mirrored, with a warning; that is right for a fibre without tilt.
    theta_i
        Radians, increasing, shape (A,), to within 10° of both poles.
    phi
        Radians, increasing, shape (B,): a whole turn, or [0, pi] for an even function.
    values
        f in 1/sr, without a cosine: shape (R, A, B, channels), (R, A, B), or either without R for one viewer. What is given
        for a pole itself is not looked at. NaN is a hole: up to 20 % of a viewer's values, filled by the harmonic function
        through the values around it.
    degrees
        Whether the angles are in degrees.
    even
        Whether a table over a whole turn is even, f(phi) = f(-phi). Both sides are then averaged, and lobes serve both.
        Default: true if the two sides differ by noise only.
    smooth
        Whether to average out values below 0 as zero-mean noise: values within 4 sigma of zero are smoothed, stronger
        signal is kept. Sigma may be up to a quarter of the largest f cos(theta_i). Default: values below 0 that sum to less
        than 0.1 % are set to 0, and more are refused.

    Raises
    ------
    ValueError
        Shapes that do not fit, a grid that does not cover the sphere, infinite values, more holes or noise than that,
        values below 0 that are not noise, a viewer without energy, or more than 100 times the energy that came in
        (wrong units).

    Warns
    -----
    UserWarning
        Energy above 1, values below 0 set to 0, holes further than 5° from a value, viewers further than 15° from any
        that is known, one side of them only.
    """

    strands = 0.0
    suffixes = (".npz", ".csv")

    def __init__(
        self,
        theta_r: ArrayLike,
        theta_i: ArrayLike,
        phi: ArrayLike,
        values: ArrayLike,
        *,
        degrees: bool = False,
        even: bool | None = None,
        smooth: bool = False,
    ) -> None:
        self.source: dict[str, Any] | None = None
        for name, value in (("degrees", degrees), ("smooth", smooth), *((("even", even),) if even is not None else ())):
            validate.flag(name, value)
        for name, x in (("theta_r", theta_r), ("theta_i", theta_i), ("phi", phi), ("values", values)):
            validate.real(name, x)
        turn = np.radians if degrees else np.asarray
        self.theta_r = increasing("theta_r", turn(np.atleast_1d(np.asarray(theta_r, np.float64))), 1)
        self.theta_i = increasing("theta_i", turn(np.asarray(theta_i, np.float64)), 3)
        phi = np.asarray(turn(np.asarray(phi, np.float64)))
        f = shaped(values, len(self.theta_r), len(self.theta_i), np.size(phi))
        check_theta(self.theta_i)
        self.phi, order, self.even = azimuth(phi)
        f = f[:, :, order] * np.maximum(np.cos(self.theta_i), _POLE)[:, None, None]  # a copy, which is ours to change
        for pole, inner in ((0, 1), (-1, -2)):
            if np.cos(self.theta_i[pole]) <= _POLE:
                f[:, pole] = f[:, inner]
        self._bad(f)
        below = f[f < 0]
        missing = np.isnan(f).any(axis=3)
        self.holes = fill_holes(f, not self.even)
        if self.holes:
            self._say_holes(f, missing)
        if not self.even:
            f, self.phi, self.even = _fold(f, self.phi, even)
        if len(below):
            self._settle(f, below, smooth)
        if not self.even:  # the first azimuth once more, a turn later
            f = np.concatenate([f, f[:, :, :1]], axis=2)
            self.phi = np.append(self.phi, self.phi[0] + 2 * np.pi)
        self.values = f
        f.setflags(write=False)
        self.energy = self._energies()
        self._check_energy()
        self._mirrored = len(self.theta_r) > 1 and (self.theta_r[0] >= 0 or self.theta_r[-1] <= 0)
        self._scaled_at, self._scale = self._scales()
        self._check_viewers()
        if self._mirrored:
            side = "below" if self.theta_r[0] >= 0 else "above"
            _warn(f"no viewer {side} 0° is known: mirror images stand for them, which is right for a fibre without tilt")

    def __repr__(self) -> str:
        r, a, b, c = self.values.shape
        energy = luminance(self.energy)
        holes = ""
        if self.holes:
            holes = f", {100 * self.holes:.2g} % holes filled, up to {np.degrees(self.farthest):.2g}° from a value"
        size = f"{r} viewers × {a} theta_i × {b} phi × {c} channel{'s' if c > 1 else ''}"
        return f"Tabulated({size}{', even' if self.even else ''}, energy {energy.min():.3g} to {energy.max():.3g}{holes})"

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return self.values.shape[3]

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; angles in radians broadcast, the last axis is channels."""
        ti, tr, ph = validate.directions(theta_i, theta_r, phi)
        shape = validate.broadcast(theta_i=ti, theta_r=tr, phi=ph)
        if tr.size == 1 and ti.ndim == 2 and ti.shape[1] == 1 and ph.shape in ((shape[1],), (1, shape[1])):
            return self._grid(ti[:, 0], float(tr.ravel()[0]), ph.ravel())
        ti, tr, ph = (np.broadcast_to(x, shape).ravel() for x in (ti, tr, ph))
        if self._mirrored:
            other = tr < 0 if self.theta_r[0] >= 0 else tr > 0
            ti, tr = np.where(other, -ti, ti), np.where(other, -tr, tr)
        column, v = self._column(ph)
        row, t = _locate(self.theta_r, tr)
        out = np.zeros((len(ti), self.channels))
        for step, weight in ((0, 1 - t), (1, t)):
            used = np.flatnonzero(weight > 0)
            sheet = np.minimum(row[used] + step, len(self.theta_r) - 1)
            a, s = _locate(self.theta_i, ti[used] + tr[used] - self.theta_r[sheet])
            b, v_ = column[used], v[used]
            for da, wa in ((0, 1 - s), (1, s)):
                for db, wb in ((0, 1 - v_), (1, v_)):
                    out[used] += (weight[used] * wa * wb)[:, None] * self.values[sheet, a + da, b + db]
        k, s = _locate(self._scaled_at, tr)
        out *= (1 - s)[:, None] * self._scale[k] + s[:, None] * self._scale[k + 1]
        out /= np.maximum(np.cos(ti), _POLE)[:, None]
        return out.reshape(*shape, self.channels)

    def _grid(self, ti: NDArray, tr: float, ph: NDArray) -> NDArray[np.float64]:
        """The same for one viewer over the product of two axes: one axis after the other."""
        if self._mirrored and tr * (1 if self.theta_r[0] >= 0 else -1) < 0:
            ti, tr = -ti, -tr
        row, t = (x[0] for x in _locate(self.theta_r, np.array([tr])))
        rows = np.zeros((len(ti), *self.values.shape[2:]))
        for sheet, weight in ((row, 1 - t), (min(row + 1, len(self.theta_r) - 1), t)):
            if weight > 0:
                a, s = _locate(self.theta_i, ti + tr - self.theta_r[sheet])
                at = self.values[sheet]
                rows += (weight * (1 - s))[:, None, None] * at[a] + (weight * s)[:, None, None] * at[a + 1]
        k, s = _locate(self._scaled_at, np.array([tr]))
        rows *= (1 - s) * self._scale[k[0]] + s * self._scale[k[0] + 1]
        rows /= np.maximum(np.cos(ti), _POLE)[:, None, None]
        column, v = self._column(ph)
        return (1 - v)[:, None] * rows[:, column] + v[:, None] * rows[:, column + 1]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the table to an .npz file; the file is replaced whole, or left as it was."""
        if Path(path).suffix.lower() != ".npz":
            raise ValueError(f"a table is written as .npz, got {path}; end the name in .npz")
        last = None if self.even else -1
        f = self.values[:, :, :last] / np.maximum(np.cos(self.theta_i), _POLE)[:, None, None]
        return write_table(path, self.theta_r, self.theta_i, self.phi[:last], f)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, even: bool | None = None, smooth: bool = False) -> Tabulated:
        """Read a table from an .npz or a CSV file; docs/sources.md describes the formats.

        Raises
        ------
        ValueError
            The file cannot be read or holds no such table; the message names the line and the remedy.
        """
        with reading(path, "table"):
            made = cls(*read_table(path), even=even, smooth=smooth)
        made.source = {"path": str(path), "sha256": hashlib.sha256(read_bytes(path, "table")).hexdigest()}
        made.source |= {k: v for k, v in (("even", even), ("smooth", smooth or None)) if v is not None}
        return made

    def to_dict(self) -> dict[str, Any]:
        """Return the file or plugin that the table came from, as values that JSON can hold."""
        return {"source": self.source} if self.source else {}

    def _column(self, phi: NDArray) -> tuple[NDArray, NDArray]:
        if self.even:
            folded = np.abs(np.pi - np.mod(np.pi - phi, 2 * np.pi))
            return _locate(self.phi, folded)
        return _locate(self.phi, self.phi[0] + np.mod(phi - self.phi[0], 2 * np.pi))

    def _bad(self, f: NDArray) -> None:
        if np.isinf(f).any():
            raise ValueError(f"values must be finite or NaN (a hole), got {int(np.isinf(f).sum()):,} infinite ones")
        holes = np.isnan(f).mean(axis=(1, 2, 3))
        worst = int(np.argmax(holes))
        if holes[worst] > MOST_HOLES:
            raise ValueError(
                f"at most {100 * MOST_HOLES:g} % of a viewer's values may be holes (NaN), got {100 * holes[worst]:.3g} % at"
                f" theta_r {np.degrees(self.theta_r[worst]):.4g}°; measure more, or leave that viewer out"
            )

    def _say_holes(self, f: NDArray, missing: NDArray) -> None:
        """Keep how far from a value was filled; where that is far, warn of it, and of how much energy was filled."""
        far = farthest(missing, self.theta_i, self.phi, not self.even)
        self.farthest = float(far.max())
        if self.farthest <= FAR_HOLE:
            return
        weight = np.cos(self.theta_i)[:, None]
        total = np.abs(f).sum(axis=3) * weight
        filled = (total * missing).sum(axis=(1, 2)) / np.maximum(total.sum(axis=(1, 2)), 1e-300)
        r = int(np.argmax(far))
        _warn(
            f"{100 * self.holes:.2g} % of the values are holes (NaN), filled from those around them: up to"
            f" {np.degrees(far[r]):.2g}° from the nearest value, at theta_r {np.degrees(self.theta_r[r]):.3g}°; what was"
            f" filled holds up to {100 * filled.max():.2g} % of a viewer's energy"
        )

    def _settle(self, f: NDArray, below: NDArray, smooth: bool) -> None:
        """Make f at least 0; `below`: what was not, as it was given."""
        share = -float(below.sum()) / float(np.abs(f).sum() - below.sum())
        if not smooth and share > LEAST_SHARE:
            raise ValueError(
                f"values must be at least 0, got {len(below):,} below 0, {100 * share:.3g} % of the sum of f cos(theta_i),"
                f" the least {float(below.min()):.4g}: smooth=True averages out what is zero-mean noise"
            )
        weight = np.cos(self.theta_i)
        before = np.einsum("rabc,a->rc", f, weight)
        left, deviation = settle_noise(f, not self.even)
        if left > MOST_NEGATIVE:
            raise ValueError(
                f"values must be at least 0 but for noise about 0: {100 * share:.3g} % of the sum of f cos(theta_i) is"
                f" negative, {100 * left:.3g} % still where noise averages out; the least is {float(below.min()):.4g};"
                " subtract a dark measurement, or set to 0 what is known to be dark"
            )
        if deviation > MOST_NOISE:
            raise ValueError(
                f"noise may have a deviation of {100 * MOST_NOISE:g} % of the largest f cos(theta_i), got"
                f" {100 * deviation:.3g} %, judged by the values below 0; measure longer, or average n measurements, which"
                " divides it by the root of n"
            )
        changed = np.abs(np.einsum("rabc,a->rc", f, weight) / np.maximum(before, 1e-300) - 1).max()
        done = "set to 0"
        if deviation:
            done = f"smoothed as noise of {100 * deviation:.2g} % of the largest value"
            done += f"; that changes a viewer's energy by up to {100 * changed:.2g} %"
        _warn(f"{len(below):,} values below 0 ({100 * share:.2g} % of the sum) are {done}")

    def _energies(self) -> NDArray[np.float64]:
        """∫ f cos theta_i d omega_i of each viewer and channel, shape (R, channels), by the trapezium rule."""
        theta = np.concatenate([[-np.pi / 2], self.theta_i, [np.pi / 2]])
        along_theta = 0.5 * (theta[2:] - theta[:-2]) * np.cos(self.theta_i)
        return np.einsum("rac,a->rc", self._over_phi(), along_theta)

    def _scales(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return viewers, those of the table and some between, and what f is to be multiplied by there: 1 at the table's."""
        theta = (np.arange(_FINE) + 0.5) * np.pi / _FINE - np.pi / 2
        over_phi = self._over_phi()

        def energy(sheet: int, shift: float) -> NDArray[np.float64]:
            return np.cos(theta) @ np.stack([np.interp(theta + shift, self.theta_i, m) for m in over_phi[sheet].T], axis=1)

        own = np.stack([energy(r, 0.0) for r in range(len(self.theta_r))])
        known = np.unique([-np.pi / 2, *self.theta_r, np.pi / 2])
        parts = [np.linspace(a, b, max(8, math.ceil((b - a) / _STEP)), endpoint=False) for a, b in pairwise(known)]
        viewers = np.append(np.concatenate(parts), known[-1])
        scale = np.ones((len(viewers), self.channels))
        wanted = own[:1] if len(own) == 1 else monotone(self.theta_r, own)(viewers.clip(*self.theta_r[[0, -1]]))
        wanted = np.broadcast_to(wanted, scale.shape)
        for k, (viewer, row, t) in enumerate(zip(viewers, *_locate(self.theta_r, viewers), strict=True)):
            sheets = [(row, 1 - t), (min(row + 1, len(own) - 1), t)]
            moved = sum(w * energy(r, viewer - self.theta_r[r]) for r, w in sheets if w > 0)
            np.divide(wanted[k], moved, out=scale[k], where=moved > 0)
        return viewers, scale

    def _over_phi(self) -> NDArray[np.float64]:
        """∫ f cos(theta_i) d phi of each viewer, theta_i and channel."""
        along_phi = np.zeros(len(self.phi))
        half = 0.5 * np.diff(self.phi)
        along_phi[:-1] += half
        along_phi[1:] += half
        if self.even:  # from the first azimuth to 0 and from the last to pi, both sides
            along_phi[0] += self.phi[0]
            along_phi[-1] += np.pi - self.phi[-1]
            along_phi *= 2
        return np.einsum("rabc,b->rac", self.values, along_phi, optimize=True)

    def _check_viewers(self) -> None:
        known = np.unique(np.concatenate([self.theta_r, -self.theta_r])) if self._mirrored else self.theta_r
        places = np.linspace(-np.pi / 2, np.pi / 2, 181)
        apart = np.abs(places[:, None] - known).min(axis=1)
        if apart.max() > FAR:
            place, nearest = places[np.argmax(apart)], known[np.argmin(np.abs(places[np.argmax(apart)] - known))]
            of = "one viewer is known" if len(known) == 1 else "few viewers are known"
            _warn(
                f"{of}: at theta_r {np.degrees(place):.3g}° stands what was given for {np.degrees(nearest):.3g}°, moved by"
                f" {np.degrees(apart.max()):.3g}° along theta_i to its highlight: a guess beyond {np.degrees(FAR):g}°"
            )

    def _check_energy(self) -> None:
        total = self.energy.max(axis=1)
        dark = np.flatnonzero(~(total > 0))
        if len(dark):
            raise ValueError(
                f"every viewer must see some light, got only zeros at theta_r {np.degrees(self.theta_r[dark[0]]):.4g}°"
                f" ({len(dark)} of {len(total)} viewers); leave them out"
            )
        r, c = np.unravel_index(int(np.argmax(self.energy)), self.energy.shape)
        most, where = self.energy[r, c], f"at theta_r {np.degrees(self.theta_r[r]):.4g}°, channel {c}"
        if most > _NOT_ENERGY:
            raise ValueError(
                f"∫ f cos(theta_i) d omega must be at most 1, got {most:.4g} {where}: values of over {_NOT_ENERGY:g} are no"
                " 1/sr without a cosine; divide by the incoming light"
            )
        if most > MOST_ENERGY:
            _warn(f"more light leaves than came: ∫ f cos(theta_i) d omega is {most:.4g} {where}; is f 1/sr, with no cosine?")


def _warn(message: str) -> None:
    warnings.warn(message, stacklevel=4)


def _fold(f: NDArray, phi: NDArray, even: bool | None) -> tuple[NDArray, NDArray, bool]:
    """Return half a turn, both sides averaged, where f is even by `even` or by what it shows."""
    turned = np.mod(-phi - phi[0], 2 * np.pi) + phi[0]  # -phi, within the table's turn
    other = np.searchsorted(phi, turned - 1e-6) % len(phi)
    meets = np.abs(np.angle(np.exp(1j * (phi[other] + phi)))) < 1e-6
    if even is False or not meets.all():
        if even:
            raise ValueError("even=True needs a phi grid that holds -phi beside every phi")
        return f, phi, False
    wrapped = np.angle(np.exp(1j * phi))
    half = np.flatnonzero((wrapped > -1e-6) | (np.abs(wrapped + np.pi) < 1e-6))
    half = half[np.argsort(np.abs(wrapped[half]))]
    if even is None:
        difference = 0.5 * (f - f[:, :, other])
        square = float((difference**2).sum())
        if square > (_ALL_BUT_EVEN**2) * float((f**2).sum()):
            # What is left is noise where neighbours know nothing of each other.
            along = float((difference * np.roll(difference, 1, axis=2)).sum())
            if along > _CORRELATED * square:
                return f, phi, False
    folded = 0.5 * (f[:, :, half] + f[:, :, other[half]])
    return folded, np.abs(wrapped[half]).clip(0, np.pi), True


def _locate(axis: NDArray, x: NDArray) -> tuple[NDArray, NDArray]:
    """Return the place below each x and how far it is to the next, held within the axis."""
    if len(axis) == 1:
        return np.zeros(len(x), np.intp), np.zeros(len(x))
    i = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, len(axis) - 2)
    return i, np.clip((x - axis[i]) / (axis[i + 1] - axis[i]), 0, 1)


@restores("path")
def _read_again(source: dict[str, Any]) -> Tabulated:
    """Return the table of a file that a sampler was fitted to, if the file is still the same."""
    path = Path(source["path"])
    if not path.exists():
        raise ValueError(f"this sampler was fitted to {path}, which is not there; name the table with --model")
    if hashlib.sha256(read_bytes(path, "table")).hexdigest() != source.get("sha256"):
        raise ValueError(
            f"this sampler was fitted to {path}, which has changed since; fit again, or name another with --model"
        )
    return Tabulated.load(path, even=source.get("even"), smooth=source.get("smooth", False))
