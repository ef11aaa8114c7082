"""Families in every host: f, its density and samples of random fibres, against the core in double precision."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from conformance import hosts
from conformance.cuda_compiler import by_hipcc, by_nvrtc
from conformance.dxc import compile_hlsl
from cuticle.export import export_family
from cuticle.export.literals import singles
from cuticle.export.registry import Export
from cuticle.scattering.any_fibre import Fibres

FIBRES = 16
PROGRAM = "replay_family.cpp"
# A density's relative error in single precision: exponents of 2/v times half an angle squared, with v of .05 or more.
SINGLE = dict(rtol=5e-3, atol=2e-5)


AMONG = {  # forms of a strand among those of a mean fibre, counted or random, whose mean says how its own are written
    "among marschner": cuticle.Fibre(alpha_R=-5, beta_R=6, beta_N=12, sigma_a=(0.1, 0.3, 1.0), d_f=0.8, d_b=0.9),
    "among chiang": cuticle.Chiang(beta_m=0.3, beta_n=0.4, sigma_a=(0.1, 0.3, 1.0)),
}
BEHIND = {"among marschner": {}, "among chiang": {"behind": 2.5, "random": True}}
FORMS = ["chiang", "marschner", *AMONG]
SHADERS = ("glsl", "hlsl", "metal", "slang", "wgsl")
Rows = slice | np.ndarray  # of the cases
EVERY, FEW = slice(None), slice(None, None, 10)  # a tenth is enough to see a wrong number
# A number and what it becomes, by host: of the cells' edges, and of asin's polynomial.
WRONG = {
    "cells": {to: ("(0.7853982", "(0.7753982") for to in SHADERS}
    | {to: ("1 - double(j) / tt_cells", "1 - double(j) / (tt_cells + 1)") for to in ("cpp", "cuda")},
    "asin": {to: ("0.0501743046", "0.0601743046") for to in SHADERS}
    | {to: ("-.0501743046f", "-.0601743046f") for to in ("cpp", "cuda")},
}


@cache
def family_of(form: str) -> cuticle.Family:
    """The family; tables of strands around in the numbers that files have."""
    if form not in AMONG:
        return cuticle.family(form)
    made = cuticle.family(
        "dual_scattering", AMONG[form], **{name: np.float32(getattr(AMONG[form], name, 1.0)) for name in ("d_f", "d_b")}
    )
    assert isinstance(made, cuticle.FamilyAmong)
    vars(made)["around"] = made.around._make(np.float32(x).astype(float) for x in made.around)
    return made


def exported(form: str, to: str) -> Export:
    among = family_of(form)
    return export_family(*("dual_scattering", to) if form in AMONG else (form, to), among=among if form in AMONG else None)


def around(form: str, rows: Rows = EVERY) -> dict[str, Any]:
    return {"strands": cases()[rows, 7], **BEHIND[form]} if form in AMONG else {}


@cache
def fibres(form: str) -> Fibres:
    """Fibres all over the box, in numbers that single precision holds."""
    rng = np.random.default_rng(11)
    family = family_of(form)
    values: dict[str, Any] = {
        name: rng.uniform(max(p.low, 3.0 if p.unit and name[0] == "b" else 0.1), min(p.high, 15.0), FIBRES)
        if name != "eta" else rng.uniform(1.3, 1.8, FIBRES)
        for name, p in family.parameters.items()
    }  # fmt: skip
    made = family.fibres(**values, sigma_a=10 ** rng.uniform(-2, 1.3, (FIBRES, 3)))
    return Fibres(family.form, *(x.astype(np.float32).astype(float) for x in (made.parameters, made.sigma_a)))


@cache
def cases() -> np.ndarray:
    """(theta_i, theta_r, phi, fibre, u, u, u, strands around); with whole turns and both ends of the random numbers."""
    rng = np.random.default_rng(12)
    x = rng.random((4000, 8))
    x[:, :2] = (x[:, :2] - 0.5) * np.radians(178)
    x[:, 2] = (x[:, 2] - 0.5) * 4 * np.pi
    x[:, 3] = rng.integers(0, FIBRES, len(x))
    x[:, 7] = rng.choice([0, 0.25, 1, 2, 5.5, 20], len(x))
    x[:40, 2] = np.tile([-np.pi, 0, np.pi - 1e-6, 2 * np.pi], 10)
    x[40:80, 4:7] = rng.choice([0, 1 - 2.0**-24], (40, 3))
    return x.astype(np.float32).astype(float)


def own_fibres(form: str, rows: Rows = EVERY) -> Fibres:
    k = cases()[rows, 3].astype(int)
    return Fibres(fibres(form).form, fibres(form).parameters[k], fibres(form).sigma_a[k])


@cache
def expected(form: str, dtype: Any) -> tuple[np.ndarray, np.ndarray]:
    """(f, density) of the directions in double precision, and (theta_i, phi, pdf) of the samples.

    Those in a host's own precision: the lower half of a random number's digits turns a direction about its axis.
    """
    x, own = cases(), own_fibres(form)
    family = family_of(form)
    f, p = family.eval_pdf(*np.ascontiguousarray(x[:, :3].T), own, **around(form))
    return np.concatenate([f, p[:, None]], axis=1), np.stack(
        family.sample(x[:, 1].astype(dtype), x[:, 4:7].astype(dtype), own, **around(form)), axis=1
    )


def write_fibres(form: str, folder: Path) -> None:
    """The fibres, as the replayed program includes them."""
    rows = []
    for p, s in zip(fibres(form).parameters, fibres(form).sigma_a, strict=True):
        numbers = singles(p)
        groups = (
            numbers
            if form.endswith("chiang")
            else ["{" + ", ".join(g) + "}" for g in (numbers[:3], numbers[3:6])] + numbers[6:]
        )
        rows.append(f"{{{', '.join(groups)}, {{{', '.join(singles(s))}}}}}")
    prepare = "fibre::prepare(r, f)"
    if form in AMONG:
        more = f", {BEHIND[form]['behind']}, true" if BEHIND[form] else ""
        prepare = f"fibre::prepare_among(r, f, n{more})"
    (folder / "fibres.h").write_text(
        f"#define PREPARE(r, f, n) {prepare}\n"
        "CUTICLE_HD inline fibre::Fibre<REAL> fibre_of(int k) {\n"
        f" const fibre::Fibre<REAL> all[] = {{{', '.join(rows)}}};\n return all[k];\n}}\n"
    )


def cpp(
    form: str, folder: Path, precision: str = "float", made: Export | None = None, rows: Rows = EVERY, compiler: str = "g++"
) -> np.ndarray:
    write_fibres(form, folder)
    return hosts.cpp(
        made or exported(form, "cpp"), cases()[rows], folder, compiler=compiler, precision=precision, program=PROGRAM
    )


def cuda(form: str, folder: Path, made: Export | None = None, rows: Rows = EVERY) -> np.ndarray:
    write_fibres(form, folder)
    return hosts.cuda(made or exported(form, "cuda"), cases()[rows], folder, program=PROGRAM)


def answered(form: str, to: str, folder: Path, browser: Any, made: Export, rows: Rows) -> np.ndarray:
    """By any host."""
    if to in ("cpp", "cuda"):
        return cpp(form, folder, made=made, rows=rows) if to == "cpp" else cuda(form, folder, made, rows)
    return shaded(form, to, folder, browser, made, rows)


def shaded(form: str, to: str, folder: Path, browser: Any, made: Export | None = None, rows: Rows = EVERY) -> np.ndarray:
    """Both of a shader's functions, each an answer of four numbers."""
    made, x = made or exported(form, to), cases()[rows]
    one, three, four, whole = {
        "glsl": ("float", "vec3", "vec4", "int"), "wgsl": ("f32", "vec3<f32>", "vec4<f32>", "i32")
    }.get(to, ("float", "float3", "float4", "int"))  # fmt: skip
    reads = form in AMONG and to == "metal"  # the texture is an argument
    texture, given = ({"model_": "FIBRE_TEXTURE"}, ", model_") if reads else ({}, "")

    def function(result: str, name: str, parameters: dict[str, str], body: str) -> str:
        if to == "wgsl":
            return f"fn {name}({', '.join(f'{n}: {t}' for n, t in parameters.items())}) -> {result} {{\n{body}\n}}\n"
        return f"{result} {name}({', '.join(f'{t} {n}' for n, t in parameters.items())}) {{\n{body}\n}}\n"

    suffix = "f" if to == "metal" else ""
    kinds = [one] * 4 if form.endswith("chiang") else [three, three, one, one]
    kinds.append(three)
    choices = []
    for k, (p, s) in enumerate(zip(fibres(form).parameters, fibres(form).sigma_a, strict=True)):
        numbers = singles(p, suffix)
        groups = numbers
        if form.endswith("marschner"):
            groups = [f"{three}({', '.join(g)})" for g in (numbers[:3], numbers[3:6])] + numbers[6:]
        groups = [*groups, f"{three}({', '.join(singles(s, suffix))})"]
        choices.append(f"if (k == {k}) {{ {' '.join(f'p{i} = {g};' for i, g in enumerate(groups))} }}")
    begin = [
        f"{'var' if to == 'wgsl' else kind} p{i} = {kind}(0.0{', 0.0, 0.0' * (kind == three)});"
        for i, kind in enumerate(kinds)
    ]
    prepare, more = "prepare_fibre", ", n" if form in AMONG else ""
    if BEHIND.get(form):
        prepare, more = "prepare_among", f", n, {BEHIND[form]['behind']}{suffix}, true"
    body = "\n".join([*begin, *choices, f"return fibre_{prepare}(theta_r, p0, p1, p2, p3, p4{more}{given});"])
    text = made.text + "\n"
    text += function("FIBRE_Field", "field_of", {"k": whole, "theta_r": one, "n": one, **texture}, body)
    text += function(four, "drawn", {"d": "FIBRE_Drawn"}, f"return {four}(d.theta_i, d.phi, d.pdf, 0.0);")
    given = given.replace("model_", "model")
    field = f"field_of({whole}(a.w + 0.5{suffix}), a.y, u.w{given})"
    answers = [
        f"fibre_prepared_eval({field}, a.x, a.z{given})", f"drawn(fibre_prepared_sample({field}, u.xyz{given}))"
    ]  # fmt: skip
    made = Export(text, 0, made.data)
    if to == "slang":
        got = [hosts.shaded_slang(text, made, x, answer) for answer in answers]
    elif to == "metal":
        got = [hosts.shaded_metal(text, made, x, folder, answer) for answer in answers]
    else:
        run_in = {"glsl": hosts.shaded, "hlsl": hosts.shaded_hlsl, "wgsl": hosts.shaded_wgsl}[to]
        got = [run_in(text, made, x, folder, browser, asked=answer) for answer in answers]
    return np.concatenate([got[0], got[1][:, :3]], axis=1)


def compare(form: str, got: np.ndarray, rtol: float, atol: float, dtype: Any = np.float32, rows: Rows = EVERY) -> None:
    turned, tilted = (5e-3, 2e-2) if dtype == np.float32 else (1e-6, 1e-6)
    (values, drawn), x = (e[rows] for e in expected(form, dtype)), cases()[rows]
    size = np.concatenate([np.tile(1 / np.cos(x[:, :1]), 3), np.ones((len(values), 1))], axis=1)  # f grows as 1/cos
    size *= (values / size).max(0)
    np.testing.assert_allclose(got[:, :4] / size, values / size, rtol=rtol, atol=atol)
    # Where a number falls on a border between lobes or cells, a host may take the other: of 4,000, a handful.
    wrapped = np.angle(np.exp(1j * (got[:, 5] - drawn[:, 1])))
    assert np.mean(np.abs(wrapped) < turned) > 0.995
    # The lower digits of a number are off by 2048 times its rounding, over the chance of its lobe.
    assert np.mean(np.abs(got[:, 4] - drawn[:, 0]) < tilted) > 0.99
    theta_i = np.clip(got[:, 4], -np.pi / 2, np.pi / 2)  # the right angle in single precision is past it
    _, p = family_of(form).eval_pdf(theta_i, x[:, 1], got[:, 5], own_fibres(form, rows), **around(form, rows))
    np.testing.assert_allclose(got[:, 6], p, rtol=rtol, atol=atol * values[:, 3].max())


@pytest.mark.parametrize("form", FORMS)
def test_a_family_in_cpp(form: str, tmp_path: Path) -> None:
    compare(form, right_one(form, "cpp", tmp_path, None), **SINGLE)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_family_on_arm(form: str, tmp_path: Path) -> None:
    compare(form, cpp(form, tmp_path, compiler=hosts.ARM), **SINGLE)


@pytest.mark.parametrize("form", [*FORMS[:-1], pytest.param(FORMS[-1], marks=pytest.mark.slow)])
def test_a_family_in_double_precision(form: str, tmp_path: Path) -> None:
    got = cpp(form, tmp_path, "double")
    compare(form, got, 1e-6, 1e-9, np.float64)
    weight = got[:, 7:] @ [0.2126, 0.7152, 0.0722] * np.cos(got[:, 4]) / got[:, 6]
    # The albedo, or what others send besides: at most twice.
    assert np.all((weight > 0) & (weight <= (2 if form in AMONG else 1) + 1e-6))


@pytest.mark.parametrize(("to", "form"), [
    pytest.param(to, form, marks=() if to == "glsl" or form == "chiang" else pytest.mark.slow)
    for to in ("glsl", "hlsl", "metal", "slang", "wgsl") for form in FORMS
])  # fmt: skip
def test_a_family_in_a_shader(form: str, to: str, browser: Any, tmp_path: Path) -> None:
    compare(form, right_one(form, to, tmp_path, browser), **SINGLE)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_family_in_wgsl_by_another_compiler(form: str, tmp_path: Path) -> None:
    compare(form, shaded(form, "wgsl", tmp_path, None), **SINGLE)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("version", ["300 es", "330", "460", "460, Vulkan"])
def test_a_familys_glsl_validates(form: str, version: str, tmp_path: Path) -> None:
    """By a strict front end: browsers take words for names that other versions reserve."""
    hosts.need("glslangValidator", "glslang-tools")
    head = f"#version {version.split(',')[0]}\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n"
    main = "layout(location = 0) out vec4 color;\nvoid main() { color = vec4(1.); }\n"
    (tmp_path / "shader.frag").write_text(head + exported(form, "glsl").text + main)
    command = ["glslangValidator", *(["-V"] if "Vulkan" in version else []), "shader.frag"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("compiler", [by_nvrtc, by_hipcc])
def test_another_compiler_takes_a_familys_cuda(form: str, compiler: Any, tmp_path: Path) -> None:
    """Without a warning, all of it in one kernel; NVRTC, without a host's standard library."""
    prepare, more = ("prepare_direction_among", ", x[7]") if form in AMONG else ("prepare_direction", "")
    kernel = f"""
struct V {{ float x, y, z; }};
extern "C" __global__ void kernel(float *x) {{
    float f[3];
    const V viewer{{x[0], x[1], x[2]}};
    const auto s = fibre::{prepare}(viewer, fibre::Fibre<float>{{}}{more});
    const V light = fibre::sample_direction(s, viewer, x[3], x[4], x[5], f, x + 6);
    x[8] = fibre::eval_pdf_direction(s, viewer, light, f);
}}
"""
    compiled, said = compiler(exported(form, "cuda").text + kernel, tmp_path)
    assert not said
    assert b"kernel" in compiled


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("model", [("-T", "lib_6_3"), ("-T", "lib_6_6", "-HV", "2021")])
def test_dxc_takes_a_familys_hlsl(form: str, model: tuple[str, ...]) -> None:
    """Without a warning: every function of it, as a library for ray tracing."""
    unsigned = "-Vd"  # what signs it is not here
    compiled, said = compile_hlsl(exported(form, "hlsl").text, *model, "-default-linkage", "external", unsigned)
    assert not said
    assert compiled


@pytest.mark.parametrize("form", FORMS)
def test_a_family_in_cuda(form: str, tmp_path: Path) -> None:
    compare(form, cuda(form, tmp_path), **SINGLE)


# ---- What has to be caught. ----


ANSWERS: dict[tuple[str, str], np.ndarray] = {}


def right_one(form: str, to: str, folder: Path, browser: Any) -> np.ndarray:
    """What a host answers to every case by its export as it is; asked once."""
    if (form, to) not in ANSWERS:
        ANSWERS[form, to] = answered(form, to, folder, browser, exported(form, to), EVERY)
    return ANSWERS[form, to]


def judge_wrong_ones(form: str, to: str, wrong: dict[str, Export], browser: Any, folder: Path, rows: Rows = FEW) -> None:
    """Of few cases: as it is exported, a host passes; with each wrong number it runs, and is caught."""
    compare(form, right_one(form, to, folder, browser)[rows], rows=rows, **SINGLE)
    for made in wrong.values():
        got = answered(form, to, folder, browser, made, rows)
        with pytest.raises(AssertionError):
            compare(form, got, rows=rows, **SINGLE)


def with_wrong(made: Export, right: str, wrong: str) -> Export:
    """The export with a number of its text replaced, which is there once."""
    assert made.text.count(right) == 1
    return Export(made.text.replace(right, wrong), made.table_bytes, made.data)


@pytest.mark.parametrize(("to", "number"), [
    pytest.param(to, number, marks=() if (to, number) in (("cpp", "asin"), ("glsl", "cells")) else pytest.mark.slow)
    for to in ("cpp", "cuda", *SHADERS) for number in WRONG
])  # fmt: skip
def test_a_wrong_number_is_caught(to: str, number: str, browser: Any, tmp_path: Path) -> None:
    made = exported("chiang", to)
    judge_wrong_ones("chiang", to, {number: with_wrong(made, *WRONG[number][to])}, browser, tmp_path)


BOTH = ("energy", "variance")
SHORT = ("glsl", "among marschner")  # of which one number is in `make test`


@pytest.mark.parametrize(("to", "form", "numbers"), [
    (*SHORT, BOTH[:1]),
    pytest.param(*SHORT, BOTH[1:], marks=pytest.mark.slow),
    *(
        pytest.param(to, form, BOTH, marks=pytest.mark.slow)
        for to in ("cpp", "cuda", *SHADERS) for form in AMONG if (to, form) != SHORT
    ),
])  # fmt: skip
def test_a_wrong_number_of_the_strands_around_is_caught(
    form: str, to: str, numbers: tuple[str, ...], browser: Any, tmp_path: Path
) -> None:
    """An energy through two strands in the tables, and a variance of the mean's in the text."""
    made, tables = exported(form, to), family_of(form).around  # type: ignore[attr-defined]
    variance = singles(tables.variance, "")[0]
    wrong = {"variance": with_wrong(made, variance, f"{1.2 * float(variance)!r}")}
    rows = tables.energy.shape[2]
    # TT's ln of energy in red light, at the middle rows: of the nodes of counted or random strands the third is of two.
    first = ((bool(BEHIND[form]) * 6 + 2) * rows + rows // 2 - 1) * 6
    texels = np.frombuffer(exported(form, "glsl").data, np.float32).reshape(-1, 4).copy()
    if made.data:
        texels[[first, first + 6], 1] += 0.1
        wrong["energy"] = Export(made.text, made.table_bytes, texels.tobytes())
    else:
        wrong["energy"] = made
        for right in singles(texels[[first, first + 6], 1], ""):
            wrong["energy"] = with_wrong(wrong["energy"], right, f"{float(right) + 0.1!r}")
    near = np.argsort(np.abs(cases()[:, 7] - 2) + np.abs(cases()[:, 1]))[:400]  # two strands, the middle rows
    judge_wrong_ones(form, to, {n: wrong[n] for n in numbers}, browser, tmp_path, near)
