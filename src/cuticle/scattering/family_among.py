"""Any fibre among strands of a mean one: its parameters and the number of strands are arguments."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from cuticle import _core
from cuticle._support import validate
from cuticle.scattering.any_fibre import FORMS, Around, Family, Fibres, FibreSampler
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.mean_strands import MeanStrands, mean_strands

FAMILIES = (*FORMS, "dual_scattering")
_SURROUNDINGS = ("strands", "behind", "random")


class FamilyAmong(Family):
    """Any fibre among strands of a mean fibre, in closed form: f, its density and exact samples.

    Light reaches the strand directly, or through others; the strands behind it send some back, as in
    `DualScattering` with "exact". The strand keeps its own energies, tilts and widths. What other strands do to light is the
    mean fibre's, of which tables are made once, in a few seconds.

    Each function takes, beside the fibre:

    - `strands`, the number of strands toward the light, 0 to 10,000, whole or not; an array broadcasts. Default 0.
    - `behind`, how many are expected beyond this strand, away from the light. Default: no end of them.
    - `random`, whether `strands` is the mean of a Poisson number. Default: False.

    Where the number is known only once there is a direction, draw and take the density with one number, such as 2, and f
    with the right one.

    Parameters
    ----------
    among
        The mean fibre: a `Fibre`, and the family is "marschner"'s, or a `Chiang`. Its absorption must be above 0 in every
        channel; fibres have as many channels, or one.
    d_f, d_b
        Densities of the strands around, 0 to 1, by which light through them and from behind is multiplied. Default: the
        mean fibre's own, and 1 of a `Chiang`.

    Raises
    ------
    TypeError
        `among` is no fibre.
    ValueError
        A density is out of range, an absorption is 0, or the mean fibre is meant for another formulation than "exact".

    Examples
    --------
    >>> import cuticle, numpy as np
    >>> hair = cuticle.family("dual_scattering", among=cuticle.Fibre.preset("brown"))
    >>> s = hair.sample(0.2, np.random.default_rng(1).random((5, 3)), alpha_R=-3, eumelanin=[0.5, 1, 2, 4, 8], strands=2)
    >>> s.pdf.shape
    (5,)
    """

    among_others = True

    def __init__(self, among: Fibre | Chiang, *, d_f: float | None = None, d_b: float | None = None) -> None:
        if not isinstance(among, (Fibre, Chiang)):
            raise TypeError(f"among must be the mean fibre, a cuticle.Fibre or a cuticle.Chiang; got {among!r}")
        if getattr(among, "formulation", "exact") != "exact":
            raise ValueError(
                f"among must have the formulation exact, got {among.formulation}, which has no density of its own;"  # type: ignore[union-attr]
                ' among.replace(formulation="exact") has it'
            )
        super().__init__("chiang" if isinstance(among, Chiang) else "marschner")
        self.among = among
        self.d_f, self.d_b = (
            validate.number(name, getattr(among, name, 1.0) if given is None else given, 0, 1)
            for name, given in (("d_f", d_f), ("d_b", d_b))
        )
        self.around  # noqa: B018 - refuses what has no tables, here and not at the first direction

    def __repr__(self) -> str:
        return f"{super().__repr__()}, among {self.among!r}"

    @property
    def channels(self) -> int:
        """Number of channels of f."""
        return self.around.energy.shape[-1]

    @cached_property
    def around(self) -> MeanStrands:
        """Tables of the strands around."""
        return mean_strands(self.among)

    @cached_property
    def _core_double(self) -> Any:
        return self._made(_core.AmongDouble, np.float64)

    @cached_property
    def _core_float(self) -> Any:
        return self._made(_core.AmongFloat, np.float32)

    def _made(self, of: Any, dtype: Any) -> Any:
        given = (x if isinstance(x, float) else np.ascontiguousarray(x, dtype) for x in self.around)
        return of(*given, self.d_f, self.d_b)

    def sampler_at(self, fibre: Any = None, **values: Any) -> FibreSampler:
        """Return the function and sampler of one fibre, through `strands` of them, for `cuticle.audit`, `measure`, `fit`."""
        strands = values.pop("strands", 0.0)
        if others := [name for name in _SURROUNDINGS if name in values]:
            raise ValueError(f"sampler_at takes strands alone of what is around the fibre; {others[0]} is for pdf, sample")
        n = validate.number("strands", strands, 0, validate.MAX_STRANDS)
        return FibreSampler(self, self._fibres(fibre, values), n)

    def _fibres(self, fibre: Any, values: Mapping[str, Any]) -> Fibres:
        fibres = super()._fibres(fibre, values)
        if fibres.channels == self.channels:
            return fibres
        if fibres.channels > 1:
            raise ValueError(
                f"fibres must have as many channels as the mean fibre, {self.channels}, or one; got {fibres.channels}: give"
                f" among an absorption of {fibres.channels} channels"
            )
        return Fibres(fibres.form, fibres.parameters, np.repeat(fibres.sigma_a, self.channels, axis=-1))

    def _around(self, values: Mapping[str, Any], dtype: Any) -> tuple[Around, Mapping[str, Any]]:
        rest = {k: v for k, v in values.items() if k not in _SURROUNDINGS}
        strands = validate.strands_of_light("strands", values.get("strands", 0.0)).astype(dtype)
        behind = values.get("behind")
        end = np.finfo(dtype).max if behind is None else validate.strands_of_light("behind", behind)
        core = self._core_double if dtype == np.float64 else self._core_float
        arrays = {"strands": strands, "behind": np.asarray(end, dtype)}
        return Around(core.eval, core.sample, arrays, (validate.flag("random", values.get("random", False)),)), rest


def family(form: str, among: Fibre | Chiang | None = None, *, d_f: float | None = None, d_b: float | None = None) -> Family:
    """Return the far field of any fibre of a model, every parameter an argument.

    Parameters
    ----------
    form
        "chiang" or "marschner", a `Family` of a strand on its own; "dual_scattering", a `FamilyAmong`, of a strand among
        others.
    among, d_f, d_b
        Of "dual_scattering", see `FamilyAmong`: the mean fibre of the strands around, and their densities.

    Raises
    ------
    ValueError
        An unknown family; "dual_scattering" without `among`, or `among` with another.
    """
    if validate.choice("family", form, FAMILIES) == "dual_scattering":
        if among is None:
            raise ValueError("the family 'dual_scattering' needs among, the mean fibre of the strands around")
        return FamilyAmong(among, d_f=d_f, d_b=d_b)
    for name, given in (("among", among), ("d_f", d_f), ("d_b", d_b)):
        if given is not None:
            raise ValueError(f"{name} is for the family 'dual_scattering'; {form!r} is of a strand on its own")
    return Family(form)
