"""What a sample costs on this machine, in calibration kernels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cuticle import _core
from cuticle.sampling.sampler import Sampler

UNIFORM = "uniform sphere"
_INPUTS, _ROUNDS = 2048, 41


def measure_costs(samplers: Mapping[str, tuple[Sampler, float]]) -> dict[str, float]:
    """Return the cost of a sample with its pdf, and of a uniform direction, in calibration kernels.

    A kernel is 16 independent expf calls on varying inputs. Single precision, one thread, lobes prepared for every
    sample; medians of rounds in which everything is timed in turn. `make bench` does the same outside Python.

    Parameters
    ----------
    samplers
        Name -> (sampler, number of strands).
    """
    rng = np.random.default_rng(1)
    x = rng.random(_INPUTS + 16, np.float32)
    theta_r = rng.uniform(-1.5, 1.5, _INPUTS).astype(np.float32)
    u = rng.random(3 * _INPUTS, np.float32)
    tables = {name: (sampler._table(np.float32), float(n)) for name, (sampler, n) in samplers.items()}
    rounds = []
    for _ in range(_ROUNDS):
        row = [_core.kernel_cost(x), _core.uniform_cost(u)]
        row += [table.sample_cost(theta_r, u, n) for table, n in tables.values()]
        rounds.append(row)
    kernel, *others = np.median(rounds, axis=0)
    return dict(zip([UNIFORM, *tables], (float(c / kernel) for c in others), strict=True))
