"""The sampler: a density, samples that follow it, files that say why they are refused."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

import cuticle
from cuticle import Sampler
from cuticle.checking.sphere_integrals import integrate_pdf


def table(lobes: int = 3, even: bool = True, strands: tuple[float, ...] = (0.0, 1.0, 4.0), seed: int = 0) -> Sampler:
    """A table of lobes that nothing was fitted to: means on and past the edges, widths from 0.2° to flat."""
    rng = np.random.default_rng(seed)
    nodes = np.empty((len(strands), 13, 5, lobes))
    nodes[:, :, 0] = rng.dirichlet(np.ones(lobes), (len(strands), 13))
    nodes[:, :, 3] = np.exp(rng.uniform(np.log(np.radians(0.2)), np.log(3), nodes[:, :, 3].shape))
    nodes[:, :, 4] = np.exp(rng.uniform(np.log(np.radians(0.2)), np.log(50), nodes[:, :, 4].shape))
    reach = math.pi / 2 + np.minimum(nodes[:, :, 3], 1) * 0.99
    nodes[:, :, 1] = rng.uniform(-1, 1, reach.shape) * reach
    past = np.minimum(nodes[:, :, 4], 1) * 0.99
    nodes[:, :, 2] = rng.uniform(-past, math.pi + past) if even else rng.uniform(-6.28, 6.28, past.shape)
    return Sampler(nodes, rng.uniform(0.2, 1, nodes.shape[:2]), strands, even)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("lobes", [1, 2, 3, 5, 8, 20])
def test_pdf_integrates_to_one(lobes: int, even: bool) -> None:
    sampler = table(lobes, even, seed=lobes)
    for theta_r in (-1.5707, 0.05, 0.9):
        for strands in (0, 0.3, 2.2) if lobes < 9 else (2.2,):
            assert abs(integrate_pdf(sampler, sampler, theta_r, strands) - 1) <= 1e-5
            assert abs(integrate_pdf(sampler, sampler, theta_r, strands, np.float32) - 1) <= 1e-4


def test_pdf_integrates_to_one_at_every_viewer(document_fit: cuticle.Fit) -> None:
    sampler = document_fit.sampler
    for theta_r in np.radians([-89.999, -89, -88.2, -86.3, -60.7, -7.5, -0.001, 3.3, 44, 77.7, 87.6, 89.9, 89.999]):
        for strands in (0, 0.01, 0.5, 0.99, 1, 1.5, 8, 30):
            assert abs(integrate_pdf(sampler, sampler, float(theta_r), strands) - 1) <= 1e-5
            assert abs(integrate_pdf(sampler, sampler, float(theta_r), strands, np.float32) - 1) <= 1e-4


@pytest.mark.parametrize("strands", [0.0, 0.4, 1.0, 3.0, 30.0])
def test_arrays_of_one_number_of_strands_in_single_precision(strands: float, document_fit: cuticle.Fit) -> None:
    """By lanes, of which one row serves all; conformance's tolerance."""
    rng = np.random.default_rng(7)
    directions = rng.uniform([[-1.5], [-1.5], [-3.1]], [[1.5], [1.5], [3.1]], (3, 5003)).astype(np.float32)
    single = document_fit.sampler.pdf(*directions, np.float32(strands))
    double = document_fit.sampler.pdf(*directions.astype(np.float64), float(np.float32(strands)))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, double, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("even", [True, False])
def test_samples_follow_the_cells_of_the_closed_form_cdfs(even: bool) -> None:
    from cuticle.checking.cell_probabilities import compare_samples, from_cdfs

    sampler = table(4, even, seed=2)
    cases = [(t, n) for t in (-1.4, 0.3, 1.2) for n in (0.0, 0.5, 1.0, 3.0)]
    level = 1 - (1 - 1e-3) ** (1 / (2 * len(cases)))  # Šidák over both precisions
    for i, (theta_r, strands) in enumerate(cases):
        u = np.random.default_rng(i).random((400_000, 3))
        for dtype in (np.float32, np.float64):
            theta, phi, _ = sampler.sample(
                dtype(theta_r), u.astype(dtype).clip(0, np.nextafter(dtype(1), dtype(0))), strands
            )
            assert compare_samples(from_cdfs(sampler, theta_r, strands), theta, phi).p_value >= level


def test_pdf_is_the_density_of_its_cells() -> None:
    """Cell probabilities by quadrature of the pdf: the cdfs and the pdf are of one density."""
    sampler = table(3, seed=5)
    theta, phi = np.linspace(-1.5, 1.5, 7), np.linspace(-3.1, 3.1, 9)
    cells = sampler.cell_probabilities(theta, phi, 0.4, 0.5)
    for i in range(6):
        for j in range(8):
            x = np.linspace(theta[i], theta[i + 1], 201)
            y = np.linspace(phi[j], phi[j + 1], 201)
            p = sampler.pdf(x[:, None], 0.4, y, 0.5) * np.cos(x)[:, None]
            assert trapezoid(trapezoid(p, y), x) == pytest.approx(cells[i, j], abs=1e-5)  # the rule: 1e-6


def test_continuous_in_theta_r_and_strands(document_fit: cuticle.Fit) -> None:
    sampler = document_fit.sampler
    grid = np.linspace(-1.4, 1.4, 23)[:, None], np.linspace(0, 3.1, 11)
    for centre in [*np.linspace(-np.pi / 2, np.pi / 2, 25)[1:-1], 0.123]:
        a, b = (sampler.pdf(grid[0], centre + d, grid[1], 2.0) for d in (-1e-7, 1e-7))
        assert np.max(np.abs(a - b)) <= 1e-4
    for centre in (1e-7, 1.0, 2.0, 4.0, 0.5, 3.0, 8.0):
        a, b = (sampler.pdf(grid[0], 0.3, grid[1], centre + d) for d in (-1e-7, 1e-7))
        assert np.max(np.abs(a - b)) <= 1e-4


def test_a_lobes_cdfs_and_inverses(document_fit: cuticle.Fit) -> None:
    sampler = document_fit.sampler
    u = np.linspace(0.001, 0.999, 99)
    for lobe in range(4):
        for strands in (0, 2.5):
            x = sampler.icdf_theta(u, 0.7, lobe, strands)
            np.testing.assert_allclose(sampler.cdf_theta(x, 0.7, lobe, strands), u, atol=1e-9)
            y = sampler.icdf_phi(u, 0.7, lobe, strands)
            np.testing.assert_allclose(sampler.cdf_phi(y, 0.7, lobe, strands), u, atol=1e-9)
            assert (np.diff(y) > 0).all()
    assert len(sampler.mixture(0.7, 0.5).weight) == 8
    assert sampler.mixture(0.7, 0.5).weight.sum() == pytest.approx(1)


@pytest.mark.parametrize(
    ("dtype", "count", "rounds"),
    [
        (np.float32, 1_000_000, 10),
        pytest.param(np.float32, 4_000_000, 25, marks=pytest.mark.slow),
        pytest.param(np.float64, 1_000_000, 10, marks=pytest.mark.slow),
    ],
)
def test_random_inputs_give_nothing_that_is_not_a_density(
    dtype: type, count: int, rounds: int, document_fit: cuticle.Fit
) -> None:
    """No NaN, no negative pdf, no sample off the domain, edges included: 1e8 in single, 1e7 in double precision."""
    samplers = [
        document_fit.sampler,
        table(4, True, (0.0, 1.0, 2.0, 4.0, 8.0), 9),
        table(4, False, (0.0, 1.0, 2.0, 4.0, 8.0), 3),
    ]
    below_one = np.nextafter(dtype(1), dtype(0))
    rng = np.random.default_rng(17)
    edge_u = np.array([0, below_one, 0.5, np.finfo(dtype).tiny, 0.25], dtype)
    edge_theta = np.array([-np.pi / 2, np.pi / 2, 0, -1.5707, 1e-20], dtype)
    edge_phi = np.array([-np.pi, np.pi, 0, -0.0, 3.1415925], dtype)
    for i in range(rounds):
        sampler = samplers[i % len(samplers)]
        u = rng.random((count, 3), dtype)
        theta_r = (rng.random(count, dtype) * dtype(np.pi) - dtype(np.pi / 2)).astype(dtype)
        u[: count // 50] = rng.choice(edge_u, (count // 50, 3))
        theta_r[: count // 25 : 3] = rng.choice(edge_theta, len(theta_r[: count // 25 : 3]))
        strands = rng.choice(np.array([0, 0.5, 1, 3, 8, 100], dtype), count)
        theta_i, phi, p = sampler.sample(theta_r, u, strands)
        assert p.dtype == dtype
        assert (np.abs(theta_i) < np.pi / 2).all()
        assert (np.abs(phi) <= dtype(np.pi)).all()
        assert (p >= 0).all()
        assert np.isfinite(p).all()
        at = rng.random(count, dtype) * dtype(6.2) - dtype(3.1)
        at[: count // 50] = rng.choice(edge_phi, count // 50)
        towards = rng.permutation(theta_r)
        q = sampler.pdf(towards, theta_r, at, strands)
        assert (q >= 0).all()
        assert np.isfinite(q).all()


@settings(max_examples=200, deadline=None)
@given(
    u=st.tuples(*[st.floats(0, 1, exclude_max=True)] * 3),
    theta_r=st.floats(-math.pi / 2, math.pi / 2),
    strands=st.floats(0, 20),
)
def test_the_pdf_of_a_sample_is_the_pdf_there(u: tuple, theta_r: float, strands: float) -> None:
    sampler = table(4, seed=1)
    theta_i, phi, p = sampler.sample(theta_r, np.array(u), strands)
    assert float(p) == pytest.approx(float(sampler.pdf(theta_i, theta_r, phi, strands)), rel=1e-12)


def test_shapes_and_precision(document_fit: cuticle.Fit) -> None:
    sampler = document_fit.sampler
    s = sampler.sample(np.zeros((4, 1)), np.full((5, 3), 0.5), 1)
    assert s.theta_i.shape == s.phi.shape == s.pdf.shape == (4, 5)
    assert s.pdf.dtype == np.float64
    single = sampler.sample(np.zeros(5, np.float32), np.full((5, 3), 0.5, np.float32), 1)
    assert single.pdf.dtype == np.float32
    np.testing.assert_allclose(single.pdf, s.pdf[0], rtol=1e-5)
    assert sampler.pdf(0.1, 0.2, np.zeros((3, 1)), [0, 1]).shape == (3, 2)
    assert sampler.sample(0.0, np.empty((0, 3)), 1).pdf.shape == (0,)


def test_file_round_trip(document_fit: cuticle.Fit, tmp_path: Path) -> None:
    path = document_fit.sampler.save(tmp_path / "document.json")
    loaded = Sampler.load(path)
    np.testing.assert_array_equal(loaded.nodes, document_fit.sampler.nodes)
    assert loaded.about == document_fit.sampler.about
    assert loaded.fibre == cuticle.Fibre.preset("document")
    assert loaded.pdf(0.1, 0.2, 3.0, 1.5) == document_fit.sampler.pdf(0.1, 0.2, 3.0, 1.5)


def broken(text: str, change) -> str:
    data = json.loads(text)
    change(data)
    return json.dumps(data)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t[: len(t) // 2], "it ends early (truncated?)"),
        (lambda t: "", "it ends early (truncated?)"),
        (lambda t: t.replace('"version": 1', '"version": 2'), "format version 2, newer than 1; upgrade cuticle"),
        (lambda t: t.replace('"version": 1', '"version": "1"'), "its version is '1'"),
        (lambda t: broken(t, lambda d: d["energy"][0].__setitem__(0, float("nan"))), "it holds NaN"),
        (lambda t: broken(t, lambda d: d["energy"][0].__setitem__(0, 0)), "energy must be finite and above 0"),
        (lambda t: t.replace('"energy": [[', '"energy": [[1e999, '), "it holds 1e999, which is not a number"),
        (lambda t: broken(t, lambda d: d["nodes"][0][0][3].__setitem__(0, -0.1)), "sigma_theta must be in"),
        (lambda t: broken(t, lambda d: d["nodes"][0][0][0].__setitem__(0, 0.9)), "weights must be at least 0 and sum to 1"),
        (lambda t: broken(t, lambda d: d["nodes"][0][0][1].__setitem__(0, 50.0)), "at most one sigma outside"),
        (lambda t: broken(t, lambda d: d["nodes"][0].pop()), "ragged"),
        (lambda t: broken(t, lambda d: d.update(lobes=7)), "its header says"),
        (lambda t: broken(t, lambda d: d.update(strands=[0, 2, 1, 4, 8])), "strands must be increasing"),
        (lambda t: broken(t, lambda d: d.update(strands=[0, 1, 2, 4, 1e20])), "from 0 on, up to 10000"),
        (lambda t: broken(t, lambda d: d.pop("energy")), "energy is missing"),
        (lambda t: broken(t, lambda d: d.update(format="other")), 'its "format" is not "cuticle-sampler"'),
        (lambda t: "[1, 2]", 'its "format" is not'),
    ],
)  # fmt: skip
def test_refused_files(document_fit: cuticle.Fit, tmp_path: Path, change, words: str) -> None:
    path = tmp_path / "broken.json"
    path.write_text(change(document_fit.sampler.to_json()))
    with pytest.raises(ValueError, match=".") as error:
        Sampler.load(path)
    assert words in str(error.value)
    assert "broken.json" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s.pdf(0, 0, 0), "strands must be given: this sampler covers 0, 1, 4"),
        (lambda s: s.pdf(2.0, 0, 0, 1), "theta_i must lie in [-1.5708, 1.5708], got 2"),
        (lambda s: s.pdf(0, np.nan, 0, 1), "theta_r must lie in"),
        (lambda s: s.pdf(0, 0, 0, -1), "strands must lie in [0, 10000], got -1"),
        (lambda s: s.sample(0, [0.1, 0.2], 1), "u must have shape (..., 3)"),
        (lambda s: s.sample(0, [0.1, 0.2, 1.0], 1), "u must lie in [0, 1), got 1 at u[2]"),
        (lambda s: s.sample(0, [0.1, np.nan, 0.5], 1), "got nan at u[1]"),
        (lambda s: s.sample(np.zeros(4), np.zeros((3, 3)), 1), "shapes do not broadcast together"),
        (lambda s: s.cdf_theta(0, 0, 3, 1), "lobe must be in [0, 2], got 3"),
        (lambda s: s.icdf_phi(1.5, 0, 0, 1), "u must lie in [0, 1], got 1.5"),
    ],
)
def test_bad_input(call, words: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        call(table())
    assert words in str(error.value)


@pytest.mark.parametrize(
    "value",
    [np.array([0.1 + 0j]), np.array(["0.1"]), np.array([True]), np.array([0.1], object), np.ma.array([0.1], mask=[True]),
     np.array(["2020-01-01"], "datetime64[D]"), "0.1", True, 0.1j],
)  # fmt: skip
def test_arrays_that_are_no_real_numbers_are_refused(value: Any, document_fit: cuticle.Fit, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="theta_i must be an array of numbers, got .*") as caught:
        document_fit.sampler.pdf(value, 0.0, 0.0, 0)
    assert "\n" not in str(caught.value)
    with pytest.raises(TypeError, match="values must be an array of numbers"):
        cuticle.Tabulated([0.0], [-1.5, 0, 1.5], [0.0, 1, 2], np.ma.array(np.ones((1, 3, 3))) if value is True else value)
    if isinstance(value, np.ndarray) and value.dtype.kind != "O" and not isinstance(value, np.ma.MaskedArray):
        np.savez(tmp_path / "d.npz", direction=np.zeros((6000, 3)), pdf=np.repeat(value, 6000))
        with pytest.raises(ValueError, match=r"cannot read samples .*d\.npz: pdf must be an array of numbers"):
            cuticle.audit_dump(tmp_path / "d.npz")
