"""What scatters: fibres and their scattering functions."""

from cuticle._support import lazy

__getattr__, __dir__, __all__ = lazy.attach(__name__, {"conventions": __name__, "presets": __name__})
