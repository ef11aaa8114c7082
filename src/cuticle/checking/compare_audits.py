"""Two audits side by side: what each is worth, and where their densities differ."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support.plain_values import html_table, plain
from cuticle._support.values import Value
from cuticle.checking.audit import Audit
from cuticle.checking.measurements import AuditMeasurement, Maps
from cuticle.checking.verdicts import Outcome, Verdict, worst

Pair = tuple[float, float]
_CELLS = (61, 61)  # in which the densities are compared; the audit's own of one size
_PATCHES = (20, 20)  # of which the one that differs most is named


class ViewerPair(NamedTuple):
    """What two samplers do at one viewer, the first and the second. NaN where f is not known."""

    theta_r: float  # radians
    p_value: Pair
    ess: Pair
    largest_weight: Pair
    energy: Pair  # ∫ f cos, the mean of the channels: two samplers of one function have one
    distance: float  # total variation distance of the two pdfs, ½ Σ |first - second| over cells
    where: str  # the patch of the sphere that differs most
    shares: Pair  # of each pdf in that patch


class VerdictPair(NamedTuple):
    """One claim of two samplers; None where it was not tested."""

    name: str
    first: Verdict | None
    second: Verdict | None


@dataclass(frozen=True, eq=False)
class Comparison(Value):
    """Two audits of the same viewers. `ok` and `outcome` are those of the worse one."""

    first: Audit
    second: Audit
    viewers: tuple[ViewerPair, ...]
    verdicts: tuple[VerdictPair, ...]

    @property
    def outcome(self) -> Outcome:
        """In one word: "fail" where either audit fails, else "inconclusive" where either is, else "pass"."""
        return worst({self.first.outcome, self.second.outcome})

    @property
    def ok(self) -> bool:
        """Whether every verdict on both holds."""
        return self.outcome == "pass"

    @property
    def farthest(self) -> ViewerPair:
        """The viewer at which the two densities differ most."""
        return max(self.viewers, key=lambda v: v.distance)

    @property
    def same_function(self) -> bool | None:
        """Whether ∫ f cos agrees within 1 % at every viewer; None where one of them has no f."""
        energy = np.array([v.energy for v in self.viewers])
        if not np.isfinite(energy).all():
            return None
        return bool((np.abs(energy[:, 0] - energy[:, 1]) <= 0.01 * energy.max(axis=1)).all())

    def to_dict(self) -> dict[str, Any]:
        """Return both audits and the viewers side by side as plain values that JSON can hold."""
        viewers = [v._asdict() for v in self.viewers]
        whole = {"ok": self.ok, "outcome": self.outcome, "same_function": self.same_function, "viewers": viewers}
        return dict(plain(whole)) | {"first": self.first.to_dict(), "second": self.second.to_dict()}

    def to_json(self) -> str:
        """Return `to_dict()` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False) + "\n"

    def _repr_html_(self) -> str:
        rows = [(f"{np.degrees(v.theta_r):.3g}°", *(f"{x:.3f}" for x in v.ess), f"{v.distance:.3f}") for v in self.viewers]
        title = f"{self.first.name}: {self.first.outcome}; {self.second.name}: {self.second.outcome}"
        return html_table(title, ("theta_r", "ESS, first", "ESS, second", "TV distance of the pdfs"), rows)


def compare_audits(first: Audit, second: Audit) -> Comparison:
    """Return two audits side by side.

    Raises
    ------
    ValueError
        They are of other viewers.
    """
    angles = [[m.theta_r for m in audit.cases] for audit in (first, second)]
    if angles[0] != angles[1]:
        raise ValueError("two audits are compared viewer by viewer: give both the same theta_r")
    names = dict.fromkeys(v.name for audit in (first, second) for v in audit.verdicts)
    of = [{v.name: v for v in audit.verdicts} for audit in (first, second)]
    return Comparison(
        first,
        second,
        tuple(_viewer(a, b) for a, b in zip(first.cases, second.cases, strict=True)),
        tuple(VerdictPair(name, of[0].get(name), of[1].get(name)) for name in names),
    )


def _viewer(a: AuditMeasurement, b: AuditMeasurement) -> ViewerPair:
    assert a.maps is not None
    assert b.maps is not None
    fine = [_claimed(m, *_CELLS) for m in (a.maps, b.maps)]
    coarse = [_claimed(m, *_PATCHES) for m in (a.maps, b.maps)]
    i, j = np.unravel_index(np.argmax(np.abs(coarse[0] - coarse[1])), _PATCHES)
    theta, phi = np.linspace(-90, 90, _PATCHES[0] + 1), np.linspace(-180, 180, _PATCHES[1] + 1)
    return ViewerPair(
        theta_r=a.theta_r, p_value=(a.p_value, b.p_value), ess=(a.ess, b.ess),
        largest_weight=(a.largest_weight, b.largest_weight), energy=(_energy(a), _energy(b)),
        distance=0.5 * float(np.abs(fine[0] - fine[1]).sum()),
        where=f"theta_i {theta[i]:.0f}° to {theta[i + 1]:.0f}°, phi {phi[j]:.0f}° to {phi[j + 1]:.0f}°",
        shares=(float(coarse[0][i, j]), float(coarse[1][i, j])),
    )  # fmt: skip


def _energy(m: AuditMeasurement) -> float:
    return float(np.mean(m.energy)) if m.energy else float("nan")


def _claimed(maps: Maps, rows: int, columns: int) -> NDArray[np.float64]:
    """Return the probability that the pdf claims in cells of one size, (rows, columns) in theta and phi."""
    theta, phi = np.linspace(-np.pi / 2, np.pi / 2, rows + 1), np.linspace(-np.pi, np.pi, columns + 1)
    return maps.spread(maps.claimed, theta, phi)
