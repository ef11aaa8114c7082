"""What `sample` returns beside a direction is what `pdf` and `eval` say there, in the mean, too."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cuticle import audit
from test_audit import Hemisphere, failed

Answer = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
RGB = np.array([0.9, 0.5, 0.1])


class Coloured(Hemisphere):
    """Whose weights are colours, and which answers what `changed` makes of theta, phi, pdf and weight."""

    def __init__(self, changed: Callable[..., Answer] = lambda *answer: answer) -> None:
        self.changed = changed

    def sample(self, theta_r: float, u: np.ndarray) -> Answer:
        theta, phi, pdf, weight = super().sample(theta_r, u)
        return self.changed(theta, phi, pdf, weight[:, None] * RGB)

    def eval(self, theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return super().eval(theta_i, theta_r, phi)[:, None] * RGB


def one_in_a_thousand(x: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(x)) % 1100 == 0, 1, 0)


@pytest.mark.parametrize(
    ("changed", "verdicts"),
    [
        (lambda t, p, pdf, w: (t, p, pdf, w), set()),
        # by a share of the samples that "pdf of a sample" and "weight of a sample" let pass
        (lambda t, p, pdf, w: (t, p, pdf * 0.01 ** one_in_a_thousand(t)), {"estimate"}),
        (lambda t, p, pdf, w: (t, p, pdf, w * 100.0 ** one_in_a_thousand(t)[:, None]), {"estimate"}),
        # by less than they see
        (lambda t, p, pdf, w: (t, p, pdf * 1.01), {"estimate"}),
        (lambda t, p, pdf, w: (t, p, pdf, w * 1.01), {"estimate"}),
        # in a channel
        (lambda t, p, pdf, w: (t, p, pdf, w * [1, 1, 1.01]), {"estimate"}),
        (lambda t, p, pdf, w: (t, p, pdf, w[:, ::-1]), {"estimate", "weight of a sample", "mean weight"}),
        (lambda t, p, pdf, w: (t, p, pdf, w @ [0.2126, 0.7152, 0.0722]), set()),
    ],
)  # fmt: skip
def test_what_sample_returns_is_what_is_evaluated_there(changed: Callable[..., Answer], verdicts: set[str]) -> None:
    assert failed(audit(Coloured(changed), theta_r=[0.3, 1.0])) == verdicts


def test_an_estimate_is_compared_without_a_function_too() -> None:
    half = Hemisphere()
    wrong = audit(lambda t, u: (*half.sample(t, u)[:2], half.sample(t, u)[2] * 1.01), half.pdf, theta_r=[0.3])
    assert failed(wrong) == {"estimate"}


def test_a_function_may_work_in_place() -> None:
    half = Hemisphere()

    def pdf(theta_i: np.ndarray, theta_r: float, phi: np.ndarray) -> np.ndarray:
        return np.maximum(np.cos(theta_i, out=theta_i) * np.sin(phi, out=phi), 0) / np.pi

    assert audit(half.sample, pdf, half.eval, theta_r=[0.3]).ok
