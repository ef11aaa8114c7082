"""Fitting a sampler to a scattering function."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from cuticle._support import validate
from cuticle._support.progress import Progress, part, silent
from cuticle.fitting.closed_forms import DRAFT, DocumentFunctions, document_nodes
from cuticle.fitting.closed_forms import THETA_NODES as DOCUMENT_NODES
from cuticle.fitting.costs import traced_cost
from cuticle.fitting.lobes import carry, fit_table, grow_at_start
from cuticle.fitting.mixture import Array, ess_of, to_natural
from cuticle.fitting.points import END, THETA_NODES, Points, make_points, with_nodes
from cuticle.fitting.result import Candidate, Fit, Worst
from cuticle.fitting.rows import settled_rows
from cuticle.fitting.samplings import FORMS
from cuticle.fitting.targets import OBJECTIVES, make_targets
from cuticle.sampling.families import FAMILIES, NORMAL
from cuticle.sampling.lobe_table import MAX_LOBES
from cuticle.sampling.quality import MEASURED_AT, measure
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import Bcsdf, check_model, strands_of
from cuticle.scattering.by_name import provenance

AUTO = "auto"  # of strand counts, those after which the shape of light no longer changes
BEST = "best"  # of the families, the one with the highest mean ESS
MAX_AUTO_LOBES = 12
_DENSE = 8  # lobes up to which all viewers are seen at every count between rows; a step's cost grows with their square
_DOUBTED = 8  # places of the lowest ESS that are measured again


def fit(
    model: Bcsdf,
    lobes: int | None = 4,
    *,
    strands: Sequence[float] | str | None = None,
    form: str = "lobes",
    objective: str = "luminance",
    family: str = NORMAL,
    defensive: float = 0.1,
    functions: DocumentFunctions | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit a sampler to a scattering function by maximising its effective sample size (ESS).

    Parameters
    ----------
    model
        The scattering function: any object with `eval(theta_i, theta_r, phi)`. For several strand counts it also needs
        `with_strands(n)`.
    lobes
        Number of lobes K, 1 to 32. None chooses K by ESS per cost of a traced sample.
    strands
        Increasing strand counts to cover, such as [0, 1, 2, 4, 8], one row of the table each. "auto" covers all numbers:
        0, 1, 2, 4, 8, 16, up to 64 where the shape of light still changes, more where the lobes lose it between, and 49
        nodes for 25 where those are not enough. Default: the model's own count.
    form
        "lobes": a mixture of K lobes. "document": the closed forms of the draft description, with `functions` and
        `defensive`.
    objective
        "luminance" maximises the ESS of the luminance. "rgb" minimises 1/ESS averaged over the channels.
    family
        Density of a lobe along each coordinate: "normal", "logistic", or "best" for the one of the two with the higher mean
        ESS. "logistic" is better for one or two lobes, "normal" for four and more.
    defensive
        Share of the nearly uniform lobe in the "document" form, 0 to 0.99.
    functions
        Functions of the "document" form. Default: the numbers printed in the draft, which belong to its own fibre.
        `cuticle.document` finds those of any fibre.
    progress
        Called with the name of the phase and the fraction done, 0 to 1.

    Returns
    -------
    Fit
        The sampler, its ESS at nine viewers for each strand count, by quadrature, and the worst ESS that was found on and
        between the table's nodes and rows.

    Raises
    ------
    ValueError
        A parameter is out of range, or the model returns NaN, negative values or no energy.

    Examples
    --------
    >>> import cuticle
    >>> result = cuticle.fit(cuticle.Marschner(cuticle.Fibre.preset("black")), lobes=2)
    >>> result.sampler
    Sampler(lobes, 2 lobes, 25 theta nodes, strands 0)
    """
    validate.choice("form", form, FORMS)
    validate.choice("objective", objective, OBJECTIVES)
    validate.choice("family", family, (*FAMILIES, BEST))
    report = progress or silent
    if family == BEST:
        tried = {
            name: fit(
                model, lobes, strands=strands, form=form, objective=objective, family=name, defensive=defensive,
                functions=functions, progress=part(report, i / len(FAMILIES), 1 / len(FAMILIES)),
            )
            for i, name in enumerate(FAMILIES)
        }  # fmt: skip
        means = {name: float(f.ess.mean()) for name, f in tried.items()}
        return replace(tried[max(means, key=means.__getitem__)], families=means)
    if form == "document" and family != NORMAL:
        raise ValueError(f"the document's form is made of normal lobes: leave family out, got {family!r}")
    if lobes is not None:
        lobes = validate.integer("lobes", lobes, 1, MAX_LOBES, remedy="4 suits most fibres; None lets the program choose")
    validate.number("defensive", defensive, 0, 0.99)
    functions = DRAFT if functions is None else functions
    if not isinstance(functions, DocumentFunctions):
        raise TypeError(f"functions must be DocumentFunctions, got {type(functions).__name__}; cuticle.document finds them")
    check_model(model)
    counts = _counts(model, strands)

    def with_strands(n: float) -> Any:
        return model if n == strands_of(model) else model.with_strands(n)  # type: ignore[attr-defined]

    start = time.perf_counter()
    if form == "document":
        report("closed forms", 0.5)
        angles = np.clip(np.linspace(-np.pi / 2, np.pi / 2, DOCUMENT_NODES), -END, END)
        models = [m for m in map(with_strands, counts) for _ in angles]
        targets = make_targets(models, [*angles] * len(counts), objective)
        nodes = document_nodes(counts, defensive, functions)
        ess = ess_of(targets, nodes.reshape(-1, *nodes.shape[2:]))
        lowest = _lowest(ess, np.repeat(counts, len(angles)), np.tile(angles, len(counts)))
        found = _Table(counts, nodes, targets.energy.reshape(len(counts), -1), True, lowest)
    else:
        found = _fit_lobes(with_strands, counts, lobes, objective, family, report, more_rows=_is_auto(strands))
        counts = found.strands
    seconds = time.perf_counter() - start

    about: dict[str, Any] = {"form": form, "objective": objective}
    if form == "document":
        about["functions"] = [line for lines in functions.code() for line in lines]
    about |= provenance(model)
    sampler = Sampler(found.nodes, found.energy, counts, found.even, about, family)
    quality = []
    for i, n in enumerate(counts):
        report("measuring", 0.8 + 0.2 * i / len(counts))
        quality.append([measure(sampler, with_strands(n), float(t), n, error=False) for t in MEASURED_AT])
    # The fit's own grids are coarse: places where they find a low ESS are measured again.
    measured = [
        Worst(q.ess, float(t), n)
        for n, row in zip(counts, quality, strict=True)
        for q, t in zip(row, MEASURED_AT, strict=True)
    ]
    again = [Worst(measure(sampler, with_strands(n), t, n, error=False).ess, t, n) for n, t in found.doubtful]
    worst = min(*measured, *again)
    report("done", 1.0)
    return Fit(
        sampler=sampler,
        theta_r=MEASURED_AT,
        ess=np.array([[q.ess for q in row] for row in quality]),
        ess_channels=np.array([[q.ess_channels for q in row] for row in quality]),
        largest_weight=np.array([[q.largest_weight for q in row] for row in quality]),
        total_variation=np.array([[q.total_variation for q in row] for row in quality]),
        seconds=seconds,
        form=form,
        objective=objective,
        worst=worst,
        candidates=found.candidates,
    )


class _Table(NamedTuple):
    """A sampler's table, and what the fit learnt on the way; `doubtful` are places (strands, theta_r) of low ESS."""

    strands: tuple[float, ...]
    nodes: Array
    energy: Array
    even: bool
    doubtful: list[tuple[float, float]]
    candidates: tuple[Candidate, ...] = ()


def _lowest(ess: Array, strands: Array, theta_r: Array) -> list[tuple[float, float]]:
    return [(float(strands[k]), float(theta_r[k])) for k in np.argsort(ess)[:_DOUBTED]]


def _is_auto(strands: Sequence[float] | str | None) -> bool:
    return isinstance(strands, str) and strands == AUTO  # an array would compare by element


def _counts(model: Any, strands: Sequence[float] | str | None) -> tuple[float, ...]:
    own = strands_of(model)
    if strands is None:
        return (own,)
    many = callable(getattr(model, "with_strands", None))
    auto = _is_auto(strands)
    if auto and many:
        return settled_rows(model)
    counts = None if auto else validate.strand_counts("strands", strands)
    if counts is None or (counts != (own,) and not many):
        raise TypeError(f"{type(model).__name__} knows no strands: leave strands out, or give a model with with_strands(n)")
    return counts


def _fit_lobes(
    with_strands: Callable[[float], Bcsdf],
    counts: tuple[float, ...],
    lobes: int | None,
    objective: str,
    family: str,
    report: Progress,
    *,
    more_rows: bool,
) -> _Table:
    # Direct light and light through strands have different shapes: two groups, each smooth within.
    groups = [g for g in (tuple(n for n in counts if n == 0), tuple(n for n in counts if n > 0)) if g]
    points: list[Points] = []

    def look(strands: Sequence[float], known: Points | None = None, nodes: int = THETA_NODES) -> Points:
        dense = lobes is None or lobes <= _DENSE
        return make_points(with_strands, strands, objective, family, dense=dense, nodes=nodes, known=known)

    for g in groups:
        report("tabulating", 0.2 * len(points) / len(groups))
        points.append(look(g))
    candidates: tuple[Candidate, ...] = ()
    if lobes is None:
        lobes, candidates = _choose_lobes(points, report)
    tables, done = [], 0.3
    for i, p in enumerate(points):
        share = 0.5 * len(p.on_nodes) / len(counts)
        points[i], u = fit_table(p, lobes, part(report, done, share), look if more_rows else None)
        tables.append(to_natural(u))
        done += share
    ess = np.concatenate([ess_of(p.targets, p.natural(x)) for p, x in zip(points, tables, strict=True)])
    nodes = max(p.nodes for p in points)
    energy = np.concatenate([p.energy_at_nodes(nodes) for p in points])
    tables = [with_nodes(x, nodes) for x in tables]
    lowest = _lowest(ess, *(np.concatenate([getattr(p, name) for p in points]) for name in ("strands", "theta_r")))
    rows = tuple(float(n) for p in points for n in p.rows)
    return _Table(rows, np.concatenate(tables), energy, points[0].targets.even, lowest, candidates)


def _choose_lobes(points: Sequence[Points], report: Progress) -> tuple[int, tuple[Candidate, ...]]:
    """Weigh K = 1, 2, … by mean ESS over the cost of a traced sample, carried to all viewers but not polished."""
    grown = [grow_at_start(p, MAX_AUTO_LOBES) for p in points]
    candidates: list[Candidate] = []
    for k in range(1, MAX_AUTO_LOBES + 1):
        report(f"weighing {k} lobes", 0.2 + 0.1 * k / MAX_AUTO_LOBES)
        values = []
        for p, fits in zip(points, grown, strict=True):
            u = carry(p, fits[k - 1])
            values.append(ess_of(p.targets, p.natural(to_natural(u))))
        ess, cost = float(np.concatenate(values).mean()), traced_cost(k)
        candidates.append(Candidate(k, ess, cost, ess / cost))
        recent = [c.efficiency for c in candidates[-3:]]
        if len(recent) == 3 and recent[0] >= max(recent[1:]):
            break
    return max(candidates, key=lambda c: c.efficiency).lobes, tuple(candidates)
