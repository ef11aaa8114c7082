"""A single fibre in the far field: R, TT and TRT (Marschner 2003, d'Eon 2011)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle import _core
from cuticle._support import validate
from cuticle._support.values import Value
from cuticle.scattering.azimuthal import AzimuthalTables, azimuthal_tables, evaluate_core, lobe_mask
from cuticle.scattering.bcsdf import Plotted
from cuticle.scattering.fibre import LOBES, Fibre
from cuticle.scattering.fibre_tables import FibreTables
from cuticle.scattering.registry import first_class

LONGITUDINAL = ("gaussian", "energy_conserving")
LONGITUDINAL_OF = {"exact": "energy_conserving", "zinke2008": "gaussian"}


@first_class
@dataclass(frozen=True, eq=False)
class Marschner(Value, Plotted):
    """Far-field scattering of a single fibre: lobes R, TT, TRT with azimuthal roughness.

    f = Σ_p M_p N_p. N_p is a quadrature over the offset h, smoothed by beta_N. docs/models.md lists the differences from
    the papers.

    Parameters
    ----------
    fibre
        The fibre.
    longitudinal
        "gaussian": M_p = g(theta_h - alpha_p)/cos² theta_d (Marschner 2003, Eq. 1); reciprocal, but does not conserve
        energy. "energy_conserving": M_p of d'Eon 2011, Eq. 7, over cos theta_i; conserves energy, but is not reciprocal.
    """

    fibre: Fibre
    longitudinal: str = "gaussian"
    even = True
    many_viewers = True
    strands = 0.0

    def __post_init__(self) -> None:
        check_fibre(self.fibre)
        validate.choice("longitudinal", self.longitudinal, LONGITUDINAL)

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` needs, as values that JSON can hold."""
        return {"fibre": self.fibre.to_dict(), "longitudinal": self.longitudinal}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Marschner:
        """Return the function that `to_dict` described."""
        return cls(Fibre(**data["fibre"]), data.get("longitudinal", "gaussian"))

    @property
    def channels(self) -> int:
        """Length of the last axis of what `eval` returns."""
        return self.fibre.channels

    @cached_property
    def tables(self) -> AzimuthalTables:
        """The azimuthal tables, shared by models of one fibre."""
        f = self.fibre
        return azimuthal_tables(f.eta, f.absorption, float(np.radians(f.beta_N)), self._conserving)

    @property
    def _conserving(self) -> bool:
        return self.longitudinal == "energy_conserving"

    def host_tables(self) -> FibreTables:
        """Return what the core's closed forms read, in single precision."""
        f, direct = self.fibre, self.tables.direct.astype(np.float32)
        return FibreTables(f.alpha, f.beta, self._conserving, direct, deviation=float(np.radians(f.beta_N)))

    @cached_property
    def _core(self) -> _core.Model:
        return _core.Model(self.fibre.alpha, self.fibre.beta, self._conserving, self.tables.direct)

    def eval(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, *, lobes: str | Iterable[str] | None = None
    ) -> NDArray[np.float64]:
        """Return f in 1/sr, without a cosine.

        Parameters
        ----------
        theta_i, theta_r, phi
            Radians; arrays broadcast. theta in [-pi/2, pi/2]; phi = phi_i - phi_r.
        lobes
            One of "R", "TT", "TRT", or several. Default: all.

        Returns
        -------
        ndarray
            Broadcast shape plus a last axis of channels.

        Raises
        ------
        ValueError
            An angle is out of range or not a number, shapes do not broadcast, or a lobe is unknown.

        Examples
        --------
        >>> import cuticle
        >>> model = cuticle.Marschner(cuticle.Fibre.preset("brown"))
        >>> model.eval([0.1, 0.2], 0.0, 3.0).shape
        (2, 3)
        """
        return evaluate_core(self._core, self.channels, lobe_mask(lobes, LOBES), theta_i, theta_r, phi)


def check_fibre(fibre: object) -> None:
    """Raise TypeError where `fibre` is no `Fibre`."""
    if not isinstance(fibre, Fibre):
        raise TypeError(f"fibre must be a cuticle.Fibre, got {type(fibre).__name__}; Fibre.preset('brown') makes one")
