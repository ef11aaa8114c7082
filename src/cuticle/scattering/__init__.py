"""What scatters: fibres and their scattering functions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["conventions", "presets"])
