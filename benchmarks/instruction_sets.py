"""What a wheel for any x86-64 loses without AVX2 and FMA: its two extensions, in turn, on this machine.

    python benchmarks/instruction_sets.py

Run it with the Python of an environment that a wheel was installed in. Figures are medians over pairs of processes of the
processor's time, and of their ratios.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys

PAIRS = 7
CODE = """
import json, time
import numpy as np
import cuticle
from cuticle import _core

rng = np.random.default_rng(1)
n = 200_000
u, theta, phi = rng.random((n, 3)), rng.uniform(-1.5, 1.5, n), rng.uniform(-3, 3, n)
singles = [x.astype(np.float32) for x in (u, theta, phi)]
fibre = cuticle.Fibre.preset("brown")
model, family = cuticle.DualScattering(fibre), cuticle.family("chiang")
found = {"extension": _core.__name__}


def measure(name, work, least=3):
    best = np.inf
    for _ in range(least):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    found[name] = best


fit = cuticle.fit(cuticle.Marschner(fibre), 4)
sampler = fit.sampler
measure("samples of 4 lobes, one viewer each, single", lambda: sampler.sample(singles[1], singles[0]))
measure("samples of 4 lobes, one viewer each, double", lambda: sampler.sample(theta, u))
measure("pdf of 4 lobes, one viewer, single", lambda: sampler.pdf(singles[1], np.float32(0.3), singles[2]))
measure("f of dual scattering, double", lambda: model.with_strands(2).eval(theta, 0.3, phi))
measure("samples of any fibre, double", lambda: family.sample(theta[:20_000], u[:20_000], eumelanin=1.3))
measure("a fit of 4 lobes, direct light", lambda: cuticle.fit(cuticle.Marschner(fibre), 4), 2)
print(json.dumps(found))
"""


def once(baseline: bool) -> dict[str, float]:
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    environment.pop("CUTICLE_BASELINE", None)
    if baseline:
        environment["CUTICLE_BASELINE"] = "1"
    done = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    if (found.pop("extension") == "cuticle._native_v3") == baseline:
        sys.exit("there is one extension only: install a wheel that `make wheel` made, on a processor with AVX2")
    return dict(found)


def main() -> None:
    pairs = [(once(True), once(False)) for _ in range(PAIRS)]
    print("| work | x86-64 | x86-64-v3 | ratio |\n| --- | --- | --- | --- |")
    for name in pairs[0][0]:
        plain, wide = (statistics.median(p[i][name] for p in pairs) for i in (0, 1))
        ratio = statistics.median(p[0][name] / p[1][name] for p in pairs)
        print(f"| {name} | {1e3 * plain:.3g} ms | {1e3 * wide:.3g} ms | {ratio:.2f} |")


if __name__ == "__main__":
    main()
