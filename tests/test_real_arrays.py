"""Complex numbers, texts, booleans and masked arrays are refused by name wherever numbers are taken, also as answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import cuticle
from cuticle.grooms.groom import Groom

WRONG: dict[str, Callable[[Any], Any]] = {
    "complex": lambda x: np.asarray(x) + 0j,
    "text": lambda x: np.asarray(x).astype(str),
    "boolean": lambda x: np.asarray(x) > 0,
    "masked": lambda x: np.ma.masked_array(x, np.zeros(np.shape(x), bool)),
}
POINTS = np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0]])


def uniform(theta_r: Any, u: Any) -> tuple[Any, Any]:
    return np.arcsin(2 * u[..., 1] - 1), np.pi * (2 * u[..., 2] - 1)


def constant(theta_i: Any, theta_r: Any, phi: Any) -> Any:
    return np.full(np.shape(theta_i), 0.25 / np.pi)


def numbers_only(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *a: function(*map(float, a))  # fails for arrays


class Model:
    def __init__(self, wrong: Callable[[Any], Any]) -> None:
        self.wrong = wrong

    def eval(self, theta_i: Any, theta_r: Any, phi: Any) -> Any:
        shape = np.broadcast_shapes(np.shape(theta_i), np.shape(theta_r), np.shape(phi))
        return self.wrong(np.full((*shape, 1), 0.05))


TAKES: dict[str, tuple[str, Callable[[Callable[[Any], Any]], Any]]] = {
    "points": ("points", lambda w: Groom(w(POINTS), [0, 3], 0.1)),
    "offsets": ("offsets", lambda w: Groom(POINTS, w([0, 3]), 0.1)),
    "radius": ("radius", lambda w: Groom(POINTS, [0, 3], w([0.1, 0.1, 0.1]))),
    "bend": ("bend", lambda w: Groom(POINTS, [0, 3], 0.1, w(np.zeros((1, 2, 4))))),
    "sample": ("what sample", lambda w: audit(lambda *a: [w(x) for x in uniform(*a)], constant)),
    "pdf": ("what pdf", lambda w: audit(uniform, lambda *a: w(constant(*a)))),
    "eval": ("what eval", lambda w: audit(uniform, constant, lambda *a: w(constant(*a)))),
    "callable": ("what .* returns", lambda w: cuticle.from_callable(lambda *a: w(constant(*a)))),
    "callable of numbers": ("what .* returns", lambda w: cuticle.from_callable(numbers_only(lambda *a: w([0.05])))),
    "model": ("what model.eval", lambda w: cuticle.tabulate(Model(w), 0.1)),
}


def audit(*functions: Any) -> Any:
    return cuticle.audit(*functions, samples=10_000, theta_r=[0.2])


@pytest.mark.parametrize("kind", WRONG)
@pytest.mark.parametrize("place", TAKES)
def test_what_is_no_real_number_is_refused_by_name(place: str, kind: str) -> None:
    name, take = TAKES[place]
    with pytest.raises(TypeError, match=rf"{name}.* must be an array of numbers, got ") as refused:
        take(WRONG[kind])
    assert "\n" not in str(refused.value)


def test_offsets_with_fractions_are_refused() -> None:
    with pytest.raises(TypeError, match="offsets must be whole numbers"):
        Groom(POINTS, [0.0, 3.0], 0.1)


def test_real_answers_are_taken() -> None:
    assert audit(uniform, constant, constant).ok
    assert cuticle.tabulate(Model(np.asarray), 0.1).values.min() >= 0


def test_single_precision_reaches_the_ends_of_a_range() -> None:
    pole = np.array([np.pi / 2], np.float32)  # 4e-8 beyond
    model = cuticle.Marschner(cuticle.Fibre.preset("brown"))
    for theta_i, theta_r in ((pole, np.array([0.1])), (np.array([0.1]), pole), (-pole, pole)):
        f = model.eval(theta_i, theta_r, np.array([1.0]))
        assert np.all(np.isfinite(f) & (f >= 0))
    assert cuticle.Chiang(beta_m=np.float32(0.01), sigma_a=1).beta_m == 0.01
    chiang = cuticle.family("chiang")
    pdf = [
        chiang.pdf(0.1, 0.2, 0.3, eta=eta, beta_m=m, sigma_a=1.0)
        for eta, m in ((np.float32(1.05), np.float32([0.05])), (1.05, [0.05]))
    ]
    assert np.allclose(*pdf, rtol=1e-6)
    with pytest.raises(ValueError, match="eta must lie in .1.05, 3., got 1.0499"):
        chiang.pdf(0.1, 0.2, 0.3, eta=np.float32(1.0499), sigma_a=1.0)
