"""The compiled core, in the build that suits this processor.

`from cuticle import _core` is the extension itself: this module puts it in its own place. A wheel for x86-64 on Linux holds
two. `_native` runs on any processor; `_native_v3` needs x86-64-v3 (AVX2, FMA), and CUTICLE_BASELINE=1 leaves it aside. A
package that was compiled where it runs holds `_native` alone.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from typing import TYPE_CHECKING

_NEEDED = frozenset(b"abm avx avx2 bmi1 bmi2 f16c fma movbe xsave".split())  # x86-64-v3, in the kernel's words
_CPU = "/proc/cpuinfo"


def _runs_v3() -> bool:
    """Return whether the processor has x86-64-v3 and the kernel keeps its registers."""
    try:
        with open(_CPU, "rb") as file:
            head = file.read(8192)  # the first processor; a machine may have hundreds
    except OSError:
        return False
    flags = next((line for line in head.split(b"\n") if line.startswith(b"flags")), b"")
    return set(flags.split()) >= _NEEDED


def _name() -> str:
    v3 = "cuticle._native_v3"
    wanted = not os.environ.get("CUTICLE_BASELINE") and importlib.util.find_spec(v3) is not None
    return v3 if wanted and _runs_v3() else "cuticle._native"


if TYPE_CHECKING:
    from cuticle._native import *  # noqa: F403
else:
    sys.modules[__name__] = importlib.import_module(_name())
