"""Values that stand beside other cases than their own: what else is wrong with them is looked for in the right order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from cuticle.reference.cases import Inputs
from cuticle.reference.slips import Array, Slip
from cuticle.reference.tolerance import EXPLAINED, Quantity

_UNLIKE, _ALIKE = 0.5, 0.8  # rank correlation with what is right: at most, as the values stand; at least, in their order
_LEAST = 20  # values


def _slip(name: str, meaning: str, wrong: str) -> Slip:
    return Slip(name, "order", meaning, "beside case n, its value", wrong, lambda F: F, kinds=())


SHIFTED = _slip("rows-shifted", "values stand one row off: a header was counted, or a row lost", "that of case n ± 1")
REVERSED = _slip("rows-reversed", "values stand in reverse", "that of the n-th case from the end")
SORTED = _slip("rows-sorted", "values stand in another order, as of sorted cases", "that of another case")
ORDER = (SHIFTED, REVERSED, SORTED)


def in_order(quantity: Quantity, value: Array, inputs: Inputs, labels: NDArray[Any]) -> tuple[Quantity, tuple[Slip, ...]]:
    """Return the values beside their own cases, and the slip if they stood beside others; `value`: what is right."""
    if _likeness(quantity, value) > _UNLIKE:
        return quantity, ()
    moved = [(_moved(quantity, rows), slip) for slip, rows in _orders(inputs, labels)]
    likeness, found = max(((_likeness(q, value), k) for k, (q, _) in enumerate(moved)))
    if likeness > _ALIKE:
        return moved[found][0], (moved[found][1],)
    ranked = _moved(quantity, np.argsort(quantity.given[:, 0])[np.argsort(np.argsort(value[:, 0], kind="stable"))])
    return (ranked, (SORTED,)) if ranked.outside(value) <= EXPLAINED else (quantity, ())


def _moved(quantity: Quantity, rows: NDArray[np.intp]) -> Quantity:
    return replace(quantity, given=np.where(rows[:, None] < 0, np.nan, quantity.given[rows]))


def _orders(inputs: Inputs, labels: NDArray[Any]) -> Iterator[tuple[Slip, NDArray[np.intp]]]:
    """Return in which row the value of each case may stand; -1 where it is lost."""
    rows = np.arange(len(inputs))
    yield SHIFTED, np.append(rows[1:], -1)
    yield SHIFTED, rows - 1
    yield REVERSED, rows[::-1]
    for key in (*inputs.columns.values(), *inputs.sigma_a.T, labels.astype(str)):
        order = np.argsort(key, kind="stable")
        yield SORTED, np.argsort(order)
        yield SORTED, np.argsort(order[::-1])


def _likeness(quantity: Quantity, value: Array) -> float:
    """Return the rank correlation of the values with what is right; 1 of too few."""
    known = np.isfinite(quantity.given) & np.isfinite(value)
    if known.sum() < _LEAST:
        return 1.0
    with np.errstate(all="ignore"):
        found = np.corrcoef(stats.rankdata(quantity.given[known]), stats.rankdata(value[known]))[0, 1]
    return float(np.nan_to_num(found))
