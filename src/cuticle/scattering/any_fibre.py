"""The far field of any fibre: every parameter is an argument, an array where fibres differ, and nothing is fitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle._support.values import Value
from cuticle.scattering import conventions
from cuticle.scattering.bcsdf import Plotted, Sample, luminance_weights
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.fibre import Fibre


@dataclass(frozen=True)
class Parameter:
    """A parameter of a family: its range, its default and its unit; degrees where the core takes radians."""

    low: float
    high: float
    default: float | None
    unit: str = ""


DEGREES = "degrees"
_ETA = Parameter(1.05, 3.0, 1.55)
FORMS: dict[str, dict[str, Parameter]] = {
    "chiang": {
        "beta_m": Parameter(0.05, 1, 0.3), "beta_n": Parameter(0.05, 1, 0.3), "alpha": Parameter(-20, 20, 2.0, DEGREES),
        "eta": _ETA,
    },
    "marschner": {
        "alpha_R": Parameter(-45, 45, -7.5, DEGREES), "alpha_TT": Parameter(-45, 45, None, DEGREES),
        "alpha_TRT": Parameter(-45, 45, None, DEGREES), "beta_R": Parameter(0.5, 60, 7.5, DEGREES),
        "beta_TT": Parameter(0.25, 60, None, DEGREES), "beta_TRT": Parameter(0.5, 90, None, DEGREES),
        "beta_N": Parameter(1, 45, 10.0, DEGREES), "eta": _ETA,
    },
}  # fmt: skip
# Of a lobe that is left out, out of R's, as `Fibre` has it.
OF_R = {"alpha_TT": -0.5, "alpha_TRT": -1.5, "beta_TT": 0.5, "beta_TRT": 2.0}
ABSORPTION = ("sigma_a", "eumelanin", "pheomelanin", "color")
TEXTURED = (*dict.fromkeys(name for form in FORMS.values() for name in form), *ABSORPTION)  # what may vary in a renderer


@dataclass(frozen=True, eq=False)
class Fibres(Value):
    """Fibres of a family, made by `Family.fibres`.

    Attributes
    ----------
    form
        The family's name.
    parameters
        As the core takes them: in the order of `Family.parameters`, angles in radians. Shape (..., parameters).
    sigma_a
        Absorption per fibre radius, shape (..., channels), 1 or 3.
    """

    form: str
    parameters: NDArray[np.float64]
    sigma_a: NDArray[np.float64]

    def __post_init__(self) -> None:
        validate.choice("form", self.form, FORMS)
        count = len(FORMS[self.form])
        for name, columns in (("parameters", (count,)), ("sigma_a", (1, 3))):
            x = np.array(getattr(self, name), np.float64)
            if x.ndim == 0 or x.shape[-1] not in columns:
                raise ValueError(f"{name} must have a last axis of {' or '.join(map(str, columns))}, got shape {x.shape}")
            if not np.isfinite(x).all():
                raise ValueError(f"{name} must be finite numbers; Family.fibres makes them, and tells their ranges")
            x.setflags(write=False)  # they were checked
            object.__setattr__(self, name, x)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array of fibres; () for one."""
        return np.broadcast_shapes(self.parameters.shape[:-1], self.sigma_a.shape[:-1])

    @property
    def channels(self) -> int:
        """Number of channels of f."""
        return self.sigma_a.shape[-1]

    def __repr__(self) -> str:
        return f"Fibres({self.form}, shape {self.shape}, {self.channels} channels)"


@dataclass(frozen=True)
class Around:
    """What surrounds a strand: the core's functions that know it, and what they take beside the strand's own."""

    eval: Callable[..., None]
    sample: Callable[..., None]
    arrays: Mapping[str, NDArray] = field(default_factory=dict)
    options: tuple[bool, ...] = ()

    def flat(self, shape: tuple[int, ...]) -> tuple[Any, ...]:
        """Return the arrays of a common shape as the core takes them, then the options."""
        return *(validate.flat(a, shape) for a in self.arrays.values()), *self.options


class Family(Value):
    """The far field of any fibre of a model, in closed form: f, its density and exact samples.

    The density is the luminance of f·cos over its integral, so the luminance has an ESS of 1. No table is read and nothing
    is fitted; include/cuticle/scattering/far_field.h has the method.

    The fibre is the last argument of each function: a `Chiang` or a `Fibre`, as the family has it; what `fibres` returns; or
    keywords, such as beta_m=roughness, of numbers and arrays. Arrays broadcast with those of directions.

    Parameters
    ----------
    form
        "chiang", Chiang et al. 2016 (`cuticle.Chiang`); or "marschner", Marschner 2003 with d'Eon's energy-conserving M
        (`cuticle.Marschner` of a `cuticle.Fibre`).

    Examples
    --------
    >>> import cuticle, numpy as np
    >>> chiang = cuticle.family("chiang")
    >>> roughness = np.linspace(0.1, 0.9, 5)
    >>> s = chiang.sample(0.2, [0.1, 0.6, 0.3], beta_m=roughness, eumelanin=1.3)
    >>> bool(np.all(s.pdf == chiang.pdf(s.theta_i, 0.2, s.phi, beta_m=roughness, eumelanin=1.3)))
    True
    """

    among_others = False

    def __init__(self, form: str = "chiang") -> None:
        self.form = validate.choice("family", form, FORMS)

    def __repr__(self) -> str:
        return f"Family({self.form!r}: {', '.join(self.parameters)}, and {' or '.join(ABSORPTION)})"

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Each parameter's range and default, beside the absorption."""
        return FORMS[self.form]

    def fibres(self, **values: ArrayLike | None) -> Fibres:
        """Return fibres from numbers and arrays, which broadcast.

        Parameters
        ----------
        values
            By name: those of `parameters`; and the absorption as one of sigma_a (per radius; a last axis of 1 or 3
            channels, a number being one), color (linear RGB, likewise, of Chiang's fibres) or eumelanin and pheomelanin.

        Raises
        ------
        ValueError
            A parameter is unknown, missing or out of its range; shapes do not broadcast.
        """
        given = {k: v for k, v in values.items() if v is not None}
        unknown = sorted(given.keys() - self.parameters.keys() - set(ABSORPTION))
        if unknown:
            raise ValueError(
                f"fibres of {self.form!r} have no parameter {unknown[0]!r}; they have {', '.join(self.parameters)},"
                f" {', '.join(ABSORPTION)}"
            )
        found = {name: _checked(name, given[name], p) for name, p in self.parameters.items() if name in given}
        for name, p in self.parameters.items():
            if name not in found and p.default is not None:
                found[name] = np.array(p.default)
        for name, share in OF_R.items():
            if name in self.parameters and name not in found:
                found[name] = share * found[f"{name.split('_')[0]}_R"]
        sigma_a = self._absorption(given, found.get("beta_n"))
        columns = [np.radians(found[n]) if p.unit == DEGREES else found[n] for n, p in self.parameters.items()]
        shape = validate.broadcast(**dict(zip(self.parameters, columns, strict=True)), absorption=sigma_a[..., 0])
        parameters = np.stack([np.broadcast_to(c, shape) for c in columns], axis=-1)
        return Fibres(self.form, parameters, np.broadcast_to(sigma_a, (*shape, sigma_a.shape[-1])))

    def _absorption(self, given: Mapping[str, Any], beta_n: NDArray | None) -> NDArray[np.float64]:
        ways = [w for w in (("sigma_a",), ("color",), ("eumelanin", "pheomelanin")) if any(n in given for n in w)]
        if len(ways) != 1 or (ways[0] == ("color",) and beta_n is None):
            raise ValueError(
                "a fibre needs one absorption: sigma_a (per radius), eumelanin and pheomelanin, or, for Chiang's fibres,"
                f" color; got {' and '.join(n for w in ways for n in w if n in given) or 'none'}"
            )
        if "sigma_a" in given:
            sigma_a = validate.array("sigma_a", given["sigma_a"], 0, 1000, np.float64, remedy="it is per fibre radius")
            return _of_channels("sigma_a", sigma_a)
        if "color" in given:
            assert beta_n is not None
            color = _of_channels("color", validate.real("color", given["color"]))
            validate.broadcast(color=color[..., 0], beta_n=beta_n)
            return conventions.sigma_a_of_color(color, beta_n[..., None])
        pigment = {n: _checked(n, given.get(n, 0.0), Parameter(0, 100, 0.0)) for n in ways[0]}
        validate.broadcast(**pigment)
        return conventions.sigma_a_of_pigment(pigment["eumelanin"], pigment["pheomelanin"])

    def _fibres(self, fibre: Any, values: Mapping[str, Any]) -> Fibres:
        if fibre is not None and values:
            raise ValueError(
                "give the fibre as one argument or by keywords, not both;"
                f" got {type(fibre).__name__} and {', '.join(values)}"
            )
        if fibre is None or isinstance(fibre, Mapping):
            return self.fibres(**(fibre or values))
        if isinstance(fibre, Fibres) and fibre.form == self.form:
            return fibre
        if isinstance(fibre, Chiang) and self.form == "chiang":
            return self.fibres(
                beta_m=fibre.beta_m, beta_n=fibre.beta_n, alpha=fibre.alpha, eta=fibre.eta, sigma_a=fibre.absorption
            )
        if isinstance(fibre, Fibre) and self.form == "marschner":
            named = {name: x for name, x in fibre.values().items() if name in self.parameters}
            return self.fibres(**named, sigma_a=fibre.absorption)
        wanted = "Chiang" if self.form == "chiang" else "Fibre"
        raise TypeError(f"fibre must be a cuticle.{wanted}, Fibres of {self.form!r}, or keywords; got {fibre!r}")

    def eval(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, fibre: Any = None, **values: ArrayLike
    ) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine: the broadcast shape plus a last axis of channels. Arguments as `eval_pdf`."""
        return self.eval_pdf(theta_i, theta_r, phi, fibre, **values)[0]

    def pdf(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, fibre: Any = None, **values: ArrayLike
    ) -> NDArray[np.float64]:
        """Return the density of `sample`, per steradian. Arguments as `eval_pdf`."""
        return self.eval_pdf(theta_i, theta_r, phi, fibre, **values)[1]

    def eval_pdf(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, fibre: Any = None, **values: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return f and the density: one computation gives both.

        Parameters
        ----------
        theta_i, theta_r, phi
            Radians. theta in [-pi/2, pi/2]; phi = phi_i - phi_r. In single precision if all arrays are.
        fibre, values
            The fibres, see the class.

        Returns
        -------
        f, pdf
            1/sr: f without a cosine, of the broadcast shape plus a last axis of channels; and the density.
        """
        dtype = validate.float_type(theta_i, theta_r, phi)
        ti, tr, ph = validate.directions(theta_i, theta_r, phi, dtype)
        around, own = self._around(values, dtype)
        fibres = self._fibres(fibre, own)
        shape = validate.broadcast(theta_i=ti, theta_r=tr, phi=ph, fibres=np.empty(fibres.shape), **around.arrays)
        f, pdf = np.empty((math.prod(shape), fibres.channels), dtype), np.empty(math.prod(shape), dtype)
        if pdf.size:
            ti, tr, ph = (validate.flat(a, shape) for a in (ti, tr, ph))
            around.eval(*self._rows(fibres, shape, dtype), ti, tr, ph, *around.flat(shape), f, pdf)
        return f.reshape(*shape, fibres.channels), pdf.reshape(shape)

    def sample(self, theta_r: ArrayLike, u: ArrayLike, fibre: Any = None, **values: ArrayLike) -> Sample:
        """Draw directions toward the light.

        Parameters
        ----------
        theta_r
            The viewer's inclination, radians. Broadcasts against u.shape[:-1] and the fibres.
        u
            Uniform random numbers in [0, 1), shape (..., 3): for the lobe, theta and phi. The remainder of the first smooths
            the azimuth and turns the direction about the lobe's axis.
        fibre, values
            The fibres, see the class.

        Returns
        -------
        Sample
            theta_i, phi (radians) and their pdf (1/sr); in single precision if theta_r and u are.
        """
        dtype = validate.float_type(theta_r, u)
        us = validate.random_triples(u, dtype)
        tr = validate.angles("theta_r", theta_r, validate.HALF_PI, dtype)
        around, own = self._around(values, dtype)
        fibres = self._fibres(fibre, own)
        shape = validate.broadcast(theta_r=tr, u=us[..., 0], fibres=np.empty(fibres.shape), **around.arrays)
        count = math.prod(shape)
        theta_i, phi, pdf = (np.empty(count, dtype) for _ in range(3))
        if count:
            flat_u = np.ascontiguousarray(np.broadcast_to(us, (*shape, 3))).reshape(-1)
            f = np.empty((count, fibres.channels), dtype)
            rows, tr = self._rows(fibres, shape, dtype), validate.flat(tr, shape)
            around.sample(*rows, tr, flat_u, *around.flat(shape), theta_i, phi, f, pdf)
        return Sample(theta_i.reshape(shape), phi.reshape(shape), pdf.reshape(shape))

    def sampler_at(self, fibre: Any = None, **values: ArrayLike) -> FibreSampler:
        """Return the function and sampler of one fibre, as `cuticle.audit`, `measure` and `fit` take them."""
        return FibreSampler(self, self._fibres(fibre, values))

    def _around(self, values: Mapping[str, Any], dtype: Any) -> tuple[Around, Mapping[str, Any]]:
        """Take what tells the surroundings out of keywords: of a strand alone there is nothing."""
        return Around(_core.far_eval, _core.far_sample), values

    def _rows(self, fibres: Fibres, shape: tuple[int, ...], dtype: Any) -> tuple[bool, NDArray, NDArray, NDArray]:
        """What the core takes: the form, rows of parameters and of absorptions, and luminance weights."""

        def rows(x: NDArray) -> NDArray:
            whole = x if math.prod(fibres.shape) == 1 else np.broadcast_to(x, (*shape, x.shape[-1]))
            return np.ascontiguousarray(whole.reshape(-1, x.shape[-1]), dtype)

        weights = luminance_weights(fibres.channels).astype(dtype)
        return self.form == "chiang", rows(fibres.parameters), rows(fibres.sigma_a), weights


class FibreSampler(Value, Plotted):
    """A family's function and sampler of one fibre: `Family.sampler_at` makes it.

    Attributes
    ----------
    strands
        The number of strands toward the light, in families that know them.
    """

    even = True

    def __init__(self, family: Family, fibre: Fibres, strands: float = 0.0) -> None:
        if fibre.shape != ():
            raise ValueError(f"sampler_at takes one fibre, got an array of shape {fibre.shape}")
        self.family, self.fibre, self.strands = family, fibre, strands

    def __repr__(self) -> str:
        names = FORMS[self.fibre.form]
        values = ", ".join(f"{n}={v:.6g}" for n, v in zip(names, self.fibre.parameters, strict=True))
        around = f", {self.strands:g} strands" if self.family.among_others else ""
        return f"FibreSampler({self.family.form}, radians: {values}, sigma_a={tuple(self.fibre.sigma_a.tolist())}{around})"

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return self.fibre.channels

    def with_strands(self, strands: float) -> FibreSampler:
        """Return the same with another number of strands toward the light; ignored by families that know none."""
        return FibreSampler(self.family, self.fibre, strands if self.family.among_others else 0.0)

    def eval(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine; as `Family.eval`."""
        return self.family.eval(theta_i, theta_r, phi, self.fibre, **self._strands(None))

    def pdf(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, strands: ArrayLike | None = None) -> NDArray:
        """Return the density of `sample`, per steradian. `strands`: another number of them, or an array."""
        return self.family.pdf(theta_i, theta_r, phi, self.fibre, **self._strands(strands))

    def sample(self, theta_r: ArrayLike, u: ArrayLike, strands: ArrayLike | None = None) -> Sample:
        """Draw directions toward the light; as `Family.sample`. `strands`: another number of them, or an array."""
        return self.family.sample(theta_r, u, self.fibre, **self._strands(strands))

    def _strands(self, strands: ArrayLike | None) -> dict[str, ArrayLike]:
        return {"strands": self.strands if strands is None else strands} if self.family.among_others else {}


def _of_channels(name: str, values: NDArray) -> NDArray:
    """Return values with a last axis of channels; a number is one."""
    values = values.reshape(1) if values.ndim == 0 else values
    if values.shape[-1] not in (1, 3):
        raise ValueError(f"{name} must have a last axis of 1 or 3 channels, got shape {values.shape}; add an axis")
    return values


def _checked(name: str, value: ArrayLike, p: Parameter) -> NDArray[np.float64]:
    unit = f" {p.unit}" if p.unit else ""
    return validate.array(name, value, p.low, p.high, np.float64, remedy=f"the family holds{unit} in that range")
