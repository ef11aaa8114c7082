"""Tests of a sampler, the verdicts they give, and results that carry verdicts."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from cuticle._support import validate
from cuticle._support.plain_values import html_table, plain
from cuticle._support.values import Value
from cuticle.checking.measurements import Measurement
from cuticle.sampling.quality import MEASURED_AT

LIMITS: Any = {"samples": (10_000, 100_000_000), "level": (1e-9, 0.5), "seed": (0, 2**63 - 1)}
_NOT_WRITTEN = ("maps", "drawn")
M = TypeVar("M")
Outcome = Literal["pass", "fail", "inconclusive"]
EXIT_CODES: dict[Outcome, int] = {"pass": 0, "fail": 1, "inconclusive": 3}


@dataclass(frozen=True)
class Verdict:
    """One claim: whether it holds, the worst value found, its limit, and where that value was found.

    `undecided` is the reason why nothing was found to speak against the claim: too little was tested. It is "" for a claim
    that was tested.
    """

    name: str
    passed: bool
    value: float
    limit: float
    where: str
    meaning: str
    undecided: str = ""

    @property
    def outcome(self) -> Outcome:
        """In one word."""
        return "pass" if self.passed else "inconclusive" if self.undecided else "fail"


def worst(outcomes: Collection[Outcome]) -> Outcome:
    """Return the worst of some outcomes; of none "inconclusive"."""
    return "fail" if "fail" in outcomes else "inconclusive" if "inconclusive" in outcomes or not outcomes else "pass"


def viewers(theta_r: ArrayLike | None, samples: int, level: float, seed: int) -> NDArray[np.float64]:
    """Check what a check and an audit are asked for; return the viewers' inclinations, shape (N,)."""
    given = MEASURED_AT if theta_r is None else validate.angles("theta_r", theta_r, np.pi / 2 * (1 - 1e-6), np.float64)
    if not np.size(given):
        raise ValueError("theta_r must name at least one viewer, got none")
    validate.integer("samples", samples, *LIMITS["samples"])
    validate.number("level", level, *LIMITS["level"])
    validate.integer("seed", seed, *LIMITS["seed"])
    return np.ravel(given)


class Judged(Value):
    """A result with verdicts: whether all hold, its values for JSON, and a summary in words."""

    verdicts: tuple[Verdict, ...]

    @property
    def ok(self) -> bool:
        """Whether every verdict holds."""
        return self.outcome == "pass"

    @property
    def outcome(self) -> Outcome:
        """In one word: "fail" where a verdict fails, else "inconclusive" where one could not be tested, else "pass"."""
        return worst({v.outcome for v in self.verdicts})

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values that JSON can hold (NaN as None), without samples and pictures."""

        def written(items: list[tuple[str, Any]]) -> dict[str, Any]:
            return {k: v for k, v in items if k not in _NOT_WRITTEN}

        return plain({"ok": self.ok, "outcome": self.outcome, **asdict(self, dict_factory=written)})  # type: ignore[call-overload]

    def to_json(self) -> str:
        """Return `to_dict()` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False) + "\n"

    def _repr_html_(self) -> str:
        rows = [
            (v.name, v.outcome, f"{v.value:.4g}", f"{v.limit:.4g}", v.undecided or v.where) for v in self.verdicts
        ]  # fmt: skip
        return html_table(f"{type(self).__name__}: {self.outcome}", ("claim", "outcome", "value", "limit", "where"), rows)

    def _summary(self, about: str) -> str:
        words = {"pass": "ok", "fail": "FAILED", "inconclusive": "inconclusive"}
        lines = [f"{type(self).__name__}({words[self.outcome]}: {about})"]
        lines += [
            f"  {'FAIL' if v.outcome == 'fail' else v.outcome}  {v.name}: {v.value:.4g} (limit {v.limit:.4g})"
            f" {v.undecided or v.where}"
            for v in self.verdicts
        ]
        return "\n".join([*lines, *(f"  note  {n}" for n in getattr(self, "notes", ()))])


class Thresholds(NamedTuple):
    """Limits of the statistical tests, from the false-positive rate asked for."""

    p_value: float  # a smaller p-value fails
    deviations: float  # a mean that is off by more standard errors fails


def sidak(level: float, count: int) -> float:
    """Return the level of each of `count` independent tests whose common false-positive rate is `level`."""
    return 1 - (1 - level) ** (1 / max(count, 1))


def deviations(level: float) -> float:
    """Return how many standard errors a normal deviate exceeds, on either side, with probability `level`."""
    return float(-ndtri(level / 2))


@dataclass(frozen=True)
class Test:
    """A claim about a sampler, and the number that decides it: the worst one of all measurements."""

    __test__: ClassVar[bool] = False  # pytest would take the class for tests of its own

    name: str
    meaning: str | Callable[[Sequence[Any]], str]  # what the number is; a function of all measurements where it varies
    limit: float | Callable[[Thresholds], float]  # the largest value that passes
    measure: Callable[[Any], float]  # of one measurement, whose samples are at hand in `m.drawn`
    of: type = Measurement  # the type of measurement; by default every viewer (and strand count) of a check or an audit
    at_least: bool = False  # whether `limit` is the smallest value that passes, as for a p-value
    place: Callable[[Any], str] = lambda m: m.place  # where a measurement was made
    tie: Callable[[Any], float] = lambda m: 0.0  # picks among equally bad measurements: the largest is reported
    option: str | None = None  # what the caller must have asked for ("energy") or supplied ("eval", "weight")
    # What NaN means. "fails": the test fails. "left out": the measurement does not count; the test fails where none is left.
    # "no verdict": the measurement does not count; there is no verdict where none is left.
    unknown: Literal["fails", "left out", "no verdict"] = "fails"
    too_little: Callable[[Any], str] = lambda m: ""  # why a measurement could not have shown a fault, if that is so

    def verdict(self, found: Sequence[tuple[float, Any, str]], thresholds: Thresholds) -> Verdict | None:
        """Return the verdict on values, the measurements that they belong to, and why those could show no fault."""
        measured = [(value, m) for value, m, _ in found]
        limit = self.limit(thresholds) if callable(self.limit) else self.limit
        meaning = self.meaning([m for _, m in measured]) if callable(self.meaning) else self.meaning
        known = [x for x in measured if self.unknown == "fails" or not math.isnan(x[0])]
        if not known:
            return Verdict(self.name, False, math.nan, limit, "everywhere", meaning) if self.unknown == "left out" else None

        def badness(x: tuple[float, Any]) -> tuple[float, float]:
            value, m = x
            return (math.inf if math.isnan(value) else -value if self.at_least else value), self.tie(m)

        value, m = max(known, key=badness)
        passed = bool(value >= limit if self.at_least else value <= limit)  # false for NaN
        reasons = [f"{reason}, {self.place(m)}".rstrip(", ") for _, m, reason in found if reason]
        if passed and reasons:
            return Verdict(self.name, False, value, limit, self.place(m), meaning, reasons[0])
        return Verdict(self.name, passed, value, limit, self.place(m), meaning)


class Judge:
    """Runs the tests on each measurement as it arrives, and gives the verdicts over all of them."""

    def __init__(self, tests: Sequence[Test], thresholds: Thresholds, options: Collection[str] = ()) -> None:
        for test in tests:
            if not isinstance(test, Test):
                raise TypeError(f"extra must hold cuticle.checking.verdicts.Test, got {type(test).__name__}")
        chosen = (t for t in tests if t.option is None or t.option in options)
        self._measured: list[tuple[Test, list[tuple[float, Any, str]]]] = [(t, []) for t in chosen]
        self._thresholds = thresholds

    def examine(self, measurement: M) -> M:
        """Run the tests that apply to a measurement, and return it without its samples."""
        kept: Any = replace(measurement, drawn=None) if isinstance(measurement, Measurement) else measurement
        for test, measured in self._measured:
            if isinstance(measurement, test.of):
                measured.append((test.measure(measurement), kept, test.too_little(measurement)))
        return kept

    def verdicts(self) -> tuple[Verdict, ...]:
        """Return one verdict for each test that applied."""
        verdicts = (test.verdict(measured, self._thresholds) for test, measured in self._measured if measured)
        return tuple(v for v in verdicts if v is not None)
