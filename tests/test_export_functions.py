"""Scattering functions that are no fibre's, in exports: closed forms for Chiang's, tables for all others."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import refused, run
from conformance import replay
from cuticle.export import export, web
from cuticle.scattering.bcsdf import with_strands
from cuticle.scattering.compact_table import FunctionTable, tabulate_function
from cuticle.scattering.host_tables import TOLERANCE, FibreTables, reduce_tables
from test_export import ROOT, compile_and_run
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


@pytest.fixture(scope="module")
def samplers() -> dict[str, cuticle.Sampler]:
    return {
        kind: cuticle.fit(model, 2, strands=COUNTS[kind] if len(COUNTS[kind]) > 1 else None).sampler
        for kind, model in MODELS.items()
    }


@pytest.fixture(scope="module")
def tables() -> dict[str, FibreTables | FunctionTable]:
    return {kind: reduce_tables(model, COUNTS[kind]) for kind, model in MODELS.items()}


def on_grid(made: FibreTables | FunctionTable, theta_r: float, n: float) -> np.ndarray:
    """What an export's f is at THETA and PHI, by the core in double precision."""
    if isinstance(made, FunctionTable):
        return made.eval(THETA, theta_r, PHI, n)
    ti, ph = (np.ascontiguousarray(x).ravel() for x in np.broadcast_arrays(THETA[:, None], PHI))
    out = np.empty((ti.size, made.channels))
    made.core().eval(ti, np.full(ti.size, theta_r), ph, np.array([n]), 15, out)
    return out.reshape(len(THETA), len(PHI), -1)


def cases_of(made: FibreTables | FunctionTable) -> tuple[np.ndarray, np.ndarray]:
    """(theta_i, theta_r, phi, strands) between nodes, on them and past them, and f there, shape (cases, channels)."""
    single = made.kind == "chiang" or (isinstance(made, FunctionTable) and len(made.strands) == 1)
    counts = (0.0,) if single else (0.0, 0.375, 1.0, 2.5, 4.0, 9.0)
    cases = [(ti, tr, ph, n) for n in counts for tr in VIEWERS for ti in THETA for ph in PHI]
    expected = np.array([[on_grid(made, float(tr), n) for tr in VIEWERS] for n in counts])
    return np.array(cases), expected.reshape(len(cases), -1)


def test_tables_are_as_close_as_they_say(tables: dict[str, Any]) -> None:
    assert isinstance(tables["chiang"], FibreTables)
    assert tables["chiang"].size < 50_000
    assert tables["chiang"].error <= TOLERANCE
    assert isinstance(tables["uneven"], FunctionTable)
    assert not tables["uneven"].even
    assert tables["uneven"].error <= TOLERANCE
    assert tables["strands"].strands == (0, 1, 2, 4)
    assert tables["strands"].error <= 0.05  # between 2 and 4 strands
    theta = (np.arange(240) + 0.5) / 240 * np.pi - np.pi / 2
    phi = (np.arange(360) + 0.5) / 180 * np.pi - np.pi
    weight = np.cos(theta)[:, None, None] ** 2
    for kind in ("uneven", "strands"):
        for n in COUNTS[kind]:
            for theta_r in VIEWERS:
                exact = with_strands(MODELS[kind], n).eval(theta[:, None], theta_r, phi)
                off = np.abs(tables[kind].eval(theta, theta_r, phi, n) - exact) * weight
                assert (off.sum((0, 1)) / (exact * weight).sum((0, 1))).max() <= 1.5 * TOLERANCE


def test_between_and_past_the_counts(tables: dict[str, Any]) -> None:
    table, at = tables["strands"], (np.array([-0.3]), 0.35, np.array([3.0]))

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


@pytest.mark.parametrize("kind", MODELS)
def test_cpp_computes_what_python_does(
    kind: str, samplers: dict[str, cuticle.Sampler], tables: dict[str, Any], tmp_path: Path
) -> None:
    made = export(samplers[kind], "cpp", name="hair", with_model=True, model=MODELS[kind])
    assert made.model is not None
    assert made.model.size == tables[kind].size
    (tmp_path / "fibre.h").write_text(made.text)
    cases, expected = cases_of(tables[kind])
    np.savetxt(tmp_path / "cases", cases, fmt="%.17g")
    printed = compile_and_run(
        """#include "fibre.h"
        #include <cstdio>
        int main() {
            double a, b, c, n;
            std::FILE *file = std::fopen("cases", "r");
            while (std::fscanf(file, "%lf %lf %lf %lf", &a, &b, &c, &n) == 4) {
                double f[hair::channels];
                float g[hair::channels];
                hair::eval(a, b, c, f, n);
                hair::eval(float(a), float(b), float(c), g, float(n));
                for (int i = 0; i < hair::channels; ++i) std::printf("%.9g %.9g ", f[i], double(g[i]));
            }
        }""",
        tmp_path,
    )
    got = np.array(printed.split(), float).reshape(*expected.shape, 2)
    np.testing.assert_allclose(got[..., 0], expected, rtol=1e-4, atol=1e-9)  # tables in single precision
    np.testing.assert_allclose(got[..., 1], expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("kind", MODELS)
def test_glsl_computes_what_python_does(
    kind: str, samplers: dict[str, cuticle.Sampler], browser: Any, tmp_path: Path
) -> None:
    page = tmp_path / f"{kind}.html"
    page.write_text(export(samplers[kind], "web", name=kind, model=MODELS[kind]).text, encoding="utf-8")
    assert visit(browser, page.as_uri()) == ([], [])
    browser.set_script_timeout(60)
    made = reduce_tables(MODELS[kind], COUNTS[kind], web.TOLERANCE)
    size = browser.execute_script("return cuticle.SIZE")
    theta_i = ((np.arange(size) + 0.5) / size - 0.5) * np.pi
    even = samplers[kind].even
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


@pytest.mark.parametrize("kind", ["chiang", "uneven"])
def test_it_is_formatted_and_validates(kind: str, samplers: dict[str, cuticle.Sampler], tmp_path: Path) -> None:
    formatter = shutil.which("clang-format") or str(Path(sys.executable).parent / "clang-format")
    if Path(formatter).exists():
        text = export(samplers[kind], "cpp", with_model=True, model=MODELS[kind]).text
        (tmp_path / "fibre.h").write_text(text)
        command = [formatter, f"--style=file:{ROOT / '.clang-format'}", "--dry-run", "--Werror", str(tmp_path / "fibre.h")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:2000]
    if shutil.which("glslangValidator") is None:
        pytest.skip("glslangValidator is not installed (Debian: apt-get install glslang-tools)")
    made = export(samplers[kind], "glsl", name="fibre", with_model=True, model=MODELS[kind])
    for version in ("300 es", "450"):
        shader = f"""#version {version}
            precision highp float;
            precision highp int;
            layout(location = 0) out vec4 color;
            {made.text}
            void main() {{ color = vec4(length(fibre_eval_direction(vec3(.6, .64, .48), vec3(0., 1., 0.), .5))); }}
            """
        (tmp_path / "shader.frag").write_text(shader)
        done = subprocess.run(
            ["glslangValidator", str(tmp_path / "shader.frag")], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout
        assert "WARNING" not in done.stdout


@pytest.mark.parametrize("kind", MODELS)
def test_hlsl_compiles(kind: str, samplers: dict[str, cuticle.Sampler], tmp_path: Path) -> None:
    made = export(samplers[kind], "hlsl", name="fibre", with_model=True, model=MODELS[kind])
    call = "fibre_eval_direction(float3(0.6, 0.64, 0.48), float3(0.0, 1.0, 0.0), 0.5)"
    main = f"\nfloat4 main() : SV_Target {{ float f = length({call}); return float4(f, f, f, 1.0); }}\n"
    replay.spirv_of(made.text + main, tmp_path)


@pytest.mark.parametrize("kind", [*MODELS, "dual"])
def test_cuda_computes_what_python_does(
    kind: str, samplers: dict[str, cuticle.Sampler], tables: dict[str, Any], document_fit: cuticle.Fit,
    document_model: cuticle.DualScattering, tmp_path: Path,
) -> None:  # fmt: skip
    sampler, model = (document_fit.sampler, document_model) if kind == "dual" else (samplers[kind], MODELS[kind])
    made = reduce_tables(model) if kind == "dual" else tables[kind]
    text = export(sampler, "cuda", name="fibre", with_model=True, model=model).text
    cases, expected = cases_of(made)
    for precision, relative, absolute in (("double", 1e-4, 1e-9), ("float", 2e-3, 1e-6)):  # as C++
        got = replay.on_a_gpu(text, cases, tmp_path, "-DEVAL", precision=precision)
        np.testing.assert_allclose(got, expected, rtol=relative, atol=absolute)


@pytest.mark.parametrize("kind", ["chiang", "uneven"])
def test_json_holds_the_tables(kind: str, samplers: dict[str, cuticle.Sampler], tables: dict[str, Any]) -> None:
    material = json.loads(export(samplers[kind], "json", with_model=True, model=MODELS[kind]).text)["model"]
    assert material["kind"] == tables[kind].kind
    for name in ("direct", "rest") if kind == "chiang" else ("shape", "log_energy"):
        np.testing.assert_allclose(np.array(material[name]), getattr(tables[kind], name), rtol=1e-6)


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
