"""The examples: built as their texts say, and what the renderers' pages ask to paste, compiled against stand-ins and run."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import cuticle
from conformance.cuda_compiler import nvcc
from conformance.dxc import compile_hlsl
from conformance.hosts import need, spirv_of, webgpu
from cuticle.export import export, export_family
from cuticle.export.headers import cmake_dir
from cuticle.export.registry import Export

ROOT = Path(__file__).parents[1]
slow = pytest.mark.slow
COMPILE = ["-std=c++17", "-O2", "-Wall", "-Wextra", "-Werror"]


@cache
def exported(sampler: cuticle.Sampler, host: str, with_model: bool = False) -> Export:
    """An export measures what its heading says: made once."""
    return export(sampler, host, name="brown", with_model=with_model)


def compiler() -> str:
    found = shutil.which("g++") or shutil.which("c++")
    if found is None:
        pytest.skip("no C++ compiler on the path")
    return found


def block(page: str, language: str) -> str:
    """The one block of a language in a page of examples."""
    blocks = re.findall(rf"```{language}\n(.*?)```", (ROOT / "examples" / page).read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 1
    return str(blocks[0])


def run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_program_tests_its_own_samples(brown_sampler: cuticle.Sampler, tmp_path: Path) -> None:
    shutil.copy(ROOT / "examples/cpp/main.cpp", tmp_path)
    text = exported(brown_sampler, "cpp").text
    (tmp_path / "brown.h").write_text(text)
    run([compiler(), *COMPILE, "main.cpp", "-o", "main"], tmp_path)
    assert "samples follow the pdf" in run(["./main"], tmp_path)
    # And it would say so if they did not: lobes 5 % narrower in the pdf than in the samples.
    wrong = text.replace("Both(d * both.rate)", "Both(d * both.rate * Both(1.05))")
    assert wrong != text
    (tmp_path / "brown.h").write_text(wrong)
    run([compiler(), *COMPILE, "main.cpp", "-o", "main"], tmp_path)
    done = subprocess.run(["./main"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "does not match" in done.stdout


@pytest.mark.parametrize("installed", ["by pip", pytest.param("by cmake --install", marks=slow)])
def test_a_cmake_project_finds_the_headers(installed: str, tmp_path: Path) -> None:
    cmake = shutil.which("cmake")
    if cmake is None:
        pytest.skip("cmake is not installed")
    compiler()
    prefix = cmake_dir()
    if installed != "by pip":
        run([cmake, "-S", str(ROOT), "-B", str(tmp_path / "own")], tmp_path)
        run([cmake, "--install", str(tmp_path / "own"), "--prefix", str(tmp_path / "prefix")], tmp_path)
        prefix = tmp_path / "prefix"
    run(
        [cmake, "-S", str(ROOT / "examples/cmake"), "-B", str(tmp_path / "build"), f"-DCMAKE_PREFIX_PATH={prefix}"], tmp_path
    )
    run([cmake, "--build", str(tmp_path / "build")], tmp_path)
    assert "integral 1.000" in run([str(tmp_path / "build/lobes")], tmp_path)


def expected(brown: cuticle.Sampler, w_r: np.ndarray, u: tuple[float, float, float]) -> tuple[np.ndarray, float, np.ndarray]:
    """Direction, pdf and f cos of a sample in a frame whose first axis is the strand."""
    theta_r, phi_r = np.arcsin(w_r[0]), np.arctan2(w_r[2], w_r[1])
    theta_i, phi, p = (float(x) for x in brown.sample(theta_r, u, 0))
    w_i = [np.sin(theta_i), np.cos(theta_i) * np.cos(phi_r + phi), np.cos(theta_i) * np.sin(phi_r + phi)]
    f = cuticle.DualScattering(cuticle.Fibre.preset("brown")).eval(theta_i, theta_r, phi) * np.cos(theta_i)
    return np.array(w_i), p, f


PBRT_HEADERS = (
    "pbrt.h", "base/bxdf.h", "base/material.h", "base/texture.h", "util/colorspace.h", "util/memory.h", "util/spectrum.h",
    "util/vecmath.h", "paramdict.h",
)  # fmt: skip
# pbrt's own files, as they are once the printed lines are in them.
PBRT_FILES = {
    "bxdfs.h": """namespace pbrt {{
class DiffuseBxDF {{
  public:
    BxDFFlags Flags() const {{ return BxDFFlags::GlossyReflection; }}
    void Regularize() {{}}
}};
class BxDF : public TaggedPointer<DiffuseBxDF{entry}> {{
  public:
    using TaggedPointer::TaggedPointer;
    BxDFFlags Flags() const {{
        return Dispatch([](auto ptr) {{ return ptr->Flags(); }});
    }}
}};
}}
""",
    "materials.h": """namespace pbrt {{
struct MaterialEvalContext {{}};
class Material : public TaggedPointer<BrownHairMaterial> {{
  public:
    using TaggedPointer::TaggedPointer;
    auto GetBxDF(MaterialEvalContext ctx, SampledWavelengths &lambda) const {{
        return Dispatch([&](auto ptr) {{ return ptr->GetBxDF(0, ctx, lambda); }});
    }}
}};
}}
""",
}


def pbrt_main(folder: Path, sampler: cuticle.Sampler, include: str, entry: str = ", BrownHairBxDF") -> Path:
    """Write the files that stand for pbrt's, with the include put where `include` says; return the program."""
    for name in PBRT_HEADERS:
        file = folder / "pbrt" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'#include "{ROOT / "tests/hosts/pbrt.h"}"\n')
    (folder / "pbrt/brown.h").write_text(exported(sampler, "pbrt").text)
    files = "".join(PBRT_FILES.values()).format(entry=entry)
    main = folder / "main.cpp"
    main.write_text(
        f"#include <pbrt/pbrt.h>\n{include.format(line='#include <pbrt/brown.h>')}\n{files}\n#include <cstdio>\n"
        "using namespace pbrt;\n"
        "int main() {\n"
        "    Allocator alloc;\n"
        "    SampledWavelengths lambda;\n"
        "    const Material material = BrownHairMaterial::Create(alloc);\n"
        "    BrownHairBxDF hair = material.GetBxDF({}, lambda);\n"
        "    const auto all = BxDFReflTransFlags::All;\n"
        "    const Vector3f wo(.6f, .48f, .64f);\n"
        "    const auto s = hair.Sample_f(wo, .3f, {.4f, .6f}, TransportMode::Radiance, all);\n"
        "    if (hair.Sample_f(wo, .3f, {.4f, .6f}, TransportMode::Radiance, BxDFReflTransFlags::Transmission)) return 1;\n"
        "    if (hair.PDF(wo, s->wi, TransportMode::Radiance, BxDFReflTransFlags::Transmission) != 0) return 2;\n"
        "    if (BxDF(&hair).Flags() != BxDFFlags::GlossyReflection) return 3;\n"
        '    std::printf("%.8g %.8g %.8g %.8g ", s->wi.x, s->wi.y, s->wi.z, s->pdf);\n'
        '    std::printf("%.8g ", hair.PDF(wo, s->wi, TransportMode::Radiance, all));\n'
        "    const SampledSpectrum f = hair.f(wo, s->wi, TransportMode::Radiance);\n"
        '    for (int i = 2; i >= 0; --i) std::printf("%.8g %.8g ", s->f[i] * AbsCosTheta(s->wi), f[i] / s->f[i]);\n'
        "}\n"
    )
    return main


@pytest.mark.parametrize("gpu", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_pbrt(brown_sampler: cuticle.Sampler, gpu: bool, tmp_path: Path) -> None:
    pbrt_main(tmp_path, brown_sampler, "{line}")
    flags = [*COMPILE, "-Wno-unused-parameter", "-I.", *(["-DPBRT_IS_GPU_CODE"] if gpu else [])]
    run([compiler(), *flags, "main.cpp", "-o", "main"], tmp_path)
    got = np.array(run(["./main"], tmp_path).split(), float)
    direction, p, f = expected(brown_sampler, np.array([0.6, 0.48, 0.64]), (0.3, 0.4, 0.6))
    np.testing.assert_allclose(got[:3], direction, atol=1e-5)
    np.testing.assert_allclose(got[3:5], p, rtol=1e-4)
    np.testing.assert_allclose(got[5::2], f, rtol=0.03)  # thinned tables
    np.testing.assert_allclose(got[6::2], 1, rtol=1e-5)


def test_pbrt_takes_any_fibre(tmp_path: Path) -> None:
    """A material with pbrt's own parameters, its tilt and its defaults; a viewer that it was not prepared for."""
    for name in PBRT_HEADERS:
        file = tmp_path / "pbrt" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'#include "{ROOT / "tests/hosts/pbrt.h"}"\n')
    (tmp_path / "pbrt/strands.h").write_text(export_family("chiang", "pbrt", name="strands").text)
    (tmp_path / "main.cpp").write_text("""#include <pbrt/strands.h>
#include <cstdio>
#include <map>
using namespace pbrt;
struct Parameters {
    std::map<std::string, Float> given;
    FloatTexture GetFloatTextureOrNull(const std::string &name, Allocator) const {
        const auto found = given.find(name);
        return FloatTexture(found == given.end() ? nullptr : &found->second);
    }
    FloatTexture GetFloatTexture(const std::string &name, Float other, Allocator alloc) const {
        if (given.count(name)) return GetFloatTextureOrNull(name, alloc);
        return FloatTexture(new Float(other));
    }
    SpectrumTexture GetSpectrumTextureOrNull(const std::string &name, SpectrumType, Allocator alloc) const {
        return SpectrumTexture(GetFloatTextureOrNull(name, alloc).value);
    }
};
struct Context { Vector3f wo, dpdus; };
void show(const Parameters &parameters, Vector3f wo) {
    SampledWavelengths lambda;
    const auto *material = StrandsHairMaterial::Create(parameters, static_cast<const int *>(nullptr), Allocator());
    const Context context{{.6f, .48f, .64f}, {2, 0, 0}};
    if (!material->CanEvaluateTextures(UniversalTextureEvaluator())) std::printf("no ");
    const auto hair = material->GetBxDF(UniversalTextureEvaluator(), context, lambda);
    const auto s = hair.Sample_f(wo, .3f, {.4f, .6f}, TransportMode::Radiance, BxDFReflTransFlags::All);
    const SampledSpectrum f = hair.f(wo, s->wi, TransportMode::Radiance);
    std::printf("%.8g %.8g %.8g %.8g ", s->wi.x, s->wi.y, s->wi.z, s->pdf);
    std::printf("%.8g ", hair.PDF(wo, s->wi, TransportMode::Radiance, BxDFReflTransFlags::All));
    for (int i = 0; i < 4; ++i) std::printf("%.8g %.8g ", s->f[i] * AbsCosTheta(s->wi), f[i] / s->f[i]);
    std::printf("\\n");
}
int main() {
    show({{{"sigma_a", .4f}, {"beta_m", .2f}, {"beta_n", .4f}, {"alpha", 3.f}}}, {.6f, .48f, .64f});
    show({{{"sigma_a", .4f}}}, {-.8f, 0, .6f});
    show({{{"color", .3f}, {"beta_n", .5f}}}, {.6f, .48f, .64f});
    show({}, {.6f, .48f, .64f});
}
""")
    run([compiler(), *COMPILE, "-Wno-unused-parameter", "-I.", "main.cpp", "-o", "main"], tmp_path)
    rows = [np.array(line.split(), float) for line in run(["./main"], tmp_path).splitlines()]
    pigment = cuticle.conventions.sigma_a_of_pigment(1.3)
    hairs = [
        ({"sigma_a": 0.4, "beta_m": 0.2, "beta_n": 0.4, "alpha": -3}, 0.6), ({"sigma_a": 0.4, "alpha": -2}, -0.8),
        ({"color": 0.3, "beta_n": 0.5, "alpha": -2}, 0.6), ({"alpha": -2}, 0.6),
    ]  # fmt: skip
    for row, (hair, x) in zip(rows, hairs, strict=True):
        if "color" in hair:
            hair["sigma_a"] = float(cuticle.conventions.sigma_a_of_color(hair.pop("color"), hair["beta_n"]))
        # The stand-in's wavelengths: blue, twice green, red.
        absorption = [hair.pop("sigma_a")] * 4 if "sigma_a" in hair else pigment[[2, 1, 0, 0]].tolist()
        theta_i, phi_i = np.arcsin(row[0]), np.arctan2(row[2], row[1])
        phi_r = np.arctan2(0.64, 0.48) if x > 0 else np.pi / 2
        models = [cuticle.Chiang(**hair, sigma_a=a) for a in absorption]
        f = [float(m.eval(theta_i, np.arcsin(x), phi_i - phi_r)[0] * np.cos(theta_i)) for m in models]
        np.testing.assert_allclose(row[5::2], f, rtol=0.02)
        np.testing.assert_allclose(row[6::2], 1, rtol=1e-5)
        albedo = [cuticle.measure(cuticle.family("chiang").sampler_at(m), m, np.arcsin(x)).energy[0] for m in models]
        np.testing.assert_allclose(row[3:5], np.mean(f) / np.mean(albedo), rtol=0.02)


@pytest.mark.parametrize(
    ("slip", "include", "flags", "entry"),
    [
        pytest.param(
            "the include within namespace pbrt", "namespace pbrt {{\n{line}\n}}", [], ", BrownHairBxDF", marks=slow
        ),
        ("no entry in the tagged pointer", "{line}", [], ""),
        ("no include before the dispatch", "", [], ", BrownHairBxDF"),
        pytest.param("no forward declarations", "", ["-DPBRT_NOT_DECLARED"], ", BrownHairBxDF", marks=slow),
    ],
)
def test_a_slip_in_pbrts_files_is_caught(
    slip: str, include: str, flags: list[str], entry: str, brown_sampler: cuticle.Sampler, tmp_path: Path
) -> None:
    pbrt_main(tmp_path, brown_sampler, include, entry)
    built = [compiler(), "-std=c++17", "-fsyntax-only", "-I.", *flags, "main.cpp"]
    assert subprocess.run(built, cwd=tmp_path, capture_output=True, check=False).returncode != 0, slip


def test_pbrts_page_shows_the_lines_that_the_command_prints(brown_sampler: cuticle.Sampler) -> None:
    page = (ROOT / "examples/pbrt.md").read_text(encoding="utf-8")
    assert exported(brown_sampler, "pbrt").remarks.split("\n\n", 1)[1].strip() in page


def test_cycles(brown_sampler: cuticle.Sampler, tmp_path: Path) -> None:
    (tmp_path / "kernel/closure").mkdir(parents=True)
    (tmp_path / "kernel/util").mkdir()
    (tmp_path / "kernel/util/colorspace.h").write_text("")  # what the page takes of it is in the stand-in
    (tmp_path / "kernel/closure/brown.h").write_text(exported(brown_sampler, "cpp", True).text)
    (tmp_path / "main.cpp").write_text(
        f'#include "{ROOT / "tests/hosts/cycles.h"}"\n{block("cycles.md", "cpp")}\n#include <cstdio>\n'
        "int main() {\n"
        "    const ccl::ShaderData sd{ccl::make_float3(.2f, .3f, .932738f), ccl::make_float3(2, 1, 0)};\n"
        "    ccl::float3 wo, f, X, Y, Z;\n"
        "    float pdf, again;\n"
        "    ccl::strand_frame(&sd, &X, &Y, &Z);\n"
        "    ccl::BrownHairBSDF bsdf;\n"
        "    if (ccl::bsdf_hair_brown_setup(&sd, &bsdf, ccl::CLOSURE_BSDF_HAIR_BROWN_ID) != (4 | 16 | 64)) return 2;\n"
        "    if (bsdf.type != ccl::CLOSURE_BSDF_HAIR_BROWN_ID || dot(bsdf.N, Y) < .9999f) return 3;\n"
        "    const int label = ccl::bsdf_hair_brown_sample(nullptr, &sd, Y, "
        "ccl::make_float3(.4f, .6f, .3f), &f, &wo, &pdf);\n"
        "    const ccl::float3 g = ccl::bsdf_hair_brown_eval(nullptr, &sd, wo, &again);\n"
        "    const int side = dot(wo, Y) < 0 ? ccl::LABEL_TRANSMIT : ccl::LABEL_REFLECT;\n"
        "    if (label != (ccl::LABEL_GLOSSY | side)) return 1;\n"
        '    std::printf("%.8g %.8g %.8g ", dot(sd.wi, X), dot(sd.wi, Y), dot(sd.wi, Z));\n'
        '    std::printf("%.8g %.8g %.8g ", dot(wo, X), dot(wo, Y), dot(wo, Z));\n'
        '    std::printf("%.8g %.8g %.8g %.8g %.8g %.8g", pdf, again, f.x, f.y, f.z, g.y);\n'
        "}\n"
    )
    run([compiler(), *COMPILE, "-I.", "main.cpp", "-o", "main"], tmp_path)
    if shutil.which("nm"):  # weak symbols would be shared between Cycles' kernels of several instruction sets
        assert not re.search(r" [VWu] .*5brown", run(["nm", "main"], tmp_path))
    got = np.array(run(["./main"], tmp_path).split(), float)
    direction, p, f = expected(brown_sampler, got[:3], (0.3, 0.4, 0.6))
    np.testing.assert_allclose(got[3:6], direction, atol=1e-5)
    np.testing.assert_allclose(got[6:8], p, rtol=1e-4)
    np.testing.assert_allclose(got[8:11], 2 * f, rtol=0.03)  # the stand-in's rec709_to_rgb doubles
    np.testing.assert_allclose(got[11], got[9], rtol=1e-5)


@pytest.mark.parametrize("version", ["300 es", "460"])
def test_glsl(brown_sampler: cuticle.Sampler, version: str, tmp_path: Path) -> None:
    need("glslangValidator", "glslang-tools")
    head = f"#version {version}\nprecision highp float;\nlayout(location = 0) out vec4 color;\n"
    made = exported(brown_sampler, "glsl", True).text
    body = "\nvoid main() { Bounce b = scatter(vec3(0, 0, 1), vec3(1, 0, 0), vec3(.2, .3, .4), 0.);\n"
    body += "  color = vec4(b.throughput, b.pdf) + toward_light(vec3(0, 0, 1), b.direction, vec3(1, 0, 0), 2.); }\n"
    (tmp_path / "shader.frag").write_text(head + made + block("rtx.md", "glsl") + body)
    assert "ERROR" not in run(["glslangValidator", "shader.frag"], tmp_path)


@pytest.mark.parametrize("place", ["", "set = 3, binding = 5"])
def test_glsl_in_a_closest_hit_shader(brown_sampler: cuticle.Sampler, place: str, tmp_path: Path) -> None:
    """Of Vulkan, which gives a texture a number."""
    need("glslangValidator", "glslang-tools")
    head = "#version 460\n#extension GL_EXT_ray_tracing : require\nlayout(location = 0) rayPayloadInEXT vec4 color;\n"
    head += f"#define BROWN_BINDING {place}\n" if place else ""
    body = "\nvoid main() { Bounce b = scatter(gl_WorldRayDirectionEXT, vec3(1, 0, 0), color.xyz, 0.);\n"
    body += "  color = vec4(b.throughput, b.pdf); }\n"
    (tmp_path / "hit.rchit").write_text(head + exported(brown_sampler, "glsl", True).text + block("rtx.md", "glsl") + body)
    run(["glslangValidator", "--target-env", "vulkan1.2", "hit.rchit", "-o", "hit.spv"], tmp_path)
    listed = run(["glslangValidator", "--target-env", "vulkan1.2", "-H", "hit.rchit"], tmp_path)
    numbers = dict(re.findall(r"Decorate \d+\(brown_model\) (DescriptorSet|Binding) (\d+)", listed))
    assert numbers == ({"DescriptorSet": "3", "Binding": "5"} if place else {"DescriptorSet": "0", "Binding": "0"})


@pytest.mark.parametrize("compiler", ["glslang", pytest.param("dxc", marks=pytest.mark.slow)])
def test_hlsl(brown_sampler: cuticle.Sampler, compiler: str, tmp_path: Path) -> None:
    made = exported(brown_sampler, "hlsl", True).text
    main = "\nfloat4 main() : SV_Target {\n"
    main += "  Bounce b = scatter(float3(0, 0, 1), float3(1, 0, 0), float3(.2, .3, .4), 0.0);\n"
    main += "  float4 l = toward_light(float3(0, 0, 1), b.direction, float3(1, 0, 0), 2.0);\n"
    main += "  return float4(b.throughput, b.pdf) + l; }\n"
    whole = made + block("rtx.md", "hlsl") + main
    if compiler == "glslang":
        assert spirv_of(whole, tmp_path)
    else:
        compiled, said = compile_hlsl(whole, "-T", "ps_6_0", "-Vd")
        assert compiled
        assert not said


@pytest.mark.slow
def test_webgpu(tmp_path: Path) -> None:
    """The picture: the ring of R, TT beyond the strand, and the ball's highlight."""
    webgpu()
    run([sys.executable, str(ROOT / "examples" / "webgpu_strand.py"), "strand.png"], tmp_path)
    pixels = matplotlib.image.imread(tmp_path / "strand.png")[..., :3]
    assert pixels.shape == (512, 1024, 3)
    ring, beyond, above, highlight = pixels[340, 200], pixels[336, 4], pixels[60, 100], pixels[220, 680]
    assert beyond.min() > ring.max() > 0.2  # TT is the brightest, and brown
    assert beyond[0] > beyond[2]
    assert above.max() < 0.05
    assert highlight.max() > 0.3


@pytest.mark.slow
def test_cuda(brown_sampler: cuticle.Sampler, tmp_path: Path) -> None:
    found = nvcc()
    if found is None:
        pytest.skip("no nvcc")
    (tmp_path / "brown.cuh").write_text(exported(brown_sampler, "cuda", True).text)
    kernel = "__global__ void f(float3 w, float3 u, float3 *o) { *o = scatter(w, u, 2.f).throughput; }\n"
    (tmp_path / "main.cu").write_text(block("rtx.md", "cuda") + kernel)
    run([found, "-std=c++17", "--Werror", "all-warnings", "-c", "main.cu", "-o", "main.o"], tmp_path)
