"""The interface of a scattering function, and what its consumers compute from it: f·cos, luminance, strand counts."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple, Protocol, cast, runtime_checkable
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.extras import needed

REC709 = (0.2126, 0.7152, 0.0722)
_UNEVEN = 1e-3  # of the largest f, between the two sides of a function that is even
_EVEN: WeakValueDictionary[int, Bcsdf] = WeakValueDictionary()  # models that were looked at, by id


class Sample(NamedTuple):
    """Directions toward the light and their density: theta_i and phi in radians, pdf in 1/sr."""

    theta_i: NDArray
    phi: NDArray
    pdf: NDArray


@runtime_checkable
class Bcsdf(Protocol):
    """A scattering function: any object with this `eval`.

    A model with f(phi) = f(-phi) should set `even = True`; one lobe then serves both sides. One that is faster at many
    theta_r than one by one may set `many_viewers = True`; a fit then asks for several at once. Both are False by default.
    """

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine. Angles are radians, arrays broadcast, the last axis holds the channels."""
        ...


class Plotted:
    """A scattering function that draws itself."""

    def plot(self, theta_r: float = 0.0, *, axes: Any = None) -> Any:
        """Draw the luminance of f·cos(theta_i), 1/sr, over all directions toward the light; return the Matplotlib axes.

        Parameters
        ----------
        theta_r
            The viewer's inclination, radians in [-pi/2, pi/2].
        axes
            Axes to draw on. Default: those of a new figure.
        """
        with needed("a plot"):  # Matplotlib takes a second to import
            from cuticle._support.plots import plot_density

        tr = validate.number("theta_r", theta_r, -validate.HALF_PI, validate.HALF_PI, remedy=validate.RADIANS)

        def f_cos(theta_i: NDArray, phi: NDArray) -> NDArray:
            return luminance(evaluate(cast(Bcsdf, self), theta_i[:, 0], tr, phi[0]))

        return plot_density(f_cos, tr, "f·cos θ_i", axes)


def is_even(model: object) -> bool:
    """Return whether a model declares itself even in phi; the default is no."""
    return bool(getattr(model, "even", False))


def checked_even(model: Bcsdf) -> bool:
    """Return the same, after a look at both sides of three viewers' highlights; raise ValueError where they differ.

    What is no number, or of a wrong shape, is left to `evaluate` and to tables, in which NaN is a hole.
    """
    if not is_even(model) or _EVEN.get(id(model)) is model:
        return is_even(model)
    side = np.linspace(0.1, 3.0, 16)
    for viewer in (-0.7, 0.1, 1.0):
        theta_i = np.clip(-viewer + np.linspace(-0.4, 0.4, 9), -1.5, 1.5)
        f = validate.real(
            "what model.eval returns", model.eval(theta_i[:, None], viewer, np.concatenate([side, -side])[None])
        )
        if f.shape[:-1] != (len(theta_i), 2 * len(side)):
            return True
        right, left = np.split(np.where(np.isfinite(f), f, np.nan), 2, axis=1)
        apart = np.nan_to_num(np.abs(right - left))
        if apart.max() > _UNEVEN * np.nan_to_num(f).max():
            at = np.unravel_index(int(np.argmax(apart)), apart.shape)
            raise ValueError(
                f"a model with even=True must be even in phi, {model!r} is not: f is {right[at]:.4g} at theta_i"
                f" {theta_i[at[0]]:.4g}, theta_r {viewer:.4g}, phi {side[at[1]]:.4g} rad and {left[at]:.4g} at phi"
                f" {-side[at[1]]:.4g}; leave even out"
            )
    with suppress(TypeError):  # of a class without weak references: it is looked at again
        _EVEN[id(model)] = model
    return True


def strands_of(model: object) -> float:
    """Return a model's number of strands; the default is 0."""
    return float(getattr(model, "strands", 0.0))


def check_model(model: object) -> None:
    """Raise TypeError if `model` is not a scattering function."""
    if not callable(getattr(model, "eval", None)):
        remedy = {
            "Fibre": "; Marschner(fibre) is what it scatters, DualScattering(fibre) the same among strands",
            "str": "; Marschner(Fibre.preset('brown')) is one",
        }.get(type(model).__name__, "")
        raise TypeError(f"model must have eval(theta_i, theta_r, phi), got {type(model).__name__}{remedy}")
    if hasattr(model, "sampler_at"):
        raise TypeError(f"model must be one fibre's, got {model!r}; its sampler_at(fibre) is one")


def with_strands(model: Any, strands: float) -> Any:
    """Return the model for a number of strands, or the model itself if it does not depend on strands."""
    return model.with_strands(strands) if hasattr(model, "with_strands") else model


def evaluate(model: Bcsdf, theta_i: NDArray, theta_r: float | NDArray, phi: NDArray) -> NDArray[np.float64]:
    """Return f·cos(theta_i) on the product of two axes, (A, B, channels); raise ValueError for NaN or f < 0.

    Of several viewers (E,), whose axes may be their own, (E, A) and (E, B): (E, A, B, channels).
    """
    if isinstance(theta_r, np.ndarray) and not getattr(model, "many_viewers", False):
        axes = (np.broadcast_to(x, (len(theta_r), x.shape[-1])) for x in (theta_i, phi))
        return np.array([evaluate(model, ti, float(tr), ph) for tr, ti, ph in zip(theta_r, *axes, strict=True)])
    viewers = theta_r[:, None, None] if isinstance(theta_r, np.ndarray) else theta_r
    angles = theta_i[..., :, None], viewers, phi[..., None, :]
    f = validate.real("what model.eval returns", model.eval(*angles))
    f = np.asarray(f, np.float64)
    shape = np.broadcast_shapes(*map(np.shape, angles))
    if f.shape[:-1] != shape:
        raise ValueError(
            f"model.eval must return shape {(*shape, 'channels')} for angles that broadcast to {shape}, got {f.shape}"
        )
    if f.size and not (f.min() >= 0 and f.max() < np.inf):  # of a NaN both are NaN
        at = tuple(np.argwhere(~(np.isfinite(f) & (f >= 0)))[0])
        there = [float(np.broadcast_to(x, shape)[at[:-1]]) for x in angles]
        raise ValueError(
            f"model.eval must be finite and at least 0, got {f[at]:g} at theta_i {there[0]:.4g},"
            f" theta_r {there[1]:.4g}, phi {there[2]:.4g} rad"
        )
    return f * np.cos(theta_i)[..., :, None, None]


def luminance_weights(channels: int) -> NDArray[np.float64]:
    """Return the weight of each channel in the luminance: Rec. 709 for three channels, else equal weights."""
    return np.array(REC709) if channels == 3 else np.full(channels, 1 / channels)


def luminance(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the luminance over the last axis: Rec. 709 for three channels, else their mean."""
    return values @ luminance_weights(values.shape[-1])
