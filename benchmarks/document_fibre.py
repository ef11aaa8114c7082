"""Which fibre did the draft use, and what line and parabola run through its table for n strands?

Compares the `document` preset with the draft's table 2 (Gaussians along phi and theta_i through the highlight), looks for a
better fibre by least squares, and fits the two forms of `fitting.closed_forms.DRAFT` for n strands to table 3. Prints every
residual. Reads the printed tables from $CUTICLE_DATA/document.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.optimize import least_squares

import cuticle
from cuticle.draft.functions import fit_form
from cuticle.draft.printed import Printed
from cuticle.draft.tables import table_2

NAMES = ("alpha_R", "alpha_TT", "beta_R", "beta_TT", "sigma_a", "beta_N")
SIGMA_UNIT, SHIFT_UNIT = 0.05, 1.0  # a residual of 1: 0.05 rad of deviation, 1 degree of shift


def slices(fibre: cuticle.Fibre, degrees: np.ndarray) -> np.ndarray:
    """Return sigma_V, sigma_H (radians) and the shift of the peak from -theta_r (degrees), one row a theta_r."""
    rows = []
    for r in table_2(cuticle.DualScattering(fibre), degrees, axis=np.pi):
        if r.vertical is None or r.horizontal is None or r.shift is None:
            raise ValueError(f"no Gaussian at theta_r {np.degrees(r.theta_r):.0f}°")
        rows.append((r.vertical.sigma, r.horizontal.sigma, np.degrees(r.shift)))
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
    tables = Printed.find()
    if tables is None:
        sys.exit("the draft's tables are not at hand; set CUTICLE_DATA")
    degrees = np.array([key[0] for key in tables.table_2])
    printed = np.array([(v[1], v[4], v[5]) for v in tables.table_2.values()])
    units = np.array([SIGMA_UNIT, SIGMA_UNIT, SHIFT_UNIT])

    def residuals(values: np.ndarray) -> np.ndarray:
        try:
            return ((slices(make(values), degrees) - printed) / units).ravel()
        except ValueError:  # no sum of multiple scattering, or no peak: far from any fit
            return np.full(printed.size, 30.0)

    start = np.array([3.2, -1.24, 15.6, 7.7, 0.42, 4.0])
    bounds = ([-10, -5, 5, 2.5, 0.2, 1], [10, 5, 20, 12, 3, 30])
    fit = least_squares(residuals, start, diff_step=0.02, x_scale=np.abs(start), bounds=bounds)
    print("least squares:", ", ".join(f"{n} {v:.3f}" for n, v in zip(NAMES, fit.x, strict=True)))
    tell("the preset", cuticle.Fibre.preset("document"), degrees, printed)
    tell("least squares", make(fit.x), degrees, printed)

    inner = [(*k, *v) for k, v in tables.table_3.items() if abs(k[1]) <= 60]
    n, theta_r, _, sigma, shift = np.array(inner).T
    for name, values, terms in (
        ("mu", np.radians(shift), (("θ", ""), ("θ", "log₂n"), ("1", ""))),
        ("sigma", sigma, (("1", ""), ("1", "log₂n"), ("θ²", ""))),
    ):
        form = fit_form(terms, np.radians(theta_r), values, n)
        assert form is not None
        print(f"table 3: {name} = {form.text()}, rms {form.rms:.4f} rad ({np.degrees(form.rms):.2f}°)")


if __name__ == "__main__":
    main()
