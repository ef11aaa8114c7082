"""Fibres: ratios, pigments, files, and one clear line for everything that is wrong."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

import cuticle
from cuticle import Fibre
from cuticle.scattering.presets import PRESETS


def test_usual_ratios_unless_given() -> None:
    fibre = Fibre(alpha_R=-6, beta_R=8, sigma_a=0.5)
    np.testing.assert_allclose(np.degrees(fibre.alpha), [-6, 3, 9])
    np.testing.assert_allclose(np.degrees(fibre.beta), [8, 4, 16])
    assert np.degrees(Fibre(alpha_R=-6, alpha_TT=1, sigma_a=0.5).alpha)[1] == pytest.approx(1)


def test_pigment() -> None:
    fibre = Fibre(eumelanin=1.3, pheomelanin=0.2)
    np.testing.assert_allclose(fibre.absorption, 1.3 * np.array([0.419, 0.697, 1.37]) + 0.2 * np.array([0.187, 0.4, 1.05]))
    assert fibre.channels == 3
    assert Fibre(sigma_a=0.3).channels == 1


def test_frozen_and_equal_by_value() -> None:
    fibre = Fibre.preset("brown")
    with pytest.raises(FrozenInstanceError):
        fibre.eta = 2  # type: ignore[misc]
    assert fibre == Fibre.preset("brown")
    assert hash(fibre) == hash(Fibre.preset("brown"))


@pytest.mark.parametrize("name", PRESETS)
def test_presets_state_their_source_and_go_through_toml(name: str, tmp_path) -> None:
    assert len(PRESETS[name].source.split()) > 8
    fibre = Fibre.preset(name)
    path = fibre.save(tmp_path / "fibre.toml")
    assert Fibre.load(path) == fibre
    assert Fibre.from_toml(fibre.to_toml()) == fibre


def test_presets_have_the_published_values() -> None:
    """Marschner et al. 2003, table 1, its middle; pbrt-v4's hair with d'Eon's pigments: per radius, of eumelanin 1."""
    marschner = Fibre.preset("marschner")
    assert (marschner.alpha_R, marschner.beta_R, marschner.beta_N, marschner.eta) == (-7.5, 7.5, 17.5, 1.55)
    assert marschner.absorption == (0.55,)
    for name, eumelanin in (("blond", 0.3), ("brown", 1.3), ("black", 8.0)):
        fibre = Fibre.preset(name)
        assert np.degrees(fibre.alpha) == pytest.approx([-2, 1, 4])
        assert fibre.eta == 1.55
        assert fibre.absorption == pytest.approx([0.419 * eumelanin, 0.697 * eumelanin, 1.37 * eumelanin])


def test_replace() -> None:
    fibre = Fibre.preset("brown").replace(sigma_a=0.1)
    assert fibre.absorption == (0.1,)
    assert fibre.beta_R == Fibre.preset("brown").beta_R
    assert Fibre(sigma_a=0.1).replace(eumelanin=1.0).channels == 3


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"beta_R": 0, "sigma_a": 1}, "beta_R must be in [0.1, 60] degrees, got 0; published fibres have 5 to 10"),
        ({"beta_R": float("nan"), "sigma_a": 1}, "beta_R must be in [0.1, 60] degrees, got nan"),
        ({"beta_R": "wide", "sigma_a": 1}, "beta_R must be a number, got 'wide'"),
        ({"alpha_R": 90, "sigma_a": 1}, "alpha_R must be in [-45, 45] degrees, got 90"),
        ({"beta_N": 0, "sigma_a": 1}, "beta_N must be in [0.2, 90] degrees"),
        ({"eta": 1.0, "sigma_a": 1}, "eta must be in (1, 3], got 1"),
        ({"sigma_a": -0.1}, "sigma_a must be in [0, 1000] per radius, got -0.1"),
        ({"sigma_a": (0.1, float("inf"))}, "sigma_a[1] must be in [0, 1000] per radius, got inf"),
        ({"sigma_a": ()}, "sigma_a must have 1 to 32 channels, got 0"),
        ({"sigma_a": 1, "eumelanin": 1}, "give sigma_a or eumelanin, not both"),
        ({}, "a fibre needs its absorption"),
        ({"sigma_a": 1, "d_f": 0}, "d_f must be in (0, 1], got 0"),
        ({"sigma_a": 1, "d_b": 1.5}, "d_b must be in [0, 1], got 1.5"),
        ({"sigma_a": 1, "formulation": "other"}, "formulation must be one of exact, zinke2008; got 'other'"),
        ({"sigma_a": 1, "beta": 3}, "a fibre has no parameter 'beta'; it has alpha_R"),
    ],
)
def test_bad_parameters(values: dict, words: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        Fibre(**values)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[fibre", "is not valid TOML"),
        ("beta_R = 3", "must hold one table, [fibre]"),
        ("[fibre]\nbeta_R = 99\nsigma_a = 1", "beta_R must be in [0.1, 60]"),
        ("[fibre]\nsigma_a = 'dark'", "sigma_a must be a number, got 'dark'"),
        ("", "must hold one table, [fibre], got nothing"),
    ],
)
def test_bad_toml(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=".") as error:
        Fibre.from_toml(text, source="mine.toml")
    assert words in str(error.value)
    assert "mine.toml" in str(error.value)


def test_unknown_preset_and_unreadable_files(tmp_path) -> None:
    with pytest.raises(ValueError, match="preset must be one of document, marschner, blond, brown, black; got 'red'"):
        Fibre.preset("red")
    with pytest.raises(ValueError, match="cannot read fibre .*: No such file or directory"):
        Fibre.load(tmp_path / "none.toml")
    with pytest.raises(ValueError, match="cannot write .*: No such file or directory"):
        cuticle.Fibre.preset("brown").save(tmp_path / "none" / "x.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="it is not text in UTF-8"):
        Fibre.load(tmp_path / "binary.toml")
