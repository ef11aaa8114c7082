"""Kinds of mistakes of which no list is complete, planted one by one: other orders, clamps, powers, forms of a formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from cuticle.reference import check
from cuticle.reference.cases import Inputs, draw
from cuticle.reference.findings import Findings
from cuticle.reference.formulas import Formulas, amplitudes
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.slip_table import SLIPS
from cuticle.reference.slips import having, schlick, tilted_cosine
from planted import submission

pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
NEAR = draw("chiang", 120, 4, near=True, longitudinal="")
F = formulas_of(NEAR)
RIGHT = evaluate(F, NEAR, density=True)
HALVED = next(s for s in SLIPS if s.name == "tilt-halved")


def of(f: np.ndarray) -> Findings:
    return check(submission(NEAR, f, single=True))


ORDERS: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "header counted": ("rows-shifted", lambda f: np.concatenate([f[1:], f[-1:]])),
    "row doubled": ("rows-shifted", lambda f: np.concatenate([f[:1], f[:-1]])),
    "reversed": ("rows-reversed", lambda f: f[::-1]),
    "sorted by theta_i": ("rows-sorted", lambda f: f[np.argsort(NEAR.columns["theta_i"])]),
    "sorted as text": ("rows-sorted", lambda f: f[np.argsort([str(n) for n in range(1, len(f) + 1)])]),
    "shuffled": ("rows-sorted", lambda f: np.random.default_rng(1).permutation(f)),
}


@pytest.mark.parametrize("order", ORDERS)
def test_rows_in_another_order_are_named(order: str) -> None:
    name, moved = ORDERS[order]
    found = of(moved(RIGHT.f))
    assert not found.ok
    assert found.slips == (name,)
    assert f"verdict: WRONG (f: {name})" in str(found)


def test_a_slip_is_named_of_rows_in_another_order() -> None:
    found = of(np.roll(evaluate(HALVED.change(F), NEAR).f, 1, axis=0))
    assert found.slips == ("rows-shifted", "tilt-halved")
    density = check(submission(NEAR, pdf=RIGHT.pdf[::-1], single=True))
    assert density.slips == ("rows-reversed",)


@pytest.mark.parametrize("name", ["pdf-offset-evenly", "pdf-equal-lobes"])
def test_a_density_of_lobes_at_h_is_named_in_the_far_field(name: str) -> None:
    far = draw("chiang", 40, 4, near=False, longitudinal="")
    slip = next(s for s in SLIPS if s.name == name)
    found = check(submission(far, pdf=evaluate(slip.change(formulas_of(far)), far, density=True).pdf, single=True))
    assert found.ok
    assert found.slips == (name,)


def other_inputs(**columns: Any) -> Inputs:
    return replace(NEAR, columns={**NEAR.columns, **columns})


C = NEAR.columns
INPUTS: dict[str, Inputs] = {
    "beta_m at least 0.1": other_inputs(beta_m=np.maximum(C["beta_m"], 0.1)),
    "beta_n at most 0.8": other_inputs(beta_n=np.minimum(C["beta_n"], 0.8)),
    "every beta at least 0.3": other_inputs(beta_m=np.maximum(C["beta_m"], 0.3), beta_n=np.maximum(C["beta_n"], 0.3)),
    "|h| at most 0.9": other_inputs(h=np.clip(C["h"], -0.9, 0.9)),
    "sigma_a at most 10": replace(NEAR, sigma_a=np.minimum(NEAR.sigma_a, 10)),
    "the power of beta_m × 2": other_inputs(beta_m=C["beta_m"] ** 2),
    "the power of every beta × 0.5": other_inputs(beta_m=C["beta_m"] ** 0.5, beta_n=C["beta_n"] ** 0.5),
}
FORMULAS: dict[str, Formulas] = {
    "the power of f × 0.4545": replace(F, finish=lambda q, f: F.finish(q, f) ** (1 / 2.2)),
    "the tilted cosine × 2": tilted_cosine(lambda q, cone: 2 * np.cos(cone))(F),
    "the tilt in the cosine × 0.5": tilted_cosine(lambda q, cone: np.cos((cone - q.theta_r) / 2))(F),
    "F = F_0 + (1 - F_0)(1 - cos)^4": replace(F, fresnel=partial(schlick, power=4)),
    "F = |r_s r_p| for ½ (r_s² + r_p²)": having(fresnel=lambda c, eta: np.abs(np.prod(amplitudes(c, eta), axis=0)))(F),
}


@pytest.mark.parametrize("words", [w if w in list(INPUTS)[:1] else pytest.param(w, marks=pytest.mark.slow) for w in INPUTS])
def test_an_input_that_is_changed_is_named(words: str) -> None:
    assert f"verdict: WRONG (f: {words})" in str(of(evaluate(F, INPUTS[words]).f))


@pytest.mark.parametrize("words", [pytest.param(w, marks=pytest.mark.slow) for w in FORMULAS])
def test_a_formula_of_another_kind_is_named(words: str) -> None:
    assert f"verdict: WRONG (f: {words})" in str(of(evaluate(FORMULAS[words], NEAR).f))
