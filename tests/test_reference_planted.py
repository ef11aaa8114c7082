"""Slips planted in another implementation, the C++ core, by inputs and factors: each is named, alone and together.

`test_reference.py` plants every slip by the reference's own formulas; these share none with it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import cuticle
from cuticle.reference import Submission, check
from cuticle.reference.cases import ANGLES, Inputs, draw

pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
Row = dict[str, float]
Change = Callable[[Row], Row]
Factor = Callable[[Row], float]


def scaled(factor: float, *names: str) -> Change:
    """Inputs whose name begins so, times a factor."""
    return lambda row: {k: factor * v if k.startswith(names) else v for k, v in row.items()}


def one(*names: str) -> Change:
    return lambda row: row | dict.fromkeys(names, 1.0)


INPUTS: dict[str, Change] = {
    "tilt-sign": scaled(-1, "alpha"),
    "tilt-halved": scaled(0.5, "alpha"),
    "tilt-missing": scaled(0, "alpha"),
    "path-per-diameter": scaled(0.5, "sigma_a"),
    "path-doubled": scaled(2, "sigma_a"),
    "phi-sign": scaled(-1, "h"),
    "density-missing": one("d_f"),
    "density-behind-missing": one("d_b"),
}
FACTORS: dict[str, Factor] = {
    "over-pi": lambda row: 1 / np.pi,
    "cosine-in": lambda row: np.cos(row["theta_i"]),
    "cosine-out-twice": lambda row: 1 / np.cos(row["theta_i"]),
    "cosine-viewer-in": lambda row: np.cos(row["theta_r"]),
}


def hair(row: Row) -> cuticle.Chiang:
    names = ("beta_m", "beta_n", "alpha", "eta")
    return cuticle.Chiang(**{k: row[k] for k in names}, sigma_a=tuple(row[f"sigma_a_{c}"] for c in "rgb"))


def core(model: str, longitudinal: str, row: Row) -> np.ndarray:
    """f of the core's, in double precision."""
    sigma_a = tuple(row[f"sigma_a_{c}"] for c in "rgb")
    fibre = {k: v for k, v in row.items() if k[:4] in ("alph", "beta", "eta")}
    angles = [row[k] for k in ANGLES]
    if model == "chiang":
        return (hair(row).near(row["h"]) if "h" in row else hair(row)).eval(*angles)
    if model == "marschner":
        return cuticle.Marschner(cuticle.Fibre(**fibre, sigma_a=sigma_a), longitudinal).eval(*angles)
    among: Any = cuticle.Fibre(**fibre, sigma_a=sigma_a, d_f=row["d_f"], d_b=row["d_b"], formulation="zinke2008")
    return cuticle.DualScattering(among).with_strands(row["strands"]).eval(*angles)


@cache
def cases(model: str, near: bool, longitudinal: str, count: int) -> Inputs:
    return draw(model, count, 5, near=near, longitudinal=longitudinal)


def submitted(inputs: Inputs, slips: tuple[str, ...] = ()) -> Submission:
    f = []
    for i in range(len(inputs)):
        row = given = inputs.row(i)
        for slip in slips:
            row = INPUTS.get(slip, dict)(row)
        factor = np.prod([FACTORS[s](given) for s in slips if s in FACTORS])
        f.append(factor * core(inputs.model, inputs.longitudinal, row))
    numbers = np.arange(1, len(inputs) + 1)
    return Submission("values", inputs, np.array(f), np.full(len(inputs), np.nan), False, numbers)


MODELS = {
    "near": ("chiang", True, "", 160),
    "far": ("chiang", False, "", 24),
    "conserving": ("marschner", False, "energy_conserving", 24),
    "gaussian": ("marschner", False, "gaussian", 24),
    "dual scattering": ("dual_scattering", False, "", 48),
}
TOGETHER: tuple[tuple[str, ...], ...] = (
    (), ("tilt-sign",), ("cosine-in",), ("tilt-sign", "over-pi"), ("path-per-diameter", "cosine-out-twice")
)  # fmt: skip
PLANTED: dict[str, tuple[tuple[str, ...], ...]] = {
    "near": (
        *TOGETHER, ("path-doubled",), ("phi-sign",), ("cosine-viewer-in", "tilt-halved"),
        ("over-pi", "path-doubled", "tilt-missing"), ("tilt-halved", "path-per-diameter", "cosine-out-twice"),
    ),
    "far": TOGETHER,
    "conserving": TOGETHER,
    "gaussian": TOGETHER,
    "dual scattering": (
        (), ("density-behind-missing",), ("density-missing",), ("cosine-in", "density-missing"),
        ("density-missing", "density-behind-missing"),
    ),
}  # fmt: skip


@pytest.mark.parametrize(("model", "slips"), [
    pytest.param(
        model, slips, marks=() if model == "near" else pytest.mark.slow, id=f"{model}: {' + '.join(slips) or 'none'}"
    )
    for model, sets in PLANTED.items() for slips in sets
])  # fmt: skip
def test_what_is_planted_in_the_core_is_named(model: str, slips: tuple[str, ...]) -> None:
    found = check(submitted(cases(*MODELS[model]), slips))
    assert found.ok == (not slips)
    assert set(found.slips) == set(slips)


@pytest.mark.parametrize("slip", ["", "pdf-over-pi", "pdf-per-angle", "pdf-no-cosine"])
def test_what_is_planted_in_the_cores_density_is_named(slip: str) -> None:
    inputs, p = cases(*MODELS["near"]), []
    for i in range(len(inputs)):
        row = inputs.row(i)
        cosine = np.cos(row["theta_i"])
        factor = {"": 1, "pdf-over-pi": 1 / np.pi, "pdf-per-angle": cosine, "pdf-no-cosine": 1 / cosine}[slip]
        p.append(factor * hair(row).near(row["h"]).pdf(*(row[k] for k in ANGLES)))
    numbers = np.arange(1, len(inputs) + 1)
    found = check(Submission("values", inputs, np.full((len(inputs), 3), np.nan), np.array(p), False, numbers))
    assert found.ok == (not slip)
    assert found.slips == ((slip,) if slip else ())
