"""Scattering functions that are no fibre's, in exports: closed forms for Chiang's, tables for all others."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import refused, run
from cuticle.export import export
from cuticle.export.hosts import web
from cuticle.scattering.bcsdf import with_strands
from cuticle.scattering.compact_table import FunctionTable, tabulate_function
from cuticle.scattering.fibre_tables import FibreTables
from cuticle.scattering.host_tables import TOLERANCE, reduce_tables
from test_export import unformatted
from test_report import visit

CHIANG = cuticle.Chiang(beta_m=0.6, beta_n=0.6, eumelanin=1.3)  # rough, for small tables
COUNTS = {"chiang": (0.0,), "uneven": (0.0,), "strands": (0.0, 1.0, 4.0)}
# Single precision holds them: a GPU is given no more.
THETA, VIEWERS, PHI = (
    x.astype(np.float32).astype(float)
    for x in (np.radians(np.linspace(-89, 89, 16)), np.radians((-80, -31, 0, 52, 85)), np.linspace(-3, 3, 11))
)


def one_sided(theta_i: Any, theta_r: Any, phi: Any) -> np.ndarray:
    """A function that is not even in phi, of two channels."""
    x = (theta_i + theta_r - 0.1) / 0.25
    f = np.exp(-0.5 * x**2) * (1.2 + np.cos(phi - 0.8)) / 8
    return np.stack([f, f * (0.6 + 0.3 * np.sin(theta_r))], axis=-1)


MODELS: dict[str, Any] = {
    "chiang": CHIANG,
    "uneven": cuticle.from_callable(one_sided),
    "strands": cuticle.Strands(CHIANG),
}


SLOW = pytest.param("strands", marks=pytest.mark.slow)


@cache
def sampler_of(kind: str) -> cuticle.Sampler:
    return cuticle.fit(MODELS[kind], 2, strands=COUNTS[kind] if len(COUNTS[kind]) > 1 else None).sampler


@cache
def tables_of(kind: str) -> Any:
    return reduce_tables(MODELS[kind], COUNTS[kind])


def test_chiang_keeps_its_closed_form() -> None:
    assert isinstance(tables_of("chiang"), FibreTables)
    assert tables_of("chiang").size < 50_000
    assert tables_of("chiang").error <= TOLERANCE


@pytest.mark.parametrize("kind", ["uneven", SLOW])
def test_tables_are_as_close_as_they_say(kind: str) -> None:
    table = tables_of(kind)
    assert isinstance(table, FunctionTable)
    assert table.even == (kind == "strands")
    assert table.strands == ((0, 1, 2, 4) if kind == "strands" else (0,))
    assert table.error <= (0.05 if kind == "strands" else TOLERANCE)  # between 2 and 4 strands
    theta = (np.arange(240) + 0.5) / 240 * np.pi - np.pi / 2
    phi = (np.arange(360) + 0.5) / 180 * np.pi - np.pi
    weight = np.cos(theta)[:, None, None] ** 2
    for n in COUNTS[kind]:
        for theta_r in VIEWERS:
            exact = with_strands(MODELS[kind], n).eval(theta[:, None], theta_r, phi)
            off = np.abs(table.eval(theta, theta_r, phi, n) - exact) * weight
            assert (off.sum((0, 1)) / (exact * weight).sum((0, 1))).max() <= 1.5 * TOLERANCE


@pytest.mark.slow
def test_between_and_past_the_counts() -> None:
    table, at = tables_of("strands"), (np.array([-0.3]), 0.35, np.array([3.0]))

    def f(n: float) -> np.ndarray:
        return table.eval(*at, n).ravel()

    np.testing.assert_allclose(f(0.25), 0.75 * f(0) + 0.25 * f(1), rtol=1e-6)  # a share of the light
    for n in (2, 3):
        ratio = f(n) / MODELS["strands"].with_strands(n).eval(-0.3, 0.35, 3.0)
        np.testing.assert_allclose(ratio, 1, atol=0.06)
    # Each strand more takes the same off: past the last count as before it.
    fade = np.diff(np.log([f(4), f(5), f(7)]), axis=0) / np.array([[1], [2]])
    np.testing.assert_allclose(fade[0], fade[1], rtol=1e-6)
    np.testing.assert_allclose(fade[0], np.log(f(4) / f(2)) / 2, rtol=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MODELS)
def test_the_page_computes_what_python_does(kind: str, browser: Any, tmp_path: Path) -> None:
    page = tmp_path / f"{kind}.html"
    page.write_text(export(sampler_of(kind), "web", name=kind, model=MODELS[kind]).text, encoding="utf-8")
    assert visit(browser, page.as_uri()) == ([], [])
    browser.set_script_timeout(60)
    made = reduce_tables(MODELS[kind], COUNTS[kind], web.TOLERANCE)
    size = browser.execute_script("return cuticle.SIZE")
    theta_i = ((np.arange(size) + 0.5) / size - 0.5) * np.pi
    even = sampler_of(kind).even
    phi = (np.arange(size) + 0.5) / size * (np.pi if even else 2 * np.pi) - (0 if even else np.pi)
    for theta, n in ((25, 0), (-70, 0.5), (10, 3), (84, 6)):
        count = min(n, COUNTS[kind][-1])  # the page's own slider ends there
        browser.execute_script("cuticle.set(arguments[0])", {"theta": theta, "strands": count})
        f = np.reshape(browser.execute_script("return cuticle.fields().f"), (size, size, 4))[..., : made.channels]
        theta_r = np.radians(theta)
        if isinstance(made, FunctionTable):
            expected = made.eval(theta_i, theta_r, phi, count)
        else:
            ti, ph = (np.ascontiguousarray(x).ravel() for x in np.broadcast_arrays(theta_i[:, None], phi))
            expected = np.empty((ti.size, made.channels))
            made.core().eval(ti, np.full(ti.size, theta_r), ph, np.array([0.0]), 15, expected)
            expected = expected.reshape(size, size, -1)
        expected = expected * np.cos(theta_i)[:, None, None]
        np.testing.assert_allclose(f, expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("kind", ["chiang", pytest.param("uneven", marks=pytest.mark.slow)])
def test_it_is_formatted(kind: str, tmp_path: Path) -> None:
    assert not unformatted(export(sampler_of(kind), "cpp", with_model=True, model=MODELS[kind]).text, tmp_path)


@pytest.mark.slow
def test_a_sharp_function_is_refused_with_what_it_would_cost() -> None:
    needle = cuticle.from_callable(
        lambda ti, tr, phi: np.exp(-0.5 * ((ti + tr - 0.7 * np.cos(8 * phi)) / 0.004) ** 2), even=True
    )
    with pytest.raises(ValueError, match=r"too sharp to be written as a table: .* bytes would be off by"):
        reduce_tables(needle)


def test_a_channel_without_light_stays_dark() -> None:
    dark = cuticle.from_callable(lambda *x: one_sided(*x) * np.array([1.0, 0.0]))
    table = tabulate_function(dark, (0.0,), 0.05)
    f = table.eval(THETA, 0.2, PHI, 0)
    assert np.isfinite(f).all()
    assert f[..., 0].max() > 0.1
    assert not f[..., 1].any()


def make_table(path: Path, function: Callable[..., np.ndarray]) -> None:
    degrees = np.linspace(-85, 85, 18), np.linspace(-90, 90, 61), np.linspace(0, 180, 37)
    tr, ti, ph = (np.radians(x) for x in degrees)
    f = function(np.clip(ti, -1.57, 1.57)[None, :, None], tr[:, None, None], ph)
    np.savez(path, theta_r_deg=degrees[0], theta_i_deg=degrees[1], phi_deg=degrees[2], f=f)


def test_a_measured_table_goes_the_whole_way(tmp_path: Path) -> None:
    make_table(tmp_path / "mine.npz", CHIANG.eval)
    done = run("fit", "mine.npz", "--lobes", "2", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    done = run("export", "out", "--to", "cpp", "--with-model", "-o", "mine.h", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "% of ∫ f cos" in " ".join(done.stdout.split())
    (tmp_path / "mine.npz").rename(tmp_path / "moved.npz")
    wrong = ["export", "out", "--to", "glsl", "-o", "x.glsl"]
    refused(*wrong, "--with-model", words="mine.npz, which is not there; name the table with --model", cwd=tmp_path)
    refused(*wrong, "--model", "moved.npz", words="give --with-model, too", cwd=tmp_path)
    refused(*wrong, "--with-model", "--model", "nowhere.npz", words="nowhere.npz", cwd=tmp_path)
    done = run(*wrong, "--with-model", "--model", "moved.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "x.f32").stat().st_size % (1024 * 16) == 0
