"""A family as a file for another host: the far field of any fibre, parameters as arguments."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cuticle._support import validate
from cuticle._support.version import __version__
from cuticle.export.headers import amalgamate
from cuticle.export.registry import Export, FamilyJob, host, host_names
from cuticle.export.source import environment, signed
from cuticle.scattering.bcsdf import REC709
from cuticle.scattering.family_among import FAMILIES, FamilyAmong

_ABOUT = {
    "chiang": "Chiang et al. 2016, far field: beta_m and beta_n from 0.05 to 1, alpha in radians, positive toward the root.",
    "marschner": "Marschner 2003 with d'Eon's energy-conserving M: alpha, beta of R, TT, TRT in theta_h, beta_n; radians.",
}


def about_family(form: str, among: FamilyAmong | None) -> list[str]:
    """Return lines that say which family a file is of."""
    lines = [f"Made by Cuticle {__version__}: the far field of any fibre. {_ABOUT[form]}"]
    return lines if among is None else [*lines, f"Among strands of a mean fibre: {among.among!r}."]


def family_writer(form: str, to: str) -> Callable[[FamilyJob], Export]:
    """Return what writes a family for a host, or raise ValueError for a family or a host that there is not."""
    validate.choice("family", form, FAMILIES)
    if to not in host_names() or host(to).family is None:  # only then all hosts are imported
        to = validate.choice("to", to, [name for name in host_names() if host(name).family is not None])
    chosen = host(to)
    if form not in chosen.forms:
        raise ValueError(f"{to} takes the family {' or '.join(chosen.forms)}, got {form!r}; --to cpp takes any")
    assert chosen.family is not None
    return chosen.family


def family_header(
    job: FamilyJob, *, cuda: bool = False, weights: Sequence[float] = REC709, colour: str = "linear RGB"
) -> Export:
    """Return a family as a C++ header. `weights`: of the channels in the density; `colour`: what the channels are."""
    text = environment().get_template("family.h.j2").render(
        name=job.name, guard=f"{job.name}_CUTICLE_H", frame=job.frame, cuda=cuda, chiang=job.form == "chiang",
        about=job.about, core=amalgamate([f"scattering/{'far_field' if job.among is None else 'far_among'}.h"]),
        version=__version__.split("."), weights=weights, colour=colour, among=job.among,
    )  # fmt: skip
    return Export(signed(text), 0 if job.among is None else 4 * sum(x.size for x in job.among.around[:3]))
