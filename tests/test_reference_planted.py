"""Slips planted in another implementation, the C++ core, by inputs and factors: each is named, alone and together.

`test_reference.py` plants every slip by the reference's own formulas; these share none with it.
"""

from __future__ import annotations

from functools import cache

import pytest

from cuticle.reference import check
from cuticle.reference.cases import Inputs, draw
from planted import planted

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
        ("density-missing", "density-behind-missing"),
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


@pytest.mark.parametrize("slips", [(), ("pdf-over-pi",), ("pdf-per-angle",), ("pdf-no-cosine",)], ids=str)
def test_what_is_planted_in_the_cores_density_is_named(slips: tuple[str, ...]) -> None:
    found = check(planted(cases("near"), slips, density=True))
    assert found.ok == (not slips)
    assert found.slips == slips
