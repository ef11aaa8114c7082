"""Importance samplers for hair-fibre scattering functions, fitted and proven.

The public names are in `__init__.pyi`; a name's module is imported when the name is first asked for.
"""

import lazy_loader

from cuticle._support import moved

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
moved.install()
