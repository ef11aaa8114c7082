"""Where samples and density differ: the band or patch of the sphere with the least likely count."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_PATCHES = 24  # cells along each axis where patches are looked for
LEAST_REPEATS = 20  # samples at one angle from which on it is reported
_SAME = 1e-6  # radians


class Region(NamedTuple):
    """A patch of the sphere (radians; a band spans the other angle), and the samples drawn and expected in it."""

    theta: tuple[float, float]
    phi: tuple[float, float]
    drawn: float
    expected: float

    def text(self) -> str:
        """Return the region in words, in degrees."""
        t, p = np.degrees(self.theta), np.degrees(self.phi)
        patch = f"theta_i {t[0]:.1f}° to {t[1]:.1f}°" if t[1] - t[0] < 179.9 else "all theta_i"
        patch += f", phi {p[0]:.1f}° to {p[1]:.1f}°" if p[1] - p[0] < 359.9 else ""
        many = "many" if self.drawn > self.expected else "few"
        return f"too {many} samples at {patch}: {self.drawn:,.0f} drawn, {self.expected:,.0f} expected"


class RepeatedAngle(NamedTuple):
    """An angle (degrees) that many samples share to the last digit."""

    axis: str
    angle: float
    hits: int
    of: int

    @property
    def share(self) -> float:
        """Share of all samples."""
        return self.hits / self.of

    def within(self, region: Region) -> bool:
        """Return whether the angle lies in a region."""
        low, high = region.theta if self.axis == "theta_i" else region.phi
        return low - 1e-6 <= np.radians(self.angle) <= high + 1e-6

    def text(self) -> str:
        """Return the angle and its share in words."""
        return f"{self.hits:,} of {self.of:,} samples ({100 * self.share:.2g} %) at exactly {self.axis} = {self.angle:.3f}°"


def worst_region(counts: NDArray, expected: Array, error: Array, theta: Array, phi: Array) -> Region:
    """Return the band in theta, band in phi or patch whose count is least likely.

    The measure is Poisson's log likelihood ratio o ln(o/e) - (o - e), with e moved toward o by the quadrature's error.
    """
    best, found = -1.0, Region((theta[0], theta[-1]), (phi[0], phi[-1]), counts.sum(), expected.sum())
    for axis, edges in ((1, theta), (0, phi)):
        o, e, d = (x.sum(axis=axis) for x in (counts, expected, error))
        gain, i, j = _best_interval(o, e, d)
        if gain > best:
            best, band = gain, (float(edges[i]), float(edges[j]))
            across, around = (band, (phi[0], phi[-1])) if axis else ((theta[0], theta[-1]), band)
            found = Region(across, around, float(o[i:j].sum()), float(e[i:j].sum()))
    rows, columns = _groups(expected.sum(axis=1)), _groups(expected.sum(axis=0))
    o, e, d = (np.add.reduceat(np.add.reduceat(x, rows, axis=0), columns, axis=1) for x in (counts, expected, error))
    r, c = np.append(rows, len(theta) - 1), np.append(columns, len(phi) - 1)
    for i in range(len(rows)):
        for k in range(i + 1, len(rows) + 1):
            gain, a, b = _best_interval(o[i:k].sum(axis=0), e[i:k].sum(axis=0), d[i:k].sum(axis=0))
            if gain > best * 1.5 + 5:  # there are more patches than bands: one must be clearly less likely
                best = gain
                found = Region(
                    (float(theta[r[i]]), float(theta[r[k]])), (float(phi[c[a]]), float(phi[c[b]])),
                    float(o[i:k, a:b].sum()), float(e[i:k, a:b].sum()),
                )  # fmt: skip
    return found


def repeated_angles(theta: Array, phi: Array) -> list[RepeatedAngle]:
    """Return angles that too many samples share exactly: atoms of the distribution, which no density has."""
    found = []
    for name, x in (("theta_i", theta), ("phi", phi)):
        values, counts = np.unique(np.round(x / _SAME), return_counts=True)
        at = int(np.argmax(counts)) if len(counts) else 0
        if len(counts) and counts[at] >= LEAST_REPEATS and abs(values[at] * _SAME) < np.pi - 1e-3:
            near = np.abs(x - values[at] * _SAME) < 1e-3  # a narrow peak has samples nearby, an atom has not
            if counts[at] > 0.2 * near.sum():
                degrees = float(np.degrees(values[at] * _SAME)) + 0.0  # never -0
                found.append(RepeatedAngle(name, degrees, int(counts[at]), len(x)))
    return found


def _groups(expected: Array) -> NDArray[np.intp]:
    """Return the first cells of about `_PATCHES` groups of like probability."""
    share = np.cumsum(expected) / max(float(expected.sum()), 1e-300)
    return np.unique(np.searchsorted(share, np.arange(_PATCHES) / _PATCHES, side="right").clip(0, len(expected) - 1))


def _best_interval(o: Array, e: Array, d: Array) -> tuple[float, int, int]:
    """Return the gain and the ends of the run of cells with the most unlikely count."""
    so, se, sd = (np.concatenate([[0.0], np.cumsum(x)]) for x in (o, e, d))
    drawn, mean, off = (s[None, :] - s[:, None] for s in (so, se, sd))
    mean = np.where(drawn > mean, mean + off, np.maximum(mean - off, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.where(drawn > 0, drawn * np.log(drawn / np.maximum(mean, 0.5)), 0.0) - (drawn - np.maximum(mean, 0.5))
    gain = np.where(np.triu(np.ones_like(gain), 1) > 0, gain, -np.inf)
    i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return float(gain[i, j]), int(i), int(j)
