"""Importance samplers for hair-fibre scattering functions, fitted and proven."""

from __future__ import annotations

from cuticle import densities, presets
from cuticle.check import Report, check
from cuticle.combine import combine
from cuticle.distribution import Distribution, tabulate
from cuticle.document import Document, document
from cuticle.fibre import Fibre
from cuticle.fit import Fit, fit
from cuticle.models import Averages, Bcsdf, DualScattering, Marschner
from cuticle.quality import Quality, measure
from cuticle.sampler import Sample, Sampler
from cuticle.version import __version__

__all__ = [
    "Averages",
    "Bcsdf",
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
    "__version__",
    "check",
    "combine",
    "densities",
    "document",
    "fit",
    "measure",
    "presets",
    "tabulate",
]
