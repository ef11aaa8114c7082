"""Chiang's far field: what fitted lobes give, what drawing h at random gives, and each channel's share.

python benchmarks/far_field.py
"""

from __future__ import annotations

import numpy as np

import cuticle
from cuticle._support.quadrature import adapted_edges, gauss_legendre, grid
from cuticle.scattering.bcsdf import evaluate, luminance

HAIRS = {
    "blond, roughness .25/.3": {"beta_m": 0.25, "beta_n": 0.3, "eumelanin": 0.3},
    "brown, .3/.3": {"beta_m": 0.3, "beta_n": 0.3, "eumelanin": 1.3},
    "black, .3/.3": {"beta_m": 0.3, "beta_n": 0.3, "eumelanin": 8.0},
    "black, .15/.15": {"beta_m": 0.15, "beta_n": 0.15, "eumelanin": 8.0},
    "blond, .15/.15": {"beta_m": 0.15, "beta_n": 0.15, "eumelanin": 0.3},
}
VIEWERS = np.radians(np.arange(-70, 71, 10.0))


def random_offset_ess(model: cuticle.Chiang, theta_r: float) -> float:
    """ESS of drawing h evenly over the width and then from the near field there, f and pdf being those at that h.

    The weight is f(h)/p(h); its second moment is the mean over h of (∫ f cos at h)², the pdf at h being f cos up to that.
    """
    gamma, weight = gauss_legendre(np.linspace(-np.pi / 2, np.pi / 2, 9), 8)
    share = weight * np.cos(gamma) / 2
    energies = []
    for h in np.sin(gamma):
        near = model.near(h)
        edges = adapted_edges(
            lambda c, near=near: luminance(evaluate(near, c.theta, theta_r, c.phi)) * np.cos(c.theta)[:, None],
            even=False, coarse=(180, 60), fine=(60, 40),
        )  # fmt: skip
        g = grid(*edges, 3)
        energies.append(
            float((g.weights * np.cos(g.theta)[:, None] * luminance(evaluate(near, g.theta, theta_r, g.phi))).sum())
        )
    e = np.array(energies)
    return float((share @ e) ** 2 / (share @ e**2))


def main() -> None:
    print("| hair | h at random | K = 1 | 2 | 4 | 8 | 8, objective rgb | worst channel: K = 8, rgb (bound), best of all |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, given in HAIRS.items():
        model = cuticle.Chiang(**given)
        at_random = np.mean([random_offset_ess(model, float(t)) for t in VIEWERS[::2]])
        cells = []
        fits = {k: cuticle.fit(model, k).sampler for k in (1, 2, 4, 8)}
        rgb = cuticle.fit(model, 8, objective="rgb").sampler
        for sampler in (*fits.values(), rgb):
            ess = [cuticle.measure(sampler, model, float(t)).ess for t in VIEWERS]
            cells.append(f"{np.mean(ess):.3f} ({min(ess):.3f})")
        bright, every = ([min(cuticle.measure(s, model, float(t)).ess_channels) for t in VIEWERS] for s in (fits[8], rgb))
        bounds = [cuticle.channel_bounds(model, float(t)) for t in VIEWERS]
        rgb_bound, best = min(min(b.rgb) for b in bounds), min(b.worst for b in bounds)
        channels = f"{min(bright):.3f}, {min(every):.3f} ({rgb_bound:.3f}), {best:.3f}"
        print(f"| {name} | {at_random:.3f} | {' | '.join(cells)} | {channels} |", flush=True)


if __name__ == "__main__":
    main()
