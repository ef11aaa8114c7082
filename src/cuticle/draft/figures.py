"""The draft's figures, its missing plot and the comparison it announces, each by one function."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize, PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from cuticle.draft.findings import Findings, Mixing
from cuticle.draft.gaussians import fit_gaussian
from cuticle.draft.printed import Printed
from cuticle.draft.tables import PHI_R, THETA_R_1, USED, SliceRow, around, highlight_axis, near_pole
from cuticle.fitting.closed_forms import DRAFT, DocumentFunctions
from cuticle.sampling.quality import measure
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import Bcsdf, luminance

# Okabe and Ito's palette: told apart with any colour vision; lines differ in their dashes too.
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#666666"
MAP, RATIO = "viridis", "PuOr_r"
_NOTHING = 1e-5  # of the distribution's peak
_STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


Function = TypeVar("Function", bound=Callable[..., Figure])


def _styled(draw: Function) -> Function:
    """Draw in our style, and lay out once, not for each file that is written."""

    @functools.wraps(draw)
    def styled(*arguments: Any, **options: Any) -> Figure:
        with mpl.rc_context(_STYLE):
            figure = draw(*arguments, **options)
            engine = figure.get_layout_engine()
            if engine is not None:
                engine.execute(figure)
            figure.set_layout_engine("none")
        return figure

    return styled  # type: ignore[return-value]


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained", dpi=110)


@_styled
def figure_1(model: Bcsdf, *, cells: tuple[int, int] = (60, 90)) -> Figure:
    """Draw the scattering distribution for direct light, 7 x 5 viewers (the draft's Figure 1).

    Parameters
    ----------
    model
        Any scattering function.
    cells
        Cells of a map along theta_i and phi_i.
    """
    return _maps(model, "The scattering distribution f·cos θᵢ, no strand between the fibre and the light", cells)


@_styled
def figure_2(model: Bcsdf, strands: float = 2, *, cells: tuple[int, int] = (60, 90)) -> Figure:
    """Draw the same through n strands (the draft's Figure 2, there for two)."""
    own = model.with_strands(strands)  # type: ignore[attr-defined]
    return _maps(own, f"The scattering distribution f·cos θᵢ through {_count(strands)}", cells)


def _count(strands: float) -> str:
    return f"{strands:g} strand{'' if strands == 1 else 's'}"


def _maps(model: Bcsdf, title: str, cells: tuple[int, int]) -> Figure:
    theta = (np.arange(cells[0]) + 0.5) / cells[0] * np.pi - np.pi / 2
    phi = (np.arange(cells[1]) + 0.5) / cells[1] * 2 * np.pi - np.pi
    rows = sorted(PHI_R, reverse=True)
    values = {
        (t, p): luminance(np.asarray(model.eval(theta[:, None], near_pole(t), phi - math.radians(p))))
        * np.cos(theta)[:, None]
        for t in THETA_R_1
        for p in rows
    }
    # At ±90° f·cos has no bound: those maps share the scale of the others and saturate.
    top = max(float(v.max()) for (t, _), v in values.items() if abs(t) < 90)
    fig = Figure(figsize=(11, 6.2), dpi=110)  # placed by hand: laying out 35 maps takes longer than drawing them
    room = {"left": 0.065, "right": 0.915, "bottom": 0.075, "top": 0.905, "wspace": 0.22, "hspace": 0.2}
    axes = fig.subplots(len(rows), len(THETA_R_1), gridspec_kw=room)  # shared, each would look at all others for its limits
    norm = PowerNorm(0.5, 0, top)
    for a, p in enumerate(rows):
        for b, t in enumerate(THETA_R_1):
            ax: Axes = axes[a, b]
            ax.imshow(values[t, p], norm=norm, cmap=MAP, origin="lower", extent=(-180, 180, -90, 90), aspect="auto")
            ax.set(xticks=(-90, 0, 90), yticks=(-90, 0, 90))
            ax.tick_params(length=2, labelsize=7)
            ax.label_outer()
            for side in ax.spines.values():
                side.set_visible(False)
            if a == 0:
                ax.set_title(f"θᵣ = {_signed(t)}")
            if b == 0:
                ax.set_ylabel(f"ϕᵣ = {_signed(p)}\nθᵢ", fontsize=8)
            if a == len(rows) - 1:
                ax.set_xlabel("ϕᵢ", fontsize=8)
    bar = fig.colorbar(ScalarMappable(norm, MAP), cax=fig.add_axes((0.932, 0.12, 0.011, 0.74)), extend="max")
    bar.set_label("f·cos θᵢ, 1/sr (square-root scale)", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    fig.suptitle(title, fontsize=11)
    return fig


def _signed(degrees: float) -> str:
    return f"{'−' if degrees < 0 else ''}{abs(degrees):g}°"


@_styled
def figure_3(model: Bcsdf, *, strands: Sequence[float] = (1, 2, 4, 8), theta_r: Sequence[float] = (-60, 0, 60)) -> Figure:
    """Draw slices of the distribution with the one Gaussian, strands x theta_r in degrees (the draft's Figure 3)."""
    fig = _figure(9, 1.75 * len(strands) + 0.6)
    axes = fig.subplots(len(strands), len(theta_r), sharex=True, squeeze=False)
    x = np.linspace(-math.pi / 2, math.pi / 2, 361)
    for a, n in enumerate(strands):
        own = model.with_strands(n)  # type: ignore[attr-defined]
        for b, t in enumerate(theta_r):
            ax: Axes = axes[a, b]
            curve = around(own, near_pole(t))
            y = curve(x)
            gaussian = fit_gaussian(curve, -math.pi / 2, math.pi / 2, window=0.0)
            scale = 1 / y.max()
            ax.plot(np.degrees(x), scale * y, color=BLUE, lw=2)
            ax.fill_between(np.degrees(x), scale * y, color=BLUE, alpha=0.12, lw=0)
            label = "no Gaussian fits"
            if gaussian is not None:
                ax.plot(np.degrees(x), scale * gaussian(x), color=ORANGE, lw=1.6, ls=(0, (4, 2)))
                label = f"σ {gaussian.sigma:.2f}, shift {math.degrees(gaussian.mean) + t:+.0f}°"
            ax.text(0.02, 0.97, label, transform=ax.transAxes, va="top", fontsize=7.5, color=GREY)
            ax.set(xlim=(-90, 90), ylim=(0, 1.3), xticks=(-90, -45, 0, 45, 90), yticks=(0, 1))
            if a == 0:
                ax.set_title(f"θᵣ = {_signed(t)}")
            if b == 0:
                ax.set_ylabel(f"{_count(n)}\nof the peak", fontsize=8)
            if a == len(strands) - 1:
                ax.set_xlabel("θᵢ, degrees", fontsize=8)
    handles = [
        Line2D([], [], color=BLUE, lw=2, label="distribution over θᵢ, all azimuths"),
        Line2D([], [], color=ORANGE, lw=1.6, ls=(0, (4, 2)), label="its Gaussian"),
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return fig


@_styled
def figure_functions(
    rows: Sequence[SliceRow], functions: DocumentFunctions | None, printed: Printed | None = None
) -> Figure:
    """Draw sigma_V and mu_H against theta_r, data and functions: the plot the draft refers to and lacks.

    Parameters
    ----------
    rows
        Table 2.
    functions
        Those found, or None.
    printed
        The draft's own tables, to be drawn with its own functions.
    """
    fig = _figure(9.5, 3.9)
    axes = fig.subplots(1, 2)
    t = np.linspace(-80, 80, 321)
    kept = [r for r in rows if r.vertical is not None and r.holds]
    degrees = np.array([math.degrees(r.theta_r) for r in kept])
    data = (
        (axes[0], "σ_V, radians", np.array([r.vertical.sigma for r in kept if r.vertical]), "sigma_V", 1, 1.0),
        (
            axes[1],
            "shift of the peak μ_H, degrees",
            np.degrees([r.shift for r in kept if r.shift is not None]),
            "mu_H",
            5,
            180 / math.pi,
        ),
    )
    for ax, label, ours, name, column, unit in data:
        ax.axvspan(USED, 84, color=GREY, alpha=0.08, lw=0)
        ax.axvspan(-84, -USED, color=GREY, alpha=0.08, lw=0)
        ax.plot(degrees, ours, "o", color=BLUE, ms=5, label="this fibre")
        top = [ours.max(initial=0), ours.min(initial=0)] if len(ours) else [1, 0]
        if functions is not None:
            form = getattr(functions, name)
            ax.plot(t, unit * form(np.radians(t)), color=BLUE, lw=1.5, label=f"found: {form.text(degrees=unit != 1)}")
        if printed is not None:
            keys = np.array([k[0] for k in printed.table_2])
            values = np.array([v[column] for v in printed.table_2.values()])
            ax.plot(keys, values, "s", mfc="none", mec=ORANGE, ms=5, label="the draft's table 2")
            form = getattr(DRAFT, name)
            ax.plot(
                t,
                unit * form(np.radians(t)),
                color=ORANGE,
                lw=1.2,
                ls=(0, (4, 2)),
                label=f"the draft: {form.text(degrees=unit != 1)}",
            )
            top = [max(top[0], values.max()), min(top[1], values.min())]
        if not len(ours):
            ax.text(0.5, 0.5, "no slice is a Gaussian", transform=ax.transAxes, ha="center", color=GREY)
        room = 0.45 * (top[0] - top[1])
        ax.set(xlim=(-84, 84), xticks=range(-80, 81, 40), xlabel="θᵣ, degrees", ylabel=label)
        ax.set_ylim(top[1] - 0.1 * room, top[0] + room)
        ax.legend(fontsize=7.5, frameon=False, loc="upper center")
        ax.grid(alpha=0.25, lw=0.5)
    return fig


@_styled
def figure_comparison(
    model: Bcsdf, document: Sampler, lobes: Sampler, *, theta_r: float = 30.0, strands: Sequence[float] = (0, 2)
) -> Figure:
    """Draw what section 0.2.2 announces: distribution, the draft's Gaussian, fitted lobes, and the weights f·cos/p.

    Weights are left grey where distribution and density are both below 1e-5 of the distribution's peak.

    Parameters
    ----------
    model
        The scattering function.
    document, lobes
        Samplers that cover `strands`.
    theta_r
        The viewer, degrees.
    strands
        One row each.
    """
    fig = _figure(12.5, 2.75 * len(strands) + 0.4)
    axes = fig.subplots(len(strands), 5, sharex=True, sharey=True, squeeze=False)
    theta = (np.arange(120) + 0.5) / 120 * np.pi - np.pi / 2
    middle = highlight_axis(model)  # the highlight whole, not cut at the maps' edges
    phi = (np.arange(180) + 0.5) / 180 * 2 * np.pi - np.pi + middle
    left, right = (math.degrees(middle) + side for side in (-180, 180))
    t = math.radians(theta_r)
    ratio_norm = LogNorm(1 / 8, 8)
    for row, n in zip(axes, strands, strict=True):
        own = model.with_strands(n)  # type: ignore[attr-defined]
        f = luminance(np.asarray(own.eval(theta[:, None], t, phi))) * np.cos(theta)[:, None]
        quality = [measure(s, own, t, n) for s in (document, lobes)]
        f = f / luminance(np.array(quality[0].energy))
        densities = [s.pdf(theta[:, None], t, phi, n) for s in (document, lobes)]
        norm = Normalize(0, float(f.max()))
        maps: list[tuple[NDArray, Normalize, str]] = [(f, norm, MAP)]
        maps += [(p, norm, MAP) for p in densities]
        # Where neither the distribution nor the density has anything, a weight says nothing.
        weights = [np.where(np.maximum(f, p) > _NOTHING * f.max(), f / np.maximum(p, 1e-300), np.nan) for p in densities]
        maps += [(w, ratio_norm, RATIO) for w in weights]
        for ax, (values, scale, cmap) in zip(row, maps, strict=True):
            ax.imshow(values, norm=scale, cmap=cmap, origin="lower", extent=(left, right, -90, 90), aspect="auto")
            ax.set(xticks=np.linspace(left, right, 5), yticks=(-90, 0, 90))
            ax.tick_params(length=2, labelsize=7)
            for side in ax.spines.values():
                side.set_visible(False)
        for ax, q in zip(row[1:3], quality, strict=True):
            ax.set_xlabel(f"ESS {q.ess:.3f}   TV {q.total_variation:.3f}", fontsize=8.5, fontweight="bold")
        for ax, w in zip(row[3:], weights, strict=True):
            ax.set_facecolor("#d9d9d9")
            ax.set_xlabel(f"largest weight {np.nanmax(w):.3g}", fontsize=8.5)
        row[0].set_xlabel("ϕ, degrees", fontsize=8)
        row[0].set_ylabel(("direct light" if n == 0 else f"through {_count(n)}") + "\nθᵢ, degrees", fontsize=8.5)
        fig.colorbar(ScalarMappable(norm, MAP), ax=row[:3], aspect=25, pad=0.01).set_label("density, 1/sr", fontsize=7.5)
    bar = fig.colorbar(ScalarMappable(ratio_norm, RATIO), ax=axes[:, 3:], aspect=50, pad=0.01, extend="both")
    bar.set_label("weight f·cos/(p ∫f·cos): 1 is perfect", fontsize=7.5)
    bar.set_ticks([0.125, 0.25, 0.5, 1, 2, 4, 8], labels=["⅛", "¼", "½", "1", "2", "4", "8"])
    bar.ax.minorticks_off()
    titles = (
        "scattering distribution",
        "the draft's form",
        f"{lobes.lobes} fitted lobes",
        "weight: the draft's form",
        "weight: lobes",
    )
    for ax, title in zip(axes[0], titles, strict=True):
        ax.set_title(title)
    fig.suptitle(f"Viewer at θᵣ = {_signed(theta_r)}", fontsize=10)
    return fig


@_styled
def figure_mixing(mixing: Sequence[Mixing]) -> Figure:
    """Draw what a weight of the direct PDF costs, a line for each share v of directly lit directions."""
    fig = _figure(9.5, 3.9)
    axes = fig.subplots(1, len(mixing), sharey=True, squeeze=False)[0]
    dashes = ("-", (0, (5, 1.5)), (0, (3, 1.5)), (0, (1.5, 1)))
    for ax, m in zip(axes, mixing, strict=True):
        shades = mpl.colormaps[MAP](np.linspace(0.0, 0.88, len(m.shares)))
        for i, (share, row, best) in enumerate(zip(m.shares, m.ess, m.best, strict=True)):
            relative = np.array(row) / best
            ax.plot(
                m.weights, relative, ls=dashes[i % 4], color=shades[i], lw=1.6, label=f"v = {share:g}  (best {best:.2f})"
            )
            top = int(np.argmax(relative))
            ax.plot(m.weights[top], relative[top], "o", color=shades[i], ms=5)
        ax.set_title("none or an unknown number of strands" if m.strands is None else f"none or {_count(m.strands)}")
        ax.set(xlim=(0, 1), ylim=(0, 1.04), xlabel="weight of the direct PDF", xticks=m.weights)
        ax.grid(alpha=0.25, lw=0.5)
        ax.legend(fontsize=7, frameon=False, loc="lower center", ncols=2, title="directly lit", title_fontsize=7.5)
    axes[0].set_ylabel("ESS, as a share of the best possible")
    return fig


def figures(d: Findings) -> dict[str, tuple[Figure, dict[str, str]]]:
    """Return every figure of a reproduction by name, each with its title, caption and a text that stands for it."""
    name = "found" if d.found is not None else "draft"
    own, lobes = d.fits[name].sampler, d.fits["lobes"].sampler
    functions = d.found.functions if d.found is not None else None
    gaussians, fitted = d.quality[name], d.quality["lobes"]
    shared = "One scale for all maps; at ±90°, where f·cos may have no bound, they saturate. The pattern turns with ϕᵣ."
    drawn = {
        "comparison": (
            figure_comparison(d.model, own, lobes),
            "The distribution and what is fitted to it.",
            "What section 0.2.2 of the draft announces. The weight f·cos/(p ∫f·cos) is what a sample carries: even where"
            " the density fits, and the noise of a picture where it does not.",
            f"Maps side by side for direct light and two strands: the distribution, the draft's form (mean ESS"
            f" {gaussians['0']['ess']:.2f} and {gaussians['2']['ess']:.2f}), fitted lobes"
            f" ({fitted['0']['ess']:.3f} and {fitted['2']['ess']:.3f}),"
            " and the weights: nearly even for the lobes, uneven for the draft's form.",
        ),
        "figure1": (
            figure_1(d.model),
            "Figure 1: the scattering distribution, direct light.",
            shared,
            "35 maps of f·cos over azimuth and inclination of the light, for seven inclinations and five azimuths of the"
            f" viewer: a highlight that turns with the viewer, at phi_r + {math.degrees(d.axis):.0f}°.",
        ),
        "figure2": (
            figure_2(d.model),
            "Figure 2: the same through two strands.",
            shared,
            "The same 35 maps through two strands: wide bands along the azimuth that move against the viewer's inclination.",
        ),
        "figure3": (
            figure_3(d.model),
            "Figure 3: the one Gaussian through n strands.",
            "The density of θᵢ over all azimuths, per radian, over its peak.",
            "Twelve curves of the density of theta_i for 1, 2, 4 and 8 strands and viewers at -60°, 0° and 60°, each with"
            " the Gaussian fitted to it.",
        ),
        "functions": (
            figure_functions(d.table_2, functions, d.printed),
            "The plot the draft refers to and lacks.",
            "Table 2 against θᵣ with the functions found through it. Grey: past ±70° no function is asked to follow.",
            "Deviation along phi and shift of the peak against the viewer's inclination: points of table 2 and functions.",
        ),
        "combined": (
            figure_mixing(d.mixing),
            "The two PDFs combined.",
            "A dot marks the best of the weights tried for each share v of directly lit directions; “best” in the key is the"
            " ESS that no density exceeds.",
            "Effective sample size of the combined PDFs, over the best possible, against the weight of the direct one: the"
            " more directions are lit, the larger the best weight.",
        ),
    }
    return {
        key: (figure, {"title": title, "caption": caption, "alt": alt})
        for key, (figure, title, caption, alt) in drawn.items()
    }
