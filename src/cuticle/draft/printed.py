"""The draft's printed tables, where they are at hand. The package does not hold them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cuticle._support.files import read_text, reading
from cuticle.draft.functions import Choice, find_form, fit_form
from cuticle.draft.tables import USED
from cuticle.fitting.closed_forms import ClosedForm

_COLUMNS = {
    "table1.csv": ("phi_r_deg", "theta_r_deg", "peak_theta_i_deg", "peak_phi_i_deg"),
    "table2.csv": ("theta_r_deg", "s_V", "sigma_V_rad", "mu_shift_V_deg", "s_H", "sigma_H_rad", "mu_shift_H_deg"),
    "table3.csv": ("strands", "theta_r_deg", "s", "sigma_rad", "mu_shift_deg"),
}


@dataclass(frozen=True)
class Printed:
    """Rows of the printed tables: keys in degrees (and strands), values in degrees and radians as printed.

    Attributes
    ----------
    table_1
        (phi_r, theta_r) -> (theta_i, phi_i) of the peak, degrees.
    table_2
        theta_r -> (s_V, sigma_V, mu-shift V, s_H, sigma_H, mu-shift H).
    table_3
        (strands, theta_r) -> (s, sigma, mu-shift).
    """

    table_1: dict[tuple[float, ...], tuple[float, ...]]
    table_2: dict[tuple[float, ...], tuple[float, ...]]
    table_3: dict[tuple[float, ...], tuple[float, ...]]

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Printed:
        """Read table1.csv, table2.csv and table3.csv.

        Raises
        ------
        ValueError
            A file is missing, or lacks a column, or holds what is no number.
        """
        tables = []
        for (name, columns), keys in zip(_COLUMNS.items(), (2, 1, 2), strict=True):
            rows = _read(Path(folder) / name, columns)
            tables.append({tuple(map(float, r[:keys])): tuple(map(float, r[keys:])) for r in rows})
        return cls(*tables)

    @classmethod
    def find(cls) -> Printed | None:
        """Read them from $CUTICLE_DATA/document, or from ../shared/data/document beside a checkout; None if absent."""
        folder = Path(os.environ.get("CUTICLE_DATA", "../shared/data")) / "document"
        return cls.load(folder) if (folder / "table1.csv").is_file() else None

    def draft_forms(self) -> dict[str, ClosedForm]:
        """Return the least squares of the draft's own shapes through table 2: a line for mu_H, a quartic for sigma_V."""
        rows = np.array([(*k, *v) for k, v in self.table_2.items()])
        t = np.radians(rows[:, 0])
        line = fit_form([("θ", ""), ("1", "")], t, np.radians(rows[:, 6]))
        quartic = fit_form([("θ⁴", ""), ("1", "")], t, rows[:, 2])
        if line is None or quartic is None:
            raise ValueError("printed tables: table 2 has too few rows for a line and a quartic")
        return {"mu_H": line, "sigma_V": quartic}

    def choices(self) -> dict[str, Choice]:
        """Return the functions that the program finds from the printed numbers alone."""
        two = np.array([(*k, *v) for k, v in self.table_2.items() if abs(k[0]) <= USED])
        three = np.array([(*k, *v) for k, v in self.table_3.items() if abs(k[1]) <= USED])
        t2, t3, n = np.radians(two[:, 0]), np.radians(three[:, 1]), three[:, 0]
        return {
            "sigma_V": find_form(t2, two[:, 2], "even"),
            "mu_H": find_form(t2, np.radians(two[:, 6]), "odd"),
            "sigma": find_form(t3, three[:, 3], "even", strands=n),
            "mu": find_form(t3, np.radians(three[:, 4]), "odd", strands=n),
        }


def _read(path: Path, columns: tuple[str, ...]) -> NDArray[np.float64]:
    if not path.is_file():
        raise ValueError(f"printed tables: {path} is missing; the folder must hold {', '.join(_COLUMNS)}")
    with reading(path, "printed table"):
        lines = read_text(path, "printed table").splitlines()
        header = tuple(lines[0].strip().split(",")) if lines else ()
        rows = np.loadtxt(lines[1:], delimiter=",", ndmin=2)
    if header != columns or rows.shape[1] != len(columns) or not np.isfinite(rows).all():
        raise ValueError(f"printed tables: {path} must have the columns {', '.join(columns)}, all numbers")
    return rows
