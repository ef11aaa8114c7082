"""What is drawn: lobes, tables of lobes, and how well a density matches a scattering function."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["densities"])
