"""Values below 0, which a measurement has about 0: smoothed away where the signal does not stand out of the noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WIDTHS = (1.0, 2.0, 4.0, 8.0)  # deviations of the smoothing, cells
_CLEAR = 4.0  # standard deviations of the noise above which a value stands as it is
LEAST_SHARE = 1e-3  # of the sum: less is set to 0, not smoothed


def settle_noise(f: NDArray, periodic: bool) -> tuple[float, float]:
    """Make f (viewers, theta, phi, channels) at least 0 in place, if its values below 0 are noise about 0.

    The deviation of the noise is that of the values below 0, sheet by sheet. A value that stays within four of it is
    replaced by a mean over those of its neighbours that do, too, the smallest neighbourhood in which the mean is clear of
    what noise is left in it, eight cells wide at most. What lies clear of the noise is not touched and not spread.

    Returns
    -------
    tuple
        Share of the sum (of absolute values) that is below 0 beyond what noise explains, once smoothed as wide as it goes:
        0 for noise; the noise's deviation over the largest value of its
        viewer. Both 0 where hardly anything lies below 0.
    """
    below = np.minimum(f, 0)
    whole = float(np.abs(f).sum())
    if -float(below.sum()) <= LEAST_SHARE * whole:
        np.maximum(f, 0, out=f)
        return 0.0, 0.0
    from scipy.ndimage import gaussian_filter  # where there is noise: most tables have none

    left = kept = largest = 0.0
    modes = ("nearest", "wrap" if periodic else "mirror")
    for r in range(f.shape[0]):
        # Of all channels, and of means over neighbours, since the largest value alone has the largest noise.
        top = max(
            1e-300, *(float(gaussian_filter(sheet, _WIDTHS[0], mode=modes).max()) for sheet in np.moveaxis(f[r], 2, 0))
        )
        for c in range(f.shape[3]):
            sheet = f[r, ..., c].astype(np.float64)
            negative = sheet[sheet < 0]
            if not len(negative):
                continue
            sigma = float(np.sqrt((negative**2).mean()))
            largest = max(largest, sigma / top)
            out, unclear = sheet.copy(), sheet < _CLEAR * sigma
            for width in _WIDTHS:
                share_of = gaussian_filter(unclear.astype(np.float64), width, mode=modes)
                mean = gaussian_filter(np.where(unclear, sheet, 0), width, mode=modes) / np.maximum(share_of, 1e-6)
                out[unclear] = mean[unclear]
                # Of white noise a Gaussian mean of this width keeps 1/(2 w √π).
                unclear &= mean < _CLEAR * sigma / (2 * width * np.sqrt(np.pi))
            # What noise leaves is within four of its own deviations, in each mean and in that of all that is unclear.
            smooth = gaussian_filter(sheet, _WIDTHS[-1], mode=modes)
            left -= float(np.minimum(smooth + _CLEAR * sigma / (2 * _WIDTHS[-1] * np.sqrt(np.pi)), 0).sum())
            dim = sheet[sheet < _CLEAR * sigma]
            left -= min(float(dim.sum()) + _CLEAR * sigma * float(np.sqrt(len(dim))), 0.0)
            kept += float(np.abs(smooth).sum())
            f[r, ..., c] = np.maximum(out, 0)
    return left / max(kept, 1e-300), largest
