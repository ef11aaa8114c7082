"""Any scattering function as a table that exports carry: no finer than its shape asks for."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle import _core
from cuticle._support.interpolation import smooth_spline
from cuticle._support.quadrature import trapezoid
from cuticle.scattering.bcsdf import Bcsdf, checked_even, evaluate, with_strands

Array = NDArray[np.float64]
Progress = Callable[[float], None]
_DIM = 1e-5  # of the light that is scattered directly
MOST_VALUES = 1_000_000
WORST = 0.1  # what is further off, at the first strand count, is not the function any more
_POLE = np.pi / 2 * (1 - 1e-6)
_DARK = 1e-37  # least energy: what single precision can hold
_LEAST = 1e-9  # 1/sr, of a shape
_ENERGIES = 145  # a few numbers each
_SHARE = 0.35  # of what is allowed, for rows and for columns; viewers have the rest
_TESTED = np.radians([-77, -58, -33, -11, 4, 19, 41, 63, 82])  # between the viewers of most tables
_THETA, _PHI = 270, 135  # cells of the tests, phi over half a turn
_VIEWERS = (13, 19, 25, 31, 37, 49, 61, 73)
_ROWS = (19, 25, 31, 37, 45, 55, 67, 81, 97, 117, 141, 171, 205, 251, 301)
_COLUMNS = (7, 10, 13, 19, 25, 31, 37, 46, 61, 91, 121, 181)  # over half a turn
_REACHES = (0.1, 2.0, 3.0, 4.0, 5.0)


@dataclass(frozen=True, eq=False)
class FunctionTable:
    """A scattering function on a grid, as include/cuticle/scattering/function_table.h reads it.

    Attributes
    ----------
    strands
        The counts it is for; one, or several that begin with 0 and 1 or at 1 or more.
    shape
        f cos(theta_i) over its integral, 1/sr, single precision: shape (counts, viewers, rows, columns, channels). Viewers
        lie at theta_r = (pi/2) sin(t), t even over ±pi/2.
    log_energy
        ln ∫ f cos, shape (counts, more viewers spaced in that way, channels).
    reach
        How dense rows lie about the highlight: they are even in s within ±reach, at theta_i + theta_r = pi sinh(s) /
        sinh(reach).
    even
        Whether columns run over [0, pi]; else over [-pi, pi].
    error
        Largest ∫|Δf| cos / ∫ f cos over viewers, strand counts (those between among them) and channels, by quadrature.
    """

    strands: tuple[float, ...]
    shape: NDArray[np.float32]
    log_energy: NDArray[np.float32]
    reach: float
    even: bool
    error: float = np.nan

    kind = "table"

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return self.shape.shape[-1]

    @property
    def stretch(self) -> float:
        """What theta_i + theta_r is multiplied by before its asinh."""
        return float(np.sinh(self.reach) / np.pi)

    @property
    def size(self) -> int:
        """Bytes in single precision."""
        return self.shape.nbytes + self.log_energy.nbytes

    @cached_property
    def core(self) -> _core.Table:
        """What evaluates it."""
        shape, log_energy = (np.ascontiguousarray(x, np.float64) for x in (self.shape, self.log_energy))
        return _core.Table(shape, log_energy, np.array(self.strands, float), self.reach, self.even)

    def eval(self, theta_i: Array, theta_r: float, phi: Array, strands: float) -> Array:
        """Return f in 1/sr, without a cosine, on the product of two axes: shape (A, B, channels)."""
        ti, ph = (np.ascontiguousarray(x).ravel() for x in np.broadcast_arrays(theta_i[:, None], phi[None, :]))
        out = np.empty((len(ti), self.channels))
        self.core.eval(ti, np.full(len(ti), theta_r), ph, np.array([float(strands)]), out)
        return out.reshape(len(theta_i), len(phi), -1)


def tabulate_function(
    model: Bcsdf, counts: Iterable[float], tolerance: float, progress: Progress | None = None
) -> FunctionTable:
    """Return the smallest table of a scattering function that is off by less than `tolerance` of ∫ f cos.

    Rows, columns and the rows' density are chosen from what each costs alone, viewers by trial. Between strand counts it may
    be off by more, and where `MOST_VALUES` are not enough: `error` says by how much.

    Parameters
    ----------
    model
        Any scattering function; with `with_strands` it is asked for several counts.
    counts
        The numbers of strands that a sampler covers; where they are more than a factor of two apart, others between them
        are put in.
    tolerance
        Of ∫ f cos, or of 1e-5 of what is scattered directly where less comes through strands.
    progress
        Called with a fraction from 0 to 1.

    Raises
    ------
    ValueError
        A function that is not finite, or below 0, or too sharp for a table.
    """
    report = progress or (lambda fraction: None)
    strands = _own_counts(model, counts)
    even = checked_even(model)
    exact = _Exact(model, even)
    kept = [(n, viewer) for n in strands for viewer in _TESTED]
    between = [(n, viewer) for n in _between(strands) for viewer in _TESTED]

    # Light that so many strands dim to nothing is not told apart.
    least_light = _DIM * max(float(_sum(exact(strands[0], viewer)).max()) for viewer in _TESTED)

    def off(table: FunctionTable, cases: list[tuple[float, float]]) -> float:
        return max((_distance(exact.on(table, *case), exact(*case), least_light) for case in cases), default=0.0)

    best, least = None, np.inf
    choose_rows, choose_columns = _row_chooser(exact, kept), _column_chooser(exact, kept)
    for allowed in (tolerance * factor for factor in (1, 2, 4, 8)):  # where too many values are asked for, all axes give way
        rows, reach = choose_rows(_SHARE * allowed)
        columns = choose_columns(_SHARE * allowed)
        most = MOST_VALUES / (len(strands) * rows * columns * exact.channels)
        fitting = [v for v in _VIEWERS if v <= most]
        wanted = 0.0
        while fitting:
            viewers = next((v for v in fitting if v >= wanted), fitting[-1])
            made = _make(exact, strands, viewers, rows, columns, reach)
            error = off(made, kept)
            if error < least:
                best, least = made, error
            report(min(tolerance / error, 1.0))
            fitting = [v for v in fitting if v > viewers]
            if error <= allowed:
                break
            wanted = 0.75 * viewers * (error / allowed) ** 0.5  # errors fall with the square of the number
        if least <= allowed or most >= _VIEWERS[-1]:  # fewer rows and columns would let in no more viewers
            break
    if best is None:
        raise ValueError(
            f"the scattering function is too sharp to be written as a table of {MOST_VALUES:,} values"
            f" ({len(strands)} strand counts, {exact.channels} channels); export the sampler without it"
        )
    if off(best, [case for case in kept if case[0] == strands[0]]) > WORST:
        raise ValueError(
            f"the scattering function is too sharp to be written as a table: {best.size:,} bytes would be off by"
            f" {100 * least:.2g} % of ∫ f cos, {100 * WORST:g} % are allowed; export the sampler without it"
        )
    return replace(best, error=max(least, off(best, between)))


class _Exact:
    """f cos, times the cosine that a solid angle has, in the tests' cells; what was asked is kept."""

    def __init__(self, model: Bcsdf, even: bool) -> None:
        self.model: Any = model
        self.even = even
        self.theta = (np.arange(_THETA) + 0.5) / _THETA * np.pi - np.pi / 2
        low, cells = (0.0, _PHI) if even else (-np.pi, 2 * _PHI)
        self.phi = low + (np.arange(cells) + 0.5) * np.pi / _PHI
        self._kept: dict[tuple[float, float], Array] = {}

    @property
    def channels(self) -> int:
        return self(0.0 if not hasattr(self.model, "strands") else self.model.strands, float(_TESTED[0])).shape[-1]

    def at(self, n: float) -> Bcsdf:
        return with_strands(self.model, n)

    def __call__(self, n: float, viewer: float) -> Array:
        if (n, viewer) not in self._kept:
            self._kept[n, viewer] = self._weighted(evaluate(self.at(n), self.theta, viewer, self.phi))
        return self._kept[n, viewer]

    def on(self, table: FunctionTable, n: float, viewer: float) -> Array:
        return self._weighted(table.eval(self.theta, viewer, self.phi, n) * np.cos(self.theta)[:, None, None])

    def _weighted(self, f_cos: Array) -> Array:
        return f_cos * np.cos(self.theta)[:, None, None]


def _own_counts(model: Bcsdf, counts: Iterable[float]) -> tuple[float, ...]:
    given = sorted({float(n) for n in counts})
    if len(given) == 1 or not hasattr(model, "with_strands"):
        return (given[0],)
    kept = given if given[0] >= 1 else [0.0, 1.0, *(n for n in given if n > 1)]
    out = kept[:1]
    for n in kept[1:]:  # shapes may be mixed from one count to its double
        while out[-1] >= 1 and n > 2 * out[-1] * (1 + 1e-9):
            out.append(2 * out[-1])
        out.append(n)
    return tuple(out)


def _between(strands: tuple[float, ...]) -> list[float]:
    return [0.5 * (a + b) for a, b in itertools.pairwise(strands)]


def _row_axis(rows: int, reach: float) -> Array:
    """theta_i + theta_r of the rows."""
    return np.pi * np.sinh(np.linspace(-reach, reach, rows)) / np.sinh(reach)


def _column_axis(columns: int, even: bool) -> Array:
    return np.linspace(0.0 if even else -np.pi, np.pi, columns)


def _hats(nodes: Array, x: Array) -> Array:
    """The matrix of linear interpolation: shape (x, nodes)."""
    i = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
    t = np.clip((x - nodes[i]) / (nodes[i + 1] - nodes[i]), 0, 1)
    out = np.zeros((len(x), len(nodes)))
    out[np.arange(len(x)), i] = 1 - t
    out[np.arange(len(x)), i + 1] = t
    return out


def _row_chooser(exact: _Exact, cases: list[tuple[float, float]]) -> Callable[[float], tuple[int, float]]:
    """What chooses the fewest rows, and how dense about the highlight, that lose less than a tolerance by themselves."""
    cosine = np.cos(exact.theta)
    sheets = []
    for n, viewer in cases:
        f = exact(n, viewer) / cosine[:, None, None]
        sheets.append((viewer, f, smooth_spline(exact.theta, f)))

    def error(rows: int, reach: float) -> float:
        x, worst = _row_axis(rows, reach), 0.0
        for viewer, f, spline in sheets:
            nodes = spline(np.clip(x - viewer, exact.theta[0], exact.theta[-1]))
            found = np.tensordot(_hats(x, exact.theta + viewer), nodes, 1)
            worst = max(worst, _distance(found * cosine[:, None, None], f * cosine[:, None, None]))
        return worst

    reach = min(_REACHES, key=lambda r: error(67, r))
    return lambda tolerance: (next((rows for rows in _ROWS if error(rows, reach) <= tolerance), _ROWS[-1]), reach)


def _column_chooser(exact: _Exact, cases: list[tuple[float, float]]) -> Callable[[float], int]:
    # Even or periodic, what lies past either end is known: the splines need no condition there.
    period = np.pi if exact.even else 2 * np.pi
    around = np.concatenate([exact.phi - period, exact.phi, exact.phi + period])
    splines = []
    for n, viewer in cases:
        f = exact(n, viewer)
        beside = f[:, ::-1] if exact.even else f
        whole = np.concatenate([beside, f, beside], axis=1)
        splines.append((f, smooth_spline(around, np.moveaxis(whole, 1, 0))))

    def error(columns: int) -> float:
        axis = _column_axis(columns, exact.even)
        hats = _hats(axis, exact.phi)
        return max(_distance(np.moveaxis(np.tensordot(hats, spline(axis), 1), 0, 1), f) for f, spline in splines)

    sizes = [c if exact.even else 2 * c - 1 for c in _COLUMNS]
    return lambda tolerance: next((c for c in sizes if error(c) <= tolerance), sizes[-1])


def _make(exact: _Exact, strands: tuple[float, ...], viewers: int, rows: int, columns: int, reach: float) -> FunctionTable:
    x, phi = _row_axis(rows, reach), _column_axis(columns, exact.even)
    shapes, energies = [], []
    turned = np.linspace(-np.pi / 2, np.pi / 2, 2 * viewers - 1)  # energies lie twice as close as shapes
    for n in strands:
        model = exact.at(n)
        for k, viewer in enumerate((np.pi / 2 * np.sin(turned)).clip(-_POLE, _POLE)):
            theta, back = np.unique(np.clip(x - viewer, -_POLE, _POLE), return_inverse=True)
            f_cos = evaluate(model, theta, viewer, phi)
            energy = np.maximum(_energy(f_cos, theta, phi, exact.even), _DARK)
            energies.append(np.log(energy))
            if k % 2 == 0:
                shapes.append(_four_digits((f_cos / energy)[back]))
    channels = energies[0].shape[-1]
    log_energy = np.reshape(energies, (len(strands), len(turned), channels))
    return FunctionTable(
        strands,
        np.reshape(shapes, (len(strands), viewers, rows, columns, channels)),
        smooth_spline(turned, log_energy, axis=1)(np.linspace(-np.pi / 2, np.pi / 2, _ENERGIES)).astype(np.float32),
        reach,
        exact.even,
    )


def _energy(f: Array, theta: Array, phi: Array, even: bool) -> Array:
    along = np.einsum("j,tjc->tc", trapezoid(phi), f) * (2 if even else 1)
    return np.asarray(np.einsum("t,tc->c", trapezoid(theta) * np.cos(theta), along))


def _four_digits(shape: Array) -> NDArray[np.float32]:
    """Rounded to four digits, which halves the text of an export; next to nothing is 0."""
    power = 10.0 ** (3 - np.floor(np.log10(np.maximum(shape, _LEAST))))
    return np.where(shape < _LEAST, 0, np.rint(shape * power) / power).astype(np.float32)


def _distance(values: Array, exact: Array, least: float = 1e-300) -> float:
    """∫|Δf| cos / ∫ f cos, of the worst channel; `least` stands for integrals below it."""
    total = _sum(exact)
    return float((_sum(np.abs(values - exact)) / np.maximum(total, least)).max())


def _sum(values: Array) -> Array:
    """Over the first two axes; as a product, for a short last axis makes NumPy's sum slow."""
    return np.ones(values.shape[0] * values.shape[1]) @ values.reshape(-1, values.shape[2])
