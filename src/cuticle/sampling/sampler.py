"""The sampler: a mixture of product lobes, whose parameters are interpolated in a small table."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle._support import validate
from cuticle._support.extras import needed
from cuticle._support.files import read_text, reading, write_text
from cuticle._support.json_file import NUMBER, array, file_schema, parse
from cuticle._support.values import Value
from cuticle.sampling.families import FAMILIES, NORMAL, PACKED, core_table, padded
from cuticle.sampling.lobe_table import PARAMETERS, check_table
from cuticle.scattering.bcsdf import Sample
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.presets import PRESETS

FORMAT_VERSION = 1


class LobeSet(NamedTuple):
    """The lobes at one theta_r: arrays with one value per lobe, of both rows where two strand counts are blended.

    Weights sum to 1. Means and sigmas are in radians.
    """

    weight: NDArray[np.float64]
    mean_theta: NDArray[np.float64]
    mean_phi: NDArray[np.float64]
    sigma_theta: NDArray[np.float64]
    sigma_phi: NDArray[np.float64]


FILE = file_schema(
    "sampler",
    {
        "lobes": {"type": "integer"},
        "theta_nodes": {"type": "integer"},
        "strands": array(NUMBER),
        "even": {"type": "boolean"},
        "nodes": array(NUMBER, 4),  # [strands][theta_nodes][parameter][lobe], radians
        "energy": array(NUMBER, 2),  # [strands][theta_nodes], ∫ f cos
    },
    {"parameters": array({"type": "string"}), "family": {"type": "string"}, "about": {"type": "object"}},
)


def fitted(name: str, value: Any, remedy: str = "cuticle.fit makes one") -> Sampler:
    """Return `value` if it is a `Sampler`, with lobes of its own, or raise TypeError."""
    if not isinstance(value, Sampler):
        raise TypeError(f"{name} must be a cuticle.Sampler, got {type(value).__name__}; {remedy}")
    return value


@dataclass(frozen=True, eq=False)
class Sampler(Value):
    """Samples directions toward the light for a given viewer, and returns their density.

    The density is a mixture of K lobes: a density in theta_i truncated to [-pi/2, pi/2], times one in phi. Lobe parameters
    are tabulated over theta_r and the number of strands, and interpolated linearly. Between 0 strands and the next count,
    the densities of both rows are mixed in proportion to their energies, as the scattering function is.

    `cuticle.fit` makes samplers; `Sampler.load` reads them from files.

    Parameters
    ----------
    nodes
        Lobe parameters, shape (strand counts, theta nodes, 5, K): weight, mean_theta, mean_phi, sigma_theta, sigma_phi,
        in radians. The nodes are evenly spaced in theta_r from -pi/2 to pi/2. Weights sum to 1. A mean lies at most one
        sigma outside its domain.
    energy
        ∫ f cos theta_i d omega_i at each node, shape (strand counts, theta nodes).
    strands
        Increasing strand counts, one per row.
    even
        True: lobes are densities in abs(phi) on [0, pi], with either sign equally likely. False: each lobe covers the
        period around its mean.
    about
        What the sampler was fitted to; anything that JSON can hold.
    family
        Density of a lobe along each coordinate, one of `cuticle.sampling.families.FAMILIES`.
    """

    nodes: NDArray[np.float64]
    energy: NDArray[np.float64]
    strands: tuple[float, ...] = (0.0,)
    even: bool = True
    about: dict[str, Any] = field(default_factory=dict)
    family: str = NORMAL

    def __post_init__(self) -> None:
        nodes = np.array(self.nodes, np.float64)
        energy = np.array(self.energy, np.float64)
        object.__setattr__(self, "strands", tuple(float(n) for n in self.strands))
        check_table(nodes, energy, self.strands, self.even)
        validate.choice("family", self.family, FAMILIES)
        for name, value in (("nodes", nodes), ("energy", energy)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        counts = ", ".join(f"{n:g}" for n in self.strands)
        form = f"{self.about['form']}, " if "form" in self.about else ""
        kind = "" if self.family == NORMAL else f"{self.family} "
        return f"Sampler({form}{self.lobes} {kind}lobes, {self.nodes.shape[1]} theta nodes, strands {counts})"

    @property
    def lobes(self) -> int:
        """Number of lobes K."""
        return self.nodes.shape[3]

    @property
    def fibre(self) -> Fibre | None:
        """The fibre that the sampler was fitted to, or None."""
        return Fibre(**self.about["fibre"]) if "fibre" in self.about else None

    @property
    def covers(self) -> tuple[float, ...]:
        """Strand counts that the sampler serves: one per row, or those that `cuticle.combine` merged into one row."""
        return validate.strand_counts("covers", self.about["covers"]) if "covers" in self.about else self.strands

    def row(self, strands: float) -> Sampler:
        """Return the sampler of one strand count.

        Raises
        ------
        ValueError
            The count lies between 0 and the next row's. Two mixtures are blended there, which one row cannot hold.
        """
        n = validate.number("strands", strands, 0, validate.MAX_STRANDS)
        angles = np.linspace(-validate.HALF_PI, validate.HALF_PI, self.nodes.shape[1])
        mixtures = [np.array(self.mixture(float(t), n)) for t in angles]  # the core interpolates
        if mixtures[0].shape[1] > self.lobes:
            raise ValueError(f"strands must be 0 or at least {min(self.strands[1], 1):g} for one row, got {n:g}")
        energy = [np.interp(n, self.strands, e) for e in self.energy.T]
        return Sampler(np.array([mixtures]), np.array([energy]), (n,), self.even, self.about, self.family)

    def pdf(self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, strands: ArrayLike | None = None) -> NDArray:
        """Return the density of a direction, per steradian (d omega = cos(theta_i) d theta_i d phi).

        Parameters
        ----------
        theta_i, theta_r, phi
            Radians; arrays broadcast. The result is in single precision if all arrays are.
        strands
            Number of strands toward the light. Beyond the last count, the last row is used. Optional if the sampler
            covers one count only.

        Returns
        -------
        ndarray
            1/sr, of the broadcast shape.

        Raises
        ------
        ValueError
            An angle is out of range or not a number, shapes do not broadcast, or strands are missing.
        """
        dtype = validate.float_type(theta_i, theta_r, phi)
        ti, tr, ph = validate.directions(theta_i, theta_r, phi, dtype)
        n = self._strands(strands, dtype)
        shape = validate.broadcast(theta_i=ti, theta_r=tr, phi=ph, strands=n)
        out = np.empty(math.prod(shape), dtype)
        if out.size:
            self._table(dtype).pdf(*(validate.flat(a, shape) for a in (ti, tr, ph, n)), out)
        return out.reshape(shape)

    def sample(self, theta_r: ArrayLike, u: ArrayLike, strands: ArrayLike | None = None) -> Sample:
        """Draw directions toward the light.

        Parameters
        ----------
        theta_r
            The viewer's inclination, radians. Broadcasts against u.shape[:-1].
        u
            Uniform random numbers in [0, 1), shape (..., 3): for the lobe, theta and phi.
        strands
            As in `pdf`.

        Returns
        -------
        Sample
            theta_i and phi in radians, pdf in 1/sr; in single precision if theta_r and u are.

        Examples
        --------
        >>> import numpy as np
        >>> sampler = Sampler(np.array([1.0, 0.0, 0.3, np.pi, 0.6]).reshape(1, 1, 5, 1).repeat(2, 1), np.ones((1, 2)))
        >>> theta_i, phi, p = sampler.sample(0.2, [[0.5, 0.5, 0.0]])
        >>> float(theta_i[0]), round(float(phi[0]), 6)
        (0.0, -3.141593)
        """
        dtype = validate.float_type(theta_r, u)
        us = validate.random_triples(u, dtype)
        tr = validate.angles("theta_r", theta_r, validate.HALF_PI, dtype)
        n = self._strands(strands, dtype)
        shape = validate.broadcast(theta_r=tr, u=us[..., 0], strands=n)
        count = math.prod(shape)
        theta_i, phi, p = np.empty(count, dtype), np.empty(count, dtype), np.empty(count, dtype)
        if count:
            flat_u = np.ascontiguousarray(np.broadcast_to(us, (*shape, 3))).reshape(-1)
            self._table(dtype).sample(validate.flat(tr, shape), flat_u, validate.flat(n, shape), theta_i, phi, p)
        return Sample(theta_i.reshape(shape), phi.reshape(shape), p.reshape(shape))

    def mixture(self, theta_r: float, strands: float | None = None) -> LobeSet:
        """Return the lobes at one theta_r (radians): K of them, or 2 K between 0 and the next strand count."""
        tr = validate.number("theta_r", theta_r, -validate.HALF_PI, validate.HALF_PI, remedy=validate.RADIANS)
        out = np.empty((2, *padded(self.nodes).shape[2:]))
        self._double.mixture(tr, float(self._strands(strands, np.float64)), out)
        rows = out[:, :, : self.lobes] if out[1, 0].any() else out[:1, :, : self.lobes]
        return LobeSet(*np.concatenate(list(rows), axis=1))

    def cdf_theta(self, theta_i: ArrayLike, theta_r: ArrayLike, lobe: int, strands: ArrayLike | None = None) -> NDArray:
        """Return one lobe's cdf in theta: the probability of an inclination below theta_i (radians)."""
        x = validate.angles("theta_i", theta_i, validate.HALF_PI, np.float64)
        return self._one_lobe(0, False, lobe, x, theta_r, strands)

    def icdf_theta(self, u: ArrayLike, theta_r: ArrayLike, lobe: int, strands: ArrayLike | None = None) -> NDArray:
        """Return one lobe's inverse cdf in theta: the inclination (radians) below which the probability is u in [0, 1]."""
        x = validate.array("u", u, 0, 1, np.float64, remedy="u is a probability")
        return self._one_lobe(0, True, lobe, x, theta_r, strands)

    def cdf_phi(self, phi: ArrayLike, theta_r: ArrayLike, lobe: int, strands: ArrayLike | None = None) -> NDArray:
        """Return one lobe's cdf in phi: the probability of an azimuth between -pi and phi (radians)."""
        x = validate.angles("phi", phi, math.pi, np.float64)
        return self._one_lobe(1, False, lobe, x, theta_r, strands)

    def icdf_phi(self, u: ArrayLike, theta_r: ArrayLike, lobe: int, strands: ArrayLike | None = None) -> NDArray:
        """Return one lobe's inverse cdf in phi: the azimuth (radians) up to which, from -pi, the probability is u."""
        x = validate.array("u", u, 0, 1, np.float64, remedy="u is a probability")
        return self._one_lobe(1, True, lobe, x, theta_r, strands)

    def cell_probabilities(
        self, theta_edges: ArrayLike, phi_edges: ArrayLike, theta_r: float, strands: float | None = None
    ) -> NDArray[np.float64]:
        """Return the exact probability of each cell of a (theta, phi) grid, from the closed-form cdfs.

        Edges are in radians and increase, theta in [-pi/2, pi/2], phi in [-pi, pi]. Rows of the result are theta cells.
        """
        weights = self.mixture(theta_r, strands).weight
        total = np.zeros((np.size(theta_edges) - 1, np.size(phi_edges) - 1))
        for lobe, weight in enumerate(weights):
            if weight > 0:
                along_theta = np.diff(self.cdf_theta(theta_edges, theta_r, lobe, strands))
                along_phi = np.diff(self.cdf_phi(phi_edges, theta_r, lobe, strands))
                total += weight * np.outer(along_theta, along_phi)
        return total

    def plot(self, theta_r: float = 0.0, strands: float | None = None, *, axes: Any = None) -> Any:
        """Draw the pdf, 1/sr, over all directions toward the light; return the Matplotlib axes.

        Parameters
        ----------
        theta_r
            The viewer's inclination, radians in [-pi/2, pi/2].
        strands
            Number of strands. Default: the first that the sampler covers.
        axes
            Axes to draw on. Default: those of a new figure.
        """
        with needed("a plot"):  # Matplotlib takes a second to import
            from cuticle._support.plots import plot_density

        tr = validate.number("theta_r", theta_r, -validate.HALF_PI, validate.HALF_PI, remedy=validate.RADIANS)
        n = self.covers[0] if strands is None else strands
        return plot_density(lambda theta, phi: self.pdf(theta, tr, phi, n), tr, f"pdf, {n:g} strands", axes)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the sampler to a JSON file; the file is replaced whole, or left as it was."""
        return write_text(path, self.to_json())

    def to_json(self) -> str:
        """Return the sampler as JSON text; `cuticle.sampling.sampler.FILE` is its JSON Schema."""
        file = {
            "format": "cuticle-sampler", "version": FORMAT_VERSION, "parameters": PARAMETERS, "lobes": self.lobes,
            "theta_nodes": self.nodes.shape[1], "strands": self.strands, "even": self.even, "nodes": self.nodes.tolist(),
            "energy": self.energy.tolist(), "family": self.family, "about": self.about,
        }  # fmt: skip
        if self.family == NORMAL:  # files of normal lobes stay as they were: what reads them knows no other
            del file["family"]
        return json.dumps(file, allow_nan=False) + "\n"

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Sampler:
        """Read a sampler from a JSON file, or from the folder that `cuticle fit` wrote; raise ValueError with the reason."""
        file = Path(path)
        if not file.exists() and str(path) in PRESETS:
            raise ValueError(f"{path} is a fibre, not the file of a sampler: `cuticle fit {path} -o {path}` makes one")
        file = file / "sampler.json" if file.is_dir() else file
        return cls.from_json(read_text(file, "sampler"), source=str(file))

    @classmethod
    def from_json(cls, text: str, *, source: str = "sampler") -> Sampler:
        """Read a sampler from JSON text; error messages call it `source`."""
        with reading(source, "sampler"):
            return cls._parsed(text, source)

    @classmethod
    def _parsed(cls, text: str, source: str) -> Sampler:
        file = parse(text, FILE, what="sampler", version=FORMAT_VERSION, source=source)
        parameters = file.get("parameters", list(PARAMETERS))
        if parameters != list(PARAMETERS):
            raise ValueError(f"{source} is refused: parameters must be {list(PARAMETERS)}, got {parameters}")
        try:
            nodes, energy = np.array(file["nodes"], np.float64), np.array(file["energy"], np.float64)
        except ValueError:
            raise ValueError(f"{source} is refused: nodes or energy is ragged; every row must have one length") from None
        expected = (len(file["strands"]), file["theta_nodes"], len(PARAMETERS), file["lobes"])
        if nodes.shape != expected:
            raise ValueError(f"{source} is refused: nodes has shape {nodes.shape}, its header says {expected}")
        about, family = file.get("about", {}), file.get("family", NORMAL)
        try:
            return cls(nodes, energy, tuple(file["strands"]), file["even"], about, family)
        except ValueError as error:
            raise ValueError(f"{source} is refused: {error}") from None

    @property
    def padded_nodes(self) -> NDArray[np.float64]:
        """`nodes` padded with lobes of weight 0 to 1, 2, 4, 8, 16 or 32 lobes, which fill vectors."""
        return padded(self.nodes, PACKED)

    def _table(self, dtype: Any) -> Any:
        return self._single if dtype == np.float32 else self._double

    @cached_property
    def _single(self) -> Any:
        return core_table(self.nodes, self.energy, self.strands, self.even, self.family, np.float32)

    @cached_property
    def _double(self) -> Any:
        return core_table(self.nodes, self.energy, self.strands, self.even, self.family)

    def _strands(self, strands: ArrayLike | None, dtype: Any) -> NDArray:
        if strands is None:
            if len(self.strands) > 1:
                counts = ", ".join(f"{n:g}" for n in self.strands)
                raise ValueError(f"strands must be given: this sampler covers {counts}; pass strands=0 for direct light")
            strands = self.strands[0]
        return validate.array(
            "strands", strands, 0, validate.MAX_STRANDS, dtype, remedy="it counts strands toward the light"
        )

    def _one_lobe(
        self, coordinate: int, inverse: bool, lobe: int, x: NDArray, theta_r: ArrayLike, strands: ArrayLike | None
    ) -> NDArray:
        tr = validate.angles("theta_r", theta_r, validate.HALF_PI, np.float64)
        n = self._strands(strands, np.float64)
        blended = float(n.min(initial=math.inf)) > 0 and float(n.max(initial=0)) < 1 and self._blends
        count = self.lobes * (2 if blended else 1)
        index = validate.integer("lobe", lobe, 0, count - 1)
        shape = validate.broadcast(x=x, theta_r=tr, strands=n)
        out = np.empty(math.prod(shape))
        if out.size:
            arrays = (validate.flat(a, shape) for a in (x, tr, n))
            self._double.lobe(coordinate, inverse, index % self.lobes, index >= self.lobes, *arrays, out)
        return out.reshape(shape)

    @property
    def _blends(self) -> bool:
        return len(self.strands) > 1 and self.strands[0] == 0
