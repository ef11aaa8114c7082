"""The scattering function that a sampler was fitted to, from what its file says."""

from __future__ import annotations

from cuticle.fibre import Fibre
from cuticle.models import DualScattering, Marschner
from cuticle.sampler import Sampler


def model_of(sampler: Sampler) -> DualScattering | Marschner:
    """Return the model that a sampler was fitted to.

    Raises
    ------
    ValueError
        The sampler does not say which fibre it is for.
    """
    fibre, about = sampler.fibre, sampler.about
    if not isinstance(fibre, Fibre):
        raise ValueError(
            "this sampler does not say which fibre it is for: it was fitted to a function of your own, or to none"
        )
    if about.get("model") == "Marschner":
        return Marschner(fibre, about.get("longitudinal", "gaussian"))
    return DualScattering(fibre, sampler.covers[0], about.get("formulation"))
