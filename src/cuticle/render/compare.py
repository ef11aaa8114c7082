"""Compares samplings on one scene, at equal samples and at equal time, with a long reference."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.extras import needed
from cuticle._support.files import make_directory, write_bytes, write_text
from cuticle._support.progress import Progress, expect, silent
from cuticle.grooms.groom import Groom
from cuticle.render.picture import Image, Pass, expected_seconds, over_backdrop, passes, rel_mse, render, srgb
from cuticle.render.scene import Light, View, bsdf, integrator, load_scene, mitsuba

with needed("a comparison"):
    from cuticle._support.plots import figure_bytes

__all__ = ["Comparison", "Contender", "compare_samplings"]

_PACE_SPP = 8
_COLOURS = {"uniform": "#8a8a8a", "document": "#d08a2c", "lobes": "#2a6fbb", "function": "#3d8f57"}


class Contender(NamedTuple):
    """One sampling with one technique, and its error against the reference."""

    sampling: str
    technique: str  # "bsdf": BSDF sampling alone; "mis": emitter sampling, too
    curve: NDArray[np.float64]  # (passes, 3): samples a pixel, seconds, relMSE
    image: Image  # at equal time
    spp: int  # of it
    seconds: float

    @property
    def error(self) -> float:
        """RelMSE at equal time."""
        return float(self.curve[-1, 2])

    @property
    def cost(self) -> float:
        """Seconds times relMSE, which does not depend on the rendering time."""
        return float(self.curve[-1, 1] * self.curve[-1, 2])


@dataclass(frozen=True)
class Comparison:
    """The result of `compare_samplings`."""

    contenders: tuple[Contender, ...]
    reference: Image
    reference_spp: int
    reference_error: float  # relMSE between its two halves, over 4: about what its own noise adds to every error
    about: dict[str, Any]

    def gain(self, contender: Contender) -> float:
        """Return how many times longer uniform sampling takes to the same error, with the same technique."""
        return self.find("uniform", contender.technique).cost / contender.cost

    def find(self, sampling: str, technique: str) -> Contender:
        """Return one contender."""
        return next(c for c in self.contenders if (c.sampling, c.technique) == (sampling, technique))

    def at_equal_samples(self, contender: Contender) -> tuple[int, float]:
        """Return the most samples a pixel that all of a technique reached, and this contender's relMSE there."""
        spp = min(int(c.curve[-1, 0]) for c in self.contenders if c.technique == contender.technique)
        row = contender.curve[contender.curve[:, 0] <= spp][-1]
        return int(row[0]), float(row[2])

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as plain values."""
        rows = []
        for c in self.contenders:
            samples, error = self.at_equal_samples(c)
            rows.append(
                {
                    "sampling": c.sampling,
                    "technique": c.technique,
                    "equal_samples": {"spp": samples, "rel_mse": error},
                    "equal_time": {"spp": c.spp, "seconds": round(c.seconds, 3), "rel_mse": c.error},
                    "gain_over_uniform": self.gain(c),
                    "curve": c.curve.tolist(),
                }
            )
        return {
            **self.about,
            "reference": {"spp": self.reference_spp, "own_rel_mse": self.reference_error},
            "contenders": rows,
        }

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write compare.json, the sheet of pictures and the error curves to a folder."""
        target = make_directory(folder)
        write_text(target / "compare.json", json.dumps(self.to_dict(), indent=2) + "\n")
        write_bytes(target / "sheet.png", sheet(self))
        write_bytes(target / "curves.png", curves(self))
        return target


def compare_samplings(
    groom: Groom,
    fibre: str,
    *,
    view: View | None = None,
    light: Light | None = None,
    seconds: float = 10.0,
    reference_spp: int = 1024,
    techniques: tuple[str, ...] = ("bsdf", "mis"),
    variant: str = "scalar_rgb",
    progress: Progress | None = None,
) -> Comparison:
    """Render one scene to path depth 2 with every sampling that the fibre offers, for the same time, and measure the errors.

    Depth 2: camera, strand, light. Beyond that the next strand's light is what varies, whatever draws the direction.

    Parameters
    ----------
    groom, fibre, view, light
        The scene, as in `cuticle.render.scene`.
    seconds
        Rendering time of each, 0.1 to 3600.
    reference_spp
        Samples a pixel of the reference, which uses emitter and BSDF sampling with fitted lobes.
    techniques
        "bsdf": directions from the BSDF alone; "mis": one from the light beside each.
    variant
        Mitsuba's variant.
    progress
        Called with what is going on and how much of all is done.
    """
    seconds = validate.number("seconds", seconds, 0.1, 3600)
    reference_spp = validate.integer("reference_spp", reference_spp, 16, 1 << 20)
    for name in techniques:
        validate.choice("techniques", name, ("bsdf", "mis"))
    view, light = view or View(), light or Light()
    mi = mitsuba(variant)
    from cuticle.mitsuba.material import samplings_of  # Mitsuba is here, else this would have ended in one line

    report = progress or silent
    samples = {"bsdf": (0, 1), "mis": (1, 1)}

    def scene(sampling: str, technique: str) -> Any:
        from_light, from_bsdf = samples[technique]
        how = integrator("direct", emitter_samples=from_light, bsdf_samples=from_bsdf)
        return load_scene(mi, groom, bsdf(fibre, sampling), view=view, light=light, technique=how)

    best = scene("lobes", "mis")
    offered = samplings_of({key: value for key, value in bsdf(fibre).items() if key != "type"})
    cases = [(s, t) for t in techniques for s in offered[::-1]]
    long, compiling = expected_seconds(best, reference_spp), 0.0  # of the reference; of each other
    if long is None:  # a traced variant: the first pass of this size compiles, the second shows the pace
        first, second = passes(best, 2 * _PACE_SPP, step=_PACE_SPP)
        long, compiling = (second.seconds - first.seconds) / _PACE_SPP * reference_spp, first.seconds
    expect(progress, whole := long + (seconds + compiling) * len(cases))
    share = long / whole
    halves = [
        render(best, reference_spp // 2, seed=k, progress=lambda _, f, k=k: report("reference", share * (k - 1 + f) / 2))  # type: ignore[misc]
        for k in (1, 2)
    ]
    reference = (halves[0].image + halves[1].image) / 2
    contenders = []
    for number, (sampling, technique) in enumerate(cases):
        running = scene(sampling, technique)
        render(running, 1)  # what only the first pass does
        curve: list[tuple[float, float, float]] = []
        last: Pass | None = None
        for last in passes(running, 1 << 20, seed=3 + number, step=1):
            curve.append((last.spp, last.seconds, rel_mse(last.image, reference)))
            done = min(last.seconds / seconds, 1)
            report(f"{sampling}, {technique}", share + (1 - share) * (number + done) / len(cases))
            if last.seconds >= seconds:
                break
        assert last is not None
        contenders.append(Contender(sampling, technique, np.array(curve), last.image, last.spp, last.seconds))
    return Comparison(
        tuple(contenders),
        reference,
        reference_spp,
        rel_mse(halves[0].image, halves[1].image) / 4,
        {
            "fibre": fibre,
            "light": light.kind,
            "strands": groom.strands,
            "size": [view.width, view.height],
            "variant": variant,
        },
    )


def _window(reference: Image, size: int) -> tuple[slice, slice]:
    """Where the reference has most contrast within full coverage: what an inset shows."""
    grey = reference[..., :3].mean(axis=2)
    height, width = grey.shape
    best, place = -1.0, (0, 0)
    for y in range(0, height - size + 1, max(size // 2, 1)):
        for x in range(0, width - size + 1, max(size // 2, 1)):
            cover = reference[y : y + size, x : x + size, 3].mean()
            score = float(grey[y : y + size, x : x + size].std() * cover**2)
            if score > best:
                best, place = score, (y, x)
    return slice(place[0], place[0] + size), slice(place[1], place[1] + size)


def sheet(comparison: Comparison) -> bytes:
    """Return a PNG: each sampling at equal time and the reference, with an inset and what it is off by."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    diverging = colormaps["RdBu_r"]

    techniques = list(dict.fromkeys(c.technique for c in comparison.contenders))
    columns = [*dict.fromkeys(c.sampling for c in comparison.contenders), "reference"]
    height, width = comparison.reference.shape[:2]
    window = _window(comparison.reference, max(min(height, width) // 5, 4))
    bright = over_backdrop(comparison.reference)
    exposure = 0.75 / max(float(np.quantile(bright[..., :3], 0.995)), 1e-6)
    figure = Figure(figsize=(3.1 * len(columns), len(techniques) * (3.1 * height / width + 2.0) + 0.5), layout="constrained")
    axes = figure.subplots(
        2 * len(techniques), len(columns), squeeze=False, height_ratios=[height / width, 0.52] * len(techniques)
    )
    titles = {"bsdf": "BSDF sampling alone", "mis": "with emitter sampling (MIS)"}
    for i, technique in enumerate(techniques):
        for j, name in enumerate(columns):
            picture, inset = axes[2 * i][j], axes[2 * i + 1][j]
            for ax in (picture, inset):
                ax.set_axis_off()
            if name == "reference":
                image, text = comparison.reference, f"reference\n{comparison.reference_spp} samples a pixel"
            else:
                c = comparison.find(name, technique)
                image = c.image
                gain = "" if name == "uniform" else f", {comparison.gain(c):.1f}×"
                text = f"{name}{gain}\n{c.spp} samples, {c.seconds:.1f} s, relMSE {c.error:.2g}"
            shown = srgb(over_backdrop(image) * exposure)
            picture.imshow(shown, interpolation="nearest")
            picture.set_title(text, fontsize=10)
            corner = (window[1].start - 0.5, window[0].start - 0.5)
            side = window[0].stop - window[0].start
            picture.add_patch(Rectangle(corner, side, side, fill=False, edgecolor="white", linewidth=1))
            off = (image - comparison.reference)[..., :3].mean(axis=2)[window]
            scale = 0.5 * float(comparison.reference[..., :3][window].mean()) + 1e-9
            error = np.uint8(255 * diverging(0.5 + 0.5 * np.clip(off / scale, -1, 1))[..., :3])
            pair = np.concatenate([shown[window], np.full((side, 1, 3), 255, np.uint8), error], axis=1)
            inset.imshow(pair, interpolation="nearest")
        axes[2 * i][0].text(
            -0.04, 0.5, titles[technique], rotation=90, transform=axes[2 * i][0].transAxes, va="center", ha="right"
        )
    figure.suptitle(
        f"{comparison.about['fibre']}, {comparison.about['light']} light, equal time. Insets: a part, and what it is off by"
        " (red too bright, blue too dark)",
        fontsize=11,
    )
    return figure_bytes(figure, dpi=110)


def curves(comparison: Comparison) -> bytes:
    """Return a PNG: relMSE over time for every sampling and technique."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    ax = figure.subplots()
    for c in comparison.contenders:
        style = "-" if c.technique == "bsdf" else "--"
        label = f"{c.sampling}, {'BSDF alone' if c.technique == 'bsdf' else 'MIS'}"
        ax.loglog(c.curve[:, 1], c.curve[:, 2], style, color=_COLOURS[c.sampling], label=label, linewidth=1.8)
    ax.axhline(comparison.reference_error, color="#bbbbbb", linewidth=1)
    ax.text(
        ax.get_xlim()[0], comparison.reference_error, " the reference's own noise", va="bottom", fontsize=8, color="#777777"
    )
    ax.set_xlabel("rendering time, s")
    ax.set_ylabel("relMSE")
    ax.grid(True, which="both", color="#e6e6e6", linewidth=0.6)
    ax.legend(fontsize=9, frameon=False)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    return figure_bytes(figure, dpi=110)
