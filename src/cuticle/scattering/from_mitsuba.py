"""Any material of Mitsuba 3 as a fibre's scattering function and sampler, in this package's angles.

Mitsuba's `si.wi` is our viewer. In its frame the strand runs along y and z is the surface's normal, so that
sin theta = w.y and the azimuth is atan2(w.z, w.x); at offset h the viewer's azimuth has the cosine -h. Mitsuba folds a
cosine into `eval` (toward the normal for a surface, cos theta_i for `hair`); either way `eval` is our f·cos theta_i.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.backends import check_backend, has_llvm
from cuticle._support.extras import needed
from cuticle._support.progress import Progress, silent
from cuticle._support.quadrature import gauss_legendre
from cuticle._support.values import Value
from cuticle.scattering import conventions
from cuticle.scattering.bcsdf import Plotted
from cuticle.scattering.chiang import PARTS, Chiang, ChiangNear
from cuticle.scattering.registry import first_class, restores
from cuticle.scattering.table_axes import grid_axes
from cuticle.scattering.tabulated import Tabulated

OFFSETS = 24  # Gauss-Legendre points of the angle asin(h) where h is averaged
GRID = (25, 91, 121)
_CHUNK = 2_000_000
# Plugins that Mitsuba knows once a module has been imported.
REGISTERED_BY = {"cuticle": "cuticle.mitsuba"}


class WeightedSample(NamedTuple):
    """Directions toward the light, their pdf (1/sr), and the sampled weight f·cos/pdf, shape (..., channels)."""

    theta_i: NDArray[np.float64]
    phi: NDArray[np.float64]
    pdf: NDArray[np.float64]
    weight: NDArray[np.float64]


@first_class
class MitsubaBsdf(Value, Plotted):
    """A Mitsuba material at one offset h, with eval, pdf and sample in radians. Made by `from_mitsuba`."""

    even = False
    strands = 0.0

    def __init__(self, bsdf: Any, variant: str, h: float, parameters: dict[str, Any] | None = None) -> None:
        self.bsdf, self.variant, self.parameters = bsdf, variant, parameters
        self.h = validate.number("h", h, -1, 1, remedy="it runs over the fibre's width, 0 is its middle")
        self.chiang = _as_chiang(parameters, self.h)
        self.source: dict[str, Any] | None = None
        if parameters is not None:
            self.source = {"parameters": parameters, "h": self.h, "variant": variant}

    @cached_property
    def bsdf(self) -> Any:
        """The material, loaded once more where this object was copied or sent to another process."""
        with _variant(self.variant):
            return _load(self.parameters or {}, {}, fast=False)[1]

    def __getstate__(self) -> dict[str, Any]:
        if self.parameters is None:
            raise TypeError(
                "a material that was loaded before cannot be copied or pickled: give from_mitsuba a plugin's name and"
                " parameters instead"
            )
        return super().__getstate__()

    def __eq__(self, other: object) -> bool:
        same = super().__eq__(other)
        return same and (self.parameters is not None or self.bsdf is other.bsdf)  # type: ignore[attr-defined]

    __hash__ = Value.__hash__

    def __repr__(self) -> str:
        return f"MitsubaBsdf({(self.parameters or {}).get('type', self.bsdf)}, h={self.h:g}, {self.variant})"

    def to_dict(self) -> dict[str, Any]:
        """Return the plugin's parameters if they are known, as values that JSON can hold."""
        return {"source": self.source} if self.source else {}

    @property
    def lobe_names(self) -> tuple[str, ...]:
        """Names of the lobes if they are known: those of `hair`, through `cuticle.Chiang`."""
        return PARTS if self.chiang is not None else ()

    def lobe_densities(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return each lobe's part of f·cos, shape (lobes, ...). Needs non-empty `lobe_names`."""
        assert self.chiang is not None
        f = [self.chiang.eval(theta_i, theta_r, phi, lobes=p).mean(axis=-1) for p in PARTS]
        return np.array(f) * np.cos(theta_i)

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; angles in radians broadcast, the last axis is channels."""
        return self.eval_pdf(theta_i, theta_r, phi)[0]

    def eval_pdf(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return `eval` and `pdf` from one call."""
        (value, density), shape, ti = self._ask(theta_i, theta_r, phi, self.bsdf.eval_pdf)
        f = value.T / np.maximum(np.cos(ti), 1e-9)[:, None]
        return f.reshape(*shape, len(value)), density[0].reshape(shape)

    def pdf(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, strands: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the material's own density per steradian. `strands` is ignored."""
        (density,), shape, _ = self._ask(theta_i, theta_r, phi, lambda *asked: (self.bsdf.pdf(*asked),))
        return density[0].reshape(shape)

    def sample(self, theta_r: ArrayLike, u: ArrayLike) -> WeightedSample:
        """Draw directions; u (..., 3) are Mitsuba's sample1 and sample2.

        A delta sample, such as that of a smooth interface, has no density: its pdf and weight are 0.
        """
        us = validate.random_triples(u, np.float32, "sample1, and both of sample2")
        tr = validate.angles("theta_r", theta_r, validate.HALF_PI, np.float64)
        shape = validate.broadcast(theta_r=tr, u=us[..., 0])
        tr, us = np.broadcast_to(tr, shape).ravel(), np.broadcast_to(us, (*shape, 3)).reshape(-1, 3)
        wi = _direction(tr, self._viewer)
        with _variant(self.variant) as mi:
            delta, context = int(mi.BSDFFlags.Delta), mi.BSDFContext()

            def once(si: Any, numbers: Any) -> tuple[Any, ...]:
                s, weight = self.bsdf.sample(context, si, numbers[0], mi.Point2f(numbers[1], numbers[2]))
                return s.wo, s.pdf, weight, s.sampled_type

            wo, pdf, weight, kind = _run(mi, once, wi, us.T)
        wo = wo.T
        length = np.linalg.norm(wo, axis=1)
        single = (kind[0].astype(np.int64) & delta) != 0  # single directions: no density, and no part of f
        density, weight = np.where(single, 0.0, pdf[0]), np.where(single, 0.0, weight)
        theta = np.arcsin(np.clip(wo[:, 1] / np.maximum(length, 1e-30), -1, 1))
        phi = np.arctan2(wo[:, 2], wo[:, 0]) - self._viewer
        phi = np.pi - np.mod(np.pi - phi, 2 * np.pi)
        return WeightedSample(
            theta.reshape(shape), phi.reshape(shape), density.reshape(shape), weight.T.reshape(*shape, len(weight))
        )

    @property
    def _viewer(self) -> float:
        return float(np.arctan2(np.sqrt(1 - self.h**2), -self.h))

    def _ask(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, what: Callable[..., Any]
    ) -> tuple[tuple[NDArray, ...], tuple[int, ...], NDArray]:
        ti, tr, ph = validate.directions(theta_i, theta_r, phi)
        shape = validate.broadcast(theta_i=ti, theta_r=tr, phi=ph)
        ti, tr, ph = (np.broadcast_to(x, shape).ravel() for x in (ti, tr, ph))
        wi, wo = _direction(tr, self._viewer), _direction(ti, ph + self._viewer)
        with _variant(self.variant) as mi:
            context = mi.BSDFContext()
            return _run(mi, lambda si, light: what(context, si, mi.Vector3f(*light)), wi, wo), shape, ti


def from_mitsuba(
    bsdf: Any,
    h: float | None = None,
    *,
    grid: tuple[int, int, int] = GRID,
    progress: Progress | None = None,
    **parameters: Any,
) -> MitsubaBsdf | Tabulated:
    """Make a scattering function from a Mitsuba material.

    Parameters
    ----------
    bsdf
        A plugin's name such as "hair", with `parameters`; a dictionary for `mi.load_dict`; or a material loaded in the
        current variant.
    h
        Offset of the viewer's ray across the fibre, -1 to 1: the near field at that offset. None: the far field, averaged
        over the width and tabulated on `grid`.
    grid
        Numbers of viewers, theta_i and phi of that table.
    progress
        Called with a phase and a fraction from 0 to 1.
    parameters
        Parameters of the plugin; a tuple of three numbers is a colour.

    Returns
    -------
    MitsubaBsdf or Tabulated
        The near field evaluates the material directly and can be audited. The far field is a table.

    Raises
    ------
    ValueError
        Mitsuba rejects the material, or it scatters into delta directions only.
    RuntimeError
        Mitsuba is not installed.

    Examples
    --------
    >>> model = from_mitsuba("hair", h=0.3, eumelanin=1.3)  # doctest: +SKIP
    """
    variant, loaded, given = _load(bsdf, parameters, fast=h is None)
    if "spectral" in variant:
        raise ValueError(
            f"from_mitsuba needs a variant in RGB, whose three channels f has; the variant is {variant}: mi.set_variant("
            f'"{variant.replace("spectral", "rgb")}") first'
        )
    if h is not None:
        return MitsubaBsdf(loaded, variant, h, given)
    report = progress or silent
    gamma, weight = gauss_legendre(np.array([-np.pi / 2, np.pi / 2]), OFFSETS)
    theta_r, theta_i, phi = grid_axes(grid)
    sheets: list[Any] = [0.0] * len(theta_r)
    for k, (g, w) in enumerate(zip(gamma, weight, strict=True)):
        near = MitsubaBsdf(loaded, variant, float(np.sin(g)), given)
        for i, viewer in enumerate(theta_r):
            report(f"{near.bsdf.class_name() if hasattr(near.bsdf, 'class_name') else 'material'}: h {near.h:+.2f}",
                   (k + i / len(theta_r)) / OFFSETS)  # fmt: skip
            f = near.eval(theta_i[:, None], viewer, phi[None, :])
            sheets[i] = sheets[i] + 0.5 * w * np.cos(g) * f
    report("done", 1.0)
    table = Tabulated(theta_r, theta_i, phi, np.array(sheets))
    if given is not None:
        table.source = {"parameters": given, "h": None, "variant": variant, "grid": list(grid)}
    return table


@restores("parameters")
def _loaded_again(source: dict[str, Any]) -> MitsubaBsdf | Tabulated:
    """Return the material that a sampler was fitted to."""
    options: dict[str, Any] = {"grid": tuple(source["grid"])} if "grid" in source else {}
    return from_mitsuba(source["parameters"], source.get("h"), **options)


def _load(bsdf: Any, parameters: dict[str, Any], fast: bool) -> tuple[str, Any, dict[str, Any] | None]:
    with needed("from_mitsuba"):
        import mitsuba as mi

    if not isinstance(bsdf, (str, dict)):
        if parameters:
            raise TypeError("parameters go with a plugin's name, not with a material that is loaded")
        if not hasattr(bsdf, "eval_pdf"):
            raise TypeError(f"bsdf must be a plugin's name, a dictionary or a material, got {type(bsdf).__name__}")
        return str(mi.variant()), bsdf, None
    given = {**({"type": bsdf} if isinstance(bsdf, str) else bsdf), **parameters}
    for name, value in given.items():
        if value is None:  # Mitsuba crashes
            raise ValueError(f"{name} must be what the plugin takes, a number or a colour, got None; leave it out")
    variant = mi.variant() or ("llvm_ad_rgb" if fast and has_llvm() else "scalar_rgb")
    check_backend(variant)
    with _variant(variant):
        if given.get("type") in REGISTERED_BY:
            importlib.import_module(REGISTERED_BY[given["type"]])
        try:
            loaded = mi.load_dict({k: _value(v) for k, v in given.items()})
        except Exception as error:
            reason = " ".join(str(error).split())
            raise ValueError(f"Mitsuba refuses {given}: {reason}") from None
        if not hasattr(loaded, "eval_pdf"):
            raise ValueError(f"{given.get('type')!r} is not a BSDF of Mitsuba")
        if not mi.has_flag(loaded.flags(), mi.BSDFFlags.Smooth):
            raise ValueError(f"{given.get('type')!r} scatters into single directions only, so it has no density")
    return variant, loaded, given


def _value(value: Any) -> Any:
    return {"type": "rgb", "value": list(value)} if isinstance(value, (tuple, list)) and len(value) == 3 else value


@contextmanager
def _variant(name: str) -> Iterator[Any]:
    """Mitsuba in a variant, for a while; where none was set, that one stays."""
    import mitsuba as mi

    before = mi.variant() or name
    mi.set_variant(name)
    try:
        yield mi
    finally:
        mi.set_variant(before)


def _direction(theta: NDArray, azimuth: NDArray | float) -> NDArray[np.float32]:
    """Directions in Mitsuba's frame, shape (3, n)."""
    c = np.cos(theta)
    return np.array([c * np.cos(azimuth), np.sin(theta), c * np.sin(azimuth)], np.float32)


def _interaction(mi: Any, wi: Any, count: int) -> Any:
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, count)  # its constructor leaves scalar fields as memory had them
    si.wi = mi.Vector3f(*wi)
    si.sh_frame = mi.Frame3f(mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1))
    si.n = mi.Normal3f(0, 0, 1)
    si.uv = mi.Point2f(0.5, 0.5)
    return si


def _run(
    mi: Any, once: Callable[[Any, Any], tuple[Any, ...]], wi: NDArray, other: NDArray
) -> tuple[NDArray[np.float64], ...]:
    """Call `once` for each viewer and column of `other`, in scalar variants one by one; return results as (rows, n)."""
    if not wi.shape[1]:
        raise ValueError("there must be at least one direction to ask for")
    if "scalar" in mi.variant():
        answers: list[tuple[Any, ...]] = []
        last, si = None, None
        for viewer, point in zip(wi.T.tolist(), other.astype(np.float32).T.tolist(), strict=True):
            if viewer != last:
                last, si = viewer, _interaction(mi, viewer, 1)
            answers.append(once(si, point))
        return tuple(
            np.array([x if isinstance(x, (int, float)) else tuple(x) for x in column], np.float64).reshape(len(column), -1).T
            for column in zip(*answers, strict=True)
        )
    parts = []
    for start in range(0, wi.shape[1], _CHUNK):
        lanes = [
            [mi.Float(np.ascontiguousarray(row, np.float32)) for row in a[:, start : start + _CHUNK]] for a in (wi, other)
        ]
        size = len(lanes[0][0])
        parts.append([_wide(np.array(r), size) for r in once(_interaction(mi, lanes[0], size), lanes[1])])
    return tuple(np.concatenate(column, axis=1).astype(np.float64) for column in zip(*parts, strict=True))


def _wide(x: NDArray, size: int) -> NDArray:
    """A result that is the same for all, as one for each."""
    x = np.atleast_2d(x)
    return np.broadcast_to(x, (x.shape[0], size)) if x.shape[1] != size else x


def _as_chiang(parameters: dict[str, Any] | None, h: float) -> ChiangNear | None:
    """The same hair as ours, where the material is Mitsuba's `hair` with plain numbers."""
    if not parameters or parameters.get("type") != "hair":
        return None
    known = {k: v for k, v in parameters.items() if k != "type"}
    try:
        return Chiang(**conventions.from_host("mitsuba", **known)).near(h)
    except (TypeError, ValueError):
        return None
