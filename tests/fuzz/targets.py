"""What is fuzzed: a reader each, with small valid files to damage. A new reader is one more row in `targets`."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import signal
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import seeds

import cuticle
from cuticle.draft.printed import Printed
from cuticle.grooms.groom import Groom, read_groom
from cuticle.report.page import write_report
from cuticle.scattering.by_name import model_of, read_parameters_or_model


class Target(NamedTuple):
    """A reader.

    Attributes
    ----------
    name
        Its file's name, whose ending selects the reader; a folder before it where a reader takes a folder.
    make
        Returns valid files; called only where they are damaged, since some take seconds.
    read
        Takes the path; returns what it reads or raises ValueError with the path.
    check
        Raises AssertionError where what was read is not whole.
    pack
        Makes the file of the damaged bytes.
    share
        Of the inputs that other targets get: less where a read is slow.
    """

    name: str
    make: Callable[[], list[bytes]]
    read: Callable[[Path], Any]
    check: Callable[[Any], None]
    pack: Callable[[bytes], bytes] = bytes
    share: float = 1.0

    @property
    def seeds(self) -> list[bytes]:
        """Valid files, made once."""
        return _made(self.make)


@cache
def _made(make: Callable[[], list[bytes]]) -> list[bytes]:
    return make()


def groom_is_whole(groom: Groom) -> None:
    """Everything finite, counts that add up, every step of some length."""
    assert np.isfinite(groom.points).all()
    assert np.isfinite(groom.radius).all()
    assert (groom.radius >= 0).all()
    assert np.isfinite(groom.bend).all()
    assert len(groom.points) == groom.counts.sum() == len(groom.radius)
    assert (groom.counts >= 2).all()
    assert (groom.lengths > 0).all()
    assert np.isfinite(groom.control_points()[0]).all()
    for name in groom.attributes:
        assert np.isfinite(groom.on_segments(name)).all()


def f_is_whole(model: Any) -> None:
    """A model gives finite values."""
    f = model.eval(0.1, 0.2, 0.3)
    assert np.isfinite(f).all()
    assert (np.asarray(f) >= 0).all()


def pdf_is_whole(sampler: Any) -> None:
    """A sampler draws directions of a finite density above 0, for every strand count."""
    for n in sampler.covers:
        theta_i, phi, p = sampler.sample(0.2, [0.3, 0.4, 0.6], n)
        assert np.isfinite([theta_i, phi, p]).all()
        assert p > 0
        assert np.isfinite(sampler.pdf(0.1, 0.2, 0.3, n))


def report_is_whole(report: Any) -> None:
    """A report is JSON without NaN, and its outcome follows from its verdicts."""
    assert json.loads(report.to_json())["ok"] == (report.outcome == "pass")


def fit_is_whole(fit: cuticle.Fit) -> None:
    """A fit measured what it says, and its sampler is whole."""
    assert np.isfinite(fit.ess).all()
    assert np.isfinite(fit.theta_r).all()
    pdf_is_whole(fit.sampler)


def page_is_whole(texts: tuple[str, str]) -> None:
    """A page shows no number that is none; words of the result itself it may quote."""
    result, page = texts
    quoted = re.findall(r'"[^"]*"', result)
    for word in ("nan", "inf"):
        assert any(re.search(rf"\b{word}\b", text) for text in quoted) or not re.search(rf">[^<]*\b{word}\b", page)


def tables_are_whole(printed: Printed) -> None:
    """Rows of finite numbers."""
    for rows in (printed.table_1, printed.table_2, printed.table_3):
        assert np.isfinite([(*key, *value) for key, value in rows.items()]).all()


def _function_of(path: Path) -> Any:
    """Return the function that a sampler's record names."""
    sampler = cuticle.Sampler.load(path)
    try:
        return model_of(sampler)
    except ValueError as error:  # it speaks of "this sampler", which a caller has in hand
        raise ValueError(f"{path}: {error}") from None


def _tables(path: Path) -> Printed:
    for name, text in seeds.PRINTED.items():
        if name != path.name:
            (path.parent / name).write_bytes(text)
    return Printed.load(path.parent)


def _page(path: Path) -> tuple[str, str]:
    """Return the result's text and the page's."""
    page = write_report(path.parent)
    return path.read_text(encoding="utf-8-sig"), page.read_text()


def _function(path: Path) -> Any:
    """Return the function of a TOML file; a fibre's is that of one strand, which is made faster than the one among many."""
    found = read_parameters_or_model(str(path))
    return cuticle.Marschner(found) if isinstance(found, cuticle.Fibre) else found


@cache
def targets() -> list[Target]:
    """Return every target, those of absent libraries left out."""
    grooms = [
        Target("a.hair", seeds.cyhair, read_groom, groom_is_whole),
        Target("a.data", lambda: [seeds.usc()], read_groom, groom_is_whole),
        Target("a.tfx", seeds.tressfx, read_groom, groom_is_whole),
        Target("a.txt", seeds.lines, read_groom, groom_is_whole),
        Target("a.ply", seeds.ply, read_groom, groom_is_whole),
        Target("a.npz", seeds.npz, read_groom, groom_is_whole),
        Target(
            "packed.npz", lambda: [seeds.npy(seeds.POINTS.reshape(2, seeds.N, 3))], read_groom, groom_is_whole, seeds.packed
        ),
        Target("a.csv", lambda: [seeds.TABLE], cuticle.Tabulated.load, f_is_whole, share=0.2),
        Target("dump.npz", lambda: [seeds.dump()[0]], cuticle.audit_dump, report_is_whole, share=0.02),
        Target("dump.csv", lambda: [seeds.dump()[1]], cuticle.audit_dump, report_is_whole, share=0.02),
        Target("sampler.json", seeds.samplers, cuticle.Sampler.load, pdf_is_whole, share=0.2),
        Target("record.json", seeds.samplers, _function_of, f_is_whole, share=0.02),
        Target("saved.json", seeds.saved, cuticle.Fit.load, fit_is_whole, share=0.2),
        Target("a.toml", lambda: [seeds.FIBRE, seeds.CHIANG], _function, f_is_whole, share=0.2),
        Target("table.npz", seeds.table_arrays, cuticle.Tabulated.load, f_is_whole, share=0.2),
        *(
            Target(f"printed/{name}", partial(list, [text]), _tables, tables_are_whole)
            for name, text in seeds.PRINTED.items()
        ),
        Target("fitted/fit.json", seeds.summaries, _page, page_is_whole, share=0.02),
        Target("checked/check.json", seeds.checked, _page, page_is_whole, share=0.02),
        Target("documented/document.json", seeds.documented, _page, page_is_whole, share=0.02),
    ]
    if importlib.util.find_spec("pxr") is not None:
        grooms += [
            Target("a.usda", lambda: [seeds.USDA], read_groom, groom_is_whole, share=0.002),
            Target("a.usdc", seeds.usdc, read_groom, groom_is_whole, share=0.002),
        ]
    if importlib.util.find_spec("alembic3d") is not None:
        grooms.append(Target("a.abc", seeds.abc, read_groom, groom_is_whole, share=0.002))
    return grooms


def controls() -> list[Target]:
    """Return readers that do what none may: the fuzzer has to find each."""

    def crash(path: Path) -> None:
        if path.read_bytes() != b"valid":
            os.kill(os.getpid(), signal.SIGSEGV)

    def hang(path: Path) -> None:
        while path.read_bytes() != b"valid":
            pass

    def fill(path: Path) -> bytes:
        return b"" if path.read_bytes() == b"valid" else bytes(1 << 33)

    def leak(path: Path) -> None:
        if path.read_bytes() != b"valid":
            raise KeyError("what a decoder raises")

    def nan(path: Path) -> float:
        return 0.0 if path.read_bytes() == b"valid" else np.nan

    def mute(path: Path) -> None:
        if path.read_bytes() != b"valid":
            raise ValueError("it is damaged")

    def finite(value: Any) -> None:
        assert value is None or isinstance(value, bytes) or np.isfinite(value)

    return [Target(read.__name__, lambda: [b"valid"], read, finite) for read in (crash, hang, fill, leak, nan, mute)]
