"""What `reference check` says where no slip of the table explains the values: no hint may be false, or of no use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cuticle.reference import check
from cuticle.reference.cases import draw
from cuticle.reference.findings import Findings
from cuticle.reference.formulas import Formulas
from cuticle.reference.models import evaluate, formulas_of
from cuticle.reference.slips import having
from planted import submission

pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
NEAR = draw("chiang", 400, 3, near=True, longitudinal="")
F = formulas_of(NEAR)
RIGHT = evaluate(F, NEAR).f


def found(f: np.ndarray) -> Findings:
    return check(submission(NEAR, f, single=True))


def with_formulas(change: Callable[[Formulas], Formulas]) -> str:
    return str(found(evaluate(change(F), NEAR).f))


@pytest.mark.slow
def test_the_lobe_that_is_off_is_named() -> None:
    def narrower(G: Formulas) -> Formulas:  # of TRT, and by no factor
        return replace(G, variances=lambda q: [v + 0.02 * (p == 2) for p, v in enumerate(G.variances(q))])

    assert "the error is in TRT" in with_formulas(narrower)


def test_a_few_values_off_blame_no_lobe() -> None:
    """Values without R are right where hardly any is off: so are those without any other lobe."""
    f = RIGHT.copy()
    f[::23] *= 1.5
    text = str(found(f))
    assert "the error is in" not in text
    assert "would help" not in text


@pytest.mark.parametrize(("limit", "words"), [
    (lambda q: having(offset=lambda q: np.where(np.abs(q.h) > 0.97, q.h / 2, q.h)), "cases that are off have |h| ≥ 0.97"),
    pytest.param(
        lambda q: having(log_i0=lambda x: F.log_i0(x) + 0.3 * (x > 100)), "the largest cos θ_i cos θ_o/v of its lobes ≥ 1",
        marks=pytest.mark.slow,
    ),
])  # fmt: skip
def test_a_limit_beyond_which_values_are_off_is_named(limit: Any, words: str) -> None:
    text = with_formulas(limit(None))
    assert words in text
    assert "grow with" not in text


def test_a_clamp_is_named() -> None:
    text = str(found(np.minimum(RIGHT, 5)))
    assert "values that are off are 5: a clamp?" in text


def test_a_channel_that_is_off_alone_is_named() -> None:
    text = str(found(RIGHT * [1.7, 1, 1]))
    assert "f_g and f_b are right: look at f_r alone" in text
    assert "f_r is 1.7 times what it should be" in text
    assert " with: " not in text  # all are off by as much; tolerances are not


def test_the_width_of_trt_and_of_what_follows_is_one_number() -> None:
    wrong = replace(F, variances=lambda q: [v * (0.6 if p > 1 else 1) for p, v in enumerate(F.variances(q))])
    assert "verdict: WRONG (f: the variance of TRT and rest × 0.6)" in str(found(evaluate(wrong, NEAR).f))


def test_cases_that_are_few_are_listed() -> None:
    f = RIGHT.copy()
    f[[5, 20, 33]] *= [[1.3], [1.9], [0.4]]
    assert "only these cases are off: 6, 21, 34" in str(found(f))


@pytest.mark.parametrize(("name", "value"), [("eta", 1.55), ("alpha", 2.0), ("beta_n", 0.3)])
@pytest.mark.slow
def test_an_input_that_is_ignored_is_named(name: str, value: float) -> None:
    fixed = replace(NEAR, columns={**NEAR.columns, name: np.full(len(NEAR), value)})
    assert f"verdict: WRONG (f: {name} of every case = {value:g})" in str(found(evaluate(F, fixed).f))


@pytest.mark.slow
def test_a_lobe_that_is_off_is_no_coarse_quadrature() -> None:
    far = draw("marschner", 60, 3, near=False, longitudinal="energy_conserving")
    G = formulas_of(far)
    wrong = replace(G, tilts=lambda q: [t + (0.03 if p == 1 else 0) for p, t in enumerate(G.tilts(q))])
    text = str(check(submission(far, evaluate(wrong, far).f, single=True)))
    assert "too coarse" not in text


@pytest.mark.slow
def test_a_number_is_found_on_top_of_a_slip_that_it_hides() -> None:
    """With the cosine put right most values are still off."""
    wrong = replace(F, scale=lambda q: 0.35 * F.scale(q), finish=lambda q, f: f * np.cos(q.theta_i))
    assert "verdict: WRONG (f: cosine-in + the scale of D × 0.35)" in str(found(evaluate(wrong, NEAR).f))
