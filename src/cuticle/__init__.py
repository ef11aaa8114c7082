"""Importance samplers for hair-fibre scattering functions, fitted and proven.

The public names are in `__init__.pyi`; a name's module is imported when the name is first asked for.
"""

from cuticle._support import lazy, moved

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
moved.install()
