"""The far field of any fibre: how well it samples random fibres, how far f is off, and what it costs.

Fibres are drawn from the whole box that renderers allow (beta_m, beta_n .05 to 1; beta_R, beta_N 2 to 40°; alpha ±15°;
eta 1.3 to 1.8; sigma_a .01 to 20 in each channel, evenly in its log), viewers from |theta_r| <= 85°. ESS is of luminance,
against the function from fine tables; f is off by a share of its peak, channel by channel. Costs are medians of
interleaved rounds on one thread in single precision (g++ -O3 -march=native), in calibration kernels (16 expf).

`--box N` tells the ESS of N fibres a family instead; `--falcor FILE` that of every tenth fibre and viewer of the 50,000 of
Falcor's tests. The function is then the near field, averaged over the width by 500 Gauss-Legendre nodes: no cells, no
tables. `--strands N`: that of N fibres a family through 1 to 12 strands, and through Poisson numbers of them. `--chi-square
N`: whether samples of N fibres a family, a million of each, follow their density; all together have a false-positive rate of
1e-3 (Šidák). `--gaussian N`: how well Marschner's family samples his Gaussian form.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

import cuticle
from compiled import compiled
from cuticle import _core
from cuticle._support.files import write_bytes
from cuticle._support.quadrature import gauss_legendre
from cuticle.checking.verdicts import sidak
from cuticle.cli.tables import table
from cuticle.scattering.among_strands import _Energies
from cuticle.scattering.bcsdf import luminance_weights

LOWEST = 4  # ESS through strands that are measured again
GAMMA, WEIGHT = gauss_legendre(np.array([-np.pi / 2, np.pi / 2]), 64)
out = Console() if sys.stdout.isatty() else Console(width=118)


def random_fibre(form: str, rng: np.random.Generator) -> tuple[Any, Any]:
    """A fibre, and its function from tables."""
    common = dict(eta=rng.uniform(1.3, 1.8), sigma_a=tuple(10 ** rng.uniform(-2, np.log10(20), 3)))
    alpha = rng.uniform(-15, 15)
    if form == "chiang":
        model = cuticle.Chiang(beta_m=rng.uniform(0.05, 1), beta_n=rng.uniform(0.05, 1), alpha=alpha, **common)
        return model, model
    fibre = cuticle.Fibre(alpha_R=alpha, beta_R=rng.uniform(2, 40), beta_N=rng.uniform(2, 40), **common)
    return fibre, cuticle.Marschner(fibre, "energy_conserving")


def drawn_offset(fibre: Any, theta_r: float) -> float:
    """ESS where h is drawn evenly, then the near field exactly: a sample weighs the albedo at its h."""
    near = fibre.near(np.sin(GAMMA))
    theta_i, phi, p = near.sample(theta_r, np.full((len(GAMMA), 3), 0.5))
    weight = near.eval(theta_i, theta_r, phi) @ luminance_weights(3) * np.cos(theta_i) / p
    share = WEIGHT * np.cos(GAMMA) / 2
    return float((share @ weight) ** 2 / (share @ weight**2))


def quality(form: str, fibres: int, fits: int) -> dict[str, list[float]]:
    """Print the tables of ESS and of errors; return the ESS of each sampler."""
    rng, family = np.random.default_rng(1), cuticle.family(form)
    found: dict[str, list[float]] = {name: [] for name in ("any fibre", "4 lobes, fitted", "h drawn at random", "uniform")}
    peaks, energies, weights = [], [], []
    theta, phi = np.linspace(-1.56, 1.56, 241)[:, None], np.linspace(0, np.pi, 241)
    for k in track(range(fibres), form, console=Console(stderr=True), disable=not sys.stderr.isatty()):
        fibre, model = random_fibre(form, rng)
        theta_r = rng.uniform(-1, 1) * np.radians(85)
        ours = family.sampler_at(fibre)
        q = cuticle.measure(ours, model, theta_r)
        found["any fibre"].append(q.ess)
        weights.append(q.largest_weight)
        if form == "chiang":
            found["h drawn at random"].append(drawn_offset(fibre, theta_r))
        if k < fits:
            found["4 lobes, fitted"].append(cuticle.measure(cuticle.fit(model, 4).sampler, model, theta_r).ess)
        a, b = (m.eval(theta, theta_r, phi) * np.cos(theta)[..., None] for m in (ours, model))
        luminous, area = b @ luminance_weights(3), np.cos(theta)
        even = (luminous * area).sum() ** 2 / ((luminous**2 * area).sum() * area.sum() * len(phi))
        found["uniform"].append(float(even))
        peaks.append(float((np.abs(a - b).max((0, 1)) / b.max((0, 1))).max()))
        energies.append(float(np.abs(a.sum((0, 1)) / b.sum((0, 1)) - 1).max()))
    listing = table(f"{form}: ESS of {fibres} random fibres")
    for column in ("sampler", "fibres", "mean", "1st percentile", "worst"):
        listing.add_column(column, justify="left" if column == "sampler" else "right")
    for name, ess in found.items():
        if ess:
            listing.add_row(name, str(len(ess)), *(f"{x:.4f}" for x in (np.mean(ess), np.quantile(ess, 0.01), min(ess))))
    out.print(listing)
    out.print(
        f"f off by {100 * np.mean(peaks):.2f} % of its peak on average, {100 * np.quantile(peaks, 0.99):.2f} % in 99 of"
        f" 100, {100 * max(peaks):.2f} % at worst; energy by {100 * max(energies):.3f} % at most; largest weight"
        f" {max(weights):.2f}"
    )
    return found


def near_field_averaged(fibre: Any, theta_r: float, theta_i: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Luminance of f cos theta_i: of Chiang 2016, Eq. 1 to 10, or of Marschner 2003 with d'Eon's M."""
    chiang = isinstance(fibre, cuticle.Chiang)
    gamma, weight = gauss_legendre(np.array([-np.pi / 2, np.pi / 2]), 500)
    sine, cosine = np.sin(theta_r), np.cos(theta_r)
    incident, eta = cosine * np.cos(gamma), fibre.eta
    refracted = np.sqrt(1 - (1 - incident**2) / eta**2)
    s, p = (
        (incident - eta * refracted) / (incident + eta * refracted),
        (eta * incident - refracted) / (eta * incident + refracted),
    )
    fresnel = (s**2 + p**2) / 2
    inside = np.arcsin(np.sin(gamma) * cosine / np.sqrt(eta**2 - sine**2))
    chord = 2 * np.cos(inside) / np.sqrt(1 - (sine / eta) ** 2)
    passed = np.exp(-chord[:, None] * np.broadcast_to(fibre.absorption, 3))
    f = fresnel[:, None]
    a = [f * np.ones(3), (1 - f) ** 2 * passed, (1 - f) ** 2 * f * passed**2]
    rest = a[2] * f * passed / (1 - f * passed)
    tilt, variance = (fibre.tilt, fibre.variance) if chiang else (2 * fibre.alpha, 4 * fibre.beta**2)
    out, m = np.zeros(len(phi)), np.empty(len(phi))
    for p, energy in enumerate([*a[:2], a[2] if chiang else a[2] + rest, *([rest] if chiang else [])]):
        luminous = weight * np.cos(gamma) / 2 * (energy @ luminance_weights(3))
        if p < 3:
            turn = (phi[:, None] - (2 * p * inside - 2 * gamma + p * np.pi)).astype(np.float32)  # exp is fast there
            turn -= np.float32(2 * np.pi) * np.rint(turn / np.float32(2 * np.pi))
            if chiang:
                e = np.exp(-np.abs(turn) / fibre.scale)
                density = e / (fibre.scale * (1 + e) ** 2 * np.tanh(np.pi / 2 / fibre.scale))
            else:
                width = np.radians(fibre.beta_N)
                density = np.exp(-0.5 * (turn / width) ** 2) / (width * np.sqrt(2 * np.pi))
            around = density @ luminous
        else:
            around = luminous.sum() / (2 * np.pi)
        _core.energy_conserving_m(theta_i, np.full(len(phi), tilt[p] - theta_r), np.full(len(phi), variance[p]), m)
        out += m * around
    return out


def ess_by_samples(form: str, fibre: Any, theta_r: float, rng: np.random.Generator, count: int = 160) -> float:
    """ESS from directions drawn half from the density p, half evenly: (∫ f)² / (∫ f²/p ∫ p), at most 1 as it is."""
    sampler = cuticle.family(form).sampler_at(fibre)
    s = sampler.sample(theta_r, (rng.random((count, 3)) + np.arange(count)[:, None] / [count, np.inf, np.inf]) % 1)
    theta_i = np.append(s.theta_i, np.arcsin(rng.uniform(-1, 1, count)))
    phi = np.append(s.phi, rng.uniform(-np.pi, np.pi, count))
    pdf = sampler.pdf(theta_i, theta_r, phi)
    f, drawn = near_field_averaged(fibre, theta_r, theta_i, phi), pdf + 0.25 / np.pi
    return float((f / drawn).sum() ** 2 / ((f**2 / np.maximum(pdf, 1e-30) / drawn).sum() * (pdf / drawn).sum()))


def falcor(path: Path) -> list[tuple[Any, float]]:
    """Every tenth of its fibres and viewers; its 17 columns: beta_m, beta_n, alpha, eta, sigma_a, h, wi, wo, f."""
    columns = np.fromfile(path, "<f4").reshape(17, -1)[:, ::10].astype(float)
    return [
        (cuticle.Chiang(beta_m=m, beta_n=n, alpha=-a, eta=eta, sigma_a=(r, g, b)), float(np.arcsin(np.clip(x, -1, 1))))
        for m, n, a, eta, r, g, b, x in zip(*columns[:7], columns[8], strict=True)
    ]


def box(fibres: int, path: Path | None) -> None:
    """Print ESS over the whole box."""
    rng = np.random.default_rng(2)

    def drawn(form: str) -> list[tuple[Any, float]]:
        return [(random_fibre(form, rng)[0], rng.uniform(-1, 1) * np.radians(85)) for _ in range(fibres)]

    cases = {"chiang": drawn("chiang"), "marschner": drawn("marschner")} | ({"Falcor's": falcor(path)} if path else {})
    listing = table("ESS, the near field averaged over the width being f")
    for column in ("fibres", "viewers", "number", "mean", "1st percentile", "worst"):
        listing.add_column(column, justify="left" if column in ("fibres", "viewers") else "right")
    for name, each in cases.items():
        form = name if name == "marschner" else "chiang"
        shown = track(each, name, console=Console(stderr=True), disable=not sys.stderr.isatty())
        ess = np.array([ess_by_samples(form, fibre, theta_r, rng) for fibre, theta_r in shown])
        inner = np.abs([theta_r for _, theta_r in each]) <= np.radians(75)
        for viewers, of in (("within 75°", ess[inner]), ("all", ess)):
            listing.add_row(
                name, viewers, f"{len(of):,}", *(f"{x:.4f}" for x in (of.mean(), np.quantile(of, 0.01), of.min()))
            )
        worst = each[int(np.argmin(np.where(inner, ess, 2)))]
        out.print(f"{name}: the worst within 75° is {worst[0]!r}, theta_r {np.degrees(worst[1]):.1f}°")
    out.print(listing)


class Expected:
    """What light through a Poisson number of strands does, by the transport behind `Strands`: of cells, without lobes."""

    def __init__(self, among: cuticle.Strands, mean: float) -> None:
        d, self.single, self.channels = among._directions, among.model, among.channels
        every = np.eye(d.rows)
        arrived = [sum(t.through_random(every, (mean,), medium=False)[0]) for t in among._transports]
        self.others = _Energies(d, np.maximum(np.array(arrived).transpose(0, 2, 3, 1)[:, ::-1], 0))
        self.lit = np.exp(-mean)

    def eval(self, theta_i: Any, theta_r: Any, phi: Any) -> Any:
        """f in 1/sr."""
        return self.lit * np.asarray(self.single.eval(theta_i, theta_r, phi)) + self.others(theta_i, theta_r, phi)


class Drawn:
    """The family's density for a Poisson number of strands."""

    def __init__(self, family: Any, fibre: Any, mean: float) -> None:
        self.family, self.fibre, self.mean = family, fibre, mean

    def pdf(self, theta_i: Any, theta_r: Any, phi: Any, strands: Any = None) -> Any:
        """The density, 1/sr."""
        return self.family.pdf(theta_i, theta_r, phi, self.fibre, strands=self.mean, random=True)


def strands(fibres: int) -> None:
    """Print ESS through strands like the fibre itself, against `Strands`, which has light in cells and no lobes."""
    rng = np.random.default_rng(3)
    listing = table("ESS through strands, viewers within 75°")
    for column in ("fibres", "number", "strands", "mean", "1st percentile", "worst", "at .9 or more"):
        listing.add_column(column, justify="left" if column == "fibres" else "right")
    for form in ("chiang", "marschner"):
        found: dict[float, list[float]] = {n: [] for n in (1, 2, 3, 4, 6, 8, 12)}
        random: dict[float, list[float]] = {n: [] for n in (0.5, 1, 1.5, 2, 3, 4, 8)}
        seen = []
        for _ in track(range(fibres), form, console=Console(stderr=True), disable=not sys.stderr.isatty()):
            fibre, single = random_fibre(form, rng)
            model = cuticle.Strands(single)
            family = cuticle.family("dual_scattering", fibre, d_f=0.7, d_b=0.7)
            theta_r = rng.uniform(-1, 1) * np.radians(75)
            for n, ess in found.items():
                ess.append(cuticle.measure(family.sampler_at(fibre, strands=n), model.with_strands(n), theta_r).ess)
            whole = cuticle.family("dual_scattering", fibre, d_f=1, d_b=1)
            for n, ess in random.items():
                ess.append(cuticle.measure(Drawn(whole, fibre, n), Expected(model, n), theta_r).ess)
            seen.append((fibre, single, theta_r))
        for words, each in (("", found), (" expected", random)):
            for n, ess in each.items():
                numbers = (np.mean(ess), np.quantile(ess, 0.01), min(ess))
                high = f"{100 * np.mean(np.array(ess) >= 0.9):.0f} %"
                listing.add_row(form, str(fibres), f"{n:g}{words}", *(f"{x:.4f}" for x in numbers), high)
        for worst, n, k in sorted((x, n, k) for n, all_of_it in found.items() for k, x in enumerate(all_of_it))[:LOWEST]:
            fibre, single, theta_r = seen[k]
            sampler = cuticle.family("dual_scattering", fibre, d_f=0.7, d_b=0.7).sampler_at(fibre, strands=n)
            finer = cuticle.measure(sampler, cuticle.Strands(single, n, rows=91), theta_r).ess
            place = f"{fibre!r}, theta_r {np.degrees(theta_r):.1f}°"
            out.print(f"{form}, through {n:g}: {worst:.4f}, by rows half as wide {finer:.4f}: {place}")
    out.print(listing)


def chi_square(fibres: int, samples: int = 1_000_000) -> None:
    """Print chi-square of samples against their density; exit with an error where a fibre fails, or a wrong one does not.

    In single precision, and of every tenth fibre in double. Of these, inclinations 5 % too small are to be found out.
    """
    listing = table(f"{samples:,} samples of each fibre against their density, viewers within 85°")
    for column in ("fibres", "precision", "number", "passed", "smallest p-value", "limit", "wrong ones found out"):
        listing.add_column(column, justify="left" if column in ("fibres", "precision") else "right")
    tenth, rng, failures = -(-fibres // 10), np.random.default_rng(4), 0
    level = sidak(1e-3, 2 * (fibres + tenth))
    for form in ("chiang", "marschner"):
        drawn = [(random_fibre(form, rng)[0], rng.uniform(-1, 1) * np.radians(85)) for _ in range(fibres)]
        for dtype in (np.float32, np.float64):
            every = 1 if dtype == np.float32 else 10
            found, wrong = [], []
            for k in track(range(0, fibres, every), form, console=Console(stderr=True), disable=not sys.stderr.isatty()):
                sampler, theta_r = cuticle.family(form).sampler_at(drawn[k][0]), drawn[k][1]
                found.append(audited(sampler, theta_r, dtype, samples, level, 1.0, k))
                if k % 10 == 0:
                    wrong.append(audited(sampler, theta_r, dtype, samples, level, 0.95, k))
            passed, caught = sum(a.ok for a in found), sum(not a.ok for a in wrong)
            failures += len(found) - passed + len(wrong) - caught
            smallest = min(a.cases[0].p_value for a in found)
            listing.add_row(
                form, np.dtype(dtype).name, str(len(found)), str(passed), f"{smallest:.2g}", f"{level / 2:.2g}",
                f"{caught} of {len(wrong)}",
            )  # fmt: skip
    out.print(listing)
    if failures:
        sys.exit(f"{failures} of them are not as they have to be")


def audited(
    sampler: Any, theta_r: float, dtype: Any, samples: int, level: float, scale: float, seed: int
) -> cuticle.Audit:  # fmt: skip
    """Audit a sampler in a precision, its inclinations multiplied by `scale`."""

    def sample(tr: float, u: np.ndarray) -> Any:
        theta_i, phi, p = sampler.sample(dtype(tr), np.minimum(u, 1 - 2.0**-24).astype(dtype))
        return theta_i * dtype(scale), phi, p

    def pdf(theta_i: np.ndarray, tr: float, phi: np.ndarray) -> np.ndarray:
        return np.asarray(sampler.pdf(theta_i.astype(dtype), dtype(tr), phi.astype(dtype)))

    return cuticle.audit(sample, pdf, theta_r=[theta_r], samples=samples, level=level, seed=seed)


def gaussian(fibres: int) -> None:
    """Print how well Marschner's family samples his Gaussian form, of which N lies at theta_d, and with which weights."""
    rng = np.random.default_rng(7)
    ess, weights = np.empty((2, fibres)), np.empty((2, fibres))
    for k in track(range(fibres), "gaussian", console=Console(stderr=True), disable=not sys.stderr.isatty()):
        fibre, _ = random_fibre("marschner", rng)
        ours, share = cuticle.family("marschner").sampler_at(fibre), rng.uniform(-1, 1)
        for j, limit in enumerate((45, 85)):
            q = cuticle.measure(ours, cuticle.Marschner(fibre, "gaussian"), share * np.radians(limit))
            ess[j, k], weights[j, k] = q.ess, q.largest_weight
    listing = table("the Gaussian form, sampled by the family")
    for column in ("viewers", "fibres", "ESS, mean", "1st percentile", "worst", "largest weight, median", "at worst"):
        listing.add_column(column, justify="left" if column == "viewers" else "right")
    for limit, e, w in zip((45, 85), ess, weights, strict=True):
        numbers = (*(f"{x:.4f}" for x in (e.mean(), np.quantile(e, 0.01), e.min())), f"{np.median(w):.3g}", f"{w.max():.3g}")
        listing.add_row(f"within {limit}°", str(fibres), *numbers)
    out.print(listing)


def picture(found: dict[str, list[float]], path: Path) -> None:
    """Draw what is lost to the ideal, 1/ESS - 1, each sampler's fibres from its worst to its best."""
    from matplotlib.figure import Figure  # takes a second to import

    from cuticle._support.plots import figure_bytes

    figure = Figure((7.5, 3.4), layout="constrained")
    axes = figure.subplots()
    lines = {
        "any fibre": ("any fibre, one sampler", "#b3471d", 12, 8),
        "4 lobes, fitted": ("4 lobes, fitted to each fibre", "#2f6690", 12, -15),
        "h drawn at random": ("near field, h drawn at random", "#6c757d", 26, 8),
        "uniform": ("uniform sphere", "#b08ea2", 40, 8),
    }
    for name, (label, colour, at, above) in lines.items():
        lost = np.sort(1 / np.array(found[name]) - 1)[::-1]
        share = (np.arange(len(lost)) + 0.5) / len(lost) * 100
        axes.semilogy(share, np.maximum(lost, 1e-9), color=colour, linewidth=2)
        place = (at, np.interp(at, share, lost))
        axes.annotate(label, place, (0, above), textcoords="offset points", color=colour)
    axes.set(xlim=(0, 100), ylim=(1e-7, 300), xlabel="random fibres, % (worst first)", ylabel="variance lost: 1/ESS - 1")
    axes.spines[["top", "right"]].set_visible(False)
    write_bytes(path, figure_bytes(figure))


def costs() -> None:
    """Print the table of costs."""
    with tempfile.TemporaryDirectory() as folder:
        program = compiled("any_fibre", folder, "-march=native", "-fno-math-errno")
        lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    times = {name: float(value) for name, value in (line.split("\t") for line in lines)}
    unit = times["calibration"]
    listing = table(f"cost in calibration kernels ({unit:.1f} ns here), another fibre for each direction")
    for column in ("", "prepare", "prepare, sample, f and pdf", "f and pdf, prepared"):
        listing.add_column(column, justify="left" if not column else "right")
    for name in ("lanes chiang", "lanes marschner", "one chiang", "one marschner"):
        listing.add_row(name, *(f"{times[f'{name} {what}'] / unit:.2f}" for what in ("prepare", "sample", "eval")))
    near = (f"{times['near sample'] / unit:.2f}", f"{times['near eval'] / unit:.2f} with preparing")
    listing.add_row("one near field, h given", "", *near)
    out.print(listing)


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fibres", type=int, default=100, help="random fibres of each family")
    parser.add_argument("--fits", type=int, default=10, help="of them, how many are fitted, too")
    parser.add_argument("--picture", type=Path, help="draw the ESS of Chiang's fibres there")
    parser.add_argument("--box", type=int, metavar="N", help="tell the ESS of N fibres a family from samples, nothing else")
    parser.add_argument("--falcor", type=Path, metavar="FILE", help="with --box: pbrt_hair_bsdf.dat of Falcor's tests, too")
    parser.add_argument(
        "--strands", type=int, metavar="N", help="tell the ESS of N fibres a family among others, nothing else"
    )
    parser.add_argument(
        "--chi-square", type=int, metavar="N", help="test a million samples of N fibres a family, nothing else"
    )
    parser.add_argument(
        "--gaussian", type=int, metavar="N", help="tell how well N fibres' Gaussian form is sampled, nothing else"
    )
    arguments = parser.parse_args()
    if arguments.gaussian:
        return gaussian(arguments.gaussian)
    if arguments.chi_square:
        return chi_square(arguments.chi_square)
    if arguments.strands:
        return strands(arguments.strands)
    if arguments.box:
        return box(arguments.box, arguments.falcor)
    found = {form: quality(form, arguments.fibres, arguments.fits) for form in ("chiang", "marschner")}
    if arguments.picture:
        picture(found["chiang"], arguments.picture)
    costs()


if __name__ == "__main__":
    main()
