"""Where the energy goes: the figures of docs/models.md.

∫ f cos over the sphere of a fibre that absorbs nothing, with the Gaussian longitudinal function, with d'Eon's and N taken
at theta_d, and with ours (N at the viewer's inclination); and the backscatter as printed beside the sum of all orders.
"""

from __future__ import annotations

import numpy as np
from scipy.special import i0e

import cuticle
from cuticle import _core

VIEWERS = (0, 30, 60, 70, 80, -80)


def with_n_at_theta_d(fibre: cuticle.Fibre, theta_r: float) -> float:
    """∫ f cos with d'Eon's M and the lobes' energies taken at theta_d; orders past TRT folded into TRT."""
    theta_i = (np.arange(7200) + 0.5) / 7200 * np.pi - np.pi / 2
    theta_d = np.abs(theta_r - theta_i) / 2
    h = (np.arange(2000) + 0.5) / 1000 - 1
    cos_gamma = np.sqrt(1 - h**2)
    energies = []
    for t in np.linspace(0, np.pi / 2, 300):
        f = np.array([_core.fresnel(float(c), fibre.eta) for c in np.cos(t) * cos_gamma[1000:]])
        energies.append((f.mean(), ((1 - f) ** 2).mean(), ((1 - f) * f).mean()))
    total = 0.0
    for p, (alpha, beta) in enumerate(zip(fibre.alpha, fibre.beta, strict=True)):
        v, cone = 4 * beta**2, 2 * alpha - theta_r
        x = np.abs(np.cos(theta_i) * np.cos(cone)) / v
        m = np.exp(np.sin(theta_i) * np.sin(cone) / v + x - 1 / v) * i0e(x) / (v * (1 - np.exp(-2 / v)))
        energy = np.interp(theta_d, np.linspace(0, np.pi / 2, 300), [e[p] for e in energies])
        total += float((m * energy * np.cos(theta_i)).sum() * np.pi / 7200)
    return total


def furnace(model: cuticle.Marschner, theta_r: float) -> float:
    return float(cuticle.tabulate(model, theta_r, n_theta=720, n_phi=180).energy[0])


def main() -> None:
    print("∫ f cos, sigma_a = 0, at theta_r", ", ".join(f"{t}°" for t in VIEWERS))
    for name in ("document", "marschner", "brown"):
        fibre = cuticle.Fibre.preset(name).replace(sigma_a=0.0)
        rows = {
            "Gaussian / cos² theta_d": lambda t, f=fibre: furnace(cuticle.Marschner(f), t),
            "d'Eon, N at theta_d": lambda t, f=fibre: with_n_at_theta_d(f, t),
            "ours, N at theta_r": lambda t, f=fibre: furnace(cuticle.Marschner(f, "energy_conserving"), t),
        }
        for label, energy in rows.items():
            print(f"  {name:10} {label:25}", "  ".join(f"{energy(np.radians(t)):.4f}" for t in VIEWERS))

    print("\nbackscatter: a_f, a_b | A_b printed, all orders | shift printed, exact | deviation printed, exact")
    print("(alpha_f 2°, alpha_b -6°, beta_f 8°, beta_b 12°)")
    shape = [np.radians(x) for x in (2, -6, 8, 12)]
    for a_f, a_b in ((0.5, 0.2), (0.8, 0.1), (0.8, 0.15), (0.8, 0.19), (0.8, 0.2 - 1e-6), (0.95, 0.04)):
        printed, exact = (_core.backscatter(a_f, a_b, *shape, form, 0.7) for form in (False, True))
        angles = " | ".join(
            f"{np.degrees(p):6.2f}° {np.degrees(e):6.2f}°" for p, e in list(zip(printed, exact, strict=True))[1:]
        )
        lost = 1 - printed[0] / exact[0]
        print(f"  {a_f:.2f} {a_b:.2f} | {printed[0]:.4f} {exact[0]:.4f} ({100 * lost:.0f} % lost) | {angles}")

    print("\nwhat comes through n strands, all orders, over a_f^n")
    for a_f, a_b in ((0.8, 0.1), (0.9, 0.05)):
        energy = _core.backscatter(a_f, a_b, *shape, True, 1.0)[0]
        # A fraction s^n of the light on a half space passes n strands (Stokes 1862, a pile of plates).
        passed = a_f / (1 - a_b * (a_b + float(energy)))
        print(f"  {a_f:.2f} {a_b:.2f} |", ", ".join(f"n = {n}: {(passed / a_f) ** n:.3f}" for n in (1, 2, 5, 10)))


if __name__ == "__main__":
    main()
