"""Where to look when no known slip explains the values: what one number, exponent or factor would have to be instead."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle.reference.among_strands import BACK_TIMES
from cuticle.reference.cases import ANGLES, LIMITS, PARAMETERS, Inputs
from cuticle.reference.formulas import ROUGHLY, Evaluated, Formulas
from cuticle.reference.models import evaluate
from cuticle.reference.search import predicted, value_of
from cuticle.reference.slips import attenuation_by, tilted_cosine
from cuticle.reference.tolerance import EXPLAINED, Quantity
from cuticle.reference.variants import ROOT, SCALE, scale_of, variances_of, variants
from cuticle.reference.where_off import where_they_lie, which_are_off

Array = NDArray[np.float64]
_GRID = np.unique(np.concatenate([2.0 ** np.linspace(-3.5, 3.5, 29), -(2.0 ** np.linspace(-2, 2, 9)), [0.0]]))
_COARSE = np.unique(np.concatenate([2.0 ** np.linspace(-3, 3, 13), [-1.0, 0.0]]))
_PI, _ROOT = math.pi, math.sqrt
_CONSTANTS = {
    "π": _PI, "1/π": 1 / _PI, "2π": 2 * _PI, "1/(2π)": 0.5 / _PI, "4π": 4 * _PI, "1/(4π)": 0.25 / _PI, "π²": _PI**2,
    "1/π²": _PI**-2, "π/2": _PI / 2, "2/π": 2 / _PI, "√2": _ROOT(2), "1/√2": _ROOT(0.5), "√3": _ROOT(3),
    "√π": _ROOT(_PI), "√(π/8)": _ROOT(_PI / 8), "√(8/π)": _ROOT(8 / _PI), "π/√3": _PI / _ROOT(3), "√3/π": _ROOT(3) / _PI,
    "√(2π)": _ROOT(2 * _PI), "π/180": _PI / 180, "180/π": 180 / _PI, "1/3": 1 / 3, "2/3": 2 / 3,
    "64/63": 64 / 63, "63/64": 63 / 64,
    "ln 2": math.log(2), "log2 e": 1 / math.log(2), "ln 10": math.log(10),
}  # fmt: skip
_FAR_ROWS = 40
_POSITIVE = (  # no other number has a meaning
    "the variance", "every variance", "the scale", "the tilted cosine", "the power", "η′", "eta", "beta", "sigma_a",
)  # fmt: skip
_HELPS = 0.9  # of the values off: what a change must leave at most to be named
_NAMES = tuple(dict.fromkeys(name for names in PARAMETERS.values() for name in names))
_WIDTHS = tuple(name for name in _NAMES if name.startswith("beta"))
# What someone's code may take for a constant, or clamp, before a number; which inputs that is, and what is made of them.
_OF_INPUTS: dict[str, tuple[tuple[str, ...], Any]] = {
    **{f"{name} of every case =": ((name,), lambda x, k: 0 * x + k) for name in _NAMES},
    **{f"{name} at least": ((name,), np.maximum) for name in (*_WIDTHS, "sigma_a")},
    **{f"{name} at most": ((name,), np.minimum) for name in (*_WIDTHS, "sigma_a")},
    "every beta at least": (_WIDTHS, np.maximum),
    "|h| at most": (("h",), lambda x, k: np.clip(x, -k, k)),
}  # fmt: skip
Change = tuple[Formulas, Inputs]


@dataclass(frozen=True)
class Clue:
    """One thing that, if it were otherwise, would bring the values nearer: in words, and what it leaves."""

    words: str
    outside: float  # share of the values outside the tolerance
    score: float


@dataclass(frozen=True)
class Leads:
    """Where to look: changes that would help, best first; channels and lobes that are off; where among the inputs."""

    clues: tuple[Clue, ...]
    lobes: tuple[str, ...]
    inputs: tuple[str, ...]

    @property
    def explain(self) -> bool:
        """Whether the first change explains the values."""
        return bool(self.clues) and self.clues[0].outside <= EXPLAINED


def leads(F: Formulas, quantity: Quantity, inputs: Inputs, progress: Callable[[float], None]) -> Leads:
    """Return where to look, for formulas that do not explain the quantity."""
    if not inputs.near and len(inputs) > _FAR_ROWS:
        few = np.linspace(0, len(inputs) - 1, _FAR_ROWS).astype(int)
        quantity, inputs = quantity.take(few), inputs.take(few)
    e = evaluate(F, inputs, ROUGHLY, density=quantity.name == "pdf")
    before = quantity.score(predicted(e, quantity))
    tried = [*_powers(F, quantity, inputs, e)]
    if quantity.name == "f":
        tried += _lobe_factors(F, quantity, inputs, e)
    every = list(_one_number(F, inputs)) + list(variants(F))
    for k, (words, make) in enumerate(every):
        tried.append(_fitted(words, make, F, quantity, inputs))
        progress((k + 1) / len(every))
    outside = quantity.outside(predicted(e, quantity))
    useful = (c for c in tried if c.score < 0.8 * before and c.outside < _HELPS * outside)
    best = sorted(useful, key=lambda c: c.score)
    kept = [c for c in best if c.score <= 2 * best[0].score + 0.05][:5]
    return Leads(tuple(kept), which_are_off(F, quantity, e), where_they_lie(F, quantity, inputs, e))


def constant(k: float) -> str:
    """Return a number, and the constant that it is nearly, in words."""
    name = next((n for n, c in _CONSTANTS.items() if abs(k / c - 1) < 2e-3), "")
    digits = 4 if k == 1 or abs(k - 1) > 1e-3 else 8
    return f"{k:.{digits}g}" + (f" ({name})" if name else "")


def _fitted(words: str, make: Any, F: Formulas, quantity: Quantity, inputs: Inputs) -> Clue:
    """Return the clue of the best number for one change; `make` may instead be the formulas of a change without a number."""

    def value(k: float) -> Array:
        G, x = make(k)
        return value_of(G, x, quantity, ROUGHLY)

    if isinstance(make, Formulas):
        p = value_of(make, inputs, quantity, ROUGHLY)
        return Clue(words, quantity.outside(p), quantity.score(p))
    grid = _GRID if inputs.near else _COARSE
    if words in _OF_INPUTS:
        low, high, _ = LIMITS[_OF_INPUTS[words][0][0]]
        grid = np.linspace(0 if words.startswith("|") else max(low, -20), min(high, 20), 25 if inputs.near else 13)
    elif words.startswith(_POSITIVE):
        grid = grid[grid > 0]

    def tried(k: float) -> tuple[float, float]:
        return quantity.score(value(k)), k

    scores = [tried(float(k)) for k in grid]
    i = scores.index(min(scores))
    low, high, ratio = grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)], (math.sqrt(5) - 1) / 2
    a, b = tried(high - ratio * (high - low)), tried(low + ratio * (high - low))
    best = min(scores[i], a, b)
    for _ in range(26 if inputs.near else 10):  # golden section
        if a[0] < b[0]:
            high, b = b[1], a
            a = tried(high - ratio * (high - low))
        else:
            low, a = a[1], b
            b = tried(low + ratio * (high - low))
        best = min(best, a, b)
    p = value(best[1])
    times = "" if words in _OF_INPUTS else " ×"
    return Clue(f"{words}{times} {constant(best[1])}", quantity.outside(p), quantity.score(p))


def _one_number(F: Formulas, inputs: Inputs) -> Iterator[tuple[str, Callable[[float], Change]]]:
    if F.back is not None:  # other inputs would need other averages, which take long
        for words, change in BACK_TIMES.items():
            yield words, _back_times(F, inputs, change)
        return
    for name in inputs.columns:
        if name not in (*ANGLES, "h"):
            yield name, _input_times(F, inputs, name)
    for words, (names, of) in _OF_INPUTS.items():
        if {*names}.intersection([*inputs.columns, "sigma_a"]):
            yield words, _inputs_of(F, inputs, names, of)
    yield "sigma_a", lambda k: (F, replace(inputs, sigma_a=np.maximum(inputs.sigma_a * k, 0)))
    yield "the power of f", lambda k: (replace(F, finish=lambda q, f: F.finish(q, f) ** k), inputs)
    yield "the scale of D", lambda k: (replace(F, scale=lambda q: F.scale(q) * max(k, 1e-3)), inputs)
    lobes = range(len(F.lobes))
    yield "every variance of M", _lobes_times(F, inputs, "variances", lobes)
    yield "every tilt", _lobes_times(F, inputs, "tilts", lobes)
    if F.normalised:
        yield "the tilt in the cosine", lambda k: (tilted_cosine(lambda q, c: np.cos(_tilted(q, c, k)))(F), inputs)
        yield "the tilted cosine", lambda k: (tilted_cosine(lambda q, c: k * np.cos(c))(F), inputs)
    yield "η′", lambda k: (replace(F, bravais=lambda theta, eta: F.bravais(theta, eta) * max(k, 1e-3)), inputs)
    if F.kind == "chiang":
        yield from _coefficients(F, inputs)
        yield "the variance of TRT and rest", _lobes_times(F, inputs, "variances", (2, 3))
    for p, lobe in enumerate(F.lobes):
        yield f"the variance of {lobe}", _lobes_times(F, inputs, "variances", (p,))
        yield f"the energy of {lobe}", _energy_times(F, inputs, p)
        if p < 3:
            yield f"the tilt of {lobe}", _lobes_times(F, inputs, "tilts", (p,))


def _tilted(q: Any, cone: Array, k: float) -> Array:
    return k * (cone + q.theta_r) - q.theta_r


def _back_times(F: Formulas, inputs: Inputs, change: Callable[[Any, float], Any]) -> Callable[[float], Change]:
    return lambda k: (replace(F, back=change(F.back, k)), inputs)


def _input_times(F: Formulas, inputs: Inputs, name: str) -> Callable[[float], Change]:
    return lambda k: (F, _scaled(inputs, name, k))


def _inputs_of(F: Formulas, inputs: Inputs, names: tuple[str, ...], of: Any) -> Callable[[float], Change]:
    def change(k: float) -> Change:
        columns = {n: of(x, k) if n in names else x for n, x in inputs.columns.items()}
        return F, replace(inputs, columns=columns, sigma_a=of(inputs.sigma_a, k) if "sigma_a" in names else inputs.sigma_a)

    return change


def _lobes_times(F: Formulas, inputs: Inputs, what: str, lobes: Sequence[int]) -> Callable[[float], Change]:
    """Multiply the variances or the tilts of some lobes."""

    def change(k: float) -> Change:
        by = max(k, 1e-3) if what == "variances" else k

        def values(q: Any) -> list[Array]:
            return [x * (by if p in lobes else 1) for p, x in enumerate(getattr(F, what)(q))]

        return (replace(F, variances=values) if what == "variances" else replace(F, tilts=values)), inputs

    return change


def _energy_times(F: Formulas, inputs: Inputs, lobe: int) -> Callable[[float], Change]:
    return lambda k: (attenuation_by(lobe, lambda a, f, t: k * a)(F), inputs)


def _coefficients(F: Formulas, inputs: Inputs) -> Iterator[tuple[str, Callable[[float], Change]]]:
    """Each coefficient of Chiang's polynomials of roughness, and powers of what they are given."""
    for words, names in (("beta_m", ("beta_m",)), ("beta_n", ("beta_n",)), ("every beta", _WIDTHS)):
        yield f"the power of {words}", _inputs_of(F, inputs, names, np.power)
    for j in range(3):

        def variances(k: float, j: int = j) -> Change:
            c = tuple(x * (k if i == j else 1) for i, x in enumerate(ROOT))
            return replace(F, variances=variances_of(c, (1, 2, 20))), inputs

        def scale(k: float, j: int = j) -> Change:
            c = tuple(x * (k if i == j else 1) for i, x in enumerate(SCALE))
            s = scale_of(c, (1, 2, 22))
            return replace(F, scale=lambda q: np.maximum(s(q), 1e-3)), inputs

        yield f"the coefficient {ROOT[j]:g} of v", variances
        yield f"the coefficient {SCALE[j]:g} of s", scale


def _scaled(inputs: Inputs, name: str, k: float) -> Inputs:
    x = inputs.columns[name] * k
    low = 1.0001 if name == "eta" else 1e-3 if name.startswith("beta") else -np.inf
    return replace(inputs, columns={**inputs.columns, name: np.maximum(x, low)})


def _powers(F: Formulas, quantity: Quantity, inputs: Inputs, e: Evaluated) -> list[Clue]:
    """F times powers of the cosines and a constant."""
    ti, tr = inputs.columns["theta_i"], inputs.columns["theta_r"]
    logs = [np.log(np.cos(x)) for x in (ti, tr, (tr - ti) / 2, (tr + ti) / 2)]
    value, found = predicted(e, quantity), []
    for powers in product(range(-3, 4), repeat=4):
        if sum(map(abs, powers)) > 3:
            continue
        factor = np.exp(sum(n * x for n, x in zip(powers, logs, strict=True)))[:, None]
        with np.errstate(all="ignore"):
            ratio = quantity.given / (value * factor)
        usual = ratio[np.isfinite(ratio) & (value > 0)]
        median = float(np.median(usual)) if usual.size else 1.0
        for k in {1.0, 1.0 if abs(median - 1) < 1e-4 else median}:
            if k == 0 or (not any(powers) and k == 1):
                continue
            names = ("cos θ_i", "cos θ_r", "cos θ_d", "cos θ_h")
            words = [f"{n}^{m}" if m != 1 else n for n, m in zip(names, powers, strict=True) if m]
            words += [constant(k)] if k != 1 else []
            p = value * factor * k
            found.append(Clue(f"{quantity.name} × {' × '.join(words)}", quantity.outside(p), quantity.score(p)))
    return [min(found, key=lambda c: c.score)]


def _lobe_factors(F: Formulas, quantity: Quantity, inputs: Inputs, e: Evaluated) -> list[Clue]:
    """One factor for each lobe, fitted robustly: by cases that the lobe has almost to itself."""
    share = e.parts / np.maximum(e.parts.sum(axis=1, keepdims=True), 1e-300)
    finished = e.f / np.maximum(e.parts.sum(axis=1), 1e-300)
    factors = []
    for p in range(len(F.names)):
        with np.errstate(all="ignore"):
            ratio = np.where(share[:, p] > 0.98, quantity.given / e.f, np.nan)
        ratio = ratio[np.isfinite(ratio)]
        if ratio.size < 5:
            return []
        k = float(np.median(ratio))
        factors.append(next((n for n in (0.0, 1.0) if abs(k - n) < 2e-3), k))
    if np.ptp(factors) < 2e-3:  # one for all is a factor of f
        return []
    p = np.einsum("npc,p->nc", e.parts, factors) * finished
    changed = [(lobe, k) for lobe, k in zip(F.names, factors, strict=True) if k != 1]
    words = ", ".join(f"{lobe} × {constant(k)}" if k else f"{lobe} is missing" for lobe, k in changed)
    return [Clue(words, quantity.outside(p), quantity.score(p))]
