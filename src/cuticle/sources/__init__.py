"""Scattering functions from elsewhere: measured or simulated tables, functions, Mitsuba's materials."""

from cuticle.sources.functions import Function, from_callable
from cuticle.sources.mitsuba import MitsubaBsdf, from_mitsuba
from cuticle.sources.tabulated import Tabulated

__all__ = ["Function", "MitsubaBsdf", "Tabulated", "from_callable", "from_mitsuba"]
