"""The draft description's own form: one product of two Gaussians, or one Gaussian through n strands.

Its five functions are closed forms in theta_r and n: the draft prints some of them (`DRAFT`), `cuticle.document` finds
them for any fibre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

THETA_NODES = 61  # every 3 degrees: the quartic sigma_V is then followed to 0.2 %
_FLAT_PHI = 100.0  # radians: uniform around the fibre to 5e-4
_WIDE_THETA = 0.8  # radians: about the cosine of a uniform sphere
_SIGMA = (math.radians(0.2), 6.0)  # what a table may hold; a closed form may leave it where it extrapolates

Values = NDArray[np.float64]


class Basis(NamedTuple):
    """A function of theta_r in radians, and how a shader writes it with t for theta_r."""

    code: str
    value: Callable[[Values], Values]


EVEN = {
    "1": Basis("1.0", np.ones_like),
    "θ²": Basis("t*t", lambda t: t**2),
    "θ⁴": Basis("t*t*t*t", lambda t: t**4),
    "θ⁶": Basis("t*t*t*t*t*t", lambda t: t**6),
    "sin²θ": Basis("sin(t)*sin(t)", lambda t: np.sin(t) ** 2),
    "sin⁴θ": Basis("pow(sin(t),4.0)", lambda t: np.sin(t) ** 4),
}
ODD = {
    "θ": Basis("t", lambda t: t),
    "θ³": Basis("t*t*t", lambda t: t**3),
    "θ⁵": Basis("t*t*t*t*t", lambda t: t**5),
    "sin θ": Basis("sin(t)", np.sin),
    "sin 2θ": Basis("sin(2.0*t)", lambda t: np.sin(2 * t)),
}
THETA = EVEN | ODD

# Functions of the number of strands; the last two have a parameter of their own.
STRANDS: dict[str, Callable[[Values, float], Values]] = {
    "": lambda n, c: np.ones_like(n),
    "log₂n": lambda n, c: np.log2(n),
    "n": lambda n, c: n,
    "1/n": lambda n, c: 1 / n,
    "n^p": lambda n, c: n**c,
    "n/(n+c)": lambda n, c: n / (n + c),
}
_STRANDS_CODE = {"log₂n": "log2(n)", "n": "n", "1/n": "1.0/n", "n^p": "pow(n,{0:.4g})", "n/(n+c)": "n/(n+{0:.4g})"}


class Term(NamedTuple):
    """coefficient × a function of theta_r × a function of n ("" for none)."""

    coefficient: float
    theta: str
    strands: str = ""


@dataclass(frozen=True)
class ClosedForm:
    """A sum of terms in theta_r (radians) and the number of strands, in radians.

    Attributes
    ----------
    terms
        What is summed.
    parameter
        p or c of the strands' function, where it has one.
    rms
        Root-mean-square residual over the points it was found from, radians; None for numbers taken from elsewhere.
    criterion
        Akaike's information criterion for small samples, where it was found by it.
    """

    terms: tuple[Term, ...]
    parameter: float = 1.0
    rms: float | None = None
    criterion: float | None = None

    def __call__(self, theta_r: ArrayLike, strands: ArrayLike = 1.0) -> Values:
        """Return the value in radians at theta_r in radians; arrays broadcast. A count below 1 counts as 1."""
        t, n = np.broadcast_arrays(np.asarray(theta_r, np.float64), np.maximum(np.asarray(strands, np.float64), 1.0))
        total = np.zeros(t.shape)
        for term in self.terms:
            total = total + term.coefficient * THETA[term.theta].value(t) * STRANDS[term.strands](n, self.parameter)
        return total

    def text(self, *, degrees: bool = False) -> str:
        """Return it as people write it, θ in radians, the value in radians or degrees."""
        parts: list[str] = []
        for term in self.terms:
            factor = term.strands.replace("n^p", f"n^{self.parameter:.3g}").replace("+c)", f"+{self.parameter:.3g})")
            names = [x for x in ("" if term.theta == "1" else term.theta, factor) if x]
            value = math.degrees(term.coefficient) if degrees else term.coefficient
            sign = ("- " if value < 0 else "+ ") if parts else ("-" if value < 0 else "")
            parts.append(sign + " ".join([f"{abs(value):.4g}", *names]))
        text = " ".join(parts)
        return text if not degrees else f"({text})°" if len(parts) > 1 else f"{text}°"

    def code(self) -> str:
        """Return it as an expression in t = theta_r and n for C or a shader, all in radians."""
        parts: list[str] = []
        for term in self.terms:
            factors = [f"{term.coefficient:.6g}" if "." in f"{term.coefficient:.6g}" else f"{term.coefficient:.1f}"]
            if "e" in factors[0]:
                factors[0] = f"{term.coefficient:.9f}"
            factors += [THETA[term.theta].code] if term.theta != "1" else []
            factors += [_STRANDS_CODE[term.strands].format(self.parameter)] if term.strands else []
            parts.append("*".join(factors))
        return " + ".join(parts).replace("+ -", "- ")


@dataclass(frozen=True)
class DocumentFunctions:
    """The functions that make the draft's form a sampler. All in radians of theta_r.

    Attributes
    ----------
    sigma_V, sigma_H, mu_H
        Direct light: deviation along phi and along theta_i, and the shift of the peak from -theta_r.
    sigma, mu
        Through n > 0 strands: deviation along theta_i, and the shift of the mean from -theta_r.
    axis
        Azimuth of the highlight, pi (straight on) or 0 (back toward the viewer).
    """

    sigma_V: ClosedForm
    sigma_H: ClosedForm
    mu_H: ClosedForm
    sigma: ClosedForm
    mu: ClosedForm
    axis: float = math.pi

    def code(self) -> tuple[list[str], list[str]]:
        """Return the lines that a person types into a shader: three for direct light, two for n strands."""
        direct = [f"float {name} = {getattr(self, name).code()};" for name in ("sigma_V", "sigma_H", "mu_H")]
        return direct, [f"float {name} = {getattr(self, name).code()};" for name in ("sigma", "mu")]


_DEGREE = math.radians(1)

# The draft's Eqs. 2 to 4. Through strands it gives table 3 and leaves the functions open; the last two are least squares
# through that table, |theta_r| ≤ 60° (benchmarks/document_fibre.py): rms residuals 0.02 rad and 1.1°.
DRAFT = DocumentFunctions(
    sigma_V=ClosedForm((Term(0.25, "θ⁴"), Term(0.59, "1"))),
    sigma_H=ClosedForm((Term(0.29, "1"),)),
    mu_H=ClosedForm((Term(3 * _DEGREE, "θ"), Term(-2 * _DEGREE, "1"))),
    sigma=ClosedForm((Term(0.5065, "1"), Term(-0.0494, "1", "log₂n"), Term(0.0495, "θ²"))),
    mu=ClosedForm((Term(0.5365, "θ"), Term(0.0823, "θ", "log₂n"), Term(-1.46 * _DEGREE, "1"))),
)


def document_nodes(strands: Sequence[float], defensive: float, functions: DocumentFunctions) -> Values:
    """Return the table (strand counts, theta nodes, 5, lobes) of the draft's form with a defensive share.

    The defensive lobe is close to a uniform sphere: without it weights have no bound.
    """
    theta_r = np.linspace(-np.pi / 2, np.pi / 2, THETA_NODES)
    lobes = 2 if defensive > 0 else 1
    nodes = np.empty((len(strands), THETA_NODES, 5, lobes))
    for row, n in zip(nodes, strands, strict=True):
        if n > 0:
            shift, sigma, spread = functions.mu(theta_r, n), functions.sigma(theta_r, n), np.full(THETA_NODES, _FLAT_PHI)
        else:
            shift, sigma = functions.mu_H(theta_r), functions.sigma_H(theta_r)
            spread = np.clip(functions.sigma_V(theta_r), *_SIGMA)
        sigma = np.clip(sigma, *_SIGMA)
        mean = np.clip(shift - theta_r, -np.pi / 2 - 0.9 * sigma, np.pi / 2 + 0.9 * sigma)
        columns = [np.full(THETA_NODES, 1 - defensive), mean, np.full(THETA_NODES, functions.axis), sigma, spread]
        row[:, :, 0] = np.stack(columns, 1)
        if lobes == 2:
            row[:, :, 1] = [defensive, 0.0, np.pi, _WIDE_THETA, _FLAT_PHI]
    return nodes
