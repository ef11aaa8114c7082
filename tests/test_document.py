"""The draft, reproduced: its tables within stated limits, its functions found, its claims judged by numbers."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cuticle
from cuticle.draft.document import Document, document
from cuticle.draft.functions import find_form, find_functions
from cuticle.draft.gaussians import fit_gaussian
from cuticle.draft.printed import Printed
from cuticle.draft.tables import highlight_axis, table_1, table_2, table_3
from cuticle.fitting.closed_forms import DRAFT, THETA, ClosedForm, Term


@pytest.fixture(scope="module")
def printed(data: Path) -> Printed:
    return Printed.load(data / "document")


@pytest.fixture(scope="module")
def brown(brown_fit: cuticle.Fit) -> Document:
    return document("brown", lobes=brown_fit)


# A Gaussian through a curve.


@given(
    mean=st.floats(-1.0, 1.0), sigma=st.floats(0.01, 0.4), scale=st.floats(1e-6, 1e3), window=st.sampled_from([0.0, 1 / 3])
)
@settings(max_examples=60, deadline=None)
def test_a_gaussian_is_found_again(mean: float, sigma: float, scale: float, window: float) -> None:
    def curve(x: np.ndarray) -> np.ndarray:
        return scale / (sigma * math.sqrt(2 * math.pi)) * np.exp(-0.5 * ((x - mean) / sigma) ** 2)

    found = fit_gaussian(curve, -math.pi / 2, math.pi / 2, window=window)
    assert found is not None
    # Least squares of an exact Gaussian: what the optimiser's tolerance leaves.
    assert abs(found.mean - mean) <= 1e-4 * sigma
    assert found.sigma == pytest.approx(sigma, rel=1e-4)
    assert found.scale == pytest.approx(scale, rel=1e-4)
    assert found.residual <= 1e-4


def test_where_there_is_no_gaussian_none_is_claimed() -> None:
    assert fit_gaussian(lambda x: np.zeros_like(x), -1, 1) is None
    assert fit_gaussian(lambda x: np.exp(x), -1, 1) is None  # its peak lies on the edge
    assert fit_gaussian(lambda x: np.ones_like(x), -1, 1, centre=0.0) is None  # flat
    box = fit_gaussian(lambda x: (np.abs(x) < 0.5).astype(float), -1, 1, window=0)
    assert box is not None
    assert box.residual > 0.06  # told, and past the limit for "holds"


# The tables against the printed ones.


def test_table_1_is_met_within_3_degrees(document_model: cuticle.DualScattering, printed: Printed) -> None:
    rows = {(round(math.degrees(r.phi_r)), round(math.degrees(r.theta_r))): r for r in table_1(document_model)}
    compared = 0
    for (phi_r, theta_r), (theta_i, phi_i) in printed.table_1.items():
        if abs(theta_r) > 60:
            continue
        r = rows[round(phi_r), round(theta_r)]
        assert abs(math.degrees(r.theta_i) - theta_i) <= 3
        # The maximum has two places, one on each side of the axis; the top is flat along phi.
        apart = min(abs((math.degrees(p) - phi_i + 180) % 360 - 180) for p in (r.phi_i, r.mirror))
        assert apart <= 7
        compared += 1
    assert compared == 25


def test_table_2_is_met(document_model: cuticle.DualScattering, printed: Printed) -> None:
    rows = {round(math.degrees(r.theta_r)): r for r in table_2(document_model)}
    compared = 0
    for (theta_r,), (s_v, sigma_v, _, s_h, sigma_h, shift) in printed.table_2.items():
        r = rows[round(theta_r)]
        if abs(theta_r) > 60:
            continue
        assert r.vertical is not None
        assert r.horizontal is not None
        assert r.shift is not None
        assert r.holds
        assert abs(math.degrees(r.shift) - shift) <= 2
        assert abs(r.horizontal.sigma - sigma_h) <= 0.05
        assert abs(r.vertical.sigma - sigma_v) <= (0.15 if abs(theta_r) <= 40 else 0.3)
        # s goes with sigma and with the fibre, which is a guess: 14 % and 33 % at worst.
        assert r.vertical.scale == pytest.approx(s_v, rel=0.2)
        assert r.horizontal.scale == pytest.approx(s_h, rel=0.35)
        compared += 1
    assert compared == 13
    sharp = [r for t, r in rows.items() if abs(t) == 80]
    assert not any(r.holds for r in sharp)  # past 70° a Gaussian along phi is no description
    assert all(r.vertical is not None and r.vertical.residual > 0.06 for r in sharp)


def test_the_preset_keeps_the_residuals_its_docstring_tells(
    document_model: cuticle.DualScattering, printed: Printed
) -> None:
    rows = {round(math.degrees(r.theta_r)): r for r in table_2(document_model)}
    pairs = [(rows[round(t[0])], v) for t, v in printed.table_2.items()]
    found = np.array([(r.vertical.sigma, r.horizontal.sigma, math.degrees(r.shift)) for r, _ in pairs])  # type: ignore[union-attr, arg-type]
    rms = np.sqrt(((found - np.array([(v[1], v[4], v[5]) for _, v in pairs])) ** 2).mean(axis=0))
    assert (rms <= [0.135, 0.025, 1.1]).all()  # the docstring: 0.13 rad, 0.02 rad, 1.0°


def test_table_3_is_met_for_one_and_two_strands(document_model: cuticle.DualScattering, printed: Printed) -> None:
    compared = 0
    for r in table_3(document_model, strands=(1, 2), theta_r=(-60, -30, 0, 30, 60)):
        _, sigma, shift = printed.table_3[r.strands, round(math.degrees(r.theta_r))]
        assert r.gaussian is not None
        assert r.shift is not None
        assert r.holds
        assert abs(math.degrees(r.shift) - shift) <= 12
        assert abs(r.gaussian.sigma - sigma) <= 0.12
        compared += 1
    assert compared == 10


# The general functions.


def test_least_squares_on_the_printed_table_2(printed: Printed) -> None:
    forms = printed.draft_forms()
    line, quartic = ([c.coefficient for c in forms[name].terms] for name in ("mu_H", "sigma_V"))
    np.testing.assert_allclose(np.degrees(line), [3.03, -2.20], rtol=0.01)
    np.testing.assert_allclose(quartic, [0.225, 0.619], rtol=0.01)


def test_the_drafts_own_functions_are_found_from_its_table(printed: Printed) -> None:
    t = np.radians([k[0] for k in printed.table_2])
    choices = printed.choices()
    mu = choices["mu_H"].best
    assert [x.theta for x in mu.terms] == ["1", "θ"]
    np.testing.assert_allclose(np.degrees([x.coefficient for x in mu.terms]), [-2.2, 3.03], rtol=0.01)
    sigma = np.array([v[1] for v in printed.table_2.values()])
    ours, theirs = (float(np.sqrt(np.mean((f(t) - sigma) ** 2))) for f in (choices["sigma_V"].best, DRAFT.sigma_V))
    assert ours <= theirs
    # Through strands: no worse than the line and parabola that the draft's form uses, for the same table.
    keys = np.array([k for k in printed.table_3 if abs(k[1]) <= 60])
    values = np.array([printed.table_3[tuple(k)] for k in keys])
    for name, column in (("sigma", values[:, 1]), ("mu", np.radians(values[:, 2]))):
        found, draft = (f(np.radians(keys[:, 1]), keys[:, 0]) for f in (choices[name].best, getattr(DRAFT, name)))
        assert np.sqrt(np.mean((found - column) ** 2)) <= np.sqrt(np.mean((draft - column) ** 2))


@pytest.mark.parametrize(
    ("parity", "terms", "parameter"),
    [
        ("even", (Term(0.6, "1"), Term(0.25, "θ⁴")), 1.0),
        ("even", (Term(0.5, "1"), Term(0.3, "sin²θ")), 1.0),
        ("odd", (Term(-0.03, "1"), Term(0.05, "θ")), 1.0),
        ("odd", (Term(0.02, "1"), Term(0.2, "sin 2θ")), 1.0),
        ("even", (Term(0.5, "1"), Term(0.05, "θ²"), Term(-0.05, "1", "log₂n")), 1.0),
        ("even", (Term(0.3, "1"), Term(0.05, "θ²"), Term(0.4, "1", "n/(n+c)")), 6.0),
        ("odd", (Term(-0.02, "1"), Term(0.3, "θ"), Term(0.2, "θ", "n^p")), 0.4),
    ],
)
def test_a_known_form_is_found_through_noise(parity: str, terms: tuple[Term, ...], parameter: float) -> None:
    truth = ClosedForm(terms, parameter)
    several = any(t.strands for t in terms)
    t, n = np.meshgrid(np.radians(np.arange(-70, 71, 10.0)), [1.0, 2, 4, 8, 16] if several else [1.0])
    t, n = t.ravel(), n.ravel()
    noise = np.random.default_rng(3).normal(0, 1e-4, t.shape)
    choice = find_form(t, truth(t, n) + noise, parity, strands=n)
    assert [(x.theta, x.strands) for x in choice.best.terms] == [(x.theta, x.strands) for x in terms]
    np.testing.assert_allclose(choice.best(t, n), truth(t, n), atol=3e-4)  # three times the noise
    assert len(choice.others) == 3
    assert choice.best.criterion is not None
    assert all(o.criterion is not None and o.criterion >= choice.best.criterion - 2 for o in choice.others)


def test_a_form_is_told_alike_in_python_and_in_code(tmp_path: Path) -> None:
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    forms = [
        DRAFT.sigma_V,
        DRAFT.mu,
        ClosedForm(tuple(Term(0.1 * i - 0.35, name) for i, name in enumerate(THETA))),
        ClosedForm((Term(1.0, "1"), Term(-2e-7, "θ²", "n"), Term(0.5, "θ", "1/n"))),
        ClosedForm((Term(0.3, "1"), Term(0.2, "θ", "n^p")), 0.4),
        ClosedForm((Term(0.3, "1"), Term(-0.2, "sin θ", "n/(n+c)")), 6.25),
    ]
    lines = "\n".join(f'    std::printf("%.9g\\n", {form.code()});' for form in forms)
    head = "#include <cmath>\n#include <cstdio>\nusing namespace std;\n"
    source = f"{head}int main() {{\n    double t = 0.7, n = 3;\n{lines}\n}}\n"
    (tmp_path / "forms.cpp").write_text(source)
    subprocess.run([compiler, str(tmp_path / "forms.cpp"), "-o", str(tmp_path / "forms")], check=True)
    values = subprocess.run([str(tmp_path / "forms")], check=True, capture_output=True, text=True).stdout.split()
    np.testing.assert_allclose([float(v) for v in values], [float(f(0.7, 3)) for f in forms], rtol=1e-5)  # six digits


def test_the_functions_make_a_sampler_at_once(reproduced: Document) -> None:
    assert reproduced.found is not None
    f = reproduced.found.functions
    direct, strands = f.code()
    assert [line.split()[1] for line in direct] == ["sigma_V", "sigma_H", "mu_H"]
    assert [line.split()[1] for line in strands] == ["sigma", "mu"]
    sampler = reproduced.fits["found"].sampler
    assert sampler.about["functions"] == [*direct, *strands]
    x = sampler.nodes[0, 40, :, 0]  # theta_r = 30°
    t = np.radians(30)
    np.testing.assert_allclose(x[[1, 3, 4]], [f.mu_H(t) - t, f.sigma_H(t), f.sigma_V(t)], rtol=1e-12)
    # For its own fibre the functions found beat the printed ones, direct and through every number of strands.
    for n in ("0", "1", "2", "4", "8"):
        assert reproduced.quality["found"][n]["ess"] >= reproduced.quality["draft"][n]["ess"]
    assert cuticle.check(sampler, reproduced.model, theta_r=np.radians([-60, 0, 75]), strands=[0, 4], samples=100_000).ok


@pytest.mark.slow
def test_a_fibre_without_a_highlight_says_so(reproduced: Document, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its tables have none. Samplers are another fibre's: what they miss of this one is not looked at here."""
    monkeypatch.setattr(sys.modules[document.__module__], "fit", lambda *_, **__: reproduced.fits["draft"])
    black = document("black", lobes=reproduced.fits["lobes"])
    assert black.found is None
    assert "cuticle.fit with lobes" in black.reason
    assert black.axis == 0
    assert "found" not in black.quality
    data = json.loads(json.dumps(black.to_dict(), allow_nan=False))
    assert data["functions"] is None
    assert data["shader"] is None
    assert data["no_functions_because"] == black.reason


# The claims.


@pytest.mark.parametrize("fibre", ["document", pytest.param("brown", marks=pytest.mark.slow)])
def test_claims_follow_their_numbers(fibre: str, request: pytest.FixtureRequest) -> None:
    d: Document = request.getfixturevalue({"document": "reproduced", "brown": "brown"}[fibre])
    verdicts = {c.quote[:24]: c.verdict for c in d.claims}
    assert len(verdicts) == 6
    shift, width, turning, azimuth, match, uniform = d.claims
    assert shift.numbers["peak_offset_deg"][60] > 2  # the maximum leaves the axis
    assert shift.verdict == "holds in part"
    assert turning.numbers["change_deg"] <= 0.1
    assert turning.verdict == "holds"
    assert uniform.verdict == "does not hold"
    rows = uniform.numbers
    assert rows["lobes"]["ess_per_traced_cost_0"] > rows["uniform"]["ess_per_traced_cost_0"]
    assert rows["uniform"]["cost"] < 0.5 * rows["lobes"]["cost"]
    assert match.numbers is d.quality
    for claim in d.claims:
        assert claim.finding
        json.dumps(claim.numbers, allow_nan=False)
    if fibre == "brown":
        assert azimuth.verdict == "does not hold"
        assert azimuth.numbers["8"]["ess_lost"] > 0.2
    else:
        assert azimuth.verdict == "holds in part"
        assert width.numbers["constant_rad"] == pytest.approx(0.274, abs=0.005)


def test_the_azimuth_claim_is_the_loss_of_a_flat_sampler(document_model: cuticle.DualScattering) -> None:
    from cuticle.draft.claims import azimuth_claim

    class Flat:  # no azimuth at all
        strands = 1.0

        def with_strands(self, n: float) -> Flat:
            return self

        def eval(self, theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray) -> np.ndarray:
            return (np.cos(theta_i) ** 2 + 0 * phi)[..., None]

    flat = azimuth_claim(Flat(), [1.0])  # type: ignore[arg-type]
    assert flat.verdict == "holds"
    assert abs(flat.numbers["1"]["ess_lost"]) <= 1e-9
    assert azimuth_claim(document_model, [1.0]).numbers["1"]["ess_lost"] > 0.01


# What comes out.


def test_json_holds_ours_and_printed(reproduced: Document, printed: Printed) -> None:
    data = json.loads(json.dumps(reproduced.to_dict(), allow_nan=False))
    assert (data["format"], data["version"], data["name"]) == ("cuticle-document", 1, "document")
    assert len(data["table_1"]["rows"]) == 35
    assert [r["theta_r_deg"] for r in data["table_2"]["rows"]] == list(range(-80, 81, 10))
    assert len(data["table_3"]["rows"]) == 35
    for table, names, count in (
        ("table_1", ("theta_i_deg", "phi_i_deg"), len(printed.table_1)),
        ("table_2", ("s_V", "sigma_V", "shift_V_deg", "s_H", "sigma_H", "shift_H_deg"), len(printed.table_2)),
        ("table_3", ("s", "sigma", "shift_deg"), len(printed.table_3)),
    ):
        for name in names:
            cells = [r[name] for r in data[table]["rows"]]
            both = [c for c in cells if c["printed"] is not None]
            assert len(both) == count
            for c in both:
                turned = (c["ours"] - c["printed"] - c["difference"]) % 360
                assert min(turned, 360 - turned) <= 1e-9
    assert data["table_2"]["rms"]["sigma_V"] == pytest.approx(0.127, abs=0.002)
    assert data["functions_from_printed"]["mu_H"]["best"]["text"] == "(-2.2 + 3.028 θ)°"
    assert [m["strands"] for m in data["combined"]] == [2.0, None]


@pytest.mark.parametrize("fibre", ["document", pytest.param("brown", marks=pytest.mark.slow)])
def test_without_the_printed_tables_all_else_stands(fibre: str, request: pytest.FixtureRequest) -> None:
    """As `document` leaves them out for brown; of the other, which has them, they are taken away."""
    if fibre == "brown":
        data = request.getfixturevalue("brown").to_dict()
    else:
        data = replace(request.getfixturevalue("reproduced"), printed=None, printed_choices={}).to_dict()
    assert data["functions"] is not None
    assert data["functions_from_printed"] is None
    assert all(r["sigma_V"]["printed"] is None and r["sigma_V"]["difference"] is None for r in data["table_2"]["rows"])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda t: document("nobody"), "preset must be one of"),
        (lambda t: document(3), "fibre must be a preset's name, a Fibre or a model with eval, got int"),
        (lambda t: Printed.load(t), "table1.csv is missing"),
        (
            lambda t: cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset("black")), form="document", functions=3),
            "functions must",
        ),  # type: ignore[arg-type]
    ],
)
def test_bad_input_is_told(call: Callable[[Path], object], words: str, tmp_path: Path) -> None:
    with pytest.raises((ValueError, TypeError), match=words):
        call(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", "must have the columns"),
        ("phi_r_deg,theta_r_deg,peak_theta_i_deg,peak_phi_i_deg\n1,2,3\n", "must have the columns"),
        ("phi_r_deg,theta_r_deg,peak_theta_i_deg,peak_phi_i_deg\n1,2,3,x\n", "cannot read printed table .*'x'"),
        ("phi_r_deg,theta_r_deg,peak_theta_i_deg,peak_phi_i_deg\n1,2,3,nan\n", "all numbers"),
    ],
)
def test_broken_printed_tables_are_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "table1.csv").write_text(text)
    with pytest.raises(ValueError, match=words):
        Printed.load(tmp_path)


def test_functions_need_slices(document_model: cuticle.DualScattering) -> None:
    two = table_2(document_model, theta_r=(0, 10))
    with pytest.raises(ValueError, match="only 2 of the slices of direct light"):
        find_functions(two, table_3(document_model, strands=(1, 2)), highlight_axis(document_model))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t, v: find_form(t, v, "uneven"), "parity must be one of even, odd"),
        (lambda t, v: find_form(t[:4], v[:4], "even"), "at least 5 points"),
        (lambda t, v: find_form(t, v[:-1], "even"), "must have one shape"),
        (lambda t, v: find_form(t, v * np.nan, "even"), "finite numbers"),
        (lambda t, v: find_form(t, v, "odd", strands=0 * t), "counts of at least 1"),
    ],
)
def test_a_form_needs_good_values(change: Callable[[np.ndarray, np.ndarray], object], words: str) -> None:
    t = np.linspace(-1, 1, 9)
    with pytest.raises(ValueError, match=words):
        change(t, t**2)
