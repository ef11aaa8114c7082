"""Importance samplers for hair-fibre scattering functions, fitted and proven."""

from __future__ import annotations

from cuticle import conventions, densities, presets
from cuticle.audit import Audit, audit, audit_dump
from cuticle.check import Report, check
from cuticle.chiang import Chiang, ChiangNear
from cuticle.combine import combine
from cuticle.distribution import Distribution, tabulate
from cuticle.document import Document, document
from cuticle.fibre import Fibre
from cuticle.fit import Fit, fit
from cuticle.models import Averages, Bcsdf, DualScattering, Marschner
from cuticle.quality import ChannelBounds, Quality, channel_bounds, measure
from cuticle.sampler import Sample, Sampler
from cuticle.sources import Tabulated, from_callable, from_mitsuba
from cuticle.strands import Strands
from cuticle.version import __version__

__all__ = [
    "Audit",
    "Averages",
    "Bcsdf",
    "ChannelBounds",
    "Chiang",
    "ChiangNear",
    "Distribution",
    "Document",
    "DualScattering",
    "Fibre",
    "Fit",
    "Marschner",
    "Quality",
    "Report",
    "Sample",
    "Sampler",
    "Strands",
    "Tabulated",
    "__version__",
    "audit",
    "audit_dump",
    "channel_bounds",
    "check",
    "combine",
    "conventions",
    "densities",
    "document",
    "fit",
    "from_callable",
    "from_mitsuba",
    "measure",
    "presets",
    "tabulate",
]
