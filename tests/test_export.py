"""Exports: what the files hold, that they stand alone, and what is refused before anything is written."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import cuticle
from command import refused, run
from cuticle.export import FRAMES, HOSTS, MAX_TABLE, export, export_family
from cuticle.export.headers import amalgamate, cmake_dir, include_dir
from cuticle.export.literals import single, wrapped
from cuticle.export.registry import Job, host
from cuticle.export.shader import model_texels
from cuticle.scattering.host_tables import TOLERANCE, reduce_tables

ROOT = Path(__file__).parents[1]
WARNINGS = ["-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-Werror"]


@pytest.fixture(scope="module")
def strand() -> cuticle.Sampler:
    """A strand on its own, three lobes: a number that is padded."""
    return cuticle.fit(cuticle.Marschner(cuticle.Fibre.preset("brown"), "energy_conserving"), lobes=3).sampler


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, document_fit: cuticle.Fit) -> Path:
    target = tmp_path_factory.mktemp("export")
    document_fit.sampler.save(target / "sampler.json")
    return target


def compile_and_run(source: str, folder: Path, *, compiler: str = "g++", flags: tuple[str, ...] = ()) -> str:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    (folder / "main.cpp").write_text(source)
    command = [compiler, *WARNINGS, "-O2", *flags, "main.cpp", "-o", "main"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return subprocess.run(["./main"], cwd=folder, capture_output=True, text=True, check=True).stdout


def test_the_table_is_small_and_the_text_depends_on_nothing_else(document_fit: cuticle.Fit) -> None:
    for to in ("cpp", "cuda", "glsl", "hlsl", "metal", "slang", "wgsl"):
        made = export(document_fit.sampler, to, name="brown")
        assert made.table_bytes <= MAX_TABLE
        again = export(cuticle.Sampler.from_json(document_fit.sampler.to_json()), to, name="brown")
        assert made == again
        assert max(map(len, made.text.splitlines())) <= 130
    head = export(document_fit.sampler, "cpp", name="brown", frame="pbrt").text[:3000]
    for word in ("4 lobes", "0, 1, 2, 4, 8", "ESS", "alpha_R", "wo toward the viewer", "brown::sample"):
        assert word in head


@pytest.mark.parametrize("to", ["glsl", "hlsl"])  # whose functions are told apart by their arguments alone
@pytest.mark.parametrize("counts", [(0.0,), (1.0, 4.0), (0.0, 1.0, 2.0, 4.0, 8.0)])
def test_a_scattering_function_beside_it_leaves_a_sampler_as_it_is(
    document_fit: cuticle.Fit, to: str, counts: tuple[float, ...]
) -> None:
    rows = np.searchsorted(document_fit.sampler.strands, counts)
    sampler = cuticle.Sampler(document_fit.sampler.nodes[rows], document_fit.sampler.energy[rows], counts)
    alone = re.findall(r"^\w[^=;{]*\) \{(?:[^\n]*\}|\n.*?\n\})$", export(sampler, to).text, re.M | re.S)
    assert len(alone) > 20
    for model in (
        cuticle.DualScattering(cuticle.Fibre.preset("document")),
        cuticle.Marschner(cuticle.Fibre.preset("brown")),
    ):
        both = export(sampler, to, with_model=True, model=model).text
        assert not [function for function in alone if function not in both]


def unformatted(text: str, folder: Path) -> str:
    """What clang-format complains of in a header; skip where it is not installed."""
    formatter = shutil.which("clang-format") or str(Path(sys.executable).parent / "clang-format")
    if not Path(formatter).exists():
        pytest.skip("clang-format is not installed")
    (folder / "fibre.h").write_text(text)
    command = [formatter, f"--style=file:{ROOT / '.clang-format'}", "--dry-run", "--Werror", str(folder / "fibre.h")]
    return subprocess.run(command, capture_output=True, text=True, check=False).stderr[:2000]


def test_cpp_is_formatted(document_fit: cuticle.Fit, tmp_path: Path) -> None:
    assert not unformatted(export(document_fit.sampler, "cpp", with_model=True).text, tmp_path)


def test_numbers_read_back() -> None:
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.normal(size=2000) * 10.0 ** rng.integers(-30, 30, 2000), [0, 1, -1, 1e-38, 3e38]])
    largest = np.finfo(np.float32).max
    for x in [*values.astype(np.float32), largest, -largest]:
        text = single(float(x))
        assert abs(float(text[:-1])) <= largest  # WGSL refuses a number above it, though rounding would give it
        assert text.endswith("f")
        assert "." in text or "e" in text  # a literal of C++ and of GLSL, not an integer
        assert np.float32(text[:-1]) == x
    assert max(map(len, wrapped(["1.0"] * 100, 8).splitlines())) <= 125


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize("kind", ["dual", "strand"])
def test_the_whole_material_agrees_with_python(
    kind: str,
    compiler: str,
    document_fit: cuticle.Fit,
    document_model: cuticle.DualScattering,
    strand: cuticle.Sampler,
    tmp_path: Path,
) -> None:
    sampler = document_fit.sampler if kind == "dual" else strand
    model = document_model if kind == "dual" else cuticle.Marschner(cuticle.Fibre.preset("brown"), "energy_conserving")
    channels = model.channels
    (tmp_path / "fibre.h").write_text(export(sampler, "cpp", name="hair", with_model=True).text)
    points = list(itertools.product((-1.2, 0.3), (-0.9, 0.0, 0.7), (0.2, 2.9), (0.0, 0.4, 3.0)))
    rows = ", ".join("{" + ", ".join(map(str, p)) + "}" for p in points)
    printed = compile_and_run(
        f"""#include "fibre.h"
        #include <cstdio>
        int main() {{
            const double rows[][4] = {{{rows}}};
            for (const auto &r : rows) {{
                double f[hair::channels];
                hair::eval(r[0], r[1], r[2], f, r[3]);
                for (double x : f) std::printf("%.9g ", x);
                std::printf("%.9g\\n", hair::pdf(r[0], r[1], r[2], r[3]));
            }}
        }}""",
        tmp_path,
        compiler=compiler,
    )
    got = np.array(printed.split(), float).reshape(-1, channels + 1)
    for row, (theta_i, theta_r, phi, n) in zip(got, points, strict=True):
        own = model.with_strands(n) if isinstance(model, cuticle.DualScattering) else model
        np.testing.assert_allclose(row[:-1], own.eval(theta_i, theta_r, phi), rtol=0.05, atol=2e-3)  # thinned tables
        np.testing.assert_allclose(row[-1], sampler.pdf(theta_i, theta_r, phi, n), rtol=1e-5)  # a table in single precision


def test_directions_in_every_frame(document_fit: cuticle.Fit, tmp_path: Path) -> None:
    theta_r, phi_r = np.arcsin(0.6), np.arctan2(0.64, 0.48)
    source = "#include <cstdio>\nstruct Vector { float x, y, z; };\n"
    main = ""
    tables = reduce_tables(cuticle.DualScattering(cuticle.Fibre.preset("document")))
    for i, frame in enumerate(FRAMES.values()):
        own = f"frame{i}"
        job = Job(document_fit.sampler, own, frame, list, tables, None, lambda phase, fraction: None)
        (tmp_path / f"{own}.h").write_text(host("cpp").write(job).text)
        source = f'#include "{own}.h"\n' + source
        viewer = dict(zip(frame.axes, (0.6, 0.48, 0.64), strict=True))  # along the strand, phi = 0 and phi = 90°
        made = "{" + ", ".join(f"{viewer[a]}f" for a in "xyz") + "}"
        main += f"""{{
            const Vector viewer{made};
            float pdf, f_cos[{own}::channels];
            const Vector light = {own}::sample_direction(viewer, .3f, .4f, .6f, &pdf, 2);
            {own}::eval_direction(viewer, light, f_cos, 2);
            std::printf("%.9g %.9g %.9g ", light.x, light.y, light.z);
            std::printf("%.9g %.9g %.9g ", pdf, {own}::pdf_direction(viewer, light, 2), f_cos[0]);
            const float both = {own}::eval_pdf_direction(viewer, light, f_cos, 2);
            std::printf("%.9g %.9g\\n", both, f_cos[0]);
        }}"""
    printed = compile_and_run(f"{source}int main() {{ {main} }}", tmp_path, flags=("-O0",))
    theta_i, phi, pdf = (float(v) for v in document_fit.sampler.sample(theta_r, [0.3, 0.4, 0.6], 2))
    expected = (np.sin(theta_i), np.cos(theta_i) * np.cos(phi_r + phi), np.cos(theta_i) * np.sin(phi_r + phi))
    f = cuticle.DualScattering(cuticle.Fibre.preset("document"), 2).eval(theta_i, theta_r, phi)[0]
    for line, frame in zip(printed.splitlines(), FRAMES.values(), strict=True):
        values = [float(word) for word in line.split()]
        light = dict(zip("xyz", values[:3], strict=True))
        np.testing.assert_allclose([light[a] for a in frame.axes], expected, atol=1e-5)
        np.testing.assert_allclose(values[3:5], pdf, rtol=1e-4)
        np.testing.assert_allclose(values[5], f * np.cos(theta_i), rtol=0.03)
        np.testing.assert_allclose(values[6:], [values[4], values[5]], rtol=1e-6)  # eval_pdf_direction


@pytest.mark.slow
def test_two_exports_and_the_headers_stand_side_by_side(
    document_fit: cuticle.Fit, strand: cuticle.Sampler, tmp_path: Path
) -> None:
    (tmp_path / "a.h").write_text(export(document_fit.sampler, "cpp", name="a").text)
    (tmp_path / "b.h").write_text(export(strand, "cpp", name="b", with_model=True).text)
    (tmp_path / "cuticle.h").write_text(amalgamate())
    orders = itertools.permutations(['"a.h"', '"b.h"', '"cuticle.h"', '"cuticle/cuticle.h"'])
    for order in list(orders)[::7]:
        source = (
            "".join(f"#include {name}\n" for name in order)
            + "int main() { return a::pdf(0., 0., 3.) > b::pdf(0., 0., 3.); }\n"
        )
        compile_and_run(source, tmp_path, flags=(f"-I{include_dir()}", "-O0"))


def test_another_version_is_refused(document_fit: cuticle.Fit, tmp_path: Path) -> None:
    text = export(document_fit.sampler, "cpp", name="a").text
    (tmp_path / "old.h").write_text(re.sub(r"#define CUTICLE_VERSION_MINOR \d+", "#define CUTICLE_VERSION_MINOR 999", text))
    (tmp_path / "main.cpp").write_text('#include "old.h"\n')
    done = subprocess.run(
        ["c++", "-std=c++17", "-fsyntax-only", "main.cpp"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "export it again" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize("program", ["standalone"])
def test_the_amalgamated_headers_pass_the_headers_own_tests(program: str, compiler: str, tmp_path: Path) -> None:
    (tmp_path / "cuticle").mkdir()
    (tmp_path / "cuticle/cuticle.h").write_text(amalgamate())
    source = (ROOT / f"tests/cpp/{program}.cpp").read_text()
    compile_and_run(source, tmp_path, compiler=compiler, flags=("-I.",))


def test_thinned_tables_are_small_and_close() -> None:
    for name in ("document", "black"):
        model = cuticle.DualScattering(cuticle.Fibre.preset(name))
        tables = reduce_tables(model)
        assert tables.error <= TOLERANCE
        assert tables.size < 0.2 * model.single.tables.direct.nbytes
        texels = model_texels(tables)
        rows, columns = tables.direct.shape[:2]
        flat = texels.reshape(-1, 4)[:, : model.channels]
        np.testing.assert_array_equal(flat[: 3 * rows * columns].reshape(tables.direct.shape), tables.direct)
    whole = reduce_tables(cuticle.DualScattering(cuticle.Fibre.preset("document")), tolerance=0)
    assert whole.error == 0


def test_json_reads_back(document_fit: cuticle.Fit) -> None:
    loaded = cuticle.Sampler.from_json(export(document_fit.sampler, "json").text)
    np.testing.assert_array_equal(loaded.nodes, document_fit.sampler.nodes)
    with pytest.raises(ValueError, match="json writes the sampler alone: leave --with-model out"):
        export(document_fit.sampler, "json", with_model=True)


def test_a_sampler_of_an_unknown_function_goes_without_its_model(document_fit: cuticle.Fit) -> None:
    s = document_fit.sampler
    unknown = cuticle.Sampler(s.nodes, s.energy, s.strands, s.even)
    assert "user's own" in export(unknown, "cpp").text
    with pytest.raises(ValueError, match="does not say which scattering function"):
        export(unknown, "cpp", with_model=True)


def test_the_command_writes_what_it_says(folder: Path) -> None:
    done = run("export", "sampler.json", "--to", "cuda", "--frame", "pbrt", "-o", "my-hair.cuh", cwd=folder)
    assert done.returncode == 0, done.stderr
    text = (folder / "my-hair.cuh").read_text()
    assert "namespace my_hair {" in text
    assert "__global__" in text
    done = run("export", ".", "--to", "glsl", "--with-model", "--name", "hair", "-o", "hair.glsl", cwd=folder)
    assert done.returncode == 0, done.stderr
    values = np.fromfile(folder / "hair.f32", "<f4")
    assert values.size % (1024 * 4) == 0
    assert "hair.f32" in done.stdout
    done = run("export", "--amalgamate", "-o", "cuticle.h", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "cuticle.h").read_text() == amalgamate()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["sampler.json", "--to", "rust", "-o", "x.rs"], f"{', '.join(HOSTS)};"),
        (["sampler.json", "-o", "x.h"], "--to must say for which host"),
        (["sampler.json", "--to", "cpp", "-o", "missing/x.h"], "cannot write to missing"),
        (["sampler.json", "--to", "cpp", "-o", "."], "it is a folder"),
        (["sampler.json", "--to", "cpp", "--frame", "blender", "-o", "x.h"], "frame must be one of pbrt, mitsuba"),
        (["sampler.json", "--to", "cpp", "--name", "2fast", "-o", "x.h"], "name must be letters"),
        (["sampler.json", "--to", "glsl", "--name", "a__b", "-o", "x.h"], "single underscores"),
        (["sampler.json", "--to", "glsl", "--name", "a_", "-o", "x.h"], "not end in an underscore"),
        (["sampler.json", "--to", "cpp", "--name", "int", "-o", "x.h"], "a word that cpp keeps for itself, got 'int'"),
        (["sampler.json", "--to", "cpp", "--name", "exp", "-o", "x.h"], "a word that cpp keeps for itself"),
        (["sampler.json", "--to", "cpp", "--name", "M_PI", "-o", "x.h"], "not begin with M_, which cpp keeps"),
        (["sampler.json", "--to", "cuda", "--name", "threadIdx", "-o", "x.h"], "a word that cuda keeps for itself"),
        (["sampler.json", "--to", "pbrt", "--name", "hair", "-o", "x"], "a word that pbrt keeps for itself, got 'hair'"),
        (["sampler.json", "--to", "glsl", "--name", "gl_x", "-o", "x.glsl"], "not begin with gl_, which glsl keeps"),
        (["sampler.json", "--to", "glsl", "--name", "sampler2D", "-o", "x.glsl"], "a word that glsl keeps"),
        (["sampler.json", "--to", "hlsl", "--name", "float4", "-o", "x.hlsl"], "a word that hlsl keeps"),
        (["sampler.json", "--to", "json", "--name", "a", "-o", "x.json"], "--name does nothing with --to json"),
        (["sampler.json", "--to", "web", "--frame", "pbrt", "-o", "x.html"], "--frame does nothing with --to web"),
        (["--amalgamate", "--to", "cpp", "-o", "x.h"], "--to does nothing with --amalgamate"),
        (["sampler.json", "--to", "glsl", "--with-model", "-o", "x.F32"], "a name of its own"),
        (["nowhere.json", "--to", "cpp", "-o", "x.h"], "cannot read sampler nowhere.json"),
        (["newer.json", "--to", "cpp", "-o", "x.h"], "newer than 1; upgrade cuticle"),
        (["short.json", "--to", "cpp", "-o", "x.h"], "it ends early"),
        (["sampler.json", "--amalgamate", "-o", "x.h"], "give one of a sampler with --to HOST"),
        (["-o", "x.h"], "give one of a sampler with --to HOST"),
        (["--family", "chiang", "--amalgamate", "-o", "x.h"], "give one of a sampler with --to HOST"),
        (["--family", "kajiya", "--to", "cpp", "-o", "x.h"], "one of chiang, marschner, dual_scattering; got 'kajiya'"),
        (["--family", "dual_scattering", "--to", "cpp", "-o", "x.h"], "needs --among, the mean fibre of the strands around"),
        (
            ["--family", "dual_scattering", "--among", "brown", "--to", "pbrt", "-o", "x"],
            "pbrt takes the family chiang, got 'dual_scattering'; --to cpp takes any",
        ),
        (
            ["--family", "dual_scattering", "--among", "brown", "--to", "glsl", "-o", "x.f32"],
            "--family dual_scattering writes two files, a text and its texture, x.f32: the text needs a name of its own",
        ),
        (["--family", "dual_scattering", "--among", "x.npz", "--to", "cpp", "-o", "x.h"], "x.npz"),
        (["--family", "dual_scattering", "--among", "grey", "--to", "cpp", "-o", "x.h"], "must be a preset ("),
        (["--family", "chiang", "--among", "brown", "--to", "cpp", "-o", "x.h"], "--among does nothing without --family"),
        (["--family", "chiang", "--to", "web", "-o", "x.h"], "glsl, hlsl, metal, pbrt, slang, wgsl; got 'web'"),
        (["--family", "marschner", "--to", "pbrt", "-o", "x"], "pbrt takes the family chiang"),
        (["--family", "chiang", "--to", "cpp", "--with-model", "-o", "x.h"], "--with-model does nothing with --family"),
        (["sampler.json", "--to", "json", "--with-model", "-o", "x.json"], "leave --with-model out"),
    ],
)  # fmt: skip
def test_one_line_and_no_file_for_what_is_wrong(arguments: list[str], words: str, folder: Path) -> None:
    text = (folder / "sampler.json").read_text()
    (folder / "newer.json").write_text(text.replace('"version": 1', '"version": 2'))
    (folder / "short.json").write_text(text[: len(text) // 2])
    refused("export", *arguments, words=words, cwd=folder)


def test_a_family_is_written_by_the_command(folder: Path) -> None:
    run("export", "--family", "marschner", "--to", "glsl", "--frame", "mitsuba", "-o", "any.glsl", cwd=folder)
    written = (folder / "any.glsl").read_text()
    assert written == export_family("marschner", "glsl", frame="mitsuba", name="any").text
    assert "the strand along y" in written
    run("export", "--family", "dual_scattering", "--among", "brown", "--to", "cuda", "-o", "any.h", cwd=folder)
    mean = cuticle.Fibre.preset("brown")
    assert (folder / "any.h").read_text() == export_family("dual_scattering", "cuda", name="any", among=mean).text
    shown = run("export", "--family", "dual_scattering", "--among", "brown", "--to", "hlsl", "-o", "hair.hlsl", cwd=folder)
    made = export_family("dual_scattering", "hlsl", name="hair", among=mean)
    assert ((folder / "hair.hlsl").read_text(), (folder / "hair.f32").read_bytes()) == (made.text, made.data)
    assert len(made.data) <= 256 * 1024
    assert "hair.f32, the texture it reads" in shown.stdout
    done = run("export", "--family", "chiang", "--to", "pbrt", "--name", "mine", "-o", "other.h", cwd=folder)
    assert "class MineHairBxDF;" in done.stdout
    assert "#include <pbrt/other.h>" in done.stdout


# The headers where pip and CMake put them.


@pytest.mark.slow
def test_python_says_where_the_headers_lie() -> None:
    for option, expected in (("--include-dir", include_dir()), ("--cmake-dir", cmake_dir())):
        done = subprocess.run([sys.executable, "-m", "cuticle", option], capture_output=True, text=True, check=True)
        assert Path(done.stdout.strip()) == expected
    assert (include_dir() / "cuticle/cuticle.h").exists()
    assert (cmake_dir() / "cuticleConfig.cmake").exists()
    done = subprocess.run([sys.executable, "-m", "cuticle", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == cuticle.__version__
