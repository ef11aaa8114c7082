"""Which known slips someone's values have: single slips first, then combinations, by what each leaves unexplained."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import PANELS, ROUGHLY, Evaluated, Formulas
from cuticle.reference.models import evaluate
from cuticle.reference.slip_table import SLIPS
from cuticle.reference.slips import DUAL, Slip
from cuticle.reference.tolerance import AVERAGED_SHARE, EXPLAINED, FURTHEST, Quantity

Array = NDArray[np.float64]
MOST_TOGETHER = 5
_BEAM = 6
_ROWS = {True: 500, False: 64}  # that hypotheses are told apart on: near field, far field
_FINAL_ROWS = {True: 100_000, False: 400}
_PROGRESS = {True: 0.999, False: 0.95}  # a further slip must bring the misfit below this share


@dataclass(frozen=True)
class Hypothesis:
    """Slips, and what they leave: the share of values outside the tolerance, the median difference, and the misfit.

    `strays`: whether any value is so far off that the slips, though they explain the others, cannot be all that is wrong.
    """

    slips: tuple[Slip, ...]
    outside: float
    median: float
    score: float
    explains: bool
    strays: bool = False

    @property
    def name(self) -> str:
        """Return the names of the slips."""
        return " + ".join(s.name for s in self.slips) or "none"


@dataclass(frozen=True)
class Search:
    """What was found: the best hypothesis, others that explain the values as well, and every single slip, best first."""

    best: Hypothesis
    alternatives: tuple[Hypothesis, ...]
    singles: tuple[Hypothesis, ...]
    rows: NDArray[np.intp]  # of the cases that were searched


def applicable(F: Formulas, quantity: Quantity, near: bool) -> list[Slip]:
    """Return the slips that these formulas and this quantity may have."""
    field = "near" if near else "far"
    kinds = {F.kind, "gaussian"} if F.back is not None else {F.kind}
    return [s for s in SLIPS if kinds.intersection(s.kinds) and s.only in ("", field) and _concerns(F, s, quantity)]


def _concerns(F: Formulas, slip: Slip, quantity: Quantity) -> bool:
    """Whether a slip can show in a quantity: factors of f do not in the density, those of the density not in f.

    A Gaussian form's density is normalised by the integral of f cos theta_i: cosines in f show in it, constants do not.
    """
    if quantity.name == "f":
        return not slip.pdf
    return slip.group not in ("pi", "average", "channels", *(("cosine",) if F.normalised else ()))


def value_of(F: Formulas, inputs: Inputs, quantity: Quantity, panels: int = PANELS) -> Array:
    """Return what formulas predict for a quantity, (n, channels)."""
    return predicted(evaluate(F, inputs, panels, density=quantity.name == "pdf"), quantity)


def predicted(e: Evaluated, quantity: Quantity) -> Array:
    """Return what is compared with a quantity, (n, channels)."""
    return e.f if quantity.name == "f" else e.pdf[:, None]


def changed(F: Formulas, slips: Sequence[Slip]) -> Formulas:
    """Return the formulas with slips; those of the fibre's lobes first, for what they make of the averages is kept."""
    return _changed(F, tuple(sorted(slips, key=lambda s: s.kinds == DUAL)))


@lru_cache(maxsize=4096)
def _changed(F: Formulas, slips: tuple[Slip, ...]) -> Formulas:
    return slips[-1].change(_changed(F, slips[:-1])) if slips else F


def search_rows(quantity: Quantity, right: Array, near: bool) -> NDArray[np.intp]:
    """Return cases to tell hypotheses apart: half of them off, half at random, repeatable."""
    off = quantity.off(right)
    some = ~np.isnan(off).all(axis=1)
    far_off = np.flatnonzero(some & (np.nan_to_num(off) > 1).any(axis=1))
    others = np.flatnonzero(some)
    rng, limit = np.random.default_rng(1), _ROWS[near]
    if len(others) <= limit:
        return others
    half = rng.permutation(far_off)[: limit // 2]
    return np.unique(np.concatenate([half, rng.permutation(others)[: limit - len(half)]]))


def search(F: Formulas, quantity: Quantity, inputs: Inputs, right: Array, progress: Callable[[float], None]) -> Search:
    """Return the slips that explain a quantity best. `right` is what it should be, of all cases."""
    rows = search_rows(quantity, right, inputs.near)
    some, few = inputs.take(rows), quantity.take(rows)
    table = applicable(F, quantity, inputs.near)

    def tried(slips: tuple[Slip, ...], panels: int = ROUGHLY) -> Hypothesis:
        return judged(slips, few, value_of(changed(F, slips), some, few, panels))

    start = judged((), few, right[rows])
    frontier, singles, alternatives, best = [start], [start], [], start
    for depth in range(MOST_TOGETHER):
        seen: dict[frozenset[str], Hypothesis] = {}
        for k, h in enumerate(frontier):
            groups = {s.group for s in h.slips}
            for slip in table:
                key = frozenset(s.name for s in (*h.slips, slip))
                if slip.group not in groups and key not in seen:
                    seen[key] = tried((*h.slips, slip))
            progress((depth + (k + 1) / len(frontier)) / MOST_TOGETHER)
        found = sorted(seen.values(), key=lambda h: h.score)
        if found and not found[0].explains:  # the rough quadrature may have hidden it
            found = sorted([tried(found[0].slips, PANELS), *found[1:]], key=lambda h: h.score)
        singles = singles if depth else found
        if not found or found[0].score > _PROGRESS[inputs.near] * best.score:
            break
        best, frontier = found[0], found[:_BEAM]
        explained = [h for h in found if h.explains]
        if explained:
            best, alternatives = explained[0], explained[1:6]
            break
    whole = rows if len(inputs) > _FINAL_ROWS[inputs.near] else np.arange(len(inputs))
    last = judged(best.slips, quantity.take(whole), value_of(changed(F, best.slips), inputs.take(whole), quantity))
    near = [h for h in alternatives if h.score < 1.5 * best.score + 0.02]
    return Search(last, tuple(near), tuple(singles), rows)


def judged(slips: tuple[Slip, ...], quantity: Quantity, value: Array) -> Hypothesis:
    """Return what slips leave, of formulas with them that predict `value`."""
    with np.errstate(all="ignore"):
        difference = np.abs(quantity.given / value - 1)
    difference = difference[np.isfinite(difference)]
    median = float(np.median(difference)) if difference.size else np.inf
    outside = quantity.outside(value)
    limit = 2 * AVERAGED_SHARE if quantity.averaged else EXPLAINED
    explains = outside <= limit and quantity.bias(value) <= 1
    return Hypothesis(slips, outside, median, quantity.score(value), explains, quantity.furthest(value) > FURTHEST)
