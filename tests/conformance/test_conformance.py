"""What Python proves is what ships: every export over the same inputs, against the reference in double precision."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from conformance import replay
from cuticle.export import export

COUNTS = (0.0, 1.0, 2.0, 4.0, 8.0)
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Werror"]
FLAGS = {"O2": ["-O2"], "native": ["-O3", "-march=native"], "fast": ["-O3", "-ffast-math"]}
REPORT = Path(__file__).parents[2] / "out" / "conformance.json"


@pytest.fixture(scope="module")
def table() -> Iterator[list[replay.Worst]]:
    """Every host's worst case, kept in out/conformance.json."""
    rows: list[replay.Worst] = []
    yield rows
    REPORT.parent.mkdir(exist_ok=True)
    REPORT.write_text(json.dumps([vars(r) for r in rows], indent=1) + "\n")


@pytest.fixture(scope="module", params=["document", "brown", "black"])
def sampler(request: pytest.FixtureRequest) -> tuple[str, cuticle.Sampler]:
    model = cuticle.DualScattering(cuticle.Fibre.preset(request.param))
    return request.param, cuticle.fit(model, 4, strands=COUNTS).sampler


@pytest.fixture(scope="module")
def x() -> Any:
    inputs = replay.inputs()
    assert replay.digest(inputs) == replay.DIGEST
    return inputs


def judge(table: list[replay.Worst], worst: replay.Worst) -> None:
    table.append(worst)
    print(worst)  # -rP shows them
    assert worst.ok, f"{worst}; worst at {worst.at}"


def test_python_in_single_precision(sampler: Any, x: Any, table: Any) -> None:
    name, fitted = sampler
    judge(table, replay.compare(f"{name}: Python, float", fitted, x, replay.python(fitted, x)))


@pytest.mark.parametrize("flags", FLAGS)
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_cpp_alone_in_an_empty_folder(sampler: Any, x: Any, table: Any, compiler: str, flags: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    name, fitted = sampler
    header = export(fitted, "cpp", name="fibre").text
    command = [compiler, "-std=c++17", *FLAGS[flags], *WARNINGS]
    got = replay.compiled(command, header, x, tmp_path)
    judge(table, replay.compare(f"{name}: {compiler} {flags}, float", fitted, x, got, reassociates=flags == "fast"))
    if flags == "O2":
        double = replay.compare("double", fitted, x, replay.compiled(command, header, x, tmp_path, precision="double"))
        # The table is single precision, and nothing else.
        assert double.pdf <= 5e-6
        assert double.angle <= 1e-6


@pytest.mark.parametrize("flags", [(), ("--use_fast_math",)], ids=["O3", "fast"])
def test_cuda(sampler: Any, x: Any, table: Any, flags: tuple[str, ...], tmp_path: Path) -> None:
    name, fitted = sampler
    header = export(fitted, "cuda", name="fibre", with_model=True).text
    got = replay.on_a_gpu(header, x, tmp_path, *flags)
    judge(table, replay.compare(" ".join([f"{name}: CUDA, float", *flags]), fitted, x, got, reassociates=bool(flags)))
    if not flags:
        # At u = 0 a far end lies where the last digit of erf says, which is CUDA's own.
        inner = (x[:, 5:] > 0).all(axis=1)
        got = replay.on_a_gpu(header, x, tmp_path, precision="double")
        double = replay.compare("double", fitted, x[inner], got[inner])
        assert double.pdf <= 5e-6
        assert double.angle <= 1e-6


@pytest.mark.parametrize("with_model", [False, True])
@pytest.mark.parametrize("version", ["300 es", "330", "450"])
def test_glsl_validates(sampler: Any, version: str, with_model: bool, tmp_path: Path) -> None:
    if shutil.which("glslangValidator") is None:
        pytest.skip("glslangValidator is not installed (Debian: apt-get install glslang-tools)")
    made = export(sampler[1], "glsl", name="fibre", frame="mitsuba", with_model=with_model)
    assert bool(made.data) == with_model
    call = "fibre_pdf_direction(wi, wo, 2.)" + (" + length(fibre_eval_direction(wi, wo, .5))" if with_model else "")
    shader = f"""#version {version}
        precision highp float;
        precision highp int;
        layout(location = 0) out vec4 color;
        {made.text}
        void main() {{
            vec3 wi = vec3(.6, .64, .48);
            float p;
            vec3 wo = fibre_sample_direction(wi, vec3(.1, .2, .3), 1., p);
            color = vec4(wo, p + {call});
        }}
        """
    (tmp_path / "shader.frag").write_text(shader)
    done = subprocess.run(["glslangValidator", str(tmp_path / "shader.frag")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "WARNING" not in done.stdout


@pytest.mark.parametrize("with_model", [False, True])
def test_hlsl_compiles(sampler: Any, with_model: bool, tmp_path: Path) -> None:
    made = export(sampler[1], "hlsl", name="fibre", frame="mitsuba", with_model=with_model)
    assert bool(made.data) == with_model
    call = "fibre_pdf_direction(wi, wo, 2.0)" + (" + length(fibre_eval_direction(wi, wo, 0.5))" if with_model else "")
    main = f"""
        float4 main() : SV_Target {{
            float3 wi = float3(0.6, 0.64, 0.48);
            float p;
            float3 wo = fibre_sample_direction(wi, float3(0.1, 0.2, 0.3), 1.0, p);
            return float4(wo, p + {call});
        }}
        """
    replay.spirv_of(made.text + main, tmp_path)


def test_hlsl_by_way_of_a_browser(sampler: Any, x: Any, table: Any, browser: Any, tmp_path: Path) -> None:
    """What a compiler makes of the HLSL, written as GLSL: no Direct3D is needed."""
    name, fitted = sampler
    shader = export(fitted, "hlsl", name="fibre").text
    got = replay.shaded(browser, replay.translated(shader, tmp_path), x, tmp_path)
    judge(table, replay.compare(f"{name}: HLSL", fitted, x, got, reassociates=True))
    if name == "document":  # one digit of erf wrong
        wrong = shader.replace(*BROKEN[1])
        assert wrong != shader
        got = replay.shaded(browser, replay.translated(wrong, tmp_path), x, tmp_path)
        assert not replay.compare("broken", fitted, x, got, reassociates=True).ok


def test_glsl_in_a_browser(sampler: Any, x: Any, table: Any, browser: Any, tmp_path: Path) -> None:
    name, fitted = sampler
    shader = export(fitted, "glsl", name="fibre").text
    got = replay.shaded(browser, shader, x, tmp_path)
    judge(table, replay.compare(f"{name}: GLSL", fitted, x, got, reassociates=True))


@pytest.fixture(scope="module", params=[(1, (0.0,)), (3, (0.0, 2.0)), (8, (1.0, 5.0))], ids=["K=1", "K=3", "K=8"])
def uneven(request: pytest.FixtureRequest) -> cuticle.Sampler:
    """A table that no fit made: lobes that are not even in phi, in numbers and rows of every kind."""
    lobes, strands = request.param
    rng = np.random.default_rng(lobes)
    nodes = np.empty((len(strands), 7, 5, lobes))
    nodes[:, :, 0] = rng.dirichlet(np.ones(lobes), nodes.shape[:2])
    nodes[:, :, 1] = rng.uniform(-1.6, 1.6, nodes[:, :, 1].shape)
    nodes[:, :, 2] = rng.uniform(-6, 6, nodes[:, :, 2].shape)
    nodes[:, :, 3:] = rng.uniform(0.2, 2, nodes[:, :, 3:].shape)
    return cuticle.Sampler(nodes, rng.uniform(0.2, 2, nodes.shape[:2]), strands, even=False)


def test_any_table_in_cpp(uneven: cuticle.Sampler, x: Any, table: Any, tmp_path: Path) -> None:
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    command = ["g++", "-std=c++17", "-O2", *WARNINGS]
    got = replay.compiled(command, export(uneven, "cpp", name="fibre").text, x, tmp_path)
    judge(table, replay.compare(f"uneven, {uneven.lobes} lobes: g++ O2, float", uneven, x, got))


def test_any_table_in_cuda(uneven: cuticle.Sampler, x: Any, table: Any, tmp_path: Path) -> None:
    got = replay.on_a_gpu(export(uneven, "cuda", name="fibre").text, x, tmp_path)
    judge(table, replay.compare(f"uneven, {uneven.lobes} lobes: CUDA, float", uneven, x, got))


def test_any_table_in_glsl(uneven: cuticle.Sampler, x: Any, table: Any, browser: Any, tmp_path: Path) -> None:
    got = replay.shaded(browser, export(uneven, "glsl", name="fibre").text, x, tmp_path)
    judge(table, replay.compare(f"uneven, {uneven.lobes} lobes: GLSL", uneven, x, got, reassociates=True))


def test_any_table_compiles_as_hlsl(uneven: cuticle.Sampler, tmp_path: Path) -> None:
    main = "\nfloat4 main() : SV_Target { return float4(fibre_sample(0.3, float3(0.1, 0.2, 0.3), 1.5), 1.0); }\n"
    replay.spirv_of(export(uneven, "hlsl", name="fibre").text + main, tmp_path)


# One digit wrong: a coefficient of erf's inverse, of erf, and a node of the table.
BROKEN = [("1.50140941", "1.50240941"), ("1.12837911", "1.12857911"), ("0.318309886 + 0.5", "0.318309886 + 0.5001")]


@pytest.mark.parametrize(("right", "wrong"), BROKEN)
def test_a_wrong_constant_is_caught_in_glsl(
    x: Any, document_fit: Any, browser: Any, tmp_path: Path, right: str, wrong: str
) -> None:
    shader = export(document_fit.sampler, "glsl", name="fibre").text
    assert right in shader
    got = replay.shaded(browser, shader.replace(right, wrong), x, tmp_path)
    assert not replay.compare("broken", document_fit.sampler, x, got, reassociates=True).ok


@pytest.mark.parametrize("to", ["cpp", "cuda"])
@pytest.mark.parametrize(
    ("right", "wrong"), [*BROKEN[:2], ("1 / pi<double>) + Float(.5)", "1 / pi<double>) + Float(.5001)")]
)
def test_a_wrong_constant_is_caught_in_cpp_and_cuda(
    x: Any, document_fit: Any, tmp_path: Path, right: str, wrong: str, to: str
) -> None:
    header = export(document_fit.sampler, to, name="fibre").text
    assert right in header
    header = header.replace(right, wrong)
    if to == "cuda":
        got = replay.on_a_gpu(header, x, tmp_path)
    elif shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    else:
        got = replay.compiled(["g++", "-std=c++17", "-O1"], header, x, tmp_path)
    assert not replay.compare("broken", document_fit.sampler, x, got).ok
