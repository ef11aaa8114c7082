"""A sampler in a shading language, and the texels its scattering function reads.

The host's own functions, fetches and loops, stand in templates/*.formulas.j2 in the language of the C++ headers; they and
what they need of the headers are printed together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cuticle.export.formulas import FLOAT, Printer, Vector, headers, print_formulas
from cuticle.export.formulas.tree import BOOL, Record, Type
from cuticle.export.literals import single
from cuticle.export.registry import Export, Job, Tables
from cuticle.export.source import environment, signed
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.compact_table import FunctionTable
from cuticle.scattering.fibre_tables import ThroughTables
from cuticle.scattering.mean_strands import MeanStrands

TEXTURE_WIDTH = 1024  # every device of OpenGL ES 3.0 has 2048


@dataclass(frozen=True)
class Dialect:
    """A shading language.

    Attributes
    ----------
    printer
        Its printer.
    name
        Its name, as an include guard ends.
    about
        What a file says of it.
    texture, fetch
        How a texture is declared, and its i-th texel fetched.
    replaced
        How a user puts something else in place of NAME_TABLE and its kin.
    prelude
        What a file begins with.
    model
        What is said of the texture.
    """

    printer: type[Printer]
    name: str
    about: str
    texture: str
    fetch: str
    replaced: str = "define {} before this file"
    prelude: str = ""
    model: str = "The scattering function reads a texture, {}_model"


def shader(job: Job, dialect: Dialect, *, inline: bool = True) -> Export:
    """Return a sampler in a shading language; with `job.tables` its scattering function, too.

    `inline=False` leaves the table of lobes out: the host then defines NAME_TABLE(i).
    """
    sampler, tables, name = job.sampler, job.tables, job.name
    texels = lobe_texels(sampler)
    printer = dialect.printer(name)
    types = {"Set": Vector("float", min(sampler.lobes, 4))}
    externals = {"table": Vector("float", 4), "energy": FLOAT}
    values = _lobe_values(job, texels)
    jinja = environment()
    text = jinja.get_template("sampler.formulas.j2").render(values)
    data = b""
    if tables is not None:
        if tables.channels > 4:
            raise ValueError(
                f"a texel holds 4 channels, this fibre has {tables.channels}: leave --with-model out, or use cpp"
            )
        types["Color"] = Vector("float", tables.channels)
        externals["model"] = Vector("float", 4)
        text += jinja.get_template("model.formulas.j2").render(_model_values(tables), data=tables, frame=job.frame)
        data = model_texels(tables).tobytes()
    functions = print_formulas(text, printer, types=types, externals=externals)  # after which heads are known
    file = jinja.get_template("shader.j2").render(
        values, heading=_heading(job, dialect, printer), n=name, N=name.upper(), dialect=dialect, p=printer,
        texels=texels if inline else texels[:0], energy=sampler.energy[:2], texture_width=TEXTURE_WIDTH, FLOAT=FLOAT,
        float4=Vector("float", 4), functions=functions,
    )  # fmt: skip
    return Export(signed(file), texels.nbytes + sampler.energy.size * 4, data, tables)


def _lobe_values(job: Job, texels: NDArray[np.float32]) -> dict[str, object]:
    """What the sampler's template asks for."""
    sampler = job.sampler
    rows, nodes, groups = texels.shape[0], texels.shape[1], texels.shape[2] // 5
    width = min(sampler.lobes, 4)
    return dict(
        family=job.lobe_family, fields=headers().fields(f"{job.lobe_family}::Density"),
        lobes=sampler.lobes, width=width, lanes="xyzw"[:width],
        G=groups, rows=rows, nodes=nodes, row=nodes * 5 * groups, counts=_counts(sampler.strands),
        even=str(bool(sampler.even)).lower(), blends=rows > 1 and sampler.strands[0] == 0, frame=job.frame, data=job.tables,
        back=["xyz"[job.frame.axes.index(a)] for a in "xyz"],
    )  # fmt: skip


def _heading(job: Job, dialect: Dialect, p: Printer) -> list[str]:
    """What a file says of itself: which sampler it is, and how its functions are called."""
    n, tables = job.name, job.tables
    three, four = Vector("float", 3), Vector("float", 4)
    single = len(job.sampler.strands) == 1
    angles, strands, u = "theta_i theta_r phi", "strands", ("u", three, False)

    def call(result: Type, name: str, *parameters: str | tuple[str, Type, bool]) -> str:
        """A function's head; numbers by their names alone."""
        numbers = [[(x, FLOAT, False) for x in p.split()] if isinstance(p, str) else [p] for p in parameters]
        return p.signature(result, name, [x for group in numbers for x in group])

    viewer, light = (job.frame.viewer, three, False), (job.frame.light, three, False)
    prepare = p.signature(Record("Sampler", ()), "prepare", [("theta_r", FLOAT, False), ("strands", FLOAT, False)])
    lines = [
        *job.about(), "", dialect.about, "",
        "Angles: theta in [-pi/2, pi/2] from the plane normal to the strand, positive toward its tip; r toward the viewer, i"
        " toward the light; phi = phi_i - phi_r. pdf is per steradian. strands: how many lie between this one and the light"
        + ("; this sampler is for one count and ignores it." if single else "."),
        "u in [0, 1): which lobe, theta, phi.", "",
        call(FLOAT, "pdf", angles, strands),
        f"{call(three, 'sample', 'theta_r', u, strands)}: theta_i, phi, pdf",
        f"{prepare}: for several directions of one shading point,",
        f"{n}_prepared_pdf(s, theta_i, phi), {n}_prepared_sample(s, u)",
    ]  # fmt: skip
    if tables is not None:
        color = Vector("float", tables.channels)
        lines.append(f"{call(color, 'eval', angles, strands)}: f in 1/sr, without a cosine")
        if tables.kind == "dual":
            lines += [
                f"{call(color, 'eval_around', angles, strands, 'behind', ('random', BOOL, False))}:",
                "the same where `behind` strands lie beyond this one, on average, and, if random, `strands` is the mean of a"
                " Poisson number",
            ]
    lines += [
        "", f"With directions; frame: {job.frame.about}.", "",
        call(FLOAT, "pdf_direction", viewer, light, strands),
        call(three, "sample_direction", viewer, u, strands, ("pdf", FLOAT, True)),
    ]  # fmt: skip
    if tables is not None:
        lines += [
            f"{call(color, 'eval_direction', viewer, light, strands)}: f cos(theta_i)", "",
            f"{dialect.model.format(n)}: RGBA32F, {TEXTURE_WIDTH} texels wide, from the file of"
            f" values beside this one; or {dialect.replaced.format(f'{n.upper()}_MODEL(i)')}: the i-th texel.",
        ]  # fmt: skip
    table = f"{n.upper()}_TABLE(i)"
    instead = dialect.replaced.format(table)
    return [*lines, f"The table is inlined. To fetch it from elsewhere, {instead}: its i-th {p.type(four)}."]


def lobe_texels(sampler: Sampler) -> NDArray[np.float32]:
    """Return the table as it is fetched: shape (rows, theta nodes, 5 groups, 4), lobes of weight 0 added to fill a group."""
    rows, nodes, parameters, lobes = sampler.nodes.shape
    padded = np.ones((rows, nodes, parameters, -(-lobes // 4) * 4), np.float32)
    padded[:, :, 0] = 0
    padded[..., :lobes] = sampler.nodes
    return padded.reshape(rows, nodes, -1, 4)


def model_texels(tables: Tables) -> NDArray[np.float32]:
    """Return the scattering function's tables as rows of texels, shape (height, width, 4).

    Of a fibre N; then what comes through other strands, or the spread N and the averages, or the energies past TRT. Of a
    table its shape, then its energies.
    """
    parts = [tables.shape, tables.log_energy] if isinstance(tables, FunctionTable) else tables.parts
    return texture_rows(np.concatenate([p.reshape(-1, p.shape[-1]) for p in parts]))


def texture_rows(texels: NDArray) -> NDArray[np.float32]:
    """Return texels, shape (count, at most 4), as the rows of a texture, shape (height, width, 4)."""
    height = -(-len(texels) // TEXTURE_WIDTH)
    out = np.zeros((height * TEXTURE_WIDTH, 4), np.float32)
    out[: len(texels), : texels.shape[1]] = texels
    return out.reshape(height, TEXTURE_WIDTH, 4)


def _model_values(tables: Tables) -> dict[str, object]:
    """What the model's template asks for; tables begin at texels of the texture, and sizes are in texels."""
    if isinstance(tables, FunctionTable):
        counts, viewers, rows, columns, _ = tables.shape.shape
        return {
            "counts": counts, "viewers": viewers, "rows": rows, "columns": columns, "energies": tables.log_energy.shape[1],
            "first_energy": counts * viewers * rows * columns,
            "limits": _counts(tables.strands),
        }  # fmt: skip
    rows, columns = tables.direct.shape[:2]
    second = 3 * rows * columns
    values: dict[str, object] = {
        "rows": rows, "columns": columns, "dual": tables.kind == "dual", "second": second,
        "form": f"Longitudinal::{'energy_conserving' if tables.conserving else 'gaussian'}",
    }  # fmt: skip
    if tables.averages is not None:
        values["averages"] = f"{{{2 * second}, {len(tables.averages)}, 1}}"
    if tables.through is not None:
        values["through"] = through_table(tables.through, second, tables.channels, 1)
    return values


def _counts(strands: ArrayLike) -> list[float]:
    """Counts of strands, two at the least: one stands for all numbers."""
    counts = np.asarray(strands, float).tolist()
    return counts if len(counts) > 1 else [counts[0], counts[0] + 1]


def through_table(tables: ThroughTables | MeanStrands, first: int, texel: int, channels: int) -> str:
    """Return a ThroughTable over texels from the first on, each of so many values: all channels, or all parts of one."""
    read = (tables.energy, tables.along, tables.azimuth)
    begins = np.cumsum([first, *(t.size // texel for t in read)]).tolist()
    sizes = [*(t.shape[2] for t in read), tables.azimuth.shape[3], channels]
    parts = tables.energy.shape[4] * tables.energy.shape[5] // (texel * channels)
    return f"{{{', '.join(map(str, begins + sizes))}, {single(tables.limit)}, {parts}}}"
