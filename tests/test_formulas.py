"""From C++ to shading languages: what is printed, and what is refused instead of printed wrong."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cuticle.export.formulas import Library, SubsetError, headers, print_formulas
from cuticle.export.formulas.printer import Printer, wrap
from cuticle.export.formulas.tree import Vector
from cuticle.export.hosts.glsl import Glsl
from cuticle.export.hosts.hlsl import Hlsl
from cuticle.export.hosts.metal import Metal
from cuticle.export.hosts.wgsl import Wgsl


def glsl(text: str, host: str = "float f(float x) { return g(x); }", **options: object) -> str:
    return print_formulas(host, Glsl("n"), library=Library.of([text]), **options)  # type: ignore[arg-type]


def body(printed: str, name: str) -> str:
    """A function's body, on one line."""
    found = re.search(rf"n_{name}\([^)]*\) {{(.*?)\n?}}\n", printed, re.S)
    assert found, printed
    return " ".join(found.group(1).split())


def test_a_formula_in_both_languages() -> None:
    text = """
    namespace cuticle {
    // A parabola that is held.
    template <class Float> CUTICLE_INLINE Float g(const Float &x) {
        const Float y = x * x - Float(2) * (x - Float(.5f));
        return select(y < Float(1), math::max(y, -x), Float(1e-3) / y);
    }
    }
    """
    host = "Set f(Set x) { return g(x); }"
    four = {"Set": Vector("float", 4)}
    printed = glsl(text, host, types=four)
    assert "// A parabola that is held.\nvec4 n_g(vec4 x) {" in printed
    assert body(printed, "g") == (
        "vec4 y = x * x - 2.0 * (x - 0.5); return mix(1e-3 / y, max(y, -x), lessThan(y, vec4(1.0)));"
    )
    one = glsl(text, "float f(float x) { return g(x); }")
    assert body(one, "g") == "float y = x * x - 2.0 * (x - 0.5); return y < 1.0 ? max(y, -x) : 1e-3 / y;"
    printed = print_formulas(host, Hlsl("n"), library=Library.of([text]), types=four)
    assert "float4 n_choose(bool4 mask, float4 a, float4 b)" in printed
    assert "n_choose((y < ((float4)(1.0))), max(y, -x), 1e-3 / y)" in printed


def test_constants_are_worked_out_in_the_headers_own_precision() -> None:
    text = """
    template <class Float> inline constexpr scalar_t<Float> turn = scalar_t<Float>(6.28318530717958647692);
    template <bool Fine> inline constexpr float limit = Fine ? 4.f : 3.7f;
    enum class Kind { round, square };
    template <class Float> Float shape(Kind kind, const Float &x, bool even) {
        if (kind == Kind::round) return even ? x : Float(-x);
        return x * Float(1 / turn<double>) + Float(limit<false>) +
               Float(turn<Float> * (1 - std::numeric_limits<float>::epsilon()));
    }
    """
    printed = glsl(text, "float f(float x) { return shape(Kind::round, x, false); }")
    assert "n_shape_round(float x) { return -x; }" in printed
    printed = glsl(text, "float f(float x) { return shape(Kind::square, x, true); }")
    found = re.search(r"return x \* (\S+) \+ 3.7 \+ (\S+);", printed)
    assert found
    assert np.float32(found.group(1)) == np.float32(1 / (2 * np.pi))
    assert np.float32(found.group(2)) == np.float32(2 * np.pi) * (np.float32(1) - np.finfo(np.float32).eps)


def test_structs_families_and_what_is_not_used() -> None:
    text = """
    template <class Float> struct Pair { Float a, b; };
    struct Plain {
        template <class Float> struct Density { Float mean; template <class U> static auto each(const U &u) { return u; } };
        static constexpr double height = 2;
        template <bool Fine = true, class Float> static Density<Float> make(const Float &x) { return {x * Float(height)}; }
    };
    template <class Family, class Float> using DensityOf = typename Family::template Density<Float>;
    template <class Float> Pair<Float> twice(const Float &x) { return {x, x + x}; }
    template <class Family, class Float> Float g(const Float &x) {
        const Pair<Float> unused = twice(x);
        const DensityOf<Family, Float> d = Family::template make<false>(x);
        for (int i = 0; i < 7; ++i) { if (!(x > Float(i))) return d.mean; }
        return twice(d.mean).b;
    }
    """
    printed = glsl(text, "float f(float x) { return g<Plain>(x); }")
    assert "unused" not in printed
    assert "struct N_Pair {\n    float a, b;\n};" in printed
    assert "N_Density n_make(float x) { return N_Density(x * 2.0); }" in printed
    assert "if (!(x > float(i)))" in printed
    assert "return n_twice(d.mean).b;" in printed


@pytest.mark.parametrize(
    ("formula", "words"),
    [
        ("while (x > Float(0)) return x; return x;", "g: 'while' is outside the subset"),
        ("const auto h = [&](const Float &y) { return y; }; return h(x);", "g: '[' is outside the subset"),
        ("Float *p = &x; return *p;", r"g: '\*' is outside the subset"),
        ("const Float y = x; if (true) { const Float y = x + x; } return y;", "g: y hides another variable"),
        ("return lgamma(x);", "g: no function of the headers, and none of the languages, is lgamma"),
        ("return memory[0];", "g: memory is outside the subset"),
        ("return x > Float(0);", "g: x > Float(0) is of another type"),
        ("return x * 2;", "g: x * 2 is of types that do not go together"),
        ("return x * .5;", r"g: x \* .5 is of types that do not go together"),
        ("int i = 0; return x + i;", "g: x + i is of types"),
        ("for (int i = 0; i <= 3; ++i) x; return x;", "a loop that is not counted up with <"),
        ("return x & x;", "g: '&' is outside the subset"),
        ("if constexpr (is_wide<Float>) return x; return x;", r"g: '\)', where a name would go on"),
        ("return math::polynomial(x + x, x, x);", "g: a polynomial of x \\+ x: give it a name first"),
        ("return static_cast<float>(x);", "g: static_cast is outside the subset"),
        ("switch (1) { default: return x; }", "g: 'switch' is outside the subset"),
        ("x = Float(1); return {x, x};", "g: 2 values do not make what they become"),
        ("return x ? x : x;", "g: x is not one bool|g: x \\? x : x chooses"),
    ],
)
def test_a_function_outside_the_subset_is_refused(formula: str, words: str) -> None:
    text = f"template <class Float> Float g(const Float &x) {{ {formula} }}"
    words = words.replace("(0)", r"\(0\)").replace("+ i", r"\+ i").replace("x * 2", r"x \* 2").replace("'['", r"'\['")
    with pytest.raises(SubsetError, match=words):
        glsl(text)


def test_a_directive_or_a_reference_that_is_written_to_is_refused() -> None:
    with pytest.raises(SubsetError, match="'#if A' is outside the subset"):
        glsl("template <class Float> Float g(const Float &x) {\n#if A\n return x;\n#endif\n return x; }")
    with pytest.raises(SubsetError, match="no function of the headers"):
        glsl("template <class Float> Float g(const Float &x, int n) { return x; }")
    with pytest.raises(SubsetError, match="2 functions of the headers"):
        glsl("template <class F> F g(const F &x) { return x; } template <class G> G g(const G &x) { return x; }")


def test_a_constants_digits_are_the_headers() -> None:
    printed = print_formulas("float f(float x) { return math::erfc_single(x); }", Glsl("n"))
    for digits in ("0.0921253413", "0.370669425", "0.282409608"):
        assert digits in printed
    assert headers().fields("NormalLobes::Density")[:3] == ("mean", "rate", "width")


def test_long_lines_are_wrapped_between_words() -> None:
    line = "    float y = " + " + ".join(f"coefficient_{i}" for i in range(40)) + ";"
    parts = wrap(line).splitlines()
    assert max(map(len, parts)) <= 125
    assert " ".join(" ".join(p.split()) for p in parts) == line.strip()


CELLS = """
constexpr int first(int p) { return p == 0 ? 0 : p == 1 ? 5 : 7; }
template <class Float, int Channels> struct Cells { Float height[Channels][7]; };
template <int Channels, class Float> Cells<Float, Channels> cells(const Float &x, const Float colour[Channels]) {
    constexpr int step = abreast<Float>;
    Cells<Float, Channels> of;
    for (int c = 0; c < Channels; ++c)
        for (int j = 0; j < 7; j += step) store_abreast(Abreast<Float>(x * colour[c]), of.height[c], j);
    return of;
}
template <int p, class Float, int Channels> Float lobe(const Cells<Float, Channels> &of, int c) {
    Abreast<Float> all(Float(0));
    for (int j = first(p); j < first(p + 1); ++j) all = all + load_abreast(of.height[c], j);
    return sum_abreast<Float>(all);
}
template <class Float, int Channels> Float g(const Cells<Float, Channels> &of, Float f[Channels]) {
    Several<Float, 2> along(Float(0));
    for (int p = 0; p < 2; ++p) along.set(p, Float(p + 1));
    for (int c = 0; c < Channels; ++c) f[c] = Float(0);
    auto past = f[0] < Float(0);
    for (int p = 0; p < 2; ++p) {
        past = past & (along[p] > Float(0));
        for (int c = 0; c < Channels; ++c) f[c] = f[c] + (p == 0 ? lobe<0>(of, c) : lobe<1>(of, c)) * along[p];
    }
    return select(past, f[0], f[1]);
}
"""


HOST = "float f(float x) { const float colour[2] = {x, 2.0f}; float f[2]; return g(cells<2>(x, colour), f); }"


def test_cells_side_by_side_become_loops_over_arrays() -> None:
    """Arrays of arrays are one; a short loop is printed step by step; a template's number is a struct's, or in the name."""
    printed = " ".join(glsl(CELLS, HOST).split())
    assert "struct N_Cells2 { float height[14]; };" in printed
    assert "N_Cells2 n_cells(float x, float colour[2]) {" in printed
    for c in range(2):
        assert f"for (int j = 0; j < 7; ++j) {{ of.height[{f'{7 * c} + j' if c else 'j'}] = x * colour[{c}]; }}" in printed
    one = "for (int j = 0; j < 5; ++j) { all_ = all_ + of.height[c * 7 + j]; }"
    assert f"float n_lobe_0(N_Cells2 of, int c) {{ float all_ = 0.0; {one} return all_; }}" in printed
    two = "all_ = all_ + of.height[c * 7 + 5]; all_ = all_ + of.height[c * 7 + 6];"
    assert f"float n_lobe_1(N_Cells2 of, int c) {{ float all_ = 0.0; {two} return all_; }}" in printed
    assert "float n_g(N_Cells2 of, out float f[2]) {" in printed
    assert "along[0] = 1.0; along[1] = 2.0;" in printed
    for p in range(2):
        each = " ".join(f"f[{c}] = f[{c}] + n_lobe_{p}(of, {c}) * along[{p}];" for c in range(2))
        assert f"past = past && along[{p}] > 0.0; {each}" in printed


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (("j += step", "j += 2"), "the loop over j is not by one"),
        (("load_abreast(of.height[c], j)", "of.height[c]"), "types that do not go together"),
        (("along.set(p, Float(p + 1));", "along.fill(Float(1));"), "a call whose value is not used"),
        (("j < first(p + 1)", "j < c"), "no constant bounds"),
    ],
)
def test_what_cells_may_not_do(wrong: tuple[str, str], why: str) -> None:
    with pytest.raises(SubsetError, match=why):
        glsl(CELLS.replace(*wrong), HOST)


def test_an_instance_is_named_in_the_order_of_its_template() -> None:
    names = ["fine", "lower", "even", "closed", "random"]
    text = f"template <{', '.join(f'bool {n}' for n in names)}, class Float> Float h(const Float &x) {{ return x * x; }}"
    text += "template <class Float> Float g(const Float &x) { return h<true, true, true, true, true>(x); }"
    assert f"n_h_{'_'.join(names)}(" in glsl(text)


@pytest.mark.parametrize("printer", [Glsl, Hlsl, Metal, Wgsl])
def test_the_family_of_lobes_that_a_page_adds_is_printed(printer: type[Printer]) -> None:
    """docs/extending/lobe_family.md says that exports carry it: all that a sampler asks of it."""
    page = (Path(__file__).parents[1] / "docs/extending/lobe_family.md").read_text(encoding="utf-8")
    family = page[page.index("struct CauchyLobes") : page.index("int main()")].replace("cuticle::", "")
    library = headers().copy()
    library.add("namespace cuticle {" + family + "}")
    host = """
    float f(float x) {
        const DensityOf<CauchyLobes, float> a = make_theta<CauchyLobes>(x, x), b = make_phi<CauchyLobes>(x, x, false);
        const float scale = lobe_scale<CauchyLobes>(x, a.rate * b.rate, a.mass * b.mass, a.under * b.under, false);
        const ChosenLobe<float, CauchyLobes> chosen = {a, b};
        const Sample<float> drawn = draw(chosen, x, x, false);
        return lobe_density<CauchyLobes>(a, b, scale, drawn.theta_i, drawn.phi, false);
    }
    """
    assert "atan" in print_formulas(host, printer("n"), library=library)
