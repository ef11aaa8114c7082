"""`cuticle demo`: what `make demo` runs."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from cuticle._support.files import make_directory, write_bytes, write_text
from cuticle.checking.check import check
from cuticle.cli.tables import check_tables, fit_table
from cuticle.cli.terminal import out, progress_bar
from cuticle.draft.document import document
from cuticle.draft.printed import Printed
from cuticle.fitting.fit import fit
from cuticle.fitting.result import fit_summary
from cuticle.scattering.dual_scattering import DualScattering
from cuticle.scattering.fibre import Fibre

_SAMPLES = 40  # a pixel of the picture of hair: under a minute on two cores


def command(output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR")] = Path("out/demo")) -> None:
    """Fit, check, reproduce and picture the document fibre: what `make demo` runs."""
    from cuticle.report.densities import densities_figure
    from cuticle.report.page import write_report
    from cuticle.sampling.quality import UniformSphere, measure

    folder = make_directory(output)
    model = DualScattering(Fibre.preset("document"))
    with progress_bar(False) as progress:
        result = fit(model, 4, strands=(0, 1, 2, 4, 8), progress=progress)
    result.sampler.save(folder / "sampler.json")
    model.fibre.save(folder / "fibre.toml")
    write_text(folder / "fit.json", json.dumps(fit_summary(result), indent=2) + "\n")
    with progress_bar(False) as progress:
        report = check(result.sampler, model, progress=progress)
    tables = check_tables(report)
    recorder = Console(record=True, width=118, file=io.StringIO(), markup=False)
    for listing in tables:
        recorder.print(listing)
    write_text(folder / "check.txt", recorder.export_text())
    write_text(folder / "check.json", report.to_json())
    write_bytes(folder / "densities.png", densities_figure(result.sampler, model))
    with progress_bar(False) as progress:
        reproduced = document(model, printed=Printed.find(), lobes=result, name="document", progress=progress)
        reproduced.save(folder, progress=progress)
    page = write_report(folder)
    hair = _demo_hair(folder / "hair.png")
    out.print(fit_table(result))
    for listing in tables:
        out.print(listing)
    uniform = [measure(UniformSphere(), model.with_strands(n), 0.0).ess for n in result.sampler.strands]
    out.print(
        "ESS 1 would be a perfect match: a sample is then worth as much as one drawn from f·cos itself; 1/ESS is how many"
        f" times more samples equal noise takes. A uniform sphere has {', '.join(f'{e:.3f}' for e in uniform)} here, at"
        " theta_r 0°.\n"
        f"sampler  {folder / 'sampler.json'}\ncheck    {folder / 'check.txt'}, {folder / 'check.json'}\n"
        f"picture  {folder / 'densities.png'}: f·cos beside the fitted pdf, seven viewers, direct and through two strands\n"
        f"report   {page}: all of this, and the draft's tables, functions, figures and claims\n"
        f"hair     {hair}",
        soft_wrap=True,
    )
    if not report.ok:
        raise typer.Exit(1)


def _demo_hair(path: Path) -> str:
    """Render a head of blond hair, lit through itself, where Mitsuba can; return what came of it."""
    from cuticle.grooms.procedural import hair_head, head_bust
    from cuticle.render.picture import expected_seconds, render, save_picture
    from cuticle.render.scene import Light, View, bsdf, bust_shape, integrator, load_scene, mitsuba

    try:
        mi = mitsuba()
    except RuntimeError as error:
        return f"not rendered: {error}"
    head, view = hair_head(), View(azimuth=30, width=320, height=384, zoom=0.95)
    with progress_bar() as progress:
        scene = load_scene(
            mi,
            head,
            bsdf("blond"),
            view=view,
            light=Light("studio"),
            technique=integrator("dual"),
            others={"bust": bust_shape(mi, head_bust())},
        )
        progress.expect(expected_seconds(scene, _SAMPLES) or 0.0)
        done = render(scene, _SAMPLES, progress=progress)
    save_picture(path, done.image)
    return f"{path}: {head.strands:,} blond strands by dual scattering, {done.seconds:.1f} s; see `cuticle render --help`"
