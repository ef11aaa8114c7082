"""Which values are off, and where: channels, lobes, and limits of the inputs beyond which they are."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from cuticle.reference.cases import Inputs
from cuticle.reference.formulas import Evaluated, Formulas, arguments
from cuticle.reference.search import predicted
from cuticle.reference.tolerance import EXPLAINED, Quantity

Array = NDArray[np.float64]
_COARSE_AT_MOST = 0.5  # ln of what a coarse quadrature is off by, for three values in four
_MANY = 0.25  # of a lobe's own values: with fewer off, it is not the lobe that is wrong
_TOLD_APART = 0.8  # by a limit
_SPREAD = 0.1  # of ln of the differences, from which they are not all as large
_PRESENT = 0.2  # a lobe's share from which it counts among those that make a value
_WITHOUT = 1e-5  # a lobe's share below which a value does without it
_COARSENESS = (
    "the differences have both signs and almost no mean: a quadrature over h, or a table, that is too coarse looks so"
)


def which_are_off(F: Formulas, quantity: Quantity, e: Evaluated) -> tuple[str, ...]:
    """Say which channels and lobes are off, and what the values that are have in common."""
    value = predicted(e, quantity)
    off = quantity.off(value)
    found = (*_channels(quantity, value, off), *_lobes(F, quantity, e, off))
    coarse = quantity.averaged and _both_signs(quantity, value, _shares(quantity, e))
    return (*found, _COARSENESS) if coarse else found


def where_they_lie(F: Formulas, quantity: Quantity, inputs: Inputs, e: Evaluated) -> tuple[str, ...]:
    """Say beyond what limit of an input the values are off, and all others right; else what the differences grow with."""
    value = predicted(e, quantity)
    off = quantity.off(value)
    known = np.asarray(~np.isnan(off).all(axis=1), bool)
    wrong = np.asarray(known & (np.nan_to_num(off) > 1).any(axis=1), bool)
    right = known & ~wrong
    every = _measures(F, inputs, _shares(quantity, e).mean(axis=2))
    if wrong.sum() >= 5 and right.sum() >= 20 and (told := _limits(every, known, wrong, "that are off", "are off")):
        return told
    if wrong.sum() < 20:
        return ()
    with np.errstate(all="ignore"):  # not in tolerances: these grow with some inputs, too
        share = np.abs(quantity.given - value) / (np.abs(value) + quantity.mean)
        size = np.log(np.max(np.where(np.isfinite(share) & (off > 1), share, 0), axis=1))
    if np.ptp(np.quantile(size[wrong], (0.1, 0.9))) < _SPREAD:  # all are off by as much
        return ()
    rank = {n: float(stats.spearmanr(x[wrong], size[wrong]).statistic) for n, x in every.items() if np.ptp(x[wrong]) > 0}
    top = sorted((n for n in rank if abs(rank[n]) > 0.25), key=lambda n: -abs(rank[n]))[:4]
    kinds = {"grow": [n for n in top if rank[n] > 0], "shrink": [n for n in top if rank[n] < 0]}
    words = {how: ", ".join(f"{n} (rank correlation {rank[n]:+.2f})" for n in names) for how, names in kinds.items()}
    return tuple(f"the differences {how} with: {words[how]}" for how in kinds if kinds[how])


def where_none_are(
    F: Formulas, inputs: Inputs, quantity: Quantity, e: Evaluated, none: NDArray[np.bool_]
) -> tuple[str, ...]:
    """Say beyond what limit of an input cases have no number, and all others have one."""
    if none.sum() < 3 or (~none).sum() < 20:
        return ()
    every = _measures(F, inputs, _shares(quantity, e).mean(axis=2))
    return _limits(every, np.ones_like(none), none, "without a number", "have none")


def _limits(
    every: dict[str, Array], known: NDArray[np.bool_], wrong: NDArray[np.bool_], which: str, what: str
) -> tuple[str, ...]:
    """Return the limits that tell cases `which` from those that are known, in words; none where none does."""
    limits = [_limit(name, x[known], wrong[known], which, what) for name, x in every.items()]
    best = max(limits)
    if best.both <= _TOLD_APART:
        return ()
    return tuple(dict.fromkeys(x.words for x in sorted(limits, reverse=True)[:2] if x.both > best.both - 0.02))


class _Limit(NamedTuple):
    """How well a limit tells values that are off from the others: the harmonic mean of recall and precision; in words."""

    both: float
    words: str


def _limit(name: str, x: Array, wrong: NDArray[np.bool_], which: str, what: str) -> _Limit:
    """Return the limit of a measure that tells best which cases are wrong: those above it, or those below."""
    best = _Limit(0.0, "")
    for sign, relation in ((1, "≥"), (-1, "≤")):
        order = np.argsort(-sign * x)
        hits, count = np.cumsum(wrong[order]), np.arange(1, len(x) + 1)
        both = 2 * hits / (count + wrong.sum())
        k = int(np.argmax(both))
        words = (
            f"{hits[k]} of the {wrong.sum()} cases {which} have {name} {relation} {x[order[k]]:.4g}, and of such cases"
            f" {100 * hits[k] / count[k]:.0f} % {what}"
        )
        if count[k] < 0.7 * len(x):
            best = max(best, _Limit(float(both[k]), words))
    return best


def _measures(F: Formulas, inputs: Inputs, share: Array) -> dict[str, Array]:
    """Inputs, their sizes, and what branches of M are taken by, of the lobes that make a value."""
    columns: dict[str, Array] = {**inputs.columns, "sigma_a": inputs.sigma_a.mean(axis=1)}
    every: dict[str, Array] = {}
    for name, x in columns.items():
        every[name] = x
        if x.min() < 0:
            every[f"|{name}|"] = np.abs(x)
    if F.normalised:
        q = arguments(inputs, 1)
        widths = np.hstack([np.broadcast_to(v, (len(inputs), 1)) for v in F.variances(q)])
        cones = np.hstack([np.broadcast_to(tilt - q.theta_r, (len(inputs), 1)) for tilt in F.tilts(q)])
        x = np.abs(np.cos(q.theta_i) * np.cos(cones)) / widths
        for name, values in (("v", widths), ("cos θ_i cos θ_o/v", x)):
            every[f"the least {name} of its lobes"] = np.where(share > _PRESENT, values, np.inf).min(axis=1)
            every[f"the largest {name} of its lobes"] = np.where(share > _PRESENT, values, 0).max(axis=1)
    return every


def _channels(quantity: Quantity, value: Array, off: Array) -> tuple[str, ...]:
    """Say which channels are right, where others are not; and what value or factor those that are off have in common."""
    known = ~np.isnan(off)
    wrong = np.nan_to_num(off) > 1
    names = [f"{quantity.name}_{c}" for c in "rgb"] if off.shape[1] == 3 else [quantity.name]
    whole = known.sum(axis=0) == known.any(axis=1).sum()  # a number in each case
    right = [n for c, n in enumerate(names) if whole[c] and not wrong[:, c].any()]
    found = []
    if right and wrong.any():
        other = [n for c, n in enumerate(names) if wrong[:, c].any()]
        found.append(f"{' and '.join(right)} {'are' if len(right) > 1 else 'is'} right: look at {' and '.join(other)} alone")
        for c in (names.index(n) for n in other):
            with np.errstate(all="ignore"):
                k = float(np.nanmedian(np.where(wrong[:, c], quantity.given[:, c] / value[:, c], np.nan)))
            if quantity.outside(np.where(np.arange(off.shape[1]) == c, k * value, quantity.given)) <= EXPLAINED:
                found.append(f"{names[c]} is {k:.4g} times what it should be")
    values, counts = np.unique(quantity.given[wrong], return_counts=True)
    if counts.size and counts.max() >= max(5, 0.8 * wrong.sum()):
        found.append(f"{counts.max()} of {wrong.sum()} values that are off are {values[counts.argmax()]:g}: a clamp?")
    return tuple(found)


def _lobes(F: Formulas, quantity: Quantity, e: Evaluated, off: Array) -> tuple[str, ...]:
    """Say which lobes are wrong: the fewest without which the values are right. Then what each lobe is off by."""
    share = _shares(quantity, e)
    found, names = [], range(len(F.names))
    for size in (1, 2):
        right = {some: n for some in combinations(names, size) if (n := _right_without(share, off, some))}
        if len(right) == 1:  # of more, each would do
            some, count = right.popitem()
            which = " or ".join(F.names[p] for p in some)
            found = [f"the error is in {which}: {count} values without it are right"]
        if right:
            break
    value = predicted(e, quantity)
    for p, lobe in enumerate(F.names):
        mine = share[:, p] > 0.99
        known = off[mine & ~np.isnan(off)]
        if known.size < 5:
            continue
        with np.errstate(all="ignore"):
            middle = np.nanmedian((quantity.given / value)[mine])
        by = f"by {100 * (middle - 1):+.2g} %" if abs(middle - 1) < 0.995 else f"× {middle:.3g}"
        by = "not" if abs(middle - 1) < 1e-5 else by
        found.append(
            f"{lobe}: of {known.size} values that are its own, {100 * (known > 1).mean():.0f} % are off, in the median {by}"
        )
    return tuple(found)


def _right_without(share: Array, off: Array, some: tuple[int, ...]) -> int:
    """Return how many values do without some of the lobes, if these are right and many of the lobes' own are not; else 0."""
    rest = [p for p in range(share.shape[1]) if p not in some]
    seen = share[:, some].sum(axis=1) < _WITHOUT
    groups = [off[seen], *(off[seen & (share[:, p] > 0.5)] for p in rest), *(off[share[:, p] > 0.999] for p in rest)]
    groups = [g[~np.isnan(g)] for g in groups]
    right = groups[0].size >= 20 and all(g.size >= 5 and (g > 1).mean() < 0.01 for g in groups)
    own = off[(share[:, some].sum(axis=1) > 0.99) & ~np.isnan(off)]
    return groups[0].size if right and own.size and (own > 1).mean() > _MANY else 0


def _shares(quantity: Quantity, e: Evaluated) -> Array:
    """Return each lobe's share of the values, (n, lobes, channels)."""
    share = e.parts / np.maximum(e.parts.sum(axis=1, keepdims=True), 1e-300)
    return np.asarray(share.mean(axis=2, keepdims=True) if quantity.name == "pdf" else share)


def _both_signs(quantity: Quantity, value: Array, share: Array) -> bool:
    """Whether differences have both signs and almost no mean, of all values and of those that each lobe has to itself."""
    with np.errstate(all="ignore"):
        ratio = np.log(quantity.given / value)
    known, size = np.isfinite(ratio), np.abs(ratio)
    if known.sum() < 20 or not 0.25 < (ratio[known] > 0).mean() < 0.75:
        return False
    own = [known & (share[:, p] > 0.9) for p in range(share.shape[1])]
    if any(abs(np.median(ratio[x])) > 0.3 * size[known].mean() for x in own if x.sum() >= 5):
        return False
    return bool(
        abs(np.median(ratio[known])) < 0.15 * size[known].mean() and np.quantile(size[known], 0.75) < _COARSE_AT_MOST
    )
