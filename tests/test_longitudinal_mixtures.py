"""Three energy-conserving M's for energies over theta_i, against mixtures that are known and against another code path."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import i0e

from cuticle import Chiang, Strands, family, measure
from cuticle.scattering.longitudinal_mixtures import axis_and_variance, longitudinal_mixtures
from cuticle.scattering.strand_transport import Directions
from cuticle.scattering.through_strands import _solved, through_tables

Array = NDArray[np.float64]
D = Directions()
FINE = D.fine_theta
STEP = np.pi / len(FINE)
VIEWERS = np.radians(np.linspace(-64, 64, 17))
# Share, axis at the middle viewer and deviation of each M, degrees.
KNOWN = [
    [(0.5, -11, 8), (0.3, 17, 20), (0.2, 30, 6)],
    [(0.5, 6, 5), (0.4, 9, 25), (0.1, -40, 10)],
    [(0.3, -29, 7), (0.6, -6, 30), (0.1, 30, 7)],
    [(0.6, 26, 10), (0.3, 0, 10), (0.1, -30, 10)],
]


def mixtures(known: list[list[tuple[float, float, float]]], viewers: Array = VIEWERS) -> Array:
    """In the columns of `longitudinal_mixtures`: axes turn with the viewer, as a fibre's do."""
    share, axis, deviation = np.moveaxis(np.array(known, float), -1, 0)
    axis = np.radians(axis) - viewers[:, None, None]
    share, variance = (np.broadcast_to(x, axis.shape) for x in (share, np.radians(deviation) ** 2))
    return np.concatenate([share[..., :-1], np.stack([axis, variance], axis=-1).reshape(*axis.shape[:-1], -1)], axis=-1)


def density(columns: Array, theta: Array = FINE) -> Array:
    """Of energy over theta_i, shape (..., theta)."""
    shares = np.append(columns[..., :2], 1 - columns[..., :2].sum(axis=-1, keepdims=True), axis=-1)
    axis, variance = columns[..., 2::2], columns[..., 3::2]
    k, axis = 1 / variance[..., None], axis[..., None]
    x = k * np.cos(theta) * np.cos(axis)  # d'Eon 2011, Eq. 7, by SciPy's Bessel function
    m = k * i0e(x) * np.exp(np.abs(x) + k * (np.sin(theta) * np.sin(axis) - 1)) / -np.expm1(-2 * k)
    return (shares[..., None] * m).sum(axis=-2) * np.cos(theta)


def in_rows(columns: Array) -> Array:
    fine = density(columns)
    return fine.reshape(*fine.shape[:-1], D.rows, -1).sum(axis=-1) * STEP


def apart(found: Array, known: Array) -> Array:
    """∫ of the difference: what lies elsewhere, of 2."""
    return np.abs(density(found) - density(known)).sum(axis=-1) * STEP


def alone(viewers: Array, energy: Array) -> Array:
    """Mixtures of energies that have nothing to do with each other, shape (viewers, n, 8)."""
    return longitudinal_mixtures(D.theta, viewers, energy[:, None, None], [0], [])[:, 0, 0]


def test_a_known_mixture_is_recovered() -> None:
    known = mixtures(KNOWN)
    off = apart(alone(VIEWERS, 7 * in_rows(known)), known)  # any unit
    # One M is off by 0.3 to 0.6 on average. Of the last mixture two peaks of three are told apart.
    assert off.max() < 0.08
    assert (off.mean(axis=0) < [0.02, 0.06, 0.06, 0.08]).all()


def test_a_mixture_of_two_is_recovered() -> None:
    two = [(0.6, -11, 8, 17, 20), (0.5, 6, 5, 9, 25), (0.3, -29, 7, -6, 30), (0.7, 46, 10, 0, 10), (0.4, 17, 6, 17, 15)]
    known = mixtures([[(s, a, d), ((1 - s) / 2, b, e), ((1 - s) / 2, b, e)] for s, a, d, b, e in two])
    off = apart(alone(VIEWERS, in_rows(known)), known)
    assert off[len(VIEWERS) // 2].max() < 0.02  # where one M is off by up to 0.4
    assert off.max() < 0.03


@pytest.mark.parametrize(("deviation", "bound"), [(4, 0.06), (10, 0.01), (25, 0.01), (60, 0.01)])
def test_one_m_stays_one(deviation: float, bound: float) -> None:
    """A lobe as narrow as a row is widened by it: by a twelfth of its square, 4 % of the deviation, and in its tails."""
    one = mixtures([[(1 / 3, axis, deviation)] * 3 for axis in (-24, 0, 34)], VIEWERS[4:13])
    assert apart(alone(VIEWERS[4:13], in_rows(one)), one).max() < bound


def test_between_viewers_interpolated_mixtures_are_near() -> None:
    """Exchanged M's would not be: means of unlike M's lie between the peaks."""
    half = np.radians(np.linspace(-64, 64, 33))
    known = mixtures(KNOWN, half)
    found = alone(half[::2], in_rows(known[::2]))
    between = apart(0.5 * (found[1:] + found[:-1]), known[1::2])
    assert between.max() < 0.08


def test_faint_tails_are_not_lost() -> None:
    """What is 1e-7 of the light of a smooth dark fibre's strands, and far out: by likelihood alone an ESS of 1e-11."""
    fibre = Chiang(beta_m=0.118, beta_n=0.17, alpha=6.05, eta=1.76, sigma_a=2)
    sampler = family("dual_scattering", fibre, d_f=1, d_b=1).sampler_at(fibre, strands=8)
    assert measure(sampler, Strands(fibre).with_strands(8), np.radians(58.2)).ess > 0.95


TILTED = {
    "dark": Chiang(beta_m=0.088, beta_n=0.287, alpha=-10.6, eta=1.787, sigma_a=(12.95, 1.483, 2.262)),
    "smooth": Chiang(beta_m=0.0633, beta_n=0.255, alpha=8.66, eta=1.505, sigma_a=(1.59, 0.1, 2.265)),
}


@pytest.mark.parametrize(("fibre", "bounds"), [("dark", [0.96, 0.88, 0.88, 0.96]), ("smooth", [0.86, 0.92, 0.95, 0.97])])
def test_three_peaks_are_told_apart(fibre: str, bounds: list[float]) -> None:
    """Tilted fibres, whose light has a peak for each lobe of the strand before: with two M's .60 and .85 at worst.

    The smooth one's TT is as narrow as a row of the transport: an M narrower than a row would stand between their centres.
    """
    among, model = family("dual_scattering", TILTED[fibre], d_f=0.7, d_b=0.7), Strands(TILTED[fibre])
    for strands, bound in zip((1, 2, 4, 8), bounds, strict=True):
        sampler, seen = among.sampler_at(TILTED[fibre], strands=strands), model.with_strands(strands)
        for viewer in (-60, -40, 6, 31, 52, 70):
            assert measure(sampler, seen, np.radians(viewer)).ess > bound, (strands, viewer)


@pytest.mark.parametrize(("fibre", "bounds"), [("dark", [0.3, 0.5, 0.8]), ("smooth", [0.94, 0.94, 0.83])])
def test_between_the_tables_numbers_of_strands_the_peaks_are_where_they_are(fibre: str, bounds: list[float]) -> None:
    """M's of one number of strands that are not the next one's, in their order, are mixed up: the smooth one would have .09
    through 3. Of the dark one some are, those at 2 and 4: all that follow lose more at 2 strands than they may.
    """
    among, model = family("dual_scattering", TILTED[fibre], d_f=0.7, d_b=0.7), Strands(TILTED[fibre])
    for strands, bound in zip((3, 6, 12), bounds, strict=True):
        sampler, seen = among.sampler_at(TILTED[fibre], strands=strands), model.with_strands(strands)
        for viewer in (-45, 5, 60):
            assert measure(sampler, seen, np.radians(viewer)).ess > bound, (strands, viewer)


def test_peaks_that_move_with_strands_and_absorption_stay_in_their_order() -> None:
    """Three peaks that turn by 10° from number to number, and whose shares change with absorption."""
    shares = np.array([0.6, 0.55, 0.5, 0.45])
    known = np.array([[mixtures([[(s, -31, 8), (0.6 - 0.6 * s, -3, 20), (0.4 - 0.4 * s, 10, 6)]]) for s in shares]] * 5)
    known[..., 2::2] += np.radians([0, 10, 20, 30, 40])[:, None, None, None, None]
    known = np.moveaxis(known, 2, 0)  # (viewers, strands, absorptions, 1, columns)
    found = longitudinal_mixtures(D.theta, VIEWERS, in_rows(known), [0, 1, 2, 4], [0, 1, 3])
    inner = slice(4, 13)  # far out peaks leave past the poles
    assert apart(found, known[:, [0, 1, 2, 4]])[inner].max() < 0.05
    assert apart(0.5 * (found[:, 2] + found[:, 3]), known[:, 3])[inner].max() < 0.05
    assert (
        apart(0.5 * (found[:, :, :-1] + found[:, :, 1:]), 0.5 * (known[:, :, :-1] + known[:, :, 1:])[:, [0, 1, 2, 4]])[
            inner
        ].max()
        < 0.05
    )


def test_rows_half_as_wide_find_the_same_peaks() -> None:
    """What both the tables and `Strands` lose in rows of 4° would not be seen above."""
    sampler = family("dual_scattering", TILTED["smooth"], d_f=0.7, d_b=0.7).sampler_at(TILTED["smooth"], strands=2)
    model = Strands(TILTED["smooth"], 2, rows=91)
    for viewer in (-32, 10):
        assert measure(sampler, model, np.radians(viewer)).ess > 0.95, viewer


def test_energies_of_nothing_are_finite() -> None:
    known = in_rows(mixtures(KNOWN[:1]))[:, 0]
    peaks = np.eye(D.rows)[[0, 22]][:, None].repeat(len(VIEWERS), axis=1)
    energy = np.stack([0 * known, 1e-120 * known, 1e-90 * known, *peaks], axis=1)
    found = alone(VIEWERS, energy)
    assert np.isfinite(found).all()
    assert (found[..., 3::2] > 0).all()
    assert (found[..., :2] >= 0).all()
    assert (found[..., :2].sum(axis=-1) <= 1).all()
    whole = alone(VIEWERS, known[:, None])[:, 0]
    np.testing.assert_allclose(found[:, 2], whole, rtol=1e-6, atol=1e-9)  # its shape is kept


BETWEEN = Chiang(beta_m=0.17, beta_n=0.3, alpha=11.5, sigma_a=(0.47, 0.47, 0.47, 0.6, 0.7))  # 0.6 is interpolated


def test_between_absorptions_light_is_as_between_those_solved() -> None:
    columns = through_tables(BETWEEN).along
    assert columns.shape == (2, 6, 23, 8, 4, 5)
    np.testing.assert_array_equal(_solved(np.array(BETWEEN.sigma_a)), [0.47, 0.7])
    dark, light, between = columns[..., 4], columns[..., 0], columns[..., 3]
    whole, first, second = (apart(np.moveaxis(x, 3, -1), np.moveaxis(y, 3, -1))
                            for x, y in ((dark, light), (dark, between), (between, light)))  # fmt: skip
    assert np.maximum(first, second).max() <= whole.max() + 0.02
    assert (first + second).mean() <= 1.2 * whole.mean()
    shares, variance = columns[:, :, :, :2], columns[:, :, :, 3::2]
    assert shares.min() >= 0
    assert shares.sum(axis=3).max() <= 1
    assert variance.min() > 0
    assert np.isfinite(columns).all()


def test_three_lobes_are_nearer_to_what_comes_through_a_strand() -> None:
    """`Strands` finds it by row of theta_i and azimuth, from the fibre's values alone."""
    fibre = Chiang(beta_m=0.17, beta_n=0.3, alpha=11.5, sigma_a=(0.47,))
    model = Strands(fibre, 1)
    phi = (np.arange(36) + 0.5) * np.pi / 36
    parts = np.array([1, 1, 1, model.d_b]) * model.d_f
    tables, sheets, behind_one = through_tables(BETWEEN), 0, 1
    for row in range(4, 41, 4):  # viewers at rows of both tables: nothing is interpolated
        f = model.eval(FINE[:, None], D.theta[row], phi)[..., 0].sum(axis=1)
        truth = f * np.cos(FINE) ** 2
        energy = parts * np.exp(tables.energy[sheets, behind_one, row, 0, :, 0])
        shapes = density(tables.along[sheets, behind_one, row // 2, :, :, 0].T)
        axis, variance = axis_and_variance(shapes @ np.sin(FINE) * STEP, shapes @ np.sin(FINE) ** 2 * STEP)
        one = energy @ density(np.concatenate([np.full((4, 2), 1 / 3), *[np.stack([axis, variance], axis=-1)] * 3], axis=-1))
        three = energy @ shapes
        far = [np.abs(x / x.sum() - truth / truth.sum()).sum() for x in (one, three)]
        # One M is off by 0.14 to 0.55, for light through TT is peaked; by half of it three would be no better than one of
        # another width.
        assert far[1] < 0.4 * far[0], np.degrees(D.theta[row])


def test_moments_of_an_m_give_its_axis_and_variance() -> None:
    axis, variance = np.array([-1.2, 0.0, 0.7]), np.array([0.3, 0.01, 0.05])
    a = 1 / np.tanh(1 / variance) - variance
    first, second = a * np.sin(axis), a * variance + (1 - 3 * a * variance) * np.sin(axis) ** 2
    found = axis_and_variance(first, second)
    np.testing.assert_allclose(found, (axis, variance), rtol=1e-6)
