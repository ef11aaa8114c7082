"""Any fibre among strands of a mean one: against dual scattering, transport with another last strand, its own samples."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest

import cuticle
from conftest import sphere
from cuticle import Chiang, Fibre
from cuticle.checking.verdicts import sidak
from cuticle.scattering.strand_transport import Directions, StrandTransport
from cuticle.scattering.through_strands import _parts
from drawn import are_directions, ends_of_random_numbers, follows

VALUES = {"alpha_R": -4.0, "beta_R": 8.0, "beta_N": 10.0, "eumelanin": 1.3}
MEAN = Fibre(**VALUES, d_f=1, d_b=1)
CHIANG = Chiang(beta_m=0.3, beta_n=0.3, alpha=2, eumelanin=1.3)


@cache
def among(fibre: Any = MEAN) -> cuticle.FamilyAmong:
    made = cuticle.family("dual_scattering", among=fibre)
    assert isinstance(made, cuticle.FamilyAmong)
    return made


def test_a_strand_like_the_others_is_dual_scattering() -> None:
    """f from other tables of azimuth; so the density is nearly ideal through any number of strands."""
    fibre = Fibre.preset("blond")
    family, model = among(fibre), cuticle.DualScattering(fibre)
    rng = np.random.default_rng(1)
    ti, phi = rng.uniform(-1.3, 1.3, 500), rng.uniform(-np.pi, np.pi, 500)
    for theta_r in (-1.1, 0.2):
        for n in (0, 0.4, 1, 2, 5.5, 16, 50):
            wanted = model.with_strands(n).eval(ti, theta_r, phi)
            off = np.abs(family.eval(ti, theta_r, phi, fibre, strands=n) - wanted) / wanted.max(0)
            assert off.max() <= 0.015, (theta_r, n)
            wanted = model.expected(ti, theta_r, phi, n, behind=2.0)
            off = np.abs(family.eval(ti, theta_r, phi, fibre, strands=n, behind=2.0, random=True) - wanted) / wanted.max(0)
            assert off.max() <= 0.015, (theta_r, n)
            if n in (0.4, 1, 5.5):
                assert cuticle.measure(family.sampler_at(fibre, strands=n), model.with_strands(n), theta_r).ess >= 0.998


@pytest.mark.parametrize(
    ("name", "own", "off", "steep"),
    [
        ("eumelanin", 1.3, 0.002, 0.002),  # the transport itself
        # What comes from behind is as if the last strand were the mean, too.
        ("eumelanin", 0.1, 0.03, 0.03),
        ("eumelanin", 2.5, 0.03, 0.03),
        # A lobe's axis and width are added, not convolved.
        ("beta_R", 15.0, 0.04, 0.09),
        ("alpha_R", -10.0, 0.03, 0.06),
    ],
)
def test_a_strand_unlike_the_others_is_the_last_to_scatter(name: str, own: float, off: float, steep: float) -> None:
    """Energy through two strands, against transport among the others seen through the strand's own scattering.

    `off` of it at 0° and 40°, `steep` at 64° either way.
    """
    d = Directions()
    transport = StrandTransport(_parts(MEAN, 0, d))
    assert transport._sheets is not None  # solved for the others
    strand = _parts(Fibre(**(VALUES | {name: own})), 0, d)
    transport.parts, transport._all = strand, sum(strand[1:], start=strand[0])
    wanted = np.einsum("cpnrk,n->r", transport.through_sheets(np.ones((d.rows, 1)), (2,)), d.node_weights)
    height = (np.arange(6000) + 0.5) / 6000 * 2 - 1  # evenly over the sphere
    turn = np.arange(6000) * 0.6180339887 % 1 * 2 * np.pi - np.pi
    for row, allowed in ((22, off), (32, off), (6, steep), (38, steep)):
        f = among().eval(np.arcsin(height), -d.theta[row], turn, **(VALUES | {name: own}), strands=2)[:, 0]
        assert np.mean(f * np.sqrt(1 - height**2)) * 4 * np.pi == pytest.approx(wanted[row], rel=allowed)


def random_case(rng: np.random.Generator, mean: Any) -> cuticle.scattering.any_fibre.FibreSampler:
    """A fibre all over the box, through any number of strands."""
    absorption = {"sigma_a": 10 ** rng.uniform(-2, 1.3, 3)}
    if isinstance(mean, Chiang):
        own: dict[str, Any] = {
            "beta_m": rng.uniform(0.05, 1), "beta_n": rng.uniform(0.05, 1), "alpha": rng.uniform(-15, 15)
        }  # fmt: skip
    else:
        own = {"alpha_R": rng.uniform(-15, 15), "beta_R": rng.uniform(2, 40), "beta_N": rng.uniform(2, 40)}
    return among(mean).sampler_at(strands=rng.choice([0, 0.5, 1, 2, 3.3, 8, 30]), **own, **absorption)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    ("cases", "samples"), [(3, 100_000), pytest.param(60, 300_000, marks=pytest.mark.slow)], ids=["few", "many"]
)
@pytest.mark.parametrize("mean", [MEAN, CHIANG], ids=["marschner", "chiang"])
def test_samples_follow_the_density(mean: Any, dtype: Any, cases: int, samples: int) -> None:
    """One family of tests at 1e-3."""
    rng, level = np.random.default_rng(cases), sidak(1e-3, 252)
    for k in range(cases):
        sampler, theta_r = random_case(rng, mean), rng.uniform(-1.4, 1.4)

        follows(sampler, theta_r, dtype, samples=samples, level=level, seed=k)


@pytest.mark.parametrize("mean", [MEAN, CHIANG, Fibre(sigma_a=(50.0, 0.01, 2.0))], ids=["brown", "chiang", "coloured"])
def test_nothing_gives_what_is_no_direction(mean: Any) -> None:
    """Viewers along the strand, random numbers at their ends, no light and much, 10,000 strands, both precisions."""
    family = among(mean)
    theta_r = np.array([-np.pi / 2, -1.5, 0, np.pi / 2])[:, None, None, None]
    strands = np.array([0, 1e-6, 1, 16, 10_000])[:, None, None]
    sigma_a = np.array([0.0, 0.1, 1000.0])[:, None, None] * np.ones(3)
    for dtype, u in ends_of_random_numbers():
        for behind, random in ((None, False), (0.0, True), (3.0, True)):
            around = {"strands": strands, "behind": behind, "random": random, "sigma_a": sigma_a}
            s = family.sample(theta_r.astype(dtype), u, beta_n=0.05, **around) if mean is CHIANG else family.sample(
                theta_r.astype(dtype), u, beta_N=1.0, **around
            )  # fmt: skip
            are_directions(s, dtype)


def test_the_density_integrates_to_one() -> None:
    theta, phi, cell = sphere(360, 720)
    for n, random in ((0, False), (0.5, False), (3.3, False), (3.3, True)):
        p = among().pdf(theta, 0.7, phi, beta_R=20, beta_N=15, eumelanin=0.4, strands=n, random=random)
        assert np.sum(p * np.cos(theta)) * cell == pytest.approx(1, abs=1e-5)


def test_strands_broadcast_and_a_sampler_keeps_them() -> None:
    family, n = among(), np.array([[0.0], [2.0], [7.0]])
    melanin = np.array([0.2, 1.0, 2.0, 4.0])
    f, p = family.eval_pdf(0.2, 0.1, 1.0, eumelanin=melanin, strands=n)
    assert f.shape == (3, 4, 3)
    assert p.shape == (3, 4)
    one = family.sampler_at(eumelanin=2.0, strands=7)
    np.testing.assert_array_equal(one.eval(0.2, 0.1, 1.0), f[2, 2])
    np.testing.assert_array_equal(one.pdf(0.2, 0.1, 1.0, n[:, 0]), p[:, 2])
    assert one.with_strands(2).pdf(0.2, 0.1, 1.0) == p[1, 2]
    assert pickle.loads(pickle.dumps(one)) == one
    gray = cuticle.family("dual_scattering", among=MEAN.replace(eumelanin=None, sigma_a=(0.4,)))
    assert gray.eval(0.2, 0.1, 1.0, sigma_a=0.3, strands=2).shape == (1,)
    colour = among().eval(0.2, 0.1, 1.0, sigma_a=0.3, strands=2)  # of the mean's channels
    assert colour.shape == (3,)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: cuticle.family("dual_scattering"), ValueError, "needs among, the mean fibre"),
        (lambda: cuticle.family("chiang", among=CHIANG), ValueError, "among is for the family 'dual_scattering'"),
        (lambda: cuticle.family("dual_scattering", among=3), TypeError, r"cuticle\.Fibre or a cuticle\.Chiang; got 3"),
        (lambda: cuticle.family("dual_scattering", MEAN, d_b=2), ValueError, r"d_b must be in \[0, 1\], got 2"),
        (
            lambda: cuticle.family("dual_scattering", Fibre(sigma_a=(0.0, 0.1, 0.2))), ValueError,
            "absorption above 0 in every channel",
        ),
        (lambda: among().pdf(0, 0, 0, sigma_a=1, strands=-1), ValueError, r"strands must be in \[0, 10,000\], got -1"),
        (lambda: among().pdf(0, 0, 0, sigma_a=1, behind=np.nan), ValueError, r"behind must be in \[0, 10,000\], got nan"),
        (lambda: among().sampler_at(sigma_a=1, strands=2e4), ValueError, r"strands must be in \[0, 10000\], got 20000"),
        (lambda: among().pdf(0, 0, 0, strand=2, sigma_a=1), ValueError, "have no parameter 'strand'"),
        (lambda: among().sampler_at(sigma_a=1, behind=3), ValueError, "strands alone .*; behind is for pdf, sample"),
        (lambda: among().sampler_at(MEAN, d_f=1), ValueError, "not both; got Fibre and d_f"),
        (
            lambda: cuticle.family("dual_scattering", Fibre.preset("document")), ValueError,
            r"formulation exact, got zinke2008.*among\.replace",
        ),
        (lambda: among().pdf(0, 0, 0, CHIANG), TypeError, r"must be a cuticle\.Fibre"),
        (
            lambda: cuticle.family("dual_scattering", Fibre(sigma_a=0.3)).pdf(0, 0, 0, sigma_a=(1, 2, 3)), ValueError,
            "as many channels as the mean fibre, 1, or one; got 3",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(call: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize("n", [1, 2, 4])
def test_a_smooth_tilted_strand_keeps_its_peaks_behind_others(n: int) -> None:
    """Against `Strands`, which has light in cells and no lobes: with one M a part the ESS was .76, .81 and .94."""
    fibre = Chiang(beta_m=0.17, beta_n=0.25, alpha=11.5, eta=1.75, sigma_a=(0.47, 5.4, 0.04))
    hair = cuticle.family("dual_scattering", among=fibre, d_f=0.7, d_b=0.7)
    assert cuticle.measure(hair.sampler_at(fibre, strands=n), cuticle.Strands(fibre, n), 0.576).ess >= 0.97


@pytest.mark.parametrize(("row", "most"), [(22, 0.08), (38, 0.18)])
def test_a_smooth_strand_among_rough_ones_has_no_spikes(row: int, most: float) -> None:
    """Of light through two strands: the total variation over theta_i from transport with the strand's own scattering last.

    At 0° and 64°. With one M it was .08 and .18; with two whose variances were subtracted until none was left, .09 and .26.
    """
    rough, smooth = VALUES | {"beta_R": 20.0}, VALUES | {"beta_R": 8.0}
    mean, d = Fibre(**rough, d_f=1, d_b=1), Directions()
    transport = StrandTransport(_parts(mean, 0, d))
    assert transport._sheets is not None  # solved for the others
    strand = _parts(Fibre(**smooth), 0, d)
    transport.parts, transport._all = strand, sum(strand[1:], start=strand[0])
    wanted = np.einsum("pnk,n->k", transport.through_sheets(np.eye(d.rows), (2,))[0, :, :, row], d.node_weights)
    phi = (np.arange(72) + 0.5) * np.pi / 72
    f = among(mean).eval(d.fine_theta[:, None], -d.theta[row], phi, **smooth, strands=2)[..., 0].sum(axis=1)
    found = (f * np.cos(d.fine_theta) ** 2).reshape(d.rows, -1).sum(axis=1)
    assert 0.5 * np.abs(found / found.sum() - wanted / wanted.sum()).sum() <= most
