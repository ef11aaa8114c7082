"""Holes in a table, filled by the harmonic function through what lies about them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def fill_holes(f: NDArray, periodic: bool) -> float:
    """Fill NaN in f (viewers, theta, phi, channels) in place, sheet by sheet; return the share that was filled.

    Each hole becomes the mean of its neighbours along theta and phi: never below the least of them, so that a table of
    values at least 0 stays one. `periodic`: whether phi closes a turn (else it is mirrored at 0 and pi).
    """
    missing = np.isnan(f)
    share = float(missing.mean())
    if not share:
        return 0.0
    for r in np.flatnonzero(missing.any(axis=(1, 2, 3))):
        left = list(range(f.shape[3]))
        while left:
            mask = missing[r][..., left[0]]
            channels = [c for c in left if (missing[r][..., c] == mask).all()]  # one system for all with the same holes
            left = [c for c in left if c not in channels]
            if mask.any():
                f[r][..., channels] = _fill(f[r][..., channels], mask, periodic)
    return share


def farthest(missing: NDArray, theta: NDArray, phi: NDArray, periodic: bool) -> NDArray[np.float64]:
    """Return for each viewer the largest angle from a hole to the nearest value, radians; 0 where there is no hole.

    `missing` has shape (viewers, theta, phi); phi is radians around the fibre, measured at the equator.
    """
    from scipy.ndimage import distance_transform_edt  # where there are holes: most tables have none

    beside = missing if periodic else missing[..., ::-1]
    wide = np.concatenate([beside, missing, beside], axis=2)
    turn = 2 * np.pi
    azimuth = np.concatenate([phi - turn, phi, phi + turn] if periodic else [-phi[::-1], phi, turn - phi[::-1]])
    spacing = [float(np.diff(theta).mean()), float(np.diff(phi).mean())]
    out = np.zeros(len(missing))
    for r in np.flatnonzero(missing.any(axis=(1, 2))):
        a, b = distance_transform_edt(wide[r], sampling=spacing, return_distances=False, return_indices=True)
        out[r] = np.hypot(theta[a] - theta[:, None], azimuth[b] - azimuth).max()
    return out


def _fill(sheet: NDArray, mask: NDArray, periodic: bool) -> NDArray:
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    rows, columns = mask.shape
    a, b = np.nonzero(mask)
    number = np.full(mask.shape, -1)
    number[a, b] = np.arange(len(a))
    count, right = np.zeros(len(a)), np.zeros((len(a), sheet.shape[2]))
    i, j = [], []
    for da, db in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        to_a, to_b = a + da, b + db
        mirrored = np.where(to_b < 0, 1, np.where(to_b >= columns, columns - 2, to_b))  # even: the same beyond an end
        to_b = to_b % columns if periodic else mirrored
        inside = (to_a >= 0) & (to_a < rows)
        own, to_a, to_b = np.flatnonzero(inside), to_a[inside], to_b[inside]
        count[own] += 1
        other = number[to_a, to_b]
        known = other < 0
        right[own[known]] += sheet[to_a[known], to_b[known]]
        i.append(own[~known])
        j.append(other[~known])
    i_, j_ = np.concatenate(i), np.concatenate(j)
    size = len(a)
    entries = np.concatenate([count, -np.ones(len(i_))])
    where = np.concatenate([np.arange(size), i_]), np.concatenate([np.arange(size), j_])
    filled = sheet.copy()
    filled[a, b] = splu(csc_matrix((entries, where), shape=(size, size))).solve(right)
    return filled
