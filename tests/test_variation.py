"""Variation of hair: distributions with the moments that were asked for, in clumps of the size asked for, along a strand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

import cuticle
from cuticle.grooms.groom import Groom
from cuticle.grooms.procedural import wavy_lock
from cuticle.grooms.variation import vary
from cuticle.scattering.conventions import color_of_sigma_a

COUNT = 20_000
LEVEL = 1e-3  # false positives of a comparison; the seeds are fixed


@pytest.fixture(scope="module")
def lawn() -> Groom:
    """Straight strands over a square of side 20; two points each, but the last has 5 at uneven steps."""
    rng = np.random.default_rng(5)
    roots = np.column_stack([20 * rng.random(COUNT), np.zeros(COUNT), 20 * rng.random(COUNT)])
    points = (roots[:, None] + np.array([[0, 0, 0], [0, 1, 0]])).reshape(-1, 3)
    points = np.concatenate([points[:-1], roots[-1] + np.array([[0, y, 0] for y in (0.1, 0.25, 0.5, 1.0)])])
    return Groom(points, np.append(2 * np.arange(COUNT), 2 * COUNT + 3), 0.01)


def distributions(spread: float = 1.0) -> dict[str, Any]:
    """What SciPy makes of means and deviations, these times `spread`: log-normal, beta and normal."""

    def log_normal(mean: float, deviation: float) -> Any:
        s = math.sqrt(math.log1p((spread * deviation / mean) ** 2))
        return stats.lognorm(s, scale=mean * math.exp(-(s**2) / 2))

    mean, variance = 0.2, (spread * 0.3) ** 2 * 0.2 * 0.8
    total = mean * (1 - mean) / variance - 1
    return {
        "pigment": log_normal(1.3, 0.52), "redness": stats.beta(mean * total, (1 - mean) * total),
        "beta_m": log_normal(0.25, 0.025), "beta_n": log_normal(0.4, 0.04), "alpha": stats.norm(2.5, spread * 0.7),
    }  # fmt: skip


def test_values_have_the_distributions_asked_for(lawn: Groom) -> None:
    found = vary(
        lawn, melanin=1.3, melanin_spread=0.4, redness=0.2, redness_spread=0.3, roughness=0.25, azimuthal_roughness=0.4,
        roughness_spread=0.1, tilt=2.5, tilt_spread=0.7, clumping=0,
    ).attributes  # fmt: skip
    pigment = found["eumelanin"] + found["pheomelanin"]
    own = {**found, "pigment": pigment, "redness": found["pheomelanin"] / pigment}
    for name, right in distributions().items():
        assert own[name].mean() == pytest.approx(right.mean(), abs=4 * right.std() / math.sqrt(COUNT))
        assert own[name].std() == pytest.approx(right.std(), rel=0.03)  # 4 errors of a log-normal of this skewness
        assert stats.kstest(own[name], right.cdf).pvalue >= LEVEL / 5
    for name, wrong in distributions(0.95).items():
        assert stats.kstest(own[name], wrong.cdf).pvalue < LEVEL / 5
    assert np.corrcoef(pigment, own["redness"])[0, 1] == pytest.approx(0, abs=4 / math.sqrt(COUNT))


def test_strays_have_no_pigment_and_the_others_theirs(lawn: Groom) -> None:
    none, some, more = (vary(lawn, strays=p, clumping=0).attributes for p in (0, 0.1, 0.3))
    grey = [a["eumelanin"] == 0 for a in (none, some, more)]
    for share, found in zip((0, 0.1, 0.3), grey, strict=True):
        assert found.mean() == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / COUNT))
    assert not more["pheomelanin"][grey[2]].any()
    assert (grey[2] | ~grey[1]).all()  # whoever is grey stays so
    for name in ("eumelanin", "pheomelanin", "beta_m"):
        np.testing.assert_array_equal(some[name][~grey[1]], none[name][~grey[1]])


def test_pigment_along_a_strand(lawn: Groom) -> None:
    base = vary(lawn, clumping=0).attributes["eumelanin"]
    found = vary(lawn, clumping=0, root_darkening=0.8, root_length=0.5, tip_lightening=0.3).attributes
    assert found["eumelanin"].shape == (len(lawn.points),)
    assert found["beta_m"].shape == (COUNT,)
    ratio = found["eumelanin"] / np.repeat(base, lawn.counts)
    np.testing.assert_allclose(ratio[lawn.offsets[:-1]], 1.8, rtol=1e-5)
    np.testing.assert_allclose(ratio[lawn.offsets[1:] - 1], 0.7, rtol=1e-5)
    # Shares .1, .25 and .5 of the length: half of it is where the root's darkness ends, and sqrt(.7) is left by the sun.
    np.testing.assert_allclose(ratio[-3], (1 + 0.8 / 2) * 0.7**0.25, rtol=1e-5)
    np.testing.assert_allclose(ratio[-2], math.sqrt(0.7), rtol=1e-5)
    assert (
        np.diff(vary(wavy_lock(5), root_darkening=2, melanin_spread=0).attributes["eumelanin"].reshape(5, -1)) <= 0
    ).all()
    assert vary(lawn, clumping=0, root_darkening=-1).attributes["eumelanin"][lawn.offsets[:-1]].max() == 0


def test_neighbours_vary_together_as_far_as_a_clump(lawn: Groom) -> None:
    """The correlation of log pigment is c exp(-d²/2l²) at a distance d between roots."""
    at = lawn.points[lawn.offsets[:-1]][:, ::2]
    size, share = 0.5, 0.6
    found = vary(lawn, clumping=share, clump_size=size, redness=0).attributes["eumelanin"]
    z = np.log(found)
    z = (z - z.mean()) / z.std()
    order = np.argsort(at[:, 0])
    pair = np.stack([order[:-400].repeat(40), (np.arange(COUNT - 400)[:, None] + np.arange(1, 400, 10)).ravel()])
    pair[1] = order[pair[1]]
    distance = np.linalg.norm(at[pair[0]] - at[pair[1]], axis=1)
    for d in (0.1, 0.5, 1.0, 3.0):
        near = np.abs(distance - d) < 0.05
        # The field repeats about (20/.5)² times over the square, in 256 waves: its correlation is known to some .03.
        assert (z[pair[0]] * z[pair[1]])[near].mean() == pytest.approx(share * math.exp(-((d / size) ** 2) / 2), abs=0.07)
    alone = np.log(vary(lawn, clumping=0, redness=0).attributes["eumelanin"])
    near = distance < 0.1
    assert np.corrcoef(alone[pair[0][near]], alone[pair[1][near]])[0, 1] == pytest.approx(0, abs=0.05)


def test_a_strand_keeps_its_values_when_others_are_added(lawn: Groom) -> None:
    few = Groom(lawn.points[:200], lawn.offsets[:101], 0.01)
    how: dict[str, Any] = {
        "strays": 0.3,
        "tilt": 2,
        "tip_lightening": 0.5,
        "clump_size": 2.0,
        "dye": (0.5, 0.1, 0.2),
        "dyed": 0.5,
    }
    own, many = vary(few, **how).attributes, vary(lawn, **how).attributes
    for name, values in own.items():
        np.testing.assert_array_equal(values, many[name][: len(values)])
    assert vary(few, **how) == vary(few, **how)
    assert vary(few, **how, seed=2) != vary(few, **how)


def test_dye_is_absorption_beside_that_of_pigments(lawn: Groom) -> None:
    plain, dyed = (vary(lawn, melanin=0.4, dye=dye, dyed=0.25, clumping=0) for dye in (None, (0.5, 0.2, 0.1)))
    assert set(dyed.attributes) == {"beta_m", "beta_n", "sigma_a"}
    first = slice(0, 300)
    pigment = np.array(
        [
            cuticle.Chiang(eumelanin=float(e), pheomelanin=float(p)).absorption
            for e, p in zip(plain.attributes["eumelanin"][first], plain.attributes["pheomelanin"][first], strict=True)
        ]
    )
    more = dyed.attributes["sigma_a"][first] - pigment
    has = more[:, 0] > 1e-5
    assert has.mean() == pytest.approx(0.25, abs=4 * math.sqrt(0.25 * 0.75 / 300))
    assert np.abs(more[~has]).max() <= 1e-6
    for absorbed, beta_n in zip(more[has], dyed.attributes["beta_n"][first][has], strict=True):
        np.testing.assert_allclose(color_of_sigma_a(absorbed, float(beta_n)), [0.5, 0.2, 0.1], rtol=1e-4)


def test_other_attributes_stay_and_those_of_absorption_are_replaced(lawn: Groom) -> None:
    found = vary(lawn.with_attributes(mine=1, sigma_a=np.ones((COUNT, 3)), color=np.ones((COUNT, 3))), clumping=0)
    assert set(found.attributes) == {"mine", "beta_m", "beta_n", "eumelanin", "pheomelanin"}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"melanin": -1}, r"melanin must be in \[0, 100\], got -1; blond hair has 0.3"),
        ({"redness": 1.5}, r"redness must be in \[0, 1\], got 1.5; it is the share of pheomelanin"),
        ({"roughness": 0}, r"roughness must be in \[0.01, 1\], got 0"),
        ({"azimuthal_roughness": math.nan}, "azimuthal_roughness must be in"),
        ({"strays": 20}, r"strays must be in \[0, 1\], got 20; it is a share of the strands"),
        ({"tilt": 90}, "tilt must be in .* degrees, got 90"),
        ({"root_length": 0}, r"root_length must be in \(0, 1\], got 0"),
        ({"clump_size": 0}, "clump_size must be in"),
        ({"dye": (1, 0, 0)}, "dye must lie in .*0.0001, 1"),
        ({"dye": 0.5}, r"dye must be a colour of 3 channels, linear RGB, got shape \(\)"),
        ({"seed": -1}, "seed must be in"),
        ({"melanin": None}, "melanin must be a number, got None"),
        ({"strays": "many"}, "strays must be a number, got 'many'"),
    ],
)
def test_wrong_variation_is_told(given: dict[str, Any], words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        vary(wavy_lock(3), **given)
