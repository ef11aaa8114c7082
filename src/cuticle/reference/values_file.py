"""Files of values: the cases that `make` writes, someone's values beside them, and the layout of Falcor's 50,000."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cuticle._support import validate
from cuticle._support.files import read_bytes, read_text, reading
from cuticle._support.values import Value
from cuticle.reference.cases import ANGLES, LIMITS, LONGITUDINAL, MODELS, PARAMETERS, SIGMAS, Inputs

Array = NDArray[np.float64]
NO_DENSITY = "none: f has no integral over directions, for the light behind has no sum at some theta_i"
FORMAT = "Cuticle reference 1"
VALUES = ("f_r", "f_g", "f_b", "f", "pdf")
PREFIX = "ref_"
LEAST_ROWS = 20
_FALCOR = 17  # columns of float32
_FINE = 1e-3  # of a value: what its last decimal may be
_SINGLE_DIGITS = 9  # of a decimal number: fewer or as many are those of a float


@dataclass(frozen=True, eq=False)
class Submission(Value):
    """Someone's values of cases, NaN where there is none.

    Attributes
    ----------
    name
        Where they come from.
    inputs
        The cases.
    f
        The BCSDF in 1/sr without a cosine, (n, channels).
    pdf
        The density in 1/sr, (n,).
    single
        Whether the values of "f" and of "pdf" are those of single precision: at most nine digits each, or floats exactly.
    rows
        What each case is called: the number in the file's column `case`, or its row.
    wrong
        Values that are no numbers (nan, inf), and channels that are empty where others are not, by row.
    failed
        Which cases those are, (n,), of "f" and of "pdf".
    notes
        Which cases have no value at all.
    digits
        That a quarter of the values have at most, leading zeros aside.
    written
        By how much the values of "f" and of "pdf" may be off as they were printed, where all have as many decimals.
    """

    name: str
    inputs: Inputs
    f: Array
    pdf: Array
    single: Mapping[str, bool]
    rows: NDArray[np.int64]
    wrong: tuple[str, ...] = ()
    failed: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    digits: int = 17
    written: Mapping[str, float] = field(default_factory=dict)


def header(inputs: Inputs, seed: int) -> list[str]:
    """Return the comment lines of a file of cases."""
    near = inputs.near
    lines = [
        f"{FORMAT}: {inputs.about}; {len(inputs)} cases, seed {seed}",
        f"model: {inputs.model}",
        *([f"longitudinal: {inputs.longitudinal}"] if inputs.model == "marschner" else []),
        "Fill in f_r, f_g, f_b, or one of them, or pdf, and run: cuticle reference check FILE",
        "f is the BCSDF in 1/sr without a cosine: L_r = ∫ f L_i cos(theta_i) dω_i.",
        "pdf is per steradian, of a direction toward the light: the luminance (Rec. 709) of f cos(theta_i), normalised.",
        "theta_i, theta_r, phi: radians. i is toward the light (sampled), r toward the viewer (given);",
        "theta is measured from the normal plane, positive along the tangent; phi = phi_i - phi_r.",
        "wi, wo: the same as unit vectors (sin theta, cos theta cos phi, cos theta sin phi); x is the tangent, phi_r = 0.",
        "sigma_a: per fibre radius. Inputs but wi and wo are exact in single precision.",
    ]
    if near:
        lines.append("h: offset of the viewer's ray, -1 to 1: h = sin(gamma_i), and R leaves at phi = -2 gamma_i.")
    if inputs.model == "chiang":
        lines.append("alpha: degrees; R's axis lies at theta_i = -theta_r - 2 alpha (pbrt and Mitsuba have the other sign).")
    else:
        lines.append("alpha, beta: degrees of theta_h = (theta_i + theta_r)/2; beta_N: deviation around the fibre, degrees.")
        closed = inputs.longitudinal == LONGITUDINAL[0] and inputs.model == "marschner"
        orders = "(1-F)² F T²/(1 - F T): the orders past TRT are in it" if closed else "(1-F)² F T²: no order past TRT"
        lines.append(f"A_TRT = {orders}.")
    lines.append(f"{PREFIX}…: the reference; …_error: a proven bound of how far the printed number is off")
    if inputs.model == "dual_scattering":
        lines.append(f"{PREFIX}pdf_error: the same; or why {PREFIX}pdf is empty.")
    return lines


def vectors(inputs: Inputs) -> dict[str, Array]:
    """Return wi and wo of each case, x along the tangent."""
    ti, tr, phi = (inputs.columns[k] for k in ANGLES)
    wi = np.sin(ti), np.cos(ti) * np.cos(phi), np.cos(ti) * np.sin(phi)
    wo = np.sin(tr), np.cos(tr), np.zeros_like(tr)
    return {f"{w}_{axis}": x for w, v in (("wi", wi), ("wo", wo)) for axis, x in zip("xyz", v, strict=True)}


def text(inputs: Inputs, seed: int, values: Sequence[dict[str, tuple[str, str]]]) -> str:
    """Return the file: `values` holds, for each case, each value by name as (number, error) in decimal text."""
    out = io.StringIO()
    for line in header(inputs, seed):
        out.write(f"# {line}\n")
    along = vectors(inputs)
    names = list(values[0])
    columns = ["case", *inputs.columns, *SIGMAS, *along, *VALUES[:3], "pdf"]
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*columns, *(PREFIX + n + end for n in names for end in ("", "_error"))])
    blank = [""] * 4
    for i, row in enumerate(values):
        given = [repr(v) for v in inputs.row(i).values()]
        directions = [repr(float(v[i])) for v in along.values()]
        writer.writerow([str(i + 1), *given, *directions, *blank, *(x for n in names for x in row[n])])
    return out.getvalue()


def read(
    path: str | os.PathLike[str], *, cases: str | os.PathLike[str] | None = None, model: str | None = None
) -> Submission:
    """Return the values of a file: a CSV, or Falcor's layout of 17 columns of little-endian float32.

    Parameters
    ----------
    path
        The file. A CSV has a row of names; lines that begin with # are comments, of which `# model: NAME` and
        `# longitudinal: NAME` are read.
    cases
        A file of cases that holds the inputs, by the column `case`, where `path` has only values.
    model
        The model, where the file does not say: by default it is told by the names of the columns.

    Raises
    ------
    ValueError
        One line: which row and column, what was found, and what it needs.
    """
    with reading(path, "values"):
        if Path(path).suffix.lower() in (".gz", ".zip", ".xz"):
            raise ValueError(f"{path} is packed: unpack it first")
        if Path(path).suffix.lower() in (".dat", ".bin"):
            if cases is not None or model not in (None, "chiang"):
                raise ValueError(
                    "Falcor's layout holds its own inputs, of Chiang's near field: leave --cases and --model out"
                )
            return _read_falcor(path)
        table = _Table(path)
        source = table if cases is None else _Table(cases)
        return _submission(table, source, model, str(path), joined=cases is not None)


class _Table:
    """The cells of a CSV file as text, and what its comments say."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        lines = read_text(path, "values").splitlines()
        comments = [line for line in lines if line.lstrip().startswith("#")]
        self.said = dict(re.findall(r"^#\s*(model|longitudinal):\s*(\S+)", "\n".join(comments), re.MULTILINE))
        self.field = next((f for f in ("near", "far") for line in comments if FORMAT in line and f"{f} field" in line), "")
        kept = [(i + 1, line) for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
        if len(kept) < 2:
            raise ValueError(f"{path} holds no rows of values; it needs a row of names and then numbers")
        parsed = list(csv.reader(line for _, line in kept))
        if len(parsed) != len(kept):
            raise ValueError(f"{path} has a cell of several lines, in quotation marks; a row must be one line")
        self.names = [name.strip() for name in parsed[0]]
        other = next((c for c in ";\t| " if c in kept[0][1].strip() and "," not in kept[0][1]), None)
        if other is not None:
            raise ValueError(f"{path}, line {kept[0][0]}: columns must be separated by commas, not by {other!r}")
        doubled = next((n for n in self.names if self.names.count(n) > 1), None)
        if doubled is not None:
            raise ValueError(f"{path} has two columns named {doubled!r}; keep one")
        self.path, self.lines = path, [i for i, _ in kept[1:]]
        for number, row in zip(self.lines, parsed[1:], strict=True):
            if len(row) != len(self.names):
                raise ValueError(f"{path}, line {number}: {len(row)} cells for {len(self.names)} columns")
        self.cells = {name: [row[k].strip() for row in parsed[1:]] for k, name in enumerate(self.names)}

    def numbers(self, name: str, *, blank: bool) -> Array:
        """Return a column; cells without a number are refused, but blank ones where they are allowed: NaN."""
        out = np.empty(len(self.lines))
        for k, cell in enumerate(self.cells[name]):
            try:
                out[k] = math.nan if blank and not cell else number(cell)
            except ValueError:
                raise ValueError(f"{self.path}, line {self.lines[k]}: {name} must be a number, got {cell!r}") from None
        return out


def number(cell: str) -> float:
    """Return a cell's number; of C's printf("%f"), too, which writes what is none as -nan or -nan(ind)."""
    if "_" in cell or not cell.isascii():  # a number to Python alone
        raise ValueError(cell)
    if re.fullmatch(r"[-+]?1\.#INF0*", cell, re.IGNORECASE):  # Microsoft's, before 2015
        return math.inf
    none = r"[-+]?(nan(\(\w*\))?|1\.#(IND|QNAN|SNAN)0*)"
    return math.nan if re.fullmatch(none, cell, re.IGNORECASE) else float(cell)


def _submission(table: _Table, source: _Table, model: str | None, name: str, joined: bool) -> Submission:
    for key, value in table.said.items():
        if value != source.said.get(key, value):
            raise ValueError(f"{table.path} says {key}: {value}, but {source.path} {key}: {source.said[key]}")
    said = source.said.get("model", model)
    if model is None and said is None:
        said = _told_by(source.names)
    model = validate.choice("model", model or said, MODELS)
    longitudinal = source.said.get("longitudinal", "gaussian" if model == "dual_scattering" else LONGITUDINAL[0])
    validate.choice("longitudinal", longitudinal, LONGITUDINAL)
    inputs = _inputs(source, model, longitudinal)
    _refuse_unread(table)
    given = [v for v in VALUES if v in table.names and any(table.cells[v])]
    if not given:
        raise ValueError(
            f"{name} holds no values: fill in a column f_r, f_g, f_b, f or pdf; it has {', '.join(table.names[:6])} …"
        )
    if "f" in given and inputs.channels == 3:
        raise ValueError(f"{name} has one column f for three absorptions: name it f_r, f_g or f_b, or give one sigma_a")
    order = np.arange(len(table.lines))
    labels = _labels(table)
    if joined:
        known = {int(c): i for i, c in enumerate(_labels(source))}
        missing = next((c for c in labels if int(c) not in known), None)
        if missing is not None:
            raise ValueError(f"{name}: case {missing} is not in {source.path}, which has {len(known)} cases")
        order = np.array([known[int(c)] for c in labels])
        inputs = inputs.take(order)
        _refuse_other_cases(table, source, inputs, labels)
    if len(order) < LEAST_ROWS:
        raise ValueError(f"{name} has {len(order)} rows; a check needs at least {LEAST_ROWS}")
    names = ["f"] if inputs.channels == 1 else list(SIGMAS)
    names = [n.replace("sigma_a", "f") for n in names]
    f = np.column_stack([table.numbers(n, blank=True) if n in given else np.full(len(order), np.nan) for n in names])
    pdf = table.numbers("pdf", blank=True) if "pdf" in given else np.full(len(order), np.nan)
    columns = {"f": [n for n in names if n in given], "pdf": [n for n in given if n == "pdf"]}
    wrong, failed, notes = _without_a_number(table, {q: n for q, n in columns.items() if n}, labels)
    f[~np.isfinite(f)], pdf[~np.isfinite(pdf)] = np.nan, np.nan
    cells = {q: [c for n in columns[q] for c in table.cells[n] if c and math.isfinite(number(c))] for q in columns}
    every = sorted(d for column in cells.values() for d in _digits(column))
    return Submission(
        name, inputs, f, pdf, {q: _is_single(c) for q, c in cells.items()}, labels, wrong, failed, notes,
        every[len(every) // 4] if every else 17, {q: _written(c) for q, c in cells.items()},
    )  # fmt: skip


def _without_a_number(
    table: _Table, columns: Mapping[str, Sequence[str]], labels: NDArray[np.int64]
) -> tuple[tuple[str, ...], dict[str, NDArray[np.bool_]], tuple[str, ...]]:
    """Return what `Submission` has as `wrong`, `failed` and `notes`."""
    wrong, failed, notes = [], {}, []
    for quantity, names in columns.items():
        filled = np.array([[bool(c) for c in table.cells[n]] for n in names])
        none = np.array([[bool(c) and not math.isfinite(number(c)) for c in table.cells[n]] for n in names])
        some, all_of_it = np.asarray(filled.any(axis=0), bool), filled.all(axis=0)
        if some.sum() < LEAST_ROWS:
            raise ValueError(f"{table.path} has {quantity} in {some.sum()} rows; a check needs at least {LEAST_ROWS}")
        wrong += [f"{names[k]} is {table.cells[names[k]][i]} in case {labels[i]}" for k, i in np.argwhere(none)]
        wrong += [
            f"{names[k]} is empty in case {labels[i]}, whose other channels are not" for k, i in np.argwhere(some & ~filled)
        ]
        failed[quantity] = np.asarray(none.any(axis=0) | (some & ~all_of_it), bool)
        if not all(some):
            cases = ", ".join(map(str, labels[~some][:5])) + (" …" if (~some).sum() > 5 else "")
            notes.append(
                f"{(~some).sum()} of {len(some)} cases have no {quantity} and are not checked: case {cases}; pandas writes"
                " a NaN as an empty cell, unless na_rep='nan'"
            )
    return tuple(wrong), failed, tuple(notes)


def _refuse_unread(table: _Table) -> None:
    """Refuse columns whose names are nearly those of values: they would not be looked at."""
    alike = r"(f|bc?sdf)[^a-z0-9]*([rgb]|red|green|blue)?|pdf"
    unread = [n for n in table.names if n not in VALUES and re.fullmatch(alike, n, re.IGNORECASE) and any(table.cells[n])]
    if unread:
        names = ", ".join(VALUES)
        raise ValueError(f"{table.path} has a column {unread[0]!r}: values are named {names}; rename it if it holds none")


def _refuse_other_cases(table: _Table, source: _Table, inputs: Inputs, labels: NDArray[np.int64]) -> None:
    """Refuse values that say themselves that they are of other cases."""
    known = {**inputs.columns, **dict(zip(SIGMAS, inputs.sigma_a.T, strict=False))}
    for name in known.keys() & {*table.names}:
        own = table.numbers(name, blank=True)
        other = np.flatnonzero(np.abs(own - known[name]) > 1e-5 * (1 + np.abs(known[name])))
        if other.size:
            k = other[0]
            raise ValueError(
                f"{table.path}, line {table.lines[k]}: {name} is {own[k]:g}, but {known[name][k]:g} in case {labels[k]} of"
                f" {source.path}: these are values of other cases"
            )


def _told_by(names: Sequence[str]) -> str:
    return "chiang" if "beta_m" in names else "dual_scattering" if "strands" in names else "marschner"


def _labels(table: _Table) -> NDArray[np.int64]:
    if "case" not in table.names:
        return np.arange(1, len(table.lines) + 1)
    found = table.numbers("case", blank=False)
    wrong = np.flatnonzero(~(np.abs(found) < 2**53) | (found != np.rint(found)))
    if wrong.size:
        raise ValueError(f"{table.path}, line {table.lines[wrong[0]]}: case must be a whole number, got {found[wrong[0]]:g}")
    return found.astype(np.int64)


def _inputs(table: _Table, model: str, longitudinal: str) -> Inputs:
    sigmas = SIGMAS if SIGMAS[0] in table.names else ("sigma_a",)
    needed = [*ANGLES, *PARAMETERS[model], *sigmas]
    missing = [n for n in needed if n not in table.names]
    if missing:
        alike = next((n for n in table.names if n.casefold() == missing[0]), None)
        if alike is not None:
            raise ValueError(f"{table.path} has a column {alike!r}: name it {missing[0]!r}, in small letters")
        remedy = "give --cases CASES.csv for a file of values alone" if "case" in table.names else "keep the inputs' columns"
        raise ValueError(f"{table.path} has no column {missing[0]!r}, an input of {model}: {remedy}")
    if model == "chiang" and "h" in table.names:
        needed.insert(3, "h")
    if table.field and (table.field == "near") != ("h" in needed):
        has = "a column" if "h" in needed else "no column"
        raise ValueError(f"{table.path} has {has} 'h', though its head says {table.field} field: keep the inputs' columns")
    columns = {n: table.numbers(n, blank=False) for n in needed}
    for n, x in columns.items():
        low, high, unit = LIMITS[n]
        slack = 1e-6 * max(abs(low), abs(high))
        out = np.flatnonzero(~((x >= low - slack) & (x <= high + slack)))
        if out.size:
            unit = f" {unit}" if unit else ""
            raise ValueError(
                f"{table.path}, line {table.lines[out[0]]}: {n} must be in [{low:.6g}, {high:.6g}]{unit}, got {x[out[0]]:g}"
            )
        columns[n] = np.clip(x, low, high)
    sigma_a = np.column_stack([columns.pop(n) for n in sigmas])
    return Inputs(model, longitudinal, columns, sigma_a)


def _digits(cells: Sequence[str]) -> list[int]:
    """Return how many digits each number has, leading zeros aside."""
    return [len(re.sub(r"[eE].*|[-+.]", "", c).lstrip("0")) for c in cells if float(c)]


def _is_single(cells: Sequence[str]) -> bool:
    """Whether all numbers have at most nine digits, or are floats to the last of theirs, or as far as they are printed."""
    if max(_digits(cells), default=0) <= _SINGLE_DIGITS:
        return True
    x = np.array(cells, float)
    with np.errstate(over="ignore"):
        return bool(np.all(np.abs(x - x.astype(np.float32)) <= _half_a_unit(cells)))


def _written(cells: Sequence[str]) -> float:
    """Return half a unit of the last decimal, where that is less than a thousandth of most values; else 0."""
    half = _half_a_unit(cells)
    return half if half and half < _FINE * float(np.median(np.abs(np.array(cells, float)))) else 0.0


def _half_a_unit(cells: Sequence[str]) -> float:
    """Return half a unit of the last decimal, where all numbers have as many and no exponent; else 0."""
    decimals = {len(c.partition(".")[2]) if re.fullmatch(r"[-+]?\d*\.\d+", c) else 0 for c in cells}
    return 0.5 * 10.0 ** -decimals.pop() if len(decimals) == 1 and 0 not in decimals else 0.0


def _read_falcor(path: str | os.PathLike[str]) -> Submission:
    """Return Chiang's near field in the layout of Falcor's tests: columns one after another.

    beta_m, beta_n, alpha, eta, sigma_a (3), h, wi (3), wo (3), f (3). x is the strand. `wi` is the viewer here, alpha has
    the other sign, and f holds the cosine: all are converted.
    """
    data = read_bytes(path, "values")
    if not data or len(data) % (4 * _FALCOR):
        raise ValueError(
            f"{path} has {len(data):,} bytes; Falcor's layout has {_FALCOR} columns of float32, one after another"
        )
    with np.errstate(invalid="ignore"):
        c = np.frombuffer(data, "<f4").reshape(_FALCOR, -1).astype(np.float64)
    if not np.isfinite(c).all():
        raise ValueError(f"{path} holds {int((~np.isfinite(c)).sum())} values that are no numbers; is it Falcor's layout?")
    if c.shape[1] < LEAST_ROWS:
        raise ValueError(f"{path} holds {c.shape[1]} rows; it needs {LEAST_ROWS}")
    m, n, alpha, eta, r, g, b, h = c[:8]
    for label, x in (("beta_m", m), ("beta_n", n), ("eta", eta), ("h", h)):
        low, high, _ = LIMITS[label]
        if x.min() < low - 1e-6 or x.max() > high + 1e-6:
            raise ValueError(
                f"{path}: {label} must be in [{low:g}, {high:g}], got {x.min():g} to {x.max():g}; is it Falcor's layout?"
            )
    (rx, ry, rz), (ix, iy, iz) = c[8:11], c[11:14]
    theta_r, theta_i = np.arctan2(rx, np.hypot(ry, rz)), np.arctan2(ix, np.hypot(iy, iz))
    phi = np.arctan2(iz, iy) - np.arctan2(rz, ry)
    columns = {
        "theta_i": theta_i, "theta_r": theta_r, "phi": phi, "h": np.clip(h, -1, 1), "beta_m": m, "beta_n": n,
        "alpha": -alpha, "eta": eta,
    }  # fmt: skip
    f = (c[14:] / np.cos(theta_i)).T
    count = c.shape[1]
    return Submission(
        str(path), Inputs("chiang", "", columns, np.stack([r, g, b], axis=1)), f, np.full(count, np.nan),
        {"f": True, "pdf": True},
        np.arange(1, count + 1),
    )  # fmt: skip
