"""A sampler in a shared library: what is right passes, what is wrong fails, and what is no such library is one line."""

from __future__ import annotations

import ctypes
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from command import refused, run, run_program
from cuticle.checking.compare_audits import compare_audits
from cuticle.checking.shared_library import LibrarySampler
from cuticle.export.headers import include_dir
from cuticle.report.audit_page import write_audit_page
from test_audit import failed
from test_report import read, visit

pytestmark = pytest.mark.skipif(shutil.which("c++") is None, reason="there is no C++ compiler")
PAGE = Path(__file__).parents[1] / "docs/audit.md"
FRAMES = {"local-x": "012", "mitsuba": "102", "local-z": "201"}  # where along, toward and aside lie

# A lobe toward the viewer's mirror direction would say nothing of frames: this one leans to azimuth 60°, inclination 30°.
SOURCE = """
#include "cuticle/audit.h"
#include <math.h>
#ifndef PDF
#define PDF 1
#endif
static const double pi = 3.14159265358979323846, axis[3] = {.5, .4330127018922193, .75};
static double density(double c) { return (1 + .8 * c) / (4 * pi); }
void cuticle_audit_sample(size_t count, const double *viewer, const double *u, double *direction, double *pdf) {
    (void)viewer;
    const double a[3] = {.8660254037844386, -.25, -.4330127018922193}, b[3] = {0, -.8660254037844386, .5};
    for (size_t i = 0; i < count ROWS; ++i) {
        const double c = (sqrt(1 - .8 * (2 - .8 - 4 * u[3 * i])) - 1) / .8, s = sqrt(fmax(0, 1 - c * c));
        const double p = 2 * pi * u[3 * i + 1], x = s * cos(p), y = s * sin(p);
        const double w[3] = {c * axis[0] + x * a[0] + y * b[0], c * axis[1] + x * a[1] + y * b[1],
                             c * axis[2] + x * a[2] + y * b[2]};
        direction[3 * i + ALONG] = LENGTH * w[0], direction[3 * i + TOWARD] = LENGTH * w[1];
        direction[3 * i + ASIDE] = LENGTH * w[2];
        pdf[i] = PDF * density(c);
    }
}
void cuticle_audit_pdf(size_t count, const double *viewer, const double *w, double *pdf) {
    (void)viewer;
    for (size_t i = 0; i < count; ++i)
        pdf[i] = PDF * density(axis[0] * w[3 * i + ALONG] + axis[1] * w[3 * i + TOWARD] + axis[2] * w[3 * i + ASIDE]);
}
"""


def library(folder: Path, source: str = SOURCE, language: str = "c", frame: str = "local-x", **macros: object) -> Path:
    """Compile a library in a folder, and return its path."""
    place = dict(zip(("ALONG", "TOWARD", "ASIDE"), FRAMES[frame], strict=True))
    values = {"LENGTH": 1, "ROWS": "", **place, **macros}
    target = folder / f"lib{len(list(folder.glob('lib*')))}.so"
    (folder / "mine").write_text(source, encoding="utf-8")
    flags = ["-std=c++17", "-O2"] if language == "c++" else ["-std=c99", "-O1"]
    command = ["c++" if language == "c++" else "cc", "-x", language, *flags, "-fPIC", "-shared", "-Wall", "-Wextra"]
    defined = [f"-D{k}={v}" for k, v in values.items()]
    given = ["-Werror", *defined, f"-I{include_dir()}", "mine", "-o", str(target), "-lm"]
    subprocess.run([*command, *given], cwd=folder, check=True)
    return target


def audited(path: Path, **options: object) -> cuticle.Audit:
    return cuticle.audit_library(path, samples=50_000, theta_r=[-0.5, 0.4], **options)


def test_what_a_library_prints_is_not_in_the_commands_output(tmp_path: Path) -> None:
    source = SOURCE.replace("(void)viewer;", 'printf("%g\\n", viewer[0]);').replace(
        "<math.h>", "<math.h>\n#include <stdio.h>"
    )
    path = library(tmp_path, source)
    done = run_program("audit", str(path), "--theta-r", "20", "--samples", "10000", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcome"] == "pass"
    assert "0.34202" in done.stderr


@pytest.mark.parametrize("frame", FRAMES)
def test_a_right_library_passes_in_every_frame(frame: str, tmp_path: Path) -> None:
    report = audited(library(tmp_path, frame=frame), frame=frame)
    assert report.ok, report
    sampler = LibrarySampler(library(tmp_path, frame=frame), frame=frame)
    # The density's own peak: inclination 30°, azimuth 60°.
    there = sampler.pdf(np.radians([30, -30]), 0.3, np.radians([60, -120]))
    np.testing.assert_allclose(there, np.array([1.8, 0.2]) / (4 * np.pi), rtol=1e-12)


@pytest.mark.parametrize(
    ("macros", "verdict"),
    [
        ({"PDF": 1.01}, "∫ pdf"),
        ({"LENGTH": 1.1}, "valid samples"),
        ({"ROWS": "- 1"}, "valid samples"),  # a row that is left out
        ({"PDF": "(0.5 + u[3 * i + 2])"}, "pdf of a sample"),
    ],
)
def test_a_wrong_library_fails(macros: dict[str, object], verdict: str, tmp_path: Path) -> None:
    source = SOURCE
    if "u[" in str(macros.get("PDF")):
        source = source.replace("pdf[i] = PDF * density(axis", "pdf[i] = density(axis")
    report = audited(library(tmp_path, source, **macros))
    assert verdict in failed(report), report


def test_samples_of_another_frame_do_not_follow_the_pdf(tmp_path: Path) -> None:
    """The frame counts: a library whose sample swaps two axes is wrong in the place that its pdf has for right."""
    swapped = SOURCE.replace("direction[3 * i + ASIDE] = LENGTH * w[2]", "direction[3 * i + ASIDE] = -LENGTH * w[2]")
    report = audited(library(tmp_path, swapped))
    assert "samples follow the pdf" in failed(report), report


def test_a_library_that_writes_too_much_or_lacks_a_function_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "text.so").write_text("no library")
    without = SOURCE[: SOURCE.index("void cuticle_audit_pdf")]
    cases = (
        (library(tmp_path, ROWS="+ 1"), "cuticle_audit_sample wrote past the end of its array"),
        (library(tmp_path, without), "exports no function cuticle_audit_pdf"),
        (tmp_path / "text.so", "cannot load library"),
        (tmp_path / "none.so.1", "No such file"),
    )
    for path, message in cases:
        with pytest.raises(ValueError, match=message) as caught:
            audited(path)
        assert "\n" not in str(caught.value)
        refused("audit", str(path), "--samples", "20000", words=message, cwd=tmp_path)
    with pytest.raises(ValueError, match="frame must be one of"):
        audited(cases[0][0], frame="blender")
    refused("audit", "hair.toml", "--frame", "pbrt", words="--frame does nothing for a .toml", cwd=tmp_path)


def test_a_loaded_library_and_a_prefix(tmp_path: Path) -> None:
    path = library(tmp_path, SOURCE.replace("cuticle_audit_", "red_").replace('"cuticle/audit.h"', "<stddef.h>"))
    report = audited(path, prefix="red_", name="red")
    assert report.ok, report
    assert report.name == "red"
    loaded = cuticle.audit_library(ctypes.CDLL(str(path)), prefix="red_", samples=20_000, theta_r=[0])
    assert loaded.name == path.name


def test_the_library_that_the_docs_show(tmp_path: Path) -> None:
    """An exported header behind the three functions, as docs/audit.md prints it, with f and so with weights."""
    code = next(c for c in re.findall(r"```cpp\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL) if "audit.h" in c)
    assert run("export", "--family", "chiang", "--to", "cpp", "-o", "any.h", cwd=tmp_path).returncode == 0
    assert len(code.strip().splitlines()) <= 30
    # Beside the right ones two wrong ones of other names, without f: what takes long is the header, and to evaluate f.
    parts = code[code.index("void cuticle_audit_sample") : code.index("void cuticle_audit_eval")]
    functions = parts.replace("cuticle_audit_", "wrong_")
    wrong = functions.replace("pdf[i] = any::eval_pdf_direction", "pdf[i] = 1.05 * any::eval_pdf_direction")
    assert wrong != functions
    path = library(tmp_path, f'{code}\nextern "C" {{\n{wrong}}}\n', "c++")
    report = audited(path)
    assert report.ok, report
    assert min(m.ess for m in report.cases) > 0.999  # its density is f cos itself
    assert "mean weight" in {v.name for v in report.verdicts}
    report = cuticle.audit_library(path, samples=50_000, theta_r=[0.4], prefix="wrong_")
    assert {"∫ pdf", "pdf of a sample"} <= failed(report), report


# ---- the page, and two side by side


def test_two_side_by_side(tmp_path: Path) -> None:
    right, wrong = library(tmp_path), library(tmp_path, PDF=1.05)
    options = ("--samples", "20000", "--theta-r=-30,20")
    done = run("audit", "--compare", str(right), str(wrong), *options, "-o", "both", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert sorted(p.name for p in (tmp_path / "both").iterdir()) == ["audit.html", "audit.json", "first.png", "second.png"]
    text, page = read(tmp_path / "both/audit.html")
    assert len(page.images) == 2
    assert all(r.startswith("data:") for r in page.references)
    for words in (right.name, wrong.name, "passes", "FAILS", "Side by side", "TV distance of the pdfs"):
        assert words in text
    made = json.loads((tmp_path / "both/audit.json").read_text())
    assert (made["ok"], made["first"]["ok"], made["second"]["ok"]) == (False, True, False)
    assert made["same_function"] is None
    # One pdf is 1.05 times the other: half of the sum of the differences is .025.
    np.testing.assert_allclose([v["distance"] for v in made["viewers"]], 0.025, atol=1e-6)
    done = run("audit", "--compare", str(right), str(right), *options, "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert all(v["distance"] == 0 for v in json.loads(done.stdout)["viewers"])


def test_a_browser_opens_the_page_without_a_complaint_or_a_request(browser: Any, tmp_path: Path) -> None:
    report = cuticle.audit(cuticle.Chiang(eumelanin=1.3).near(0.1), theta_r=[0.3], samples=20_000)
    page = write_audit_page(tmp_path / "audit.html", compare_audits(report, report))
    assert visit(browser, page.as_uri()) == ([], [])
    assert browser.execute_script("return [...document.images].map(i => i.naturalWidth)") == [1860, 1860]


def test_a_comparison_says_where_two_pdfs_differ_and_whether_f_is_one() -> None:
    options = {"theta_r": [0.3], "samples": 20_000}
    near = [cuticle.Chiang(beta_m=b, beta_n=0.4, eumelanin=e).near(0.1) for b, e in ((0.3, 1.3), (0.4, 1.3), (0.3, 0.3))]
    audits = [cuticle.audit(n, **options) for n in near]  # type: ignore[arg-type]
    rougher, paler = compare_audits(audits[0], audits[1]), compare_audits(audits[0], audits[2])
    assert rougher.ok
    assert rougher.farthest.distance > 0.1
    assert rougher.farthest.shares[0] > rougher.farthest.shares[1]  # a narrower lobe is denser where they differ most
    assert paler.same_function is False
    assert compare_audits(audits[0], audits[0]).same_function is True
    with pytest.raises(ValueError, match="same theta_r"):
        compare_audits(audits[0], cuticle.audit(near[0], theta_r=[0.1], samples=20_000))


def test_the_page_of_a_file_of_samples_and_of_one_audit(tmp_path: Path) -> None:
    s = cuticle.Chiang(eumelanin=1.3).near(0.1).sample(0.3, np.random.default_rng(1).random((20_000, 3)))
    x, y, z = np.cos(s.theta_i) * np.cos(s.phi), np.sin(s.theta_i), np.cos(s.theta_i) * np.sin(s.phi)
    np.savez(tmp_path / "<b>.npz", direction=np.stack([x, y, z], axis=1), pdf=s.pdf)
    assert run("audit", "<b>.npz", "-o", "dump", cwd=tmp_path).returncode == 0
    text, page = read(tmp_path / "dump/audit.html")
    assert "<b>.npz" not in text  # a name is text, not markup
    assert "&lt;b&gt;.npz" in text
    assert page.images == []
    refused("audit", "--compare", "a.npz", "b.json", words="a file of samples has no pdf between", cwd=tmp_path)
    one = str(library(tmp_path))
    assert run("audit", one, "--samples", "20000", "--theta-r=10", "-o", "one", cwd=tmp_path).returncode == 0
    text, page = read(tmp_path / "one/audit.html")
    assert len(page.images) == 1
    assert not re.search(r"\bnan\b", re.sub(r"data:[^\"]*", "", text).lower())


# ---- what a library does to the process that calls it


@pytest.mark.parametrize(
    ("does", "words"),
    [("exit(0)", "ended before the work did: it called exit(0)"), ("abort()", "it was stopped by SIGABRT")],
)
def test_a_library_that_ends_its_process_is_no_pass(does: str, words: str, tmp_path: Path) -> None:
    path = library(
        tmp_path,
        SOURCE.replace("(void)viewer;", f"(void)viewer, {does};", 1).replace("<math.h>", "<math.h>\n#include <stdlib.h>"),
    )
    refused("audit", path.name, "--theta-r", "20", "--samples", "10000", words=words, cwd=tmp_path)


def test_libraries_side_by_side_do_not_share_what_a_loader_merges(tmp_path: Path) -> None:
    """GCC makes an inline function's static data unique in a process: the second library would read the first's."""
    for folder, factor in (("a", "1."), ("b", "1.05")):
        (tmp_path / folder).mkdir()
        unique = f"inline const double *factor() {{ static const double values[] = {{{factor}}}; return values; }}\n"
        library(tmp_path / folder, SOURCE.replace("#ifndef PDF", f"{unique}#ifndef PDF"), "c++", PDF="factor()[0]")
    done = run("audit", "--compare", "a/lib0.so", "b/lib0.so", "--samples", "10000", "--theta-r=20", "--json", cwd=tmp_path)
    made = json.loads(done.stdout)
    assert (made["first"]["name"], made["second"]["name"]) == ("a/lib0.so", "b/lib0.so")
    assert (made["first"]["ok"], made["second"]["ok"]) == (True, False)
