"""Every export over the same inputs, against the reference in double precision."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from conformance import hosts, replay
from conformance.cuda_compiler import by_hipcc, by_nvrtc
from conformance.hosts import HOSTS
from cuticle.export import formulas, headers, registry
from cuticle.export.registry import Export, Job
from cuticle.export.shader import TEXTURE_WIDTH, lobe_texels
from cuticle.scattering.frames import FRAMES

COUNTS = (0.0, 1.0, 2.0, 4.0, 8.0)
FLAGS = {"O2": ("-O2",), "native": ("-O3", "-march=native"), "fast": ("-O3", "-ffast-math")}
REPORT = Path(__file__).parents[2] / "out" / "conformance.json"
# One digit wrong: a coefficient of erf's inverse, of erf, and the place of a node.
BROKEN = {
    "erfinv": ("1.50140941", "1.50240941"),
    "erf": ("1.12837911", "1.12857911"),
    "node": ("theta_r * Float(1 / pi<double>) + Float(.5)", "theta_r * Float(1 / pi<double>) + Float(.5001)"),
}
NODE_OF_METAL = ("theta_r * 0.31830987f + 0.5f", "theta_r * 0.31830987f + 0.5001f")
NODE_OF_SHADERS = ("theta_r * 0.31830987 + 0.5", "theta_r * 0.31830987 + 0.5001")


def written(sampler: cuticle.Sampler, to: str) -> Export:
    """An export that measures nothing for its heading."""
    job = Job(sampler, "fibre", FRAMES["local-x"], list, None, None, lambda phase, fraction: None)
    return registry.host(to).write(job)


@pytest.fixture(scope="module")
def table() -> Iterator[list[replay.Worst]]:
    """Every host's worst case, kept in out/conformance.json."""
    rows: list[replay.Worst] = []
    yield rows
    REPORT.parent.mkdir(exist_ok=True)
    REPORT.write_text(json.dumps([vars(r) for r in rows], indent=1) + "\n")


@pytest.fixture(scope="module")
def x() -> Any:
    inputs = replay.inputs()
    assert replay.digest(inputs) == replay.DIGEST
    return inputs


@pytest.fixture
def judge(table: list[replay.Worst], x: Any) -> Callable[..., None]:
    def judged(name: str, sampler: cuticle.Sampler, got: np.ndarray, *, reassociates: bool = False) -> None:
        worst = replay.compare(name, sampler, x, got, reassociates=reassociates)
        table.append(worst)
        print(worst)  # -rP shows them
        assert worst.ok, f"{worst}; worst at {worst.at}"

    return judged


def fitted(name: str) -> cuticle.Sampler:
    """Four lobes, among strands, even in phi."""
    return cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset(name)), 4, strands=COUNTS).sampler


def uneven(lobes: int, strands: tuple[float, ...]) -> cuticle.Sampler:
    """A table that no fit made: lobes that are not even in phi, in numbers and rows of every kind."""
    rng = np.random.default_rng(lobes)
    nodes = np.empty((len(strands), 7, 5, lobes))
    nodes[:, :, 0] = rng.dirichlet(np.ones(lobes), nodes.shape[:2])
    nodes[:, :, 1] = rng.uniform(-1.6, 1.6, nodes[:, :, 1].shape)
    nodes[:, :, 2] = rng.uniform(-6, 6, nodes[:, :, 2].shape)
    nodes[:, :, 3:] = rng.uniform(0.2, 2, nodes[:, :, 3:].shape)
    return cuticle.Sampler(nodes, rng.uniform(0.2, 2, nodes.shape[:2]), strands, even=False)


SAMPLERS: dict[str, Callable[[], cuticle.Sampler]] = {"uneven, 3 lobes": lambda: uneven(3, (0.0, 2.0))}
OTHERS: dict[str, Callable[[], cuticle.Sampler]] = {
    "brown": lambda: fitted("brown"),
    "black": lambda: fitted("black"),
    "uneven, 1 lobe": lambda: uneven(1, (0.0,)),
    "uneven, 8 lobes": lambda: uneven(8, (1.0, 5.0)),
}
_MADE: dict[str, cuticle.Sampler] = {}


@pytest.fixture(params=["document", *SAMPLERS, *(pytest.param(name, marks=pytest.mark.slow) for name in OTHERS)])
def sampler(request: pytest.FixtureRequest) -> tuple[str, cuticle.Sampler]:
    name = request.param
    if name == "document":
        return name, request.getfixturevalue("document_fit").sampler
    if name not in _MADE:
        _MADE[name] = (SAMPLERS | OTHERS)[name]()
    return name, _MADE[name]


def test_every_host_is_replayed_here() -> None:
    assert {*HOSTS, "web", "pbrt"} == set(registry.HOSTS)


def test_python_in_single_precision(sampler: Any, x: Any, judge: Any) -> None:
    name, own = sampler
    judge(f"{name}: Python, float", own, hosts.python(own, x))


@pytest.mark.parametrize("to", HOSTS)
def test_a_host(sampler: Any, to: str, x: Any, judge: Any, browser: Any, tmp_path: Path) -> None:
    name, own = sampler
    host = HOSTS[to]
    got = host.answers(written(own, to), x, tmp_path, browser)
    judge(f"{name}: {to}", own, got, reassociates=host.reassociates)


def test_double_precision_is_as_good_as_the_table(x: Any, document_fit: Any, tmp_path: Path) -> None:
    got = hosts.cpp(written(document_fit.sampler, "cpp"), x, tmp_path, precision="double")
    double = replay.compare("double", document_fit.sampler, x, got)
    # The table is single precision, and nothing else.
    assert double.pdf <= 5e-6
    assert double.angle <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("flags", FLAGS)
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_compilers_and_their_flags(sampler: Any, x: Any, judge: Any, compiler: str, flags: str, tmp_path: Path) -> None:
    name, own = sampler
    got = hosts.cpp(written(own, "cpp"), x, tmp_path, compiler=compiler, flags=FLAGS[flags])
    judge(f"{name}: {compiler} {flags}, float", own, got, reassociates=flags == "fast")


@pytest.mark.slow
@pytest.mark.parametrize("flags", ["O2", "fast"])
def test_on_arm(sampler: Any, x: Any, judge: Any, flags: str, tmp_path: Path) -> None:
    name, own = sampler
    got = hosts.cpp(written(own, "cpp"), x, tmp_path, compiler=hosts.ARM, flags=FLAGS[flags])
    judge(f"{name}: ARM, g++ {flags}, float", own, got, reassociates=True)


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["glslang", "dxc"])
def test_hlsl_without_another_language_between(
    sampler: Any, x: Any, judge: Any, compiler: str, tmp_path: Path
) -> None:  # fmt: skip
    name, own = sampler
    table = lobe_texels(own).reshape(-1, 4)
    rows = np.zeros((-(-len(table) // TEXTURE_WIDTH) * TEXTURE_WIDTH, 4), np.float32)
    rows[: len(table)] = table
    got = hosts.hlsl_as_spirv(replace(written(own, "hlsl"), data=rows.tobytes()), x, tmp_path, compiler)
    judge(f"{name}: HLSL, {compiler}, Vulkan", own, got, reassociates=True)


@pytest.mark.slow
@pytest.mark.parametrize("flags", [(), ("--use_fast_math",)], ids=["O3", "fast"])
def test_cuda(sampler: Any, x: Any, judge: Any, flags: tuple[str, ...], tmp_path: Path) -> None:
    name, own = sampler
    made = written(own, "cuda")
    judge(
        " ".join([f"{name}: CUDA, float", *flags]), own, hosts.cuda(made, x, tmp_path, flags=flags), reassociates=bool(flags)
    )
    if not flags:
        # At u = 0 a far end lies where the last digit of erf says, which is CUDA's own.
        inner = (x[:, 5:] > 0).all(axis=1)
        got = hosts.cuda(made, x, tmp_path, precision="double")
        double = replay.compare("double", own, x[inner], got[inner])
        assert double.pdf <= 5e-6
        assert double.angle <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("compiler", [by_nvrtc, by_hipcc])
def test_another_compiler_takes_a_samplers_cuda(sampler: Any, compiler: Any, tmp_path: Path) -> None:
    """Without a warning; NVRTC, without a host's standard library."""
    kernel = """
struct V { float x, y, z; };
extern "C" __global__ void kernel(float *x) {
    const V viewer{x[0], x[1], x[2]};
    const V light = fibre::sample_direction(viewer, x[3], x[4], x[5], x + 6, x[7]);
    x[8] = fibre::pdf_direction(viewer, light, x[7]);
}
"""
    compiled, said = compiler(written(sampler[1], "cuda").text + kernel, tmp_path)
    assert not said
    assert b"kernel" in compiled


@pytest.mark.parametrize(
    "version", ["300 es", pytest.param("330", marks=pytest.mark.slow), pytest.param("450", marks=pytest.mark.slow)]
)
def test_glsl_validates(sampler: Any, version: str, tmp_path: Path) -> None:
    hosts.need("glslangValidator", "glslang-tools")
    shader = f"""#version {version}
        precision highp float;
        precision highp int;
        layout(location = 0) out vec4 color;
        {written(sampler[1], "glsl").text}
        void main() {{
            vec3 w_r = vec3(.6, .64, .48);
            float p;
            vec3 w_i = fibre_sample_direction(w_r, vec3(.1, .2, .3), 1., p);
            color = vec4(w_i, p + fibre_pdf_direction(w_r, w_i, 2.));
        }}
        """
    (tmp_path / "shader.frag").write_text(shader)
    done = subprocess.run(["glslangValidator", str(tmp_path / "shader.frag")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "WARNING" not in done.stdout


@pytest.mark.slow
def test_wgsl_by_another_compiler(sampler: Any, x: Any, judge: Any, tmp_path: Path) -> None:
    name, own = sampler
    judge(f"{name}: WGSL, naga", own, hosts.wgsl(written(own, "wgsl"), x, tmp_path, None), reassociates=True)


def test_wgsl_validates(sampler: Any, tmp_path: Path) -> None:
    """By naga, as it is written, which replaying it there changes: its tables are then in buffers."""
    hosts.need("naga", "cargo install naga-cli")
    (tmp_path / "fibre.wgsl").write_text(written(sampler[1], "wgsl").text)
    done = subprocess.run(["naga", "fibre.wgsl"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "to", ["cpp", "glsl", *(pytest.param(to, marks=pytest.mark.slow) for to in ("hlsl", "metal", "slang", "wgsl"))]
)
def test_another_family_of_lobes(to: str, x: Any, document_fit: Any, browser: Any, tmp_path: Path) -> None:
    """The same table read as logistic lobes."""
    sampler = replace(document_fit.sampler, family="logistic")
    # At u = 0 and at the last u below 1 double precision goes where less than e^-60 of a lobe lies; single precision holds
    # that tail. All other u are compared.
    u = x[:, 5:]
    inner = x[((u > 0) & (u < 1 - 2.0**-24)).all(axis=1)]
    got = HOSTS[to].answers(written(sampler, to), inner, tmp_path, browser)
    worst = replay.compare(f"logistic lobes: {to}", sampler, inner, got, reassociates=HOSTS[to].reassociates)
    assert worst.ok, f"{worst}; worst at {worst.at}"


# ---- What has to be caught. ----


@pytest.mark.slow
@pytest.mark.parametrize(("to", "name"), [(to, name) for to, host in HOSTS.items() if host.formulas for name in BROKEN])
def test_a_wrong_constant_is_caught(to: str, name: str, x: Any, document_fit: Any, browser: Any, tmp_path: Path) -> None:
    """In what is exported."""
    right, wrong = BROKEN[name]
    if name == "node" and to in ("glsl", "hlsl", "metal", "slang", "wgsl"):
        right, wrong = NODE_OF_METAL if to == "metal" else NODE_OF_SHADERS
    made = written(document_fit.sampler, to)
    assert right in made.text
    host = HOSTS[to]
    got = host.answers(Export(made.text.replace(right, wrong), made.table_bytes), x, tmp_path, browser)
    assert not replay.compare("broken", document_fit.sampler, x, got, reassociates=host.reassociates).ok


@pytest.fixture
def wrong_headers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """A copy of the headers with one digit wrong, in place of them."""
    copy = tmp_path / "include"
    shutil.copytree(headers.include_dir(), copy)
    path = copy / "cuticle/math/erf.h"
    text = path.read_text()
    assert "5.31021431e-2f" in text
    path.write_text(text.replace("5.31021431e-2f", "5.31521431e-2f"))
    monkeypatch.setattr(headers, "include_dir", lambda: copy)
    monkeypatch.setattr(formulas, "include_dir", lambda: copy)
    formulas.headers.cache_clear()
    yield
    formulas.headers.cache_clear()


@pytest.mark.parametrize("to", [to for to, host in HOSTS.items() if host.formulas])
@pytest.mark.usefixtures("wrong_headers")
def test_a_wrong_constant_of_the_headers_is_caught(to: str, x: Any, document_fit: Any, browser: Any, tmp_path: Path) -> None:
    """In every host: there is no other text of a formula. A tenth of the inputs is enough to see it."""
    host, few = HOSTS[to], x[::10]
    got = host.answers(written(document_fit.sampler, to), few, tmp_path, browser)
    assert not replay.compare("broken", document_fit.sampler, few, got, reassociates=host.reassociates).ok
