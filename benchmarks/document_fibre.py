"""Which fibre did the draft use, and what functions run through its table for n strands?

Compares the `document` preset with the draft's table 2 (deviation of the Gaussians along phi and theta_i through the
peak, and the peak's shift), looks for a better fibre by least squares, and fits the line and the parabola of
`cuticle.fit.document.multiple` to table 3. Prints every residual. Reads table2.csv and table3.csv from
$CUTICLE_DATA/document.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit, least_squares

import cuticle

DATA = Path(os.environ.get("CUTICLE_DATA", "../shared/data")) / "document"
NAMES = ("alpha_R", "alpha_TT", "beta_R", "beta_TT", "sigma_a", "beta_N")
WINDOW = 1 / 3  # the draft matched its Gaussians to the highlight, not to the floor of backscatter around it
SIGMA_UNIT, SHIFT_UNIT = 0.05, 1.0  # a residual of 1: 0.05 rad of deviation, 1 degree of shift


def gaussian(x: np.ndarray, s: float, mu: float, sigma: float) -> np.ndarray:
    return s * np.exp(-0.5 * ((x - mu) / sigma) ** 2)


def slices(fibre: cuticle.Fibre, degrees: np.ndarray) -> np.ndarray:
    """Return sigma_V, sigma_H (radians) and the shift of the peak from -theta_r (degrees), one row a theta_r."""
    model = cuticle.DualScattering(fibre)
    theta = np.radians(np.linspace(-89.75, 89.75, 360))
    phi = np.radians(np.linspace(0.5, 359.5, 360))
    rows = []
    for t in np.radians(degrees):
        along = model.eval(theta, t, np.pi)[:, 0] * np.cos(theta)
        peak = theta[np.argmax(along)]
        near = along > WINDOW * along.max()
        _, mu, sigma_h = curve_fit(gaussian, theta[near], along[near], p0=(along.max(), peak, 0.3))[0]
        around = model.eval(peak, t, phi)[:, 0] * np.cos(peak)
        near = around > WINDOW * around.max()
        sigma_v = curve_fit(lambda x, s, w: gaussian(x, s, np.pi, w), phi[near], around[near], p0=(around.max(), 0.7))[0][1]
        rows.append((abs(sigma_v), abs(sigma_h), np.degrees(mu + t)))
    return np.array(rows)


def make(values: np.ndarray) -> cuticle.Fibre:
    return cuticle.Fibre(**dict(zip(NAMES, map(float, values), strict=True)), formulation="zinke2008")


def tell(name: str, fibre: cuticle.Fibre, degrees: np.ndarray, printed: np.ndarray) -> None:
    found = slices(fibre, degrees)
    print(f"\n{name}\ntheta_r   sigma_V ours printed   sigma_H ours printed   shift ours printed")
    for t, a, b in zip(degrees, found, printed, strict=True):
        print(f"{t:6.0f}°        {a[0]:.3f}  {b[0]:.2f}          {a[1]:.3f}  {b[1]:.2f}          {a[2]:+.2f}°  {b[2]:+.1f}°")
    rms = np.sqrt(((found - printed) ** 2).mean(axis=0))
    print(f"rms: sigma_V {rms[0]:.3f}, sigma_H {rms[1]:.3f}, shift {rms[2]:.2f}°\n")


def main() -> None:
    if not (DATA / "table2.csv").exists():
        sys.exit(f"no table2.csv in {DATA}; set CUTICLE_DATA")
    table = np.genfromtxt(DATA / "table2.csv", delimiter=",", names=True)
    degrees = table["theta_r_deg"]
    printed = np.column_stack([table["sigma_V_rad"], table["sigma_H_rad"], table["mu_shift_H_deg"]])
    units = np.array([SIGMA_UNIT, SIGMA_UNIT, SHIFT_UNIT])

    def residuals(values: np.ndarray) -> np.ndarray:
        try:
            return ((slices(make(values), degrees) - printed) / units).ravel()
        except (RuntimeError, ValueError):  # no sum of multiple scattering, or no peak: far from any fit
            return np.full(printed.size, 30.0)

    start = np.array([3.2, -1.24, 15.6, 7.7, 0.42, 4.0])
    bounds = ([-10, -5, 5, 2.5, 0.2, 1], [10, 5, 20, 12, 3, 30])
    fit = least_squares(residuals, start, diff_step=0.02, x_scale=np.abs(start), bounds=bounds)
    print("least squares:", ", ".join(f"{n} {v:.3f}" for n, v in zip(NAMES, fit.x, strict=True)))
    tell("the preset", cuticle.Fibre.preset("document"), degrees, printed)
    tell("least squares, alpha_R and beta_R at their bounds", make(fit.x), degrees, printed)

    table = np.genfromtxt(DATA / "table3.csv", delimiter=",", names=True)
    table = table[np.abs(table["theta_r_deg"]) <= 60]
    t, octave = np.radians(table["theta_r_deg"]), np.log2(table["strands"])
    ones = np.ones_like(t)
    # The table's shift has the sign of theta_r; the peak lies at -theta_r plus what it has moved back.
    shift, *_ = np.linalg.lstsq(np.column_stack([t, t * octave, ones]), np.radians(table["mu_shift_deg"]), rcond=None)
    width, *_ = np.linalg.lstsq(np.column_stack([ones, octave, t**2]), table["sigma_rad"], rcond=None)
    rms_shift = np.degrees(
        np.sqrt(np.mean((np.column_stack([t, t * octave, ones]) @ shift - np.radians(table["mu_shift_deg"])) ** 2))
    )
    rms_width = np.sqrt(np.mean((np.column_stack([ones, octave, t**2]) @ width - table["sigma_rad"]) ** 2))
    print(f"table 3: slope {shift[0]:.4f} + {shift[1]:.4f} log2 n, offset {np.degrees(shift[2]):.2f}°, rms {rms_shift:.2f}°")
    print(f"         sigma {width[0]:.4f} + {width[1]:.4f} log2 n + {width[2]:.4f} theta_r², rms {rms_width:.4f}")


if __name__ == "__main__":
    main()
