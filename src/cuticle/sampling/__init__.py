"""What is drawn: lobes, tables of lobes, and how well a density matches a scattering function."""

from cuticle._support import lazy

__getattr__, __dir__, __all__ = lazy.attach(__name__, {"densities": __name__})
