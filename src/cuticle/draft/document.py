"""The draft description, recomputed for any fibre: tables, general functions, claims, and the missing comparison."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuticle._support.extras import needed
from cuticle._support.files import make_directory, write_bytes, write_text
from cuticle._support.plain_values import html_table
from cuticle._support.progress import Progress, silent
from cuticle.draft import claims as judge
from cuticle.draft.as_values import as_values
from cuticle.draft.findings import Findings, Mixing
from cuticle.draft.functions import find_functions
from cuticle.draft.printed import Printed
from cuticle.draft.tables import VIEWERS, highlight_axis, table_1, table_2, table_3
from cuticle.fitting.fit import fit
from cuticle.fitting.result import Fit
from cuticle.sampling.combining import combine, mixed_ess_of
from cuticle.sampling.quality import UniformSphere, measure
from cuticle.scattering.among_strands import Strands
from cuticle.scattering.bcsdf import Bcsdf
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.fibre import Fibre

LOBES = 4
COUNTS = (0.0, 1.0, 2.0, 4.0, 8.0)  # that samplers are fitted for
SHARES = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
WEIGHTS = (0.1, 0.25, 0.5, 0.75, 0.9)
KNOWN_STRANDS = 2.0
_MIX_VIEWERS = np.radians([-60.0, 0.0, 60.0])


@dataclass(frozen=True, eq=False, repr=False)
class Document(Findings):
    """The draft description, recomputed and completed for one fibre: as text, values and figures."""

    def __repr__(self) -> str:
        lines = [f"Document({self.name or repr(self.model)})"]
        if self.found is not None:
            for name, choice in self.found.choices.items():
                lines.append(f"  {name} = {choice.best.text()}")
        lines += [f"  {c.verdict}: {c.quote}" for c in self.claims]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        title = f"Document: {self.name or repr(self.model)}"
        return html_table(title, ("verdict", "the draft's sentence"), [(c.verdict, c.quote) for c in self.claims])

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, ours and the printed: angles in degrees, deviations in radians."""
        return as_values(self)

    def save(self, folder: str | os.PathLike[str], *, progress: Progress | None = None) -> Path:
        """Write document.json and the figures, figures/NAME.svg and .png, into a folder; return the JSON's path.

        Raises
        ------
        ValueError
            The folder cannot be written to.
        """
        with needed("a figure"):  # Matplotlib takes a second to import
            from cuticle._support.plots import figure_bytes
            from cuticle.draft.figures import figures

        report = progress or silent
        target = make_directory(Path(folder) / "figures").parent
        drawn = figures(self)
        entries = {}
        for i, (name, (figure, words)) in enumerate(drawn.items()):
            report(f"drawing {name}", i / len(drawn))
            for kind in ("svg", "png"):
                write_bytes(target / "figures" / f"{name}.{kind}", figure_bytes(figure, kind))
            entries[name] = {"file": f"figures/{name}.svg", **words}
        data = self.to_dict() | {"figures": entries}
        return write_text(target / "document.json", json.dumps(data, indent=1, allow_nan=False) + "\n")


def document(
    fibre: str | Fibre | Bcsdf = "document",
    *,
    printed: Printed | None = None,
    lobes: Fit | None = None,
    name: str = "",
    progress: Progress | None = None,
) -> Document:
    """Recompute and complete the draft description for a fibre.

    Parameters
    ----------
    fibre
        A preset's name, a fibre, a model with `with_strands`, or the function of a single strand. The last is put among
        others with `cuticle.Strands`.
    printed
        The draft's printed tables to compare with, from `Printed.load`. They belong to the `document` fibre.
    lobes
        A fit of this model for 0, 1, 2, 4 and 8 strands, to compare with. Default: four lobes are fitted.
    name
        Name of the fibre. Default: the preset's name.
    progress
        Called with a phase and a fraction from 0 to 1.

    Examples
    --------
    >>> import cuticle
    >>> d = cuticle.document("document")
    >>> d.found.functions.mu_H.terms[1].theta
    'θ'
    """
    report = progress or silent
    if isinstance(fibre, str):
        name = name or fibre
        fibre = Fibre.preset(fibre)
    if not isinstance(fibre, Fibre) and not callable(getattr(fibre, "eval", None)):
        raise TypeError(f"fibre must be a preset's name, a Fibre or a model with eval, got {type(fibre).__name__}")
    model: Any = DualScattering(fibre) if isinstance(fibre, Fibre) else fibre
    model = model.with_strands(0.0) if hasattr(model, "with_strands") else Strands(model)
    if lobes is not None and lobes.sampler.strands != COUNTS:
        counts = ", ".join(f"{n:g}" for n in lobes.sampler.strands)
        raise ValueError(f"lobes must cover the strand counts 0, 1, 2, 4, 8; got {counts}; fit with those counts")
    report("tables", 0.02)
    axis = highlight_axis(model)
    one = table_1(model)
    report("tables", 0.1)
    two = table_2(model, axis=axis)
    three = table_3(model)
    report("functions", 0.2)
    found, reason = None, ""
    try:
        found = find_functions(two, three, axis)
    except ValueError as error:
        reason = str(error)
    report("samplers", 0.3)
    fits = {"draft": fit(model, form="document", strands=COUNTS)}
    if found is not None:
        fits["found"] = fit(model, form="document", strands=COUNTS, functions=found.functions)
    fits["lobes"] = fit(model, LOBES, strands=COUNTS) if lobes is None else lobes
    report("comparison", 0.6)
    quality = _quality(model, fits)
    report("claims", 0.8)
    lobes_of = {"uniform": 0} | {name: f.sampler.lobes for name, f in fits.items()}
    claims = (
        judge.shift_claim(two),
        judge.width_claim(two),
        judge.turning_claim(one),
        judge.azimuth_claim(model, COUNTS[1:]),
        judge.match_claim(quality, fits["lobes"].sampler.lobes),
        judge.uniform_claim(quality, lobes_of),
    )
    report("combining", 0.85)
    mixing = tuple(_mixing(model, fits["lobes"], n) for n in (KNOWN_STRANDS, None))
    report("done", 1.0)
    return Document(
        name=name,
        model=model,
        axis=axis,
        table_1=one,
        table_2=two,
        table_3=three,
        found=found,
        reason=reason,
        claims=claims,
        quality=quality,
        fits=fits,
        mixing=mixing,
        printed=printed,
        printed_choices=printed.choices() if printed is not None else {},
    )


def _quality(model: DualScattering | Strands, fits: dict[str, Fit]) -> dict[str, dict[str, dict[str, float]]]:
    """Return the uniform sphere's quality and that of the fits, who measured theirs already."""

    def means(ess: NDArray[np.float64], variation: NDArray[np.float64]) -> dict[str, dict[str, float]]:
        return {
            f"{n:g}": {"ess": float(e.mean()), "total_variation": float(v.mean())}
            for n, e, v in zip(COUNTS, ess, variation, strict=True)
        }

    uniform = [[measure(UniformSphere(), model.with_strands(n), float(t), n) for t in VIEWERS] for n in COUNTS]
    pairs = np.array([[(q.ess, q.total_variation) for q in row] for row in uniform])
    quality = {"uniform": means(pairs[..., 0], pairs[..., 1])}
    for name, found in fits.items():
        at = np.isin(found.theta_r.round(9), VIEWERS.round(9))
        quality[name] = means(found.ess[:, at], found.total_variation[:, at])
    return quality


def _mixing(model: DualScattering | Strands, lobes: Fit, strands: float | None) -> Mixing:
    others = [model.with_strands(n) for n in ([strands] if strands is not None else COUNTS[1:])]
    combined = [combine(lobes.sampler, lobes.sampler, w, strands=strands) for w in WEIGHTS]
    table, best = [], []
    for share in SHARES:
        cells = [mixed_ess_of(combined, model, others, share, float(t)) for t in _MIX_VIEWERS]  # type: ignore[arg-type]
        table.append(tuple(np.mean([ess for ess, _ in cells], axis=0).tolist()))
        best.append(float(np.mean([limit for _, limit in cells])))
    return Mixing(strands, SHARES, WEIGHTS, tuple(table), tuple(best))
