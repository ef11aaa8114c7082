"""MaterialX's own text: the defaults of its library, and f of its GLSL, compiled as C++, beside ours."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import special

from cuticle import Chiang, conventions
from cuticle.reference import Submission, check
from cuticle.reference.cases import draw

LIBRARY = (
    Path(pytest.importorskip("MaterialX", reason="materialx is not installed").__file__).parent / "libraries" / "pbrlib"
)
# What of GLSL and of MaterialX's library its text needs.
AROUND = r"""
#include <cmath>
#include <cstdio>
#include <algorithm>
using std::max; using std::min; using std::isinf;
struct vec2 { float x, y; vec2(float a = 0, float b = 0) : x(a), y(b) {} };
struct vec3 { float x, y, z; vec3(float a) : x(a), y(a), z(a) {} vec3(float a, float b, float c) : x(a), y(b), z(c) {}
              vec3() : vec3(0.f) {} };
#define EACH(op) vec3 operator op(vec3 a, vec3 b) { return {a.x op b.x, a.y op b.y, a.z op b.z}; }
EACH(+) EACH(-) EACH(*) EACH(/)
void operator+=(vec3 &a, vec3 b) { a = a + b; }
vec3 operator-(vec3 a) { return {-a.x, -a.y, -a.z}; }
#define CALL(f) float f(float x) { return std::f(x); } vec3 f(vec3 a) { return {f(a.x), f(a.y), f(a.z)}; }
namespace glsl { CALL(exp) CALL(log)
vec3 max(vec3 a, vec3 b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }
vec3 min(vec3 a, vec3 b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
float max(float a, float b) { return std::max(a, b); } float min(float a, float b) { return std::min(a, b); }
float clamp(float x, float a, float b) { return min(max(x, a), b); }
vec2 clamp(vec2 v, float a, float b) { return {clamp(v.x, a, b), clamp(v.y, a, b)}; }
float dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
vec3 cross(vec3 a, vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
vec3 normalize(vec3 a) { return a / std::sqrt(dot(a, a)); }
const float M_PI_ = 3.14159265f, M_PI_INV = 1 / M_PI_, M_FLOAT_EPS = 1e-6f; const int CLOSURE_TYPE_REFLECTION = 1;
struct ClosureData { int closureType; vec3 L, V; float occlusion; }; struct BSDF { vec3 response, throughput; };
vec3 mx_forward_facing_normal(vec3 N, vec3 V) { return dot(N, V) < 0 ? -N : N; }
float mx_atan(float y, float x) { return std::atan2(y, x); }
float mx_fresnel_dielectric(float c, float n) {
    const float g = std::sqrt(n * n + c * c - 1), s = (g - c) / (g + c), t = ((g + c) * c - 1) / ((g - c) * c + 1);
    return .5f * s * s * (1 + t * t);
}
using std::sin; using std::cos; using std::asin; using std::sqrt; using std::pow; using std::sinh;
#undef M_PI
#define M_PI M_PI_
#include "materialx.h"
}
using namespace glsl;
int main(int argc, char **) {
    if (argc > 1) {  // absorption, of a colour and a roughness, and of melanin and redness
        vec3 color, sigma, eumelanin, pheomelanin;
        float roughness, melanin, redness;
        while (std::scanf("%f %f %f %f", &color.x, &color.y, &color.z, &roughness) == 4) {
            mx_chiang_hair_absorption_from_color(color, roughness, sigma);
            std::printf("%.9g %.9g %.9g\n", sigma.x, sigma.y, sigma.z);
            melanin = color.x; redness = color.y;
            mx_deon_hair_absorption_from_melanin(melanin, redness, vec3(.657704f, .498077f, .254106f),
                                                 vec3(.829443f, .670320f, .349937f), sigma);
            std::printf("%.9g %.9g %.9g\n", sigma.x, sigma.y, sigma.z);
        }
        return 0;
    }
    float m, n, eta, tilt, theta_i, theta_r, psi_i, psi_r; vec3 sigma, f;
    while (std::scanf("%f %f %f %f %f %f %f %f %f %f %f", &m, &n, &eta, &tilt, &sigma.x, &sigma.y, &sigma.z, &theta_i,
                      &theta_r, &psi_i, &psi_r) == 11) {
        const auto along = [](float t, float p) {
            return vec3(std::sin(t), std::cos(t) * std::cos(p), std::cos(t) * std::sin(p));
        };
        vec2 R, TT, TRT; BSDF out;
        mx_chiang_hair_roughness(m, n, .5f, 2.f, R, TT, TRT);
        const ClosureData at{1, along(theta_i, psi_i), along(theta_r, psi_r), 1.f};
        mx_chiang_hair_bsdf(at, 1.f, 1.f, 1.f, eta, R, TT, TRT, tilt, sigma, vec3(0, 0, 1), vec3(1, 0, 0), out);
        std::printf("%.9g %.9g %.9g\n", out.response.x, out.response.y, out.response.z);
    }
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("materialx")
    text = (LIBRARY / "genglsl" / "mx_chiang_hair_bsdf.glsl").read_text()
    text = text[: text.index("    else if (closureData.closureType == CLOSURE_TYPE_INDIRECT)")] + "}\n"
    text = re.sub(r"#include .*", "", text)
    text = re.sub(r"\b(?:in)?out (\w+) (\w+)(\[\d+\])?", lambda m: f"{m[1]} {'' if m[3] else '&'}{m[2]}{m[3] or ''}", text)
    (folder / "materialx.h").write_text(text)
    (folder / "main.cpp").write_text(AROUND)
    try:
        subprocess.run(["g++", "-std=c++17", "-O1", "-o", "main", "main.cpp"], cwd=folder, check=True)
    except FileNotFoundError:
        pytest.skip("g++ is not installed")
    return folder / "main"


def answers(program: Path, *columns: np.ndarray, mode: tuple[str, ...] = ()) -> np.ndarray:
    rows = [" ".join(map(repr, map(float, x))) for x in np.column_stack(np.broadcast_arrays(*columns))]
    done = subprocess.run([str(program), *mode], input="\n".join(rows), capture_output=True, text=True, check=True)
    return np.array(done.stdout.split(), float).reshape(-1, 3)


def said(program: Path, *columns: np.ndarray) -> np.ndarray:
    """Return π times its response: f cos(theta_i), of longitudinal, azimuthal, ior, cuticle angle, absorption, angles."""
    return np.pi * answers(program, *columns)


def bessel(x: np.ndarray) -> np.ndarray:
    """exp(-x) I0(x) as MaterialX 1.39.5 has it."""
    series = sum((x * x / 4) ** i / special.factorial(i) ** 2 for i in range(10)) * np.exp(-x)
    return np.where(x > 12, np.exp(0.5 * (np.log(1 / (2 * np.pi * np.maximum(x, 1))) + 1 / (8 * np.maximum(x, 1)))), series)


@pytest.mark.parametrize(
    "given",
    [
        {"longitudinal": 0.3},
        {"azimuthal": 0.6},
        {"longitudinal": 0.2, "cuticle_angle": 0.52},
        {"longitudinal": 0.2, "ior": 1.4, "absorption_coefficient": (0.2, 0.5, 1.1)},
        {"longitudinal": 0.2, "color": (0.4, 0.2, 0.0005), "azimuthal_roughness": 0.5},
        {"longitudinal": 0.2, "melanin_concentration": 0.6},
    ],
    ids=str,
)
def test_f_is_that_of_materialxs_glsl(given: dict[str, Any], program: Path) -> None:
    """f cos(theta_i), but for its Bessel function, 1/pi, orders past TRT, and the angle that the tilt rotates."""
    rng = np.random.default_rng(5)
    ti, psi_i = rng.uniform(-1.4, 1.4, 400), rng.uniform(-np.pi, np.pi, 400)
    tr, psi_r = rng.uniform(-1.2, 1.2, 400), rng.uniform(0.1, 3.0, 400)
    found = conventions.from_host("materialx", **given)
    model = Chiang(**found)
    own = {**conventions.HOSTS["materialx"].defaults, **given}
    scene = [own["longitudinal"], own["azimuthal"], own["ior"], own["cuticle_angle"], *model.absorption]
    theirs = said(program, *np.array(scene)[:, None], ti, tr, psi_i, psi_r)
    near, phi = model.near(np.cos(psi_r)), psi_r - psi_i  # its binormal is our -s: azimuths turn the other way
    ours = np.zeros_like(theirs)
    for part, tilt, v in zip(("R", "TT", "TRT", "rest"), model.tilt, model.variance, strict=True):
        # M at (theta_i - tilt, theta_r) in place of (theta_i, theta_r - tilt), tilt being where R's axis moves.
        mine, other = np.cos(ti) * np.cos(tilt - tr) / v, np.abs(np.cos(ti - tilt) * np.cos(tr)) / v
        rotated = (np.sin(ti) * np.sin(tr - tilt) - np.sin(ti - tilt) * np.sin(tr)) / v + other - mine
        factor = np.cos(ti) * np.exp(rotated) * bessel(other) / special.i0e(mine) * (np.pi**2 if part == "rest" else 1)
        ours += near.eval(ti, tr, np.angle(np.exp(1j * phi)), lobes=part) * factor[:, None]
    seen = ours.max(axis=1) > 1e-6
    assert seen.sum() > 100
    assert np.abs(theirs[seen] / ours[seen] - 1).max() <= 2e-3  # single precision; .6931 for ln 2


def test_absorption_is_that_of_materialxs_glsl(program: Path) -> None:
    """Of a colour at a roughness, by Chiang's polynomial; and of melanin and redness."""
    rng = np.random.default_rng(6)
    given = np.column_stack([rng.uniform(0.002, 0.999, (40, 3)), rng.uniform(0.05, 1, 40)])
    theirs = answers(program, *given.T, mode=("absorption",))
    for (*color, roughness), of_color, of_melanin in zip(given, theirs[::2], theirs[1::2], strict=True):
        found = Chiang(**conventions.from_host("materialx", color=tuple(color), azimuthal_roughness=roughness))
        np.testing.assert_allclose(found.absorption, of_color, rtol=1e-4)
        melanin = {"melanin_concentration": color[0], "melanin_redness": color[1]}
        np.testing.assert_allclose(Chiang(**conventions.from_host("materialx", **melanin)).absorption, of_melanin, rtol=1e-4)


def test_the_reference_names_its_slips(program: Path) -> None:
    pytest.importorskip("flint", reason="python-flint is not installed: pip install 'cuticle[reference]'")
    inputs = draw("chiang", 1000, 3, near=True, longitudinal="")
    # Its cosines are of sines in single precision, so near the poles they are rounded; where the tilt turns the light past a
    # pole they are negative, and large ones of log I0 go to the series.
    turned = np.abs(inputs.columns["theta_i"]) + np.radians(4 * np.abs(inputs.columns["alpha"]))
    inputs = inputs.take((turned < 1.5) & (np.abs(inputs.columns["theta_r"]) < 1.4))
    c = inputs.columns
    psi_r = np.arccos(c["h"])
    theirs = said(
        program, c["beta_m"], c["beta_n"], c["eta"], 0.5 + c["alpha"] / 180, *inputs.sigma_a.T,
        c["theta_i"], c["theta_r"], psi_r - c["phi"], psi_r,
    ) / np.cos(c["theta_i"])[:, None]  # fmt: skip
    number = np.arange(1, len(inputs) + 1)
    found = check(Submission("materialx", inputs, theirs, np.full(len(inputs), np.nan), {"f": True, "pdf": True}, number))
    assert not found.ok
    assert set(found.slips) == {"tilt-of-the-light", "rest-half-pi", "widths-clamped", "log-i0-16x", "i0-10-terms"}
    # From where widths stop growing, as docs/reference.md says: v of TRT, v of R, and s are 1.
    stops = [conventions.longitudinal_roughness(v) for v in (0.25, 1)] + [
        conventions.azimuthal_roughness(np.sqrt(np.pi / 8))
    ]
    assert [round(b, 2) for b in stops] == [0.46, 0.74, 0.8]


def test_defaults_are_those_of_materialxs_library() -> None:
    text = (LIBRARY / "pbrlib_defs.mtlx").read_text()
    for node in ("bsdf", "roughness", "absorption_from_color"):
        body = text[text.index(f'name="ND_chiang_hair_{node}"') :]
        for name, value in re.findall(r'<input name="(\w+)" type="\w+" value="([^"]*)"', body[: body.index("</nodedef>")]):
            ours = conventions.HOSTS["materialx"].defaults[name]
            np.testing.assert_allclose(np.atleast_1d(ours), np.array(value.split(","), float), err_msg=name)
    body = text[text.index('name="ND_deon_hair_absorption_from_melanin"') :]
    inputs = dict(re.findall(r'<input name="(\w+)" type="\w+" value="([^"]*)"', body[: body.index("</nodedef>")]))
    for name in ("melanin_concentration", "melanin_redness"):
        assert conventions.HOSTS["materialx"].defaults[name] == float(inputs[name])
    for name in ("eumelanin", "pheomelanin"):
        pigment = -np.log(np.array(inputs[f"{name}_color"].split(","), float))
        np.testing.assert_allclose(conventions.PIGMENTS["deon2011"][name], pigment, atol=1e-5)
