"""Words in an exported file: none that a compiler or another header keeps for itself."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import cuticle
from cuticle.export import check_name, export, export_family


def _accepted(name: str) -> bool:
    try:
        return bool(check_name(name, "cpp"))
    except ValueError:
        return False


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_a_name_is_none_that_the_headers_an_export_includes_have(
    compiler: str, document_fit: cuticle.Fit, tmp_path: Path
) -> None:
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is not installed")
    text = export(document_fit.sampler, "cpp", name="strand").text
    source = tmp_path / "a.cpp"
    source.write_text("".join(f"{line}\n" for line in text.splitlines() if re.match("#include <[a-z_]+>", line)))
    command = [compiler, "-std=gnu++20", "-dM", "-E", str(source)]
    found = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    macros = {re.split(r"[ (]", line)[1] for line in found.splitlines()}
    assert {"M_PI", "INT32_MAX"} < macros
    for name in macros:
        with pytest.raises(ValueError, match="name must"):
            check_name(name, "cpp")
    # Functions and types: the compiler itself says which of the words that are accepted no namespace can be called.
    text = subprocess.run([*command[:2], "-P", "-E", str(source)], capture_output=True, text=True, check=True).stdout
    words = {w for w in re.findall(r"\b[A-Za-z]\w*", text) if _accepted(w)}
    controls = {"cbrtf", "gamma", "random", "uint8_t"}  # refused, and rightly
    assert len(words) > 300
    assert not words & controls
    each = [*sorted(words), *sorted(controls)]
    source.write_text(source.read_text() + "#line 1\n" + "".join(f"namespace {w} {{ inline int inside; }}\n" for w in each))
    all_errors = "-ferror-limit=0" if compiler == "clang++" else "-fmax-errors=0"
    command = [*command[:2], all_errors, "-fsyntax-only", str(source)]
    errors = subprocess.run(command, capture_output=True, text=True, check=False).stderr
    assert {each[int(line) - 1] for line in re.findall(r"a\.cpp:(\d+):\d+: error", errors)} == controls


MACROS = """  // of windows.h with NOMINMAX, and of C's complex.h
#define near
#define far
#define small char
#define hyper __int64
#define interface struct
#define IN
#define OUT
#define OPTIONAL
#define CONST const
#define ERROR 0
#define DELETE 0x00010000L
#define I _Complex_I
"""


def syntax_of(folder: Path, text: str, standard: str = "c++17") -> str:
    """What the compiler says of a program: nothing where it is right."""
    (folder / "a.cpp").write_text(text)
    command = ["c++", f"-std={standard}", "-fsyntax-only", "a.cpp"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False).stderr[:2000]


def test_exports_compile_where_others_have_defined_their_words(document_fit: cuticle.Fit, tmp_path: Path) -> None:
    texts = [
        export(document_fit.sampler, "cpp", name="fitted", with_model=True).text,
        export_family("chiang", "cpp", name="alone").text,
        export_family("dual_scattering", "cpp", name="among", among=cuticle.Fibre.preset("brown")).text,
    ]
    headers = ("cmath", "cstdint", "cstring", "limits", "type_traits", "utility")  # their words are their own matter
    standard = "".join(f"#include <{name}>\n" for name in headers)
    for text in texts:
        assert not syntax_of(tmp_path, standard + MACROS + text)


def test_windows_macros_min_and_max_are_told_in_a_line(tmp_path: Path) -> None:
    macros = "#include <cmath>\n#include <limits>\n#define min(a, b) (((a) < (b)) ? (a) : (b))\n"
    assert "#error" not in syntax_of(tmp_path, macros)
    assert "define NOMINMAX before windows.h" in syntax_of(
        tmp_path, macros + export_family("chiang", "cpp", name="hair").text
    )


def test_two_names_that_differ_in_their_capitals_are_two(tmp_path: Path) -> None:
    both = "".join(export_family("chiang", "cpp", name=name).text for name in ("Hair", "hair"))
    both += "hair::Fibre<float> a;\nHair::Fibre<float> b;\n"
    assert not syntax_of(tmp_path, both)
    assert '#error "Cuticle needs C++17' in syntax_of(tmp_path, both, "c++14")


def test_two_exports_of_one_name_are_told_apart(tmp_path: Path) -> None:
    """In one file by an error, not by the silence of an include guard; in several by the linker, not by luck."""
    one, other = (export_family(form, "cpp", name="hair").text for form in ("chiang", "marschner"))
    assert not syntax_of(tmp_path, one + one + "hair::Fibre<float> a;\n")
    assert "hair: another export of this name was included before" in syntax_of(tmp_path, one + other)
    inner = [re.findall(r"^namespace hair \{\ninline namespace (x\d+) \{", text, re.M) for text in (one, other)]
    assert [len(names) for names in inner] == [1, 1]
    assert inner[0] != inner[1]
    shaders = [
        re.findall(r"#define HAIR_GLSL (\d+)", export_family(f, "glsl", name="hair").text) for f in ("chiang", "marschner")
    ]
    assert shaders[0] != shaders[1]
