"""Inputs of the reference: which columns a model has, their ranges, and cases drawn over the whole box."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.values import Value
from cuticle.scattering.any_fibre import FORMS, OF_R

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MODELS = ("chiang", "marschner", "dual_scattering")
LONGITUDINAL = ("energy_conserving", "gaussian")
ANGLES = ("theta_i", "theta_r", "phi")
SIGMAS = ("sigma_a_r", "sigma_a_g", "sigma_a_b")
_CHIANG, _MARSCHNER = tuple(FORMS["chiang"]), tuple(FORMS["marschner"])
PARAMETERS: dict[str, tuple[str, ...]] = {
    "chiang": _CHIANG, "marschner": _MARSCHNER, "dual_scattering": (*_MARSCHNER, "d_f", "d_b", "strands"),
}  # fmt: skip
# What a value may be in a file that is checked: low, high, unit.
_BOX = {name: (p.low, p.high, p.unit) for form in FORMS.values() for name, p in form.items()}
LIMITS: dict[str, tuple[float, float, str]] = {
    **_BOX, "beta_m": (0.01, 1, ""), "beta_n": (0.01, 1, ""), "beta_N": (0.2, 90, "degrees"), "eta": (1.0001, 3, ""),
    "theta_i": (-np.pi / 2, np.pi / 2, "radians"), "theta_r": (-np.pi / 2, np.pi / 2, "radians"),
    "phi": (-4 * np.pi, 4 * np.pi, "radians"), "h": (-1, 1, ""), "d_f": (0, 1, ""), "d_b": (0, 1, ""),
    "strands": (0, 1e4, ""), **{name: (0.0, 1000.0, "per radius") for name in ("sigma_a", *SIGMAS)},
}  # fmt: skip
_EDGE = 1.5706  # inclinations stay this side of the poles, where f has no value


@dataclass(frozen=True, eq=False)
class Inputs(Value):
    """Cases: a model and its inputs.

    Attributes
    ----------
    model, longitudinal
        "chiang", "marschner" or "dual_scattering"; for Marschner's, the longitudinal function.
    columns
        Each input but absorption, (n,): theta_i, theta_r, phi in radians, fibre parameters in degrees; h in the near field.
    sigma_a
        Absorption per fibre radius, (n, channels).
    """

    model: str
    longitudinal: str
    columns: Mapping[str, Array]
    sigma_a: Array

    def __len__(self) -> int:
        return len(self.sigma_a)

    @property
    def near(self) -> bool:
        """Whether the offset h is known."""
        return "h" in self.columns

    @property
    def channels(self) -> int:
        """Number of channels of f."""
        return self.sigma_a.shape[1]

    @property
    def about(self) -> str:
        """Return the model in words."""
        if self.model == "chiang":
            return f"chiang, {'near' if self.near else 'far'} field"
        return f"{self.model}, {'zinke2008' if self.model == 'dual_scattering' else self.longitudinal}"

    def take(self, rows: Any) -> Inputs:
        """Return some of the cases."""
        return replace(self, columns={k: v[rows] for k, v in self.columns.items()}, sigma_a=self.sigma_a[rows])

    def row(self, i: int) -> dict[str, float]:
        """Return one case by column."""
        names = ("sigma_a",) if self.channels == 1 else SIGMAS
        one = {k: float(v[i]) for k, v in self.columns.items()}
        return one | dict(zip(names, map(float, self.sigma_a[i]), strict=True))


def draw(model: str, count: int, seed: int, *, near: bool, longitudinal: str) -> Inputs:
    """Return cases over the whole box of parameters and directions, each exact in single precision.

    Of eight cases in turn, four aim at R, TT, TRT and the rest, where those have their light; one is anywhere, one near a
    pole, one at grazing inclinations, one of a smooth fibre.
    """
    rng = validate.random_numbers(seed)
    kind = np.arange(count) % 8
    c = _parameters(model, count, rng)
    smooth = kind == 7
    for name in ("beta_m", "beta_n", "beta_R", "beta_N"):
        if name in c:
            low = LIMITS_DRAWN[name][0]
            c[name] = np.where(smooth, low + (c[name] - low) * 0.15, c[name])
    if model != "chiang":
        for name, share in OF_R.items():
            other = c[f"{name.split('_')[0]}_R"] * share * rng.uniform(0.7, 1.3, count)
            c[name] = np.clip(other, *LIMITS_DRAWN[name])
    dual = model == "dual_scattering"  # multiple scattering has a sum for darker fibres only
    sigma_a = 10 ** rng.uniform(-0.3 if dual else -2.5, 1 if dual else 1.5, (count, 3))
    sigma_a[(rng.random(count) < 0.06) & (not dual)] = 0.0
    theta_r = rng.uniform(-1.4, 1.4, count)
    theta_r = np.where(kind == 5, rng.choice([-1, 1], count) * rng.uniform(1.5, _EDGE, count), theta_r)
    theta_r = np.where(kind == 6, rng.choice([-1, 1], count) * rng.uniform(1.25, 1.5, count), theta_r)
    h = rng.uniform(-1, 1, count)
    h = np.where(rng.random(count) < 0.1, np.sign(h) * (1 - 0.05 * np.abs(h)), h)
    aim = np.where(kind < 4, kind, rng.integers(0, 4, count))
    shift, width = _axis(model, c, aim)
    reach = rng.normal(0, 1, count) * np.where(rng.random(count) < 0.2, 3, 1)
    theta_i = np.where(kind == 4, rng.uniform(-_EDGE, _EDGE, count), shift - theta_r + reach * width)
    theta_i = np.abs((theta_i + np.pi / 2) % (2 * np.pi) - np.pi) - np.pi / 2  # past a pole, back on the other side
    theta_i = np.clip(-theta_i, -_EDGE, _EDGE)
    phi = rng.uniform(-np.pi, np.pi, count)
    about = np.clip(aim, 0, 2) * np.pi - 2 * np.arcsin(h) + 2 * np.clip(aim, 0, 2) * np.arcsin(h / c["eta"])
    spread = c["beta_n"] if model == "chiang" else np.radians(c["beta_N"])
    lobe = (kind < 3) | (rng.random(count) < 0.5)
    phi = np.where(lobe & (kind != 4), about + rng.normal(0, 0.7, count) * spread, phi)
    phi = (phi + np.pi) % (2 * np.pi) - np.pi
    phi = np.where((kind == 5) & (rng.random(count) < 0.5), np.pi - 10 ** rng.uniform(-6, -1, count), phi)
    if dual:
        theta_i, theta_r = _by_eights(c, sigma_a, theta_i, theta_r)
    columns = {"theta_i": theta_i, "theta_r": theta_r, "phi": phi, **({"h": h} if near else {}), **c}
    single = {k: v.astype(np.float32).astype(np.float64) for k, v in columns.items()}
    return Inputs(model, longitudinal, single, sigma_a.astype(np.float32).astype(np.float64))


def _by_eights(c: dict[str, Array], sigma_a: Array, theta_i: Array, theta_r: Array) -> tuple[Array, Array]:
    """Let eight cases have one fibre and one theta_d, for these alone set its averages; return the inclinations.

    Sums and differences are exact in single precision.
    """
    first = np.arange(len(theta_i)) // 8 * 8
    for name in c:
        if name != "strands":
            c[name] = c[name][first]
    sigma_a[:] = sigma_a[first]
    step = 2.0**-20
    difference = np.rint((theta_r - theta_i)[first] / 2 * 0.9 / step) * step
    half = np.rint((theta_i + theta_r) / 2 / step) * step
    room = _EDGE - np.abs(difference) - step
    half = np.rint(np.clip(half, -room, room) / step) * step
    return half - difference, half + difference


# The box that is drawn from: that of `cuticle.family`, a little inside where it ends at a singular fibre.
LIMITS_DRAWN = {k: (low, high) for k, (low, high, _) in _BOX.items()} | {
    "beta_R": (1.0, 40.0), "beta_TT": (0.5, 40.0), "beta_TRT": (1.0, 80.0), "alpha_R": (-15.0, 15.0),
}  # fmt: skip


def _parameters(model: str, count: int, rng: np.random.Generator) -> dict[str, Array]:
    found = {}
    for name in PARAMETERS[model]:
        if name == "strands":
            found[name] = rng.choice([0, 0.5, 1, 2, 3.5, 8], count)
        elif name in ("d_f", "d_b"):
            found[name] = rng.uniform(0.3, 1, count)
        else:
            found[name] = rng.uniform(*LIMITS_DRAWN[name], count)
    if model == "dual_scattering":  # where multiple scattering has a sum with Gaussian lobes
        found["beta_R"] = rng.uniform(3, 12, count)
        found["eta"] = rng.uniform(1.3, 1.7, count)
        found["alpha_R"] = rng.uniform(-10, 0, count)
        found["beta_N"] = rng.uniform(6, 30, count)
    return found


def _axis(model: str, c: Mapping[str, Array], lobe: Array) -> tuple[Array, Array]:
    """Return about where a lobe lies in theta_i + theta_r, and its deviation."""
    if model == "chiang":
        root = 0.726 * c["beta_m"] + 0.812 * c["beta_m"] ** 2 + 3.7 * c["beta_m"] ** 20
        factor = np.array([-2.0, 1.0, 4.0, 0.0])[lobe]
        return np.radians(c["alpha"]) * factor, root * np.array([1.0, 0.5, 2.0, 2.0])[lobe]
    names = ("R", "TT", "TRT", "TRT")
    shift, width = (np.choose(lobe.astype(int), [2 * np.radians(c[f"{x}_{p}"]) for p in names]) for x in ("alpha", "beta"))
    return shift, width


@dataclass(frozen=True)
class Region:
    """A part of the box by name: a test of inputs."""

    name: str
    holds: Callable[[Inputs], Mask]


def _any(x: Inputs, test: Callable[[Array], Mask], *names: str) -> Mask:
    return np.asarray(np.any([test(x.columns[n]) for n in names if n in x.columns], axis=0) & np.ones(len(x), bool))


REGIONS: tuple[Region, ...] = (
    Region("near a pole (|theta| > 86°)", lambda x: _any(x, lambda t: np.abs(t) > 1.5, "theta_i", "theta_r")),
    Region("grazing (|theta| > 70°)", lambda x: _any(x, lambda t: np.abs(t) > 1.22, "theta_i", "theta_r")),
    Region("phi near pi (within 10°)", lambda x: np.cos(x.columns["phi"]) < -0.985),
    Region("phi near 0 (within 10°)", lambda x: np.cos(x.columns["phi"]) > 0.985),
    Region("edge of the fibre (|h| > .95)", lambda x: _any(x, lambda h: np.abs(h) > 0.95, "h")),
    Region("smooth along (beta_m < .15, beta_R < 4°)", lambda x: _below(x, beta_m=0.15, beta_R=4.0)),
    Region("smooth across (beta_n < .15, beta_N < 5°)", lambda x: _below(x, beta_n=0.15, beta_N=5.0)),
    Region("rough along (beta_m > .7, beta_R > 25°)", lambda x: _below(x, beta_m=-0.7, beta_R=-25.0)),
    Region("rough across (beta_n > .7, beta_N > 30°)", lambda x: _below(x, beta_n=-0.7, beta_N=-30.0)),
    Region("much tilt (|alpha| > 5°)", lambda x: _any(x, lambda a: np.abs(a) > 5, "alpha", "alpha_R")),
    Region("no absorption (sigma_a < .01)", lambda x: x.sigma_a.max(axis=1) < 0.01),
    Region("dark (sigma_a > 3)", lambda x: x.sigma_a.min(axis=1) > 3),
    Region("index below 1.25", lambda x: x.columns["eta"] < 1.25),
    Region("through strands", lambda x: _any(x, lambda n: n > 0, "strands")),
    Region("everywhere else", lambda x: ~np.any([r.holds(x) for r in REGIONS[:-1]], axis=0)),
)


def _below(x: Inputs, **limits: float) -> Mask:
    """Return where a column lies below its limit, above it where the limit is negative."""
    tests = [x.columns[k] < v if v > 0 else x.columns[k] > -v for k, v in limits.items() if k in x.columns]
    return np.asarray(np.any(tests, axis=0))
