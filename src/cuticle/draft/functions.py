"""Finding the general functions that the draft leaves open, from its tables' values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle.draft.tables import USED, SliceRow, StrandRow
from cuticle.fitting.closed_forms import STRANDS, THETA, ClosedForm, DocumentFunctions, Term

_EVEN = (
    ("1",),
    ("1", "θ²"),
    ("1", "θ⁴"),
    ("1", "θ⁶"),
    ("1", "θ²", "θ⁴"),
    ("1", "sin²θ"),
    ("1", "sin⁴θ"),
    ("1", "sin²θ", "sin⁴θ"),
)
_ODD = ((), ("θ",), ("θ³",), ("θ", "θ³"), ("θ", "θ³", "θ⁵"), ("sin θ",), ("sin 2θ",), ("sin θ", "sin 2θ"))
_RANGE = {"n^p": (-2.0, 0.99), "n/(n+c)": (0.05, 50.0)}  # of p and of c
LEAST_VALUES = 5
INDISTINCT = 2.0  # a difference of the criterion that is no evidence (Burnham and Anderson 2002, 2.6)
_LEAST = 1e-12  # rms in radians: below it a form goes through its points, and more terms only follow the rounding


class Choice(NamedTuple):
    """The form that was taken, and those that came next."""

    best: ClosedForm
    others: tuple[ClosedForm, ...]


class Found(NamedTuple):
    """Functions that make the draft's form a sampler, with the choices behind them by name."""

    functions: DocumentFunctions
    choices: dict[str, Choice]


_RUNNERS_UP = 3  # how many other forms are told


def find_form(
    theta_r: NDArray[np.float64],
    values: NDArray[np.float64],
    parity: str,
    *,
    strands: NDArray[np.float64] | None = None,
) -> Choice:
    """Return the closed form that tells values best for the number of terms it takes.

    Least squares over a small family in theta_r, "even" or "odd" with a constant, times functions of the number of
    strands where counts are given; Akaike's criterion for small samples (AICc) decides, and of forms that it cannot tell
    apart (a difference below 2) the one with the fewest terms is taken, a polynomial before a sine.

    Parameters
    ----------
    theta_r, values
        Radians, shape (N,).
    parity
        "even": a constant and even terms. "odd": a constant and odd terms.
    strands
        Counts, shape (N,).

    Raises
    ------
    ValueError
        Shapes that differ, a value that is no finite number, too few of them.
    """
    validate.choice("parity", parity, ("even", "odd"))
    if len(values) < LEAST_VALUES:
        raise ValueError(f"values must hold at least {LEAST_VALUES} points to choose a form, got {len(values)}")
    n = np.ones_like(theta_r) if strands is None else strands
    several = len(np.unique(n)) > 1
    shapes = _EVEN if parity == "even" else tuple(("1", *odd) for odd in _ODD)
    found: list[tuple[float, int, int, ClosedForm]] = []
    for simplicity, shape in enumerate(shapes):
        candidates = [tuple((x, "") for x in shape)]
        if several:
            for h in list(STRANDS)[1:]:
                once = ("1",) if parity == "even" else shape[1:]  # n widens the whole, or turns the slope
                for grown in dict.fromkeys((once, shape)):
                    if grown:
                        candidates.append((*((x, "") for x in shape), *((x, h) for x in grown)))
        for terms in candidates:
            form = fit_form(terms, theta_r, values, n)
            if form is not None:
                found.append((form.criterion or math.inf, len(terms), simplicity, form))
    found.sort(key=lambda f: f[0])
    near = [f for f in found if f[0] - found[0][0] <= INDISTINCT]
    best = min(near, key=lambda f: f[1:3] + f[:1])[3]
    return Choice(best, tuple([f[3] for f in found if f[3] is not best][:_RUNNERS_UP]))


def fit_form(
    terms: Sequence[tuple[str, str]],
    theta_r: NDArray[np.float64],
    values: NDArray[np.float64],
    strands: NDArray[np.float64] | None = None,
) -> ClosedForm | None:
    """Return the least squares of one closed form, with its rms and AICc; None where there are too few values.

    Parameters
    ----------
    terms
        (function of theta_r, function of n) by the names in `cuticle.fitting.closed_forms.THETA` and `STRANDS`, "" for none.
    theta_r, values
        Radians, shape (N,).
    strands
        Counts, shape (N,).

    Raises
    ------
    ValueError
        Shapes that differ, a value that is no finite number.
    """
    n = np.ones_like(theta_r) if strands is None else strands
    if not theta_r.shape == values.shape == n.shape or values.ndim != 1:
        raise ValueError(
            f"theta_r, values and strands must have one shape (N,), got {theta_r.shape}, {values.shape}, {n.shape}"
        )
    if not all(np.isfinite(x).all() for x in (theta_r, values, n)) or (n < 1).any():
        raise ValueError("theta_r and values must be finite numbers, strands counts of at least 1")
    kind = next((h for _, h in terms if h in _RANGE), None)
    parameters = len(terms) + (kind is not None)
    spare = len(values) - parameters - 2  # with the variance
    if spare < 1:
        return None

    def solve(c: float) -> tuple[NDArray, float]:
        columns = np.stack([THETA[t].value(theta_r) * STRANDS[h](n, c) for t, h in terms], axis=1)
        x, *_ = np.linalg.lstsq(columns, values, rcond=None)
        return x, float(np.sqrt(np.mean((columns @ x - values) ** 2)))

    c = 1.0
    if kind is not None:
        from scipy.optimize import minimize_scalar

        c = float(minimize_scalar(lambda c: solve(c)[1], bounds=_RANGE[kind], method="bounded").x)
        if abs(c) < 0.05 and kind == "n^p":
            return None  # p → 0 is log n, which has a term of its own
    x, rms = solve(c)
    if not np.isfinite(x).all():
        return None
    k = parameters + 1
    criterion = 2 * len(values) * math.log(max(rms, _LEAST)) + 2 * k + 2 * k * (k + 1) / spare
    return ClosedForm(tuple(Term(float(a), t, h) for a, (t, h) in zip(x, terms, strict=True)), c, rms, criterion)


def find_functions(direct: Sequence[SliceRow], multiple: Sequence[StrandRow], axis: float = math.pi) -> Found:
    """Return the functions through tables 2 and 3: rows that a Gaussian describes, up to 70°.

    Raises
    ------
    ValueError
        Too few rows hold for a function to be found.
    """
    limit = math.radians(USED + 0.5)
    two = [r for r in direct if r.holds and abs(r.theta_r) <= limit]
    three = [r for r in multiple if r.holds and abs(r.theta_r) <= limit]
    for name, rows in (("direct light", two), ("light through strands", three)):
        if len(rows) < LEAST_VALUES:
            raise ValueError(
                f"a Gaussian describes only {len(rows)} of the slices of {name}: the draft's form does not suit this fibre;"
                " cuticle.fit with lobes does"
            )
    t2, t3 = np.array([r.theta_r for r in two]), np.array([r.theta_r for r in three])
    n = np.array([r.strands for r in three])
    choices = {
        "sigma_V": find_form(t2, np.array([r.vertical.sigma for r in two if r.vertical]), "even"),
        "sigma_H": constant(np.array([r.horizontal.sigma for r in two if r.horizontal])),
        "mu_H": find_form(t2, np.array([r.shift for r in two]), "odd"),
        "sigma": find_form(t3, np.array([r.gaussian.sigma for r in three if r.gaussian]), "even", strands=n),
        "mu": find_form(t3, np.array([r.shift for r in three]), "odd", strands=n),
    }
    return Found(DocumentFunctions(**{k: c.best for k, c in choices.items()}, axis=axis), choices)


def constant(values: NDArray[np.float64]) -> Choice:
    """Return the mean as a closed form: the draft takes sigma_H to be one."""
    mean = float(values.mean())
    return Choice(ClosedForm((Term(mean, "1"),), rms=float(np.sqrt(np.mean((values - mean) ** 2)))), ())
