"""Dual scattering for any scattering function, from its half-sphere averages by quadrature."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from cuticle import _core
from cuticle._support import validate
from cuticle._support.values import Value
from cuticle.scattering.bcsdf import Bcsdf, Plotted, check_model, is_even
from cuticle.scattering.dual_scattering import pass_on
from cuticle.scattering.registry import classes, first_class
from cuticle.scattering.tabulated import Tabulated

Array = NDArray[np.float64]
VIEWERS = 73
_KNOWN = np.radians(50)  # nearer to a pole it cuts lobes off, and what is left tells neither shift nor width
_THETA = 181
_PHI = 180  # cells over half a turn
_KEPT = 60  # of them, once spread over half a turn
_DARKEST = -230.0  # ln of the least energy that keeps its shape
_LIMIT = 0.9945  # of a right angle: at the pole itself nothing is seen


class _Averages(NamedTuple):
    """By viewer and channel, shape (VIEWERS, channels); angles in theta_h."""

    pass_on: Array
    alpha_f: Array
    beta_f: Array
    back_energy: Array
    back_shift: Array
    back_deviation: Array


@first_class
class Strands(Value, Plotted):
    """Dual scattering for any scattering function: a strand lit directly, or through other strands.

    It does for any function what the exact form of `DualScattering` does for a `Fibre`. The fractions scattered forward and
    back, their shifts and their widths are integrals of f. Through n strands, f is averaged over the half turn from which
    the light arrives, attenuated by s^n, and shifted and widened along theta by n scatterings; s includes light that
    bounces between strands. The backscatter of the strands behind is summed over all orders.

    Parameters
    ----------
    model
        The single strand: any object with `eval(theta_i, theta_r, phi)`. It must absorb some light.
    strands
        The number of strands toward the light, 0 to 10,000. A number between 0 and 1 is a share of light.
    d_f, d_b
        Strand density factors, forward and backward.

    Raises
    ------
    ValueError
        The fractions scattered forward and back reach 1, so that multiple scattering has no sum.

    Examples
    --------
    >>> import cuticle
    >>> model = cuticle.Strands(cuticle.Chiang(eumelanin=1.3), strands=2)
    >>> model.eval(0.1, 0.2, 3.0).shape
    (3,)
    """

    def __init__(self, model: Bcsdf, strands: float = 0.0, *, d_f: float = 0.7, d_b: float = 0.7) -> None:
        check_model(model)
        if hasattr(model, "with_strands"):
            raise TypeError(f"{type(model).__name__} knows its strands already: give the function of a single one")
        self.model = model
        self.strands = validate.number("strands", strands, 0, validate.MAX_STRANDS)
        self.d_f = validate.number("d_f", d_f, 0, 1, above=True)
        self.d_b = validate.number("d_b", d_b, 0, 1)
        self.even = is_even(model)

    def __repr__(self) -> str:
        return f"Strands({self.model!r}, {self.strands:g}, d_f={self.d_f:g}, d_b={self.d_b:g})"

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` needs, as values that JSON can hold."""
        single = type(self.model)
        known = classes().get(single.__name__) is single
        return (self.model.to_dict() if known else {}) | {  # type: ignore[attr-defined]
            "single": single.__name__, "among": {"d_f": self.d_f, "d_b": self.d_b},
        }  # fmt: skip

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Strands:
        """Return the function that `to_dict` described, for 0 strands."""
        return cls(classes()[data["single"]].from_dict(data), **data["among"])

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return int(self._spread.shape[-1])

    def with_strands(self, strands: float) -> Strands:
        """Return the same function for another number of strands; both share their tables."""
        other = Strands(self.model, strands, d_f=self.d_f, d_b=self.d_b)
        other._shared = self._shared
        return other

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; angles in radians broadcast, the last axis is channels."""
        n = self.strands
        f: Any = 0.0
        if n < 1:
            ti, tr = np.asarray(theta_i, np.float64), np.asarray(theta_r, np.float64)
            f = (1 - n) * (np.asarray(self.model.eval(theta_i, theta_r, phi)) + self._backscatter(ti, tr, phi))
        if n > 0:
            table, log_energy = self._through(max(n, 1.0))
            # Energy apart: it fades by powers of n, and faster the nearer to a pole.
            energy = np.exp(log_energy(np.clip(np.asarray(theta_r, np.float64), *self._viewers[[0, -1]])))
            f = f + min(n, 1.0) * energy * table.eval(theta_i, theta_r, phi)
        return f

    @cached_property
    def _shared(self) -> dict[str, Any]:
        """The tables, for all numbers of strands."""
        return {}

    @cached_property
    def _viewers(self) -> Array:
        return np.linspace(-np.pi / 2, np.pi / 2, VIEWERS) * _LIMIT

    @property
    def _tables(self) -> tuple[Array, _Averages]:
        if "tables" not in self._shared:
            self._shared["tables"] = self._make_tables()
        return self._shared["tables"]

    @property
    def _spread(self) -> Array:
        """The mean of f cos over the half turn that light comes from, (VIEWERS, _THETA, phi, channels)."""
        return self._tables[0]

    def _make_tables(self) -> tuple[Array, _Averages]:
        theta = _theta()
        cells = _PHI if self.even else 2 * _PHI
        low = 0.0 if self.even else -np.pi
        phi = low + (np.arange(cells) + 0.5) * np.pi / _PHI
        forward = np.abs(phi) / np.pi  # straight on is phi = pi; light comes spread over half a turn
        spread, rows = [], []
        for viewer in self._viewers:
            f = validate.real("what model.eval returns", self.model.eval(theta[:, None], viewer, phi[None, :]))
            f = f * np.cos(theta)[:, None, None]
            if not np.isfinite(f).all() or (f < 0).any():
                raise ValueError(
                    f"model.eval must be finite and at least 0, and is not at theta_r {np.degrees(viewer):.4g}°"
                )
            rows.append(_averages(f, theta, viewer, forward, (2 if self.even else 1) * np.pi / _PHI))
            spread.append(_half_turn(f, self.even))
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        inner = np.abs(self._viewers) <= _KNOWN
        for k in range(2, len(columns)):  # a strand's shifts and widths are its own, however it is looked at
            columns[k] = np.array([np.interp(self._viewers, self._viewers[inner], x[inner]) for x in columns[k].T]).T
        total = columns[0] + columns[1]
        r, c = np.unravel_index(int(np.argmax(total)), total.shape)
        if not total[r, c] < 1 - 1e-6:
            raise ValueError(
                f"light scattered forward and back must stay below 1 for strands to be summed, got {total[r, c]:.4g} at"
                f" theta_r {np.degrees(self._viewers[r]):.3g}° (channel {c}): a function that conserves energy and absorbs"
                " some does"
            )
        back = np.array(
            [[_backscatter(*(float(x[i, k]) for x in columns)) for k in range(total.shape[1])] for i in range(len(total))]
        )  # fmt: skip
        a_f, a_b, alpha_f, _, beta_f, _ = columns
        energy, *shape = np.moveaxis(back, 2, 0)
        return np.array(spread), _Averages(pass_on(a_f, a_b, energy), alpha_f, beta_f, energy, *shape)

    def _backscatter(self, theta_i: Array, theta_r: Array, phi: ArrayLike) -> Array:
        """The backscatter of the strands behind, for light that comes directly: the same for all phi."""
        shape = np.broadcast_shapes(theta_i.shape, theta_r.shape)
        ti, tr = (np.broadcast_to(x, shape).ravel() for x in (theta_i, theta_r))
        averages = self._tables[1]
        out = np.empty((len(ti), self.channels))
        for c in range(self.channels):
            energy, shift, deviation = (
                np.interp(tr, self._viewers, column[:, c])
                for column in (averages.back_energy, averages.back_shift, averages.back_deviation)
            )
            out[:, c] = self.d_b * energy / np.pi * _m(ti, 2 * shift - tr, 4 * deviation**2) / _cosine(ti)
        whole = np.broadcast_shapes(shape, np.shape(phi))
        return np.broadcast_to(
            out.reshape(*(1,) * (len(whole) - len(shape)), *shape, self.channels), (*whole, self.channels)
        )

    def _through(self, n: float) -> tuple[Tabulated, PchipInterpolator]:
        """F through n strands over its energy, and ln of that energy, a function of the viewer's inclination."""
        tables = self._shared.setdefault("through", {})
        if n not in tables:
            tables[n] = self._make_through(n)
        return tables[n]

    def _make_through(self, n: float) -> tuple[Tabulated, PchipInterpolator]:
        spread, averages = self._tables
        theta = _theta()
        weight = np.cos(theta) * np.pi / _THETA
        out = np.empty_like(spread)
        for i, viewer in enumerate(self._viewers):
            for c in range(self.channels):
                _, alpha_f, beta_f, energy, back_shift, back_deviation = (float(column[i, c]) for column in averages)
                variance, shift = n * beta_f**2, n * alpha_f
                # Each inclination is moved and widened by n scatterings; M keeps the energy within the poles.
                kernel = _m(theta[:, None], theta[None, :] + 2 * shift, np.full((1, 1), 4 * variance)) * weight
                cone, width = 2 * (back_shift + shift) - viewer, 4 * (back_deviation**2 + variance)
                back = self.d_b * energy / np.pi * _m(theta, np.full(1, cone), np.full(1, width))
                out[i, ..., c] = kernel @ spread[i, ..., c] + back[:, None]
        phi = np.linspace(0, np.pi, _KEPT + 1) if self.even else np.linspace(-np.pi, np.pi, 2 * _KEPT + 1)[:-1]
        around = np.full(len(phi), np.pi / _KEPT)
        if self.even:
            around *= np.where(np.isin(phi, phi[[0, -1]]), 1, 2)  # both sides, but where they meet
        energy = np.maximum(np.einsum("vtpc,t,p->vc", out, weight, around), 1e-300)
        f = out / (energy[:, None, None] * np.cos(theta)[:, None, None])
        log_energy = math.log(self.d_f) + n * np.log(np.maximum(averages.pass_on, 1e-300)) + np.log(energy)
        table = Tabulated(self._viewers, theta, phi, f, even=None if self.even else False)
        return table, PchipInterpolator(self._viewers, np.maximum(log_energy, _DARKEST))


def _backscatter(
    a_f: float, a_b: float, alpha_f: float, alpha_b: float, beta_f: float, beta_b: float
) -> tuple[float, float, float]:
    return _core.backscatter(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b, True, 1.0)


def _theta() -> Array:
    return (np.arange(_THETA) + 0.5) * np.pi / _THETA - np.pi / 2


def _cosine(theta: Array) -> Array:
    return np.maximum(np.cos(theta), 1e-9)


def _m(theta_i: Array, cone: Array, variance: Array) -> Array:
    """The core's energy-conserving M over arrays that broadcast; variance in theta."""
    shape = np.broadcast_shapes(theta_i.shape, cone.shape, variance.shape)
    out = np.empty(math.prod(shape))
    t, c, v = (validate.flat(x, shape) for x in (theta_i, cone, np.maximum(variance, 1e-6)))
    _core.energy_conserving_m(t, c, v, out)
    return out.reshape(shape)


def _averages(f: Array, theta: Array, viewer: float, forward: Array, step: float) -> tuple[Array, ...]:
    """Energy, shift and deviation (theta_h) of light that goes on and back: a_f, a_b, alpha_f, alpha_b, beta_f, beta_b."""
    along = f * (np.cos(theta) * np.pi / _THETA * step)[:, None, None]
    sine = np.sin(theta)[:, None]
    results = []
    for weight in (forward, 1 - forward):
        per_theta = np.einsum("abc,b->ac", along, weight)
        energy = per_theta.sum(axis=0)
        each = per_theta / np.maximum(energy, 1e-300)
        axis, variance = _axis_and_variance((sine * each).sum(axis=0), (sine**2 * each).sum(axis=0))
        results.append((energy, 0.5 * (axis + viewer), 0.5 * np.sqrt(variance)))
    (a_f, alpha_f, beta_f), (a_b, alpha_b, beta_b) = results
    return a_f, a_b, alpha_f, alpha_b, beta_f, beta_b


def _axis_and_variance(first: Array, second: Array) -> tuple[Array, Array]:
    """The axis and the variance of the M with these mean values of sin theta_i and of its square.

    M is the latitude of a von Mises-Fisher distribution of concentration k = 1/v about the axis, whose moments are known:
    with A = coth k - 1/k, E[sin] = A sin(axis) and E[sin²] = A/k + (1 - 3 A/k) sin²(axis). Taken so, what the poles cut
    off a lobe is not mistaken for a shift.
    """

    def moments(k: Array) -> tuple[Array, Array]:
        a = 1 / np.tanh(k) - 1 / k
        sine = np.clip(first / a, -1, 1)
        return sine, a / k + (1 - 3 * a / k) * sine**2

    low, high = np.full_like(first, math.log(0.05)), np.full_like(first, math.log(1e5))
    for _ in range(60):  # E[sin²] falls as the lobe narrows, for one mean
        middle = 0.5 * (low + high)
        sine, square = moments(np.exp(middle))
        wide = (square > second) | (np.abs(sine) >= 1)
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    k = np.exp(0.5 * (low + high))
    return np.arcsin(moments(k)[0]), 1 / k


def _half_turn(f: Array, even: bool) -> Array:
    """The mean of f (theta, cells, channels) over phi ± a quarter turn, at edges of every third cell."""
    whole = np.concatenate([f[:, ::-1], f], axis=1) if even else f  # from -pi
    twice = np.concatenate([whole, whole, whole[:, :1]], axis=1)
    sums = np.concatenate([np.zeros_like(twice[:, :1]), np.cumsum(twice, axis=1)], axis=1)
    start = (_PHI if even else 0) + np.arange(0, (_PHI if even else 2 * _PHI) + (1 if even else 0), _PHI // _KEPT)
    first = (start - _PHI // 2) % (2 * _PHI)
    return (sums[:, first + _PHI] - sums[:, first]) / _PHI
