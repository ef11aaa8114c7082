"""Dual scattering for any scattering function, by the same transport as the exact form of `DualScattering`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.interpolation import monotone
from cuticle._support.values import Value
from cuticle.scattering.bcsdf import Bcsdf, Plotted, check_model, checked_even, is_even
from cuticle.scattering.registry import classes, first_class
from cuticle.scattering.strand_transport import Directions, Scattering, StrandTransport
from cuticle.scattering.tabulated import Tabulated
from cuticle.scattering.through_strands import transmittance_table

Array = NDArray[np.float64]
_DARKEST = -230.0  # ln of the least energy that keeps its shape
_ROWS = Directions().rows


@first_class
class Strands(Value, Plotted):
    """Dual scattering for any scattering function: a strand lit directly, or through other strands.

    It does for any function what the exact form of `DualScattering` does for a `Fibre`: light passes n strands, one after
    another, at its true angles, and what bounces between strands and comes back from those behind is summed over all
    orders. docs/models.md says what is assumed.

    Parameters
    ----------
    model
        The single strand: any object with `eval(theta_i, theta_r, phi)`. It must absorb some light.
    strands
        The number of strands toward the light, 0 to 10,000. A number between 0 and 1 is a share of light.
    d_f, d_b
        Strand density factors, forward and backward.
    rows
        Of light's inclinations, evenly over half a turn, 9 to 361. 45 are 4° apart; lobes that are narrower come out about
        as wide as that. The matrices that are solved grow with them.

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

    def __init__(self, model: Bcsdf, strands: float = 0.0, *, d_f: float = 0.7, d_b: float = 0.7, rows: int = _ROWS) -> None:
        check_model(model)
        if hasattr(model, "with_strands"):
            raise TypeError(f"{type(model).__name__} knows its strands already: give the function of a single one")
        self.model = model
        self.strands = validate.number("strands", strands, 0, validate.MAX_STRANDS)
        self.d_f = validate.number("d_f", d_f, 0, 1, above=True)
        self.d_b = validate.number("d_b", d_b, 0, 1)
        self.rows = validate.integer("rows", rows, 9, 361, remedy="45 are 4° apart, 91 are 2°")
        self.even = is_even(model)

    def __repr__(self) -> str:
        rows = "" if self.rows == _ROWS else f", rows={self.rows}"
        return f"Strands({self.model!r}, {self.strands:g}, d_f={self.d_f:g}, d_b={self.d_b:g}{rows})"

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` needs, as values that JSON can hold."""
        single = type(self.model)
        rows = {} if self.rows == _ROWS else {"rows": self.rows}  # files are what they were
        known = classes().get(single.__name__) is single
        return (self.model.to_dict() if known else {}) | {  # type: ignore[attr-defined]
            "single": single.__name__, "among": {"d_f": self.d_f, "d_b": self.d_b, **rows},
        }  # fmt: skip

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Strands:
        """Return the function that `to_dict` described, for 0 strands."""
        return cls(classes()[data["single"]].from_dict(data), **data["among"])

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return len(self._transports)

    def with_strands(self, strands: float) -> Strands:
        """Return the same function for another number of strands; both share their tables."""
        other = Strands(self.model, strands, d_f=self.d_f, d_b=self.d_b, rows=self.rows)
        other._shared = self._shared
        return other

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; angles in radians broadcast, the last axis is channels."""
        n = self.strands
        f: Any = 0.0
        if n < 1:
            f = (1 - n) * (np.asarray(self.model.eval(theta_i, theta_r, phi)) + self._through(0)(theta_i, theta_r, phi))
        if n > 0:
            low, met = math.floor(n), max(n, 1.0)
            f = f + min(n, 1.0) * self._through(max(low, 1), met - max(low, 1))(theta_i, theta_r, phi)
        return f

    @cached_property
    def _shared(self) -> dict[Any, Any]:
        """The tables, for all numbers of strands."""
        return {}

    @property
    def _directions(self) -> Directions:
        return Directions(rows=self.rows, even=self.even)

    @property
    def _transports(self) -> list[StrandTransport]:
        """One a channel."""
        if "transports" not in self._shared:
            self._shared["transports"] = self._make_transports()
        return self._shared["transports"]

    def _make_transports(self) -> list[StrandTransport]:
        checked_even(self.model)
        d = self._directions
        rows = []
        for viewer in -d.theta:  # along which importance travels to the strand
            f = validate.real("what model.eval returns", self.model.eval(d.fine_theta[:, None], viewer, d.fine_phi[None, :]))
            if not np.isfinite(f).all() or (f < 0).any():
                raise ValueError(
                    f"model.eval must be finite and at least 0, and is not at theta_r {np.degrees(viewer):.4g}°"
                )
            energy = f * (np.cos(d.fine_theta) ** 2 * np.pi / len(d.fine_theta))[:, None, None]
            rows.append(energy.reshape(d.rows, d.fine_rows, *f.shape[1:]).sum(axis=1))
        densities = np.moveaxis(np.array(rows), -1, 0)
        single = [Scattering.of(d, density) for density in densities]
        total = np.array([s.energy for s in single])
        c, r = np.unravel_index(int(np.argmax(total)), total.shape)
        if not total[c, r] < 1 - 1e-6:
            raise ValueError(
                f"light scattered forward and back must stay below 1 for strands to be summed, got {total[c, r]:.4g} at"
                f" theta_r {np.degrees(-d.theta[r]):.3g}° (channel {c}): a function that conserves energy and absorbs"
                " some does"
            )
        return [StrandTransport([s]) for s in single]

    @property
    def passed(self) -> tuple[Array, float]:
        """What `transmittance_table` returns, and the largest inclination of its rows, radians."""
        passed = np.stack([t.passed() for t in self._transports], axis=-1)
        return transmittance_table(passed), float(self._directions.theta[-1])

    def _through(self, count: int, past: float = 0.0) -> _Energies:
        """F through a number of strands, `past` of the way from `count` to the next; of 0, the backscatter alone."""
        key = count, past
        if key not in self._shared:
            table = self._arrived(count)
            if past:  # the energy between two numbers is that of their logs
                further = self._arrived(count + 1)
                sums = [np.maximum(x.sum(axis=(2, 3), keepdims=True), math.exp(_DARKEST)) for x in (table, further)]
                energy = np.exp((1 - past) * np.log(sums[0]) + past * np.log(sums[1]))
                table = energy * ((1 - past) * table / sums[0] + past * further / sums[1])
            self._shared[key] = _Energies(self._directions, table)
        return self._shared[key]

    def _arrived(self, count: int) -> Array:
        """Energy by viewer, row of theta_i and node of phi: (channels, rows, rows, nodes)."""
        every = np.eye(self._directions.rows)
        own, back = np.moveaxis(np.array([t.through_sheets(every, (count,))[0] for t in self._transports]), 1, 0)
        table = (self.d_f if count else 1.0) * (own + self.d_b * back)
        return np.maximum(table.transpose(0, 2, 3, 1)[:, ::-1], 0)  # rows were directions of travel


class _Energies:
    """A scattering function from its energies by viewer, row and node; energy apart, for it fades by powers of n."""

    def __init__(self, d: Directions, table: Array) -> None:
        viewers = -d.theta[::-1]
        phi, around = d.nodes * d.step, d.node_weights
        energy = np.maximum(np.einsum("cvtp,p->vc", table, around), math.exp(_DARKEST))
        fine = np.cos(d.fine_theta).reshape(d.rows, -1) ** 2
        square = fine.mean(axis=1) * np.pi / d.rows  # ∫ cos² over a row
        f = np.moveaxis(table, 0, -1) / (energy[:, None, None] * square[:, None, None])
        f = np.where((energy > math.exp(_DARKEST))[:, None, None], f, 1 / np.pi**2)  # no shape is left: the even one
        if not d.even:  # the node at pi is that at -pi
            f, phi = np.concatenate([f[:, :, -1:], f], axis=2)[:, :, :-1], np.concatenate([[-np.pi], phi[:-1]])
        self._viewers = viewers
        self._shape = Tabulated(viewers, d.theta, phi, f, even=None if d.even else False)
        self._log_energy = monotone(viewers, np.log(energy))

    def __call__(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> Array:
        """Return f in 1/sr."""
        energy = np.exp(self._log_energy(np.clip(np.asarray(theta_r, np.float64), *self._viewers[[0, -1]])))
        return energy * self._shape.eval(theta_i, theta_r, phi)
