"""What a sample costs, in calibration kernels (16 expf of varying inputs): ratios that `make bench` measured."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

MEASURED = "sample_costs.json"  # beside this file; benchmarks/bench.py --write makes it anew


@cache
def measured_costs() -> dict[str, Any]:
    """Return the measured costs: "origin" says where and how, "uniform" and "lobes" (by their number) the kernels."""
    from importlib.resources import files  # a fit that is told its number of lobes asks nothing here

    return json.loads(files(__package__).joinpath(MEASURED).read_text(encoding="utf-8"))


def sample_cost(lobes: int) -> float:
    """Return the cost of one sample with its pdf, of a number of lobes; 0 is a uniform direction.

    The core pads lobes to a power of two, so 3 lobes cost what 4 do.
    """
    costs = measured_costs()
    if lobes == 0:
        return float(costs["uniform"])
    return float(next(cost for count, cost in costs["lobes"].items() if int(count) >= lobes))


def traced_cost(lobes: int, *, path: float = 30.0) -> float:
    """Return the cost of one sample and of the path behind it, smooth in the number of lobes.

    `path` is what tracing and shading one ray costs beside the sampler: an assumption, of the order of 1.5 microseconds. The
    sampler's own cost is a line through `make bench`'s K = 4, 8, 16.
    """
    return path + 1.05 + 0.04 * lobes
