"""Slips planted in another implementation, the C++ core, by inputs and factors: each is named, alone and together.

`test_reference.py` plants every slip by the reference's own formulas; these share none with it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cuticle.reference import check
from cuticle.reference.balls import working_precision
from cuticle.reference.cases import Inputs, draw
from cuticle.reference.making import values_of
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.slip_table import SLIPS
from planted import planted, submission

pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
MODELS = {  # model, longitudinal function, and number of cases
    "near": ("chiang", "", 160),
    "far": ("chiang", "", 24),
    "conserving": ("marschner", "energy_conserving", 24),
    "gaussian": ("marschner", "gaussian", 24),
    "dual scattering": ("dual_scattering", "", 48),
}
TOGETHER: tuple[tuple[str, ...], ...] = (
    (), ("tilt-sign",), ("cosine-in",), ("tilt-sign", "over-pi"), ("path-per-diameter", "cosine-out-twice")
)  # fmt: skip
PLANTED: dict[str, tuple[tuple[str, ...], ...]] = {
    "near": (
        *TOGETHER[1:], ("path-doubled",), ("phi-sign",), ("cosine-viewer-in", "tilt-halved"),
        ("over-pi", "path-doubled", "tilt-missing"), ("tilt-halved", "path-per-diameter", "cosine-out-twice"),
    ),
    "far": TOGETHER,
    "conserving": TOGETHER,
    "gaussian": TOGETHER,
    "dual scattering": (
        (), ("density-behind-missing",), ("density-missing",), ("cosine-in", "density-missing"),
        ("density-missing", "density-behind-missing"), ("tilt-sign",), ("tilt-missing",), ("path-doubled",),
        ("path-doubled", "density-missing"),
    ),
}  # fmt: skip


@cache
def cases(name: str) -> Inputs:
    model, longitudinal, count = MODELS[name]
    return draw(model, count, 5, near=name == "near", longitudinal=longitudinal)


@pytest.mark.parametrize(("name", "slips"), [
    pytest.param(name, slips, marks=() if name == "near" else pytest.mark.slow, id=f"{name}: {' + '.join(slips) or 'none'}")
    for name, sets in PLANTED.items() for slips in sets
])  # fmt: skip
def test_what_is_planted_in_the_core_is_named(name: str, slips: tuple[str, ...]) -> None:
    found = check(planted(cases(name), slips))
    assert found.ok == (not slips)
    assert set(found.slips) == set(slips)


@pytest.mark.parametrize(("name", "slips"), [
    pytest.param(name, slips, marks=() if name == "near" else pytest.mark.slow, id=f"{name}: {' + '.join(slips) or 'none'}")
    for name in ("near", "gaussian", "dual scattering")
    for slips in ((), ("pdf-over-pi",), ("pdf-per-angle",), ("pdf-no-cosine",))
])  # fmt: skip
def test_what_is_planted_in_the_cores_density_is_named(name: str, slips: tuple[str, ...]) -> None:
    """The density of Gaussian lobes is the core's f over a sum of it over directions."""
    found = check(planted(cases(name), slips, density=True))
    assert found.ok == (not slips)
    assert found.slips == slips


# Of the fibre's own lobes, by the reference's own formulas: in what strands do to light on average, too.
OF_THE_LOBES = (
    "width-of-theta-h", "path-printed", "fresnel-theta-i", "fresnel-gamma", "eta-not-bravais", "optics-theta-r",
    "tt-one-fresnel", "trt-closed", "azimuth-swapped", "deviation-is-scale",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_THE_LOBES)
def test_a_slip_of_the_lobes_is_named_among_strands(name: str) -> None:
    inputs = cases("dual scattering")
    slip = next(s for s in SLIPS if s.name == name)
    f = evaluate(slip.change(formulas_of(inputs)), inputs).f
    found = check(submission(inputs, f, single=True))
    assert not found.ok
    assert found.slips == (name,)


@pytest.mark.slow
def test_a_density_that_does_not_exist_is_told_of() -> None:
    """A fibre that absorbs next to nothing sends on more light than it gets, for Gaussian lobes gain energy."""
    dark = cases("dual scattering")
    light = replace(dark, sigma_a=np.where(np.arange(len(dark))[:, None] < 8, 0.01, dark.sigma_a))
    right = evaluate(formulas_of(light), light, density=True)
    found = check(submission(light, pdf=np.nan_to_num(right.pdf, nan=1.0), single=True))
    assert "8 densities are not checked: f has no integral over directions in case 1, 2, 3, 4, 5 …" in found.notes
    assert found.ok
    with working_precision():
        assert values_of(light.take([0]), 0, right.around[0].tolist(), density=True).pdf() is None
