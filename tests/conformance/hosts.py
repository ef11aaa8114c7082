"""The hosts: how each runs an export over inputs. A new host is one more row of `HOSTS`.

A host answers rows of inputs: (theta_i, theta_r, phi, strands, u_lobe, u_theta, u_phi) with (pdf, theta_i, phi, pdf of the
sample); or, of its scattering function, (theta_i, theta_r, phi, strands) and, for dual scattering, `behind` and whether the
numbers are random, with f. It skips the test where what it takes is missing.
"""

from __future__ import annotations

import base64
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conformance.cuda_compiler import has_gpu, nvcc, nvcc_command
from conformance.dxc import compile_hlsl
from cuticle.export.registry import Export
from cuticle.sampling.sampler import Sampler

PROGRAM = Path(__file__).parent
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Werror"]
ARM, EMULATOR = "aarch64-linux-gnu-g++", "qemu-aarch64-static"
SAMPLER, EVAL, AROUND = 7, 4, 6  # columns of inputs, which say what is asked


@dataclass(frozen=True)
class Run:
    """Runs an export over inputs, one row an answer.

    `reassociates`: its compiler may, in single precision. `formulas`: the file holds some, not the table alone.
    """

    answers: Callable[[Export, np.ndarray, Path, Any], np.ndarray]
    reassociates: bool = False
    formulas: bool = True


def compiled(
    made: Export, x: np.ndarray, folder: Path, *, command: list[str], precision: str = "float", program: str = "replay.cpp",
    under: Sequence[str] = (),
) -> np.ndarray:  # fmt: skip
    """Compile an exported header alone in an empty folder, and run it over the inputs; `under`: by what, an emulator."""
    build(made.text, x, folder, command=command, precision=precision, program=program)
    x.astype("<f4").tofile(folder / "inputs")
    ran = subprocess.run(
        [*under, "./replay", "inputs", "outputs"], cwd=folder, capture_output=True, text=True, timeout=120, check=False
    )
    assert ran.returncode == 0, ran.stderr
    return np.fromfile(folder / "outputs", "<f8").reshape(len(x), -1)


def build(text: str, x: np.ndarray, folder: Path, *, command: list[str], precision: str, program: str) -> None:
    """Compile it; a warning is an error."""
    (folder / "fibre.h").write_text(text)
    for needed in (program, "replay.h"):
        shutil.copy(PROGRAM / needed, folder)
    asked = {EVAL: ["-DEVAL"], AROUND: ["-DEVAL", "-DAROUND"]}.get(x.shape[1], [])
    built = subprocess.run(
        [*command, *asked, f"-DREAL={precision}", program, "-o", "replay"],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    assert "warning" not in built.stderr, built.stderr


def cpp(
    made: Export, x: np.ndarray, folder: Path, *, compiler: str = "g++", flags: tuple[str, ...] = ("-O1",),
    precision: str = "float", program: str = "replay.cpp",
) -> np.ndarray:  # fmt: skip
    """By a C++ compiler; what one for ARM makes is run by an emulator."""
    need(compiler)
    command, under = [compiler, "-std=c++17", *flags, *WARNINGS], []
    if compiler == ARM:
        need(EMULATOR, "qemu-user-static")
        command, under = [*command, "-static"], [EMULATOR]
    return compiled(made, x, folder, command=command, precision=precision, program=program, under=under)


def cuda(
    made: Export, x: np.ndarray, folder: Path, *, flags: tuple[str, ...] = (), precision: str = "float",
    program: str = "replay.cpp",
) -> np.ndarray:  # fmt: skip
    """By nvcc; the test is skipped where there is no compiler, or, once that has compiled it, no GPU."""
    compiler = nvcc()
    if compiler is None:
        pytest.skip(
            "no nvcc: CUDA's toolkit, or pip install nvidia-cuda-nvcc nvidia-nvvm nvidia-cuda-crt nvidia-cuda-runtime"
        )
    command = [*nvcc_command(compiler), *flags]
    if not has_gpu():
        build(made.text, x, folder, command=[*command, "-c"], precision=precision, program=program)
        pytest.skip("no GPU: compiled without a warning, not run")
    return compiled(made, x, folder, command=command, precision=precision, program=program)


def shaded(
    shader: str, made: Export, x: np.ndarray, folder: Path, driver: Any, asked: str | None = None, *, by: str = "webgl"
) -> np.ndarray:  # fmt: skip
    """Run a shader in a browser; `asked`: an expression of four numbers of a and u.

    `by`: "webgl", a fragment shader, an input a pixel; "webgpu", a compute shader, an input a thread.
    """
    page = (PROGRAM / "replay.html").read_text().replace("/* SHADER */", shader)
    (folder / "replay.html").write_text(page)
    driver.get((folder / "replay.html").as_uri())
    texts = [base64.b64encode(v).decode() for v in (x.astype("<f4").tobytes(), made.data)]
    driver.set_script_timeout(120)
    wanted = asked or asked_of(made, x, "vec4" if by == "webgl" else "vec4<f32>")
    done = driver.execute_script(f"return {by}(...arguments)", texts[0], x.shape[1], wanted, texts[1])
    if done.get("missing"):
        pytest.skip(f"this browser has no {done['missing']}")
    assert done.get("error") is None, str(done)[:2000]
    out = np.frombuffer(base64.b64decode(done["values"]), "<f4").reshape(-1, 4)[: len(x)].astype(float)
    return out if asked or x.shape[1] == SAMPLER else out[:, : made.model.channels]  # type: ignore[union-attr]


def asked_of(made: Export, x: np.ndarray, four: str, texture: str = "") -> str:
    """What a shader returns of an input; `four`: its vector of four numbers; `texture`: what the model is given last."""
    if x.shape[1] == SAMPLER:
        return f"{four}(fibre_pdf(a.x, a.y, a.z, a.w), fibre_sample(a.y, u.xyz, a.w))"
    assert made.model is not None
    call = "fibre_eval(a.x, a.y, a.z, a.w" if x.shape[1] == EVAL else "fibre_eval_around(a.x, a.y, a.z, a.w, u.x, u.y > 0.0"
    return f"{four}({call}{texture})" + ", 0.0" * (4 - made.model.channels) + ")"


def glsl(made: Export, x: np.ndarray, folder: Path, driver: Any) -> np.ndarray:
    """In a browser."""
    return shaded(made.text, made, x, folder, driver)


def hlsl(made: Export, x: np.ndarray, folder: Path, driver: Any) -> np.ndarray:
    """The same of HLSL."""
    return shaded_hlsl(made.text, made, x, folder, driver)


def shaded_hlsl(
    shader: str, made: Export, x: np.ndarray, folder: Path, driver: Any, asked: str | None = None
) -> np.ndarray:  # fmt: skip
    """What a compiler makes of it, written as GLSL, in a browser: no Direct3D is needed."""
    main = f"""
Texture2D<float4> first, second;
float4 main(float4 place : SV_Position) : SV_Target {{
    int3 at = int3(int2(place.xy), 0);
    float4 a = first.Load(at), u = second.Load(at);
    return {asked or asked_of(made, x, "float4")};
}}
"""
    spirv_of(shader + main, folder)
    need("spirv-cross")
    written = subprocess.run(
        ["spirv-cross", "--es", "--version", "300", "main.spv"], cwd=folder, capture_output=True, text=True, check=True
    )
    printed = re.sub(r"SPIRV_Cross_Combined(\w+?)SPIRV_Cross_DummySampler", r"\1", written.stdout)
    return shaded(printed, made, x, folder, driver, asked)


def hlsl_as_spirv(made: Export, x: np.ndarray, folder: Path, compiler: str) -> np.ndarray:
    """What "glslang" or "dxc" makes of a compute shader, on a WebGPU device: no other language is between.

    A sampler's table is a texture, `made.data`, for the reason that `shaded_by_wgpu` gives.
    """
    text = f"""
[[vk::binding(0, 0)]] StructuredBuffer<float4> inputs;
[[vk::binding(1, 0)]] RWStructuredBuffer<float4> answers;
[[vk::binding(0, 1)]] Texture2D<float4> texels;
#define FIBRE_{"TABLE" if x.shape[1] == SAMPLER else "MODEL"}(i) texels.Load(int3((i) % 1024, (i) / 1024, 0))
{made.text}
[numthreads(64, 1, 1)] void main(uint3 id : SV_DispatchThreadID) {{
    float4 a = inputs[2 * id.x], u = inputs[2 * id.x + 1];
    answers[id.x] = {asked_of(made, x, "float4")};
}}
"""
    device = webgpu()
    if compiler == "dxc":
        spirv, said = compile_hlsl(text, "-T", "cs_6_0", "-E", "main", "-spirv")
        assert not said, said
    else:
        spirv = spirv_of(text, folder, stage="comp")
    module = device.create_shader_module(code=spirv)
    return dispatched(device, {"module": module, "entry_point": "main"}, made, x, None)


def spirv_of(text: str, folder: Path, stage: str = "frag") -> bytes:
    """Compile HLSL with an entry point `main` to main.spv by glslang; skip the test where that is missing."""
    need("glslangValidator", "glslang-tools")
    (folder / "main.hlsl").write_text(text)
    command = ["glslangValidator", "-D", "-V", "-e", "main", "-S", stage, "-o", "main.spv", "main.hlsl"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "WARNING" not in done.stdout, done.stdout
    return (folder / "main.spv").read_bytes()


def slang(made: Export, x: np.ndarray, folder: Path, driver: Any) -> np.ndarray:
    """By Slang's own compiler, on the CPU."""
    return shaded_slang(made.text, made, x)


def shaded_slang(shader: str, made: Export, x: np.ndarray, asked: str | None = None) -> np.ndarray:
    """Run a compute shader on slangpy's CPU device, an input a thread; texels come from a buffer in place of a texture."""
    spy = pytest.importorskip("slangpy", reason="slangpy is not installed: pip install slangpy")
    texels = np.frombuffer(made.data or bytes(16), np.float32).copy()  # slangpy takes what it may write to
    text = f"""
StructuredBuffer<float4> texels;
StructuredBuffer<float> inputs;
RWStructuredBuffer<float> answers;
#define FIBRE_MODEL(i) texels[i]
{shader}
[shader("compute")][numthreads(64, 1, 1)] void replay(uint3 id : SV_DispatchThreadID) {{
    float v[8];
    for (int k = 0; k < 8; ++k) v[k] = inputs[8 * int(id.x) + k];
    float4 a = float4(v[0], v[1], v[2], v[3]), u = float4(v[4], v[5], v[6], v[7]);
    float4 answer = {asked or asked_of(made, x, "float4")};
    for (int k = 0; k < 4; ++k) answers[4 * int(id.x) + k] = answer[k];
}}
"""
    device = spy.create_device(spy.DeviceType.cpu)
    module = device.load_module_from_source("replayed", text)
    kernel = device.create_compute_kernel(device.link_program([module], [module.entry_point("replay")]))
    rows = np.zeros((-(-len(x) // 64) * 64, 8), np.float32)
    rows[: len(x), : x.shape[1]] = x
    read, write = spy.BufferUsage.shader_resource, spy.BufferUsage.unordered_access
    out = device.create_buffer(element_count=4 * len(rows), struct_size=4, usage=write)
    kernel.dispatch(
        thread_count=[len(rows), 1, 1],
        vars={
            "inputs": device.create_buffer(element_count=rows.size, struct_size=4, usage=read, data=rows.ravel()),
            "texels": device.create_buffer(element_count=texels.size // 4, struct_size=16, usage=read, data=texels),
            "answers": out,
        },
    )  # fmt: skip
    got = out.to_numpy().view(np.float32).reshape(-1, 4)[: len(x)].astype(float)
    return got if asked or x.shape[1] == SAMPLER else got[:, : made.model.channels]  # type: ignore[union-attr]


def wgsl(made: Export, x: np.ndarray, folder: Path, driver: Any) -> np.ndarray:
    """In a browser."""
    return shaded_wgsl(made.text, made, x, folder, driver)


def shaded_wgsl(
    shader: str, made: Export, x: np.ndarray, folder: Path, driver: Any, asked: str | None = None
) -> np.ndarray:  # fmt: skip
    """By a browser's WebGPU, whose compiler is Tint where that is Chromium; without a browser by wgpu's, naga."""
    if driver is None:
        return shaded_by_wgpu(shader, made, x, asked)
    return shaded(shader, made, x, folder, driver, asked, by="webgpu")


def webgpu() -> Any:
    """A WebGPU device; the test is skipped where there is none."""
    wgpu = pytest.importorskip("wgpu", reason="wgpu is not installed: pip install wgpu")
    adapters = [a for a in wgpu.gpu.enumerate_adapters_sync() if a.info["backend_type"] in ("Vulkan", "Metal", "D3D12")]
    if not adapters:
        pytest.skip("no Vulkan device (Debian, in software: apt-get install mesa-vulkan-drivers)")
    return adapters[0].request_device_sync()


def shaded_by_wgpu(shader: str, made: Export, x: np.ndarray, asked: str | None = None) -> np.ndarray:
    """Run a compute shader, an input a thread; the scattering function's texels are a texture.

    A software Vulkan will do. It copies a constant array whenever it is read, and takes minutes: numbers of tables are read
    from the text and go into buffers.
    """
    device = webgpu()
    tables: list[np.ndarray] = []

    def buffered(found: re.Match[str]) -> str:
        name, kind, length, numbers = found.groups()
        values = np.array(re.findall(r"[-\d.e]+", re.sub(r"vec\d<f32>", "", numbers)), np.float32).reshape(int(length), -1)
        tables.append(np.pad(values, ((0, 0), (0, values.shape[1] == 3))))  # a vec3 stands where a vec4 would
        return f"@group(0) @binding({len(tables) + 1}) var<storage> {name}: array<{kind}>;"

    shader = re.sub(r"const (\w+) = array<(.+), (\d+)>\(\n([^;]*)\n\);", buffered, shader)
    assert tables
    assert "const " not in shader
    text = f"""
@group(0) @binding(0) var<storage> inputs: array<array<vec4<f32>, 2>>;
@group(0) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;
{shader}
@compute @workgroup_size(64) fn replay(@builtin(global_invocation_id) id: vec3<u32>) {{
    let a = inputs[id.x][0];
    let u = inputs[id.x][1];
    answers[id.x] = {asked or asked_of(made, x, "vec4<f32>")};
}}
"""
    kernel = {"module": device.create_shader_module(code=text), "entry_point": "replay"}
    return dispatched(device, kernel, made, x, asked, tables)


def dispatched(
    device: Any,
    kernel: dict[str, Any],
    made: Export,
    x: np.ndarray,
    asked: str | None,
    tables: Sequence[np.ndarray] = (),
) -> np.ndarray:
    """Run a kernel, 64 threads a group: inputs, answers and tables in group 0, the scattering function's texture in 1."""
    rows = np.zeros((-(-len(x) // 64) * 64, 8), np.float32)
    rows[: len(x), : x.shape[1]] = x
    inputs = device.create_buffer_with_data(data=rows, usage="STORAGE")
    answers = device.create_buffer(size=16 * len(rows), usage="STORAGE | COPY_SRC")
    read = [device.create_buffer_with_data(data=np.ascontiguousarray(t), usage="STORAGE") for t in tables]
    kinds = ["read-only-storage", "storage", *["read-only-storage"] * len(read)]
    entries = [{"binding": i, "visibility": "COMPUTE", "buffer": {"type": kind}} for i, kind in enumerate(kinds)]
    bound: list[list[Any]] = [[{"buffer": b, "offset": 0, "size": b.size} for b in (inputs, answers, *read)]]
    layouts = [device.create_bind_group_layout(entries=entries)]
    if made.data:
        texels = np.frombuffer(made.data, np.float32).reshape(-1, 1024, 4)
        size = (1024, len(texels), 1)
        texture = device.create_texture(size=size, format="rgba32float", usage="TEXTURE_BINDING | COPY_DST")
        device.queue.write_texture({"texture": texture}, texels, {"bytes_per_row": 16 * 1024}, size)
        kind = {"binding": 0, "visibility": "COMPUTE", "texture": {"sample_type": "unfilterable-float"}}
        layouts.append(device.create_bind_group_layout(entries=[kind]))
        bound.append([texture.create_view()])
    pipeline = device.create_compute_pipeline(
        layout=device.create_pipeline_layout(bind_group_layouts=layouts), compute=kernel
    )
    encoder = device.create_command_encoder()
    work = encoder.begin_compute_pass()
    work.set_pipeline(pipeline)
    for i, (layout, resources) in enumerate(zip(layouts, bound, strict=True)):
        given = [{"binding": k, "resource": r} for k, r in enumerate(resources)]
        work.set_bind_group(i, device.create_bind_group(layout=layout, entries=given))
    work.dispatch_workgroups(len(rows) // 64)
    work.end()
    device.queue.submit([encoder.finish()])
    got = np.frombuffer(device.queue.read_buffer(answers), np.float32).reshape(-1, 4)[: len(x)].astype(float)
    return got if asked or x.shape[1] == SAMPLER else got[:, : made.model.channels]  # type: ignore[union-attr]


def metal(made: Export, x: np.ndarray, folder: Path, driver: Any) -> np.ndarray:
    """By a C++ compiler, with a stand-in for Metal's library: Apple's own is not needed."""
    return shaded_metal(made.text, made, x, folder)


def shaded_metal(shader: str, made: Export, x: np.ndarray, folder: Path, asked: str | None = None) -> np.ndarray:
    """Compile a shader as C++14 for the CPU, and run it over the inputs, an input a call."""
    need("g++")
    asked = asked or asked_of(made, x, "float4", ", model").replace("0.0", "0.0f")
    text = f"""
#include <cstdio>
{shader}
int main() {{
    static float rows[{len(x)}][8], texels[{max(len(made.data) // 4, 4)}];
    FILE *in = std::fopen("inputs", "rb"), *out = std::fopen("outputs", "wb");
    if (std::fread(rows, sizeof rows, 1, in) + std::fread(texels, 1, sizeof texels, in) == 0) return 1;
    const metal::texture2d<float> model{{reinterpret_cast<const float4 *>(texels), 1024}};
    (void)model;
    for (const float *v : rows) {{
        const float4 a(v[0], v[1], v[2], v[3]), u(v[4], v[5], v[6], v[7]);
        const float4 answer = {asked};
        std::fwrite(&answer, sizeof answer, 1, out);
    }}
    return std::fclose(out);
}}
"""
    (folder / "main.cpp").write_text(text)
    rows = np.zeros((len(x), 8), "<f4")
    rows[:, : x.shape[1]] = x
    (folder / "inputs").write_bytes(rows.tobytes() + made.data)
    warnings = ["-Wall", "-Wdouble-promotion", "-Wfloat-conversion", "-Werror", "-isystem", str(PROGRAM.parent / "hosts")]
    command = ["g++", "-std=c++14", "-O1", *warnings, "main.cpp", "-o", "replay"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert built.returncode == 0, built.stderr
    subprocess.run(["./replay"], cwd=folder, timeout=120, check=True)
    got = np.fromfile(folder / "outputs", "<f4").reshape(-1, 4).astype(float)
    return got if made.model is None or x.shape[1] == SAMPLER else got[:, : made.model.channels]


def read_back(made: Export, x: np.ndarray, folder: Path, driver: Any) -> np.ndarray:
    """The sampler's file, by Python in single precision."""
    return python(Sampler.from_json(made.text), x)


def python(sampler: Sampler, x: np.ndarray) -> np.ndarray:
    """Python in single precision."""
    ti, tr, ph, n = (np.ascontiguousarray(c) for c in x[:, :4].T)
    s = sampler.sample(tr, np.ascontiguousarray(x[:, 4:]), n)
    return np.stack([sampler.pdf(ti, tr, ph, n), *s], axis=1)


def need(tool: str, package: str = "") -> None:
    """Skip the test where a program is missing."""
    if shutil.which(tool) is None:
        how = package if " " in package else f"Debian: apt-get install {package or tool}"
        pytest.skip(f"{tool} is not installed ({how})")


# web: its shaders are GLSL's, and tests/test_web.py reads them back. pbrt: its core is that of cpp; tests/test_examples.py
# runs its classes.
HOSTS = {
    "cpp": Run(lambda made, x, folder, driver: cpp(made, x, folder)),
    "cuda": Run(lambda made, x, folder, driver: cuda(made, x, folder)),
    "glsl": Run(glsl, reassociates=True),
    "hlsl": Run(hlsl, reassociates=True),
    "json": Run(read_back, formulas=False),
    "metal": Run(metal),
    "slang": Run(slang, reassociates=True),
    "wgsl": Run(wgsl, reassociates=True),
}
