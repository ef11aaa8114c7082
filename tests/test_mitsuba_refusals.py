"""What the BSDF `cuticle` refuses, and what is told where a variant of Mitsuba cannot run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from cuticle.fitting.samplings import SAMPLINGS
from cuticle.mitsuba.material import read_material, samplings_of
from cuticle.render.scene import mitsuba
from mitsuba_answers import UseVariant


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"fibre": "purple"},
            "a scattering function must be a preset (document, marschner, blond, brown, black), a .toml with [fibre] or"
            " [chiang], a table (.npz, .csv), or mitsuba:PLUGIN; got 'purple'",
        ),
        ({"fibre": "brown", "betaR": 3.0}, "cuticle has no parameter 'betaR'"),
        ({}, "cuticle needs a fibre"),
        (
            {"fibre": "brown", "sigma_a": {"type": "uniform", "value": 0.3}, "lobes": 16},
            "sigma_a as a texture needs a closed form: a Fibre's of the exact formulation or Chiang's",
        ),
        (
            {"fibre": "brown", "d_f": {"type": "uniform", "value": 0.3}},
            "d_f must not be a texture; these may: scale, beta_m",
        ),
        ({"fibre": "brown", "beta_N": {"type": "uniform", "value": 99}}, "beta_N must be in [0.2, 90] degrees, got 99"),
        (
            {"fibre": "document", "sampling": "function"},
            "sampling function: formulation zinke2008 has no density of its own",
        ),
        (
            {"fibre": "brown", "beta_N": 60.0, "sampling": "function"},
            "sampling function: beta_N must lie in [1, 45], got 60",
        ),
        ({"fibre": "brown", "sampling": "function", "lobes": 2}, "lobes is their number, for sampling lobes; leave it out"),
        ({"fibre": "brown", "beta_R": 400.0}, "beta_R must be in [0.1, 60] degrees, got 400"),
        ({"fibre": "brown", "sampling": "best"}, "sampling must be one of function, lobes, document, uniform; got 'best'"),
        ({"fibre": "brown", "scale": -2.0}, "scale must be in [0, 1e+09], got -2"),
        ({"fibre": "brown", "scale": float("nan")}, "scale must be in [0, 1e+09], got nan"),
        ({"beta_m": 0.3, "eumelanin": 1.3, "d_b": 2.0}, "d_b must be in [0, 1], got 2"),
        ({"sigma_a": 0.3, "beta_m": {"type": "diffuse"}}, "beta_m must be a number or a texture, got SmoothDiffuse"),
        ({"sigma_a": 0.3, "beta_m": [0.1, 0.2, 0.3]}, "beta_m must be a number, got [0.1, 0.2, 0.3]"),
        ({"fibre": ""}, "a scattering function must be a preset"),
        ({"fibre": "brown", "lobes": 99}, "lobes must be in [1, 16], got 99"),
        ({"fibre": "brown", "direct_share": 1.5}, "direct_share must be in [0.01, 0.99], got 1.5"),
        ({"filename": "nowhere.json"}, "cannot read sampler nowhere.json: No such file or directory"),
        ({"fibre": "nowhere.toml"}, "cannot read model nowhere.toml: No such file or directory"),
    ],
)
def test_bad_parameters_are_one_line_before_any_fit(
    given: dict[str, Any], message: str, use_variant: UseVariant, monkeypatch: pytest.MonkeyPatch
) -> None:
    mi = use_variant("scalar_rgb")
    monkeypatch.setattr("cuticle.fitting.fit.fit", None)
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": "cuticle", **given})
    text = str(caught.value)
    assert message in text
    assert "Traceback" not in text


def test_an_old_llvm_is_told_before_it_aborts(use_variant: UseVariant, monkeypatch: pytest.MonkeyPatch) -> None:
    mi = use_variant("scalar_rgb")
    import drjit as dr

    monkeypatch.setattr(dr, "has_backend", lambda _: True)
    monkeypatch.setattr(dr.detail, "llvm_version", lambda: (15, 0, 6))
    mi.set_variant("llvm_ad_rgb")
    with pytest.raises(RuntimeError, match=r"would abort with LLVM 15.0.6: install LLVM 19 or newer"):
        mi.load_dict({"type": "cuticle", "fibre": "brown"})
    monkeypatch.setattr(dr, "has_backend", lambda _: False)
    with pytest.raises(RuntimeError, match="needs LLVM and none is found"):
        mi.load_dict({"type": "cuticle", "fibre": "brown"})


def test_a_missing_gpu_is_told_before_the_variant_is_set(use_variant: UseVariant, monkeypatch: pytest.MonkeyPatch) -> None:
    use_variant("scalar_rgb")
    import drjit as dr

    monkeypatch.setattr(dr, "has_backend", lambda _: False)
    with pytest.raises(RuntimeError, match=r"^cuda_ad_rgb needs an NVIDIA GPU and its driver, and none is found: scalar"):
        mitsuba("cuda_ad_rgb")


def test_another_mitsuba_is_refused(use_variant: UseVariant, monkeypatch: pytest.MonkeyPatch) -> None:
    mi = use_variant("scalar_rgb")
    from cuticle import mitsuba as plugin

    monkeypatch.setattr(mi, "__version__", "3.8.0")
    with pytest.raises(RuntimeError, match=r"this is 3.8.0: pip install mitsuba==3.9.1"):
        plugin.register()
    monkeypatch.undo()
    monkeypatch.setattr(plugin, "plugin_folder", lambda: Path("/nowhere"))
    with pytest.raises(RuntimeError, match="built without its Mitsuba plugins"):
        plugin.register()


def test_without_mitsuba_the_rest_works() -> None:
    script = (
        "import sys; sys.modules['mitsuba'] = None\n"
        "import cuticle, cuticle.cli.app\n"
        "cuticle.DualScattering(cuticle.Fibre.preset('brown'))\n"
        "try:\n    import cuticle.mitsuba\nexcept ImportError as error:\n    print(error)\n"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "cuticle.mitsuba needs mitsuba, which is not installed" in ran.stdout
    assert "pip install 'cuticle[mitsuba]'" in ran.stdout


@pytest.mark.parametrize(
    ("given", "offered"),
    [
        ({"fibre": "brown"}, ("function", "lobes", "document", "uniform")),
        ({"fibre": "document"}, ("lobes", "document", "uniform")),
        ({"beta_m": 0.3, "beta_n": 0.3, "eumelanin": 1.3}, ("function", "lobes", "uniform")),
        ({"beta_m": 0.3, "beta_n": 0.01, "eumelanin": 1.3}, ("lobes", "uniform")),
    ],
)
def test_what_may_be_drawn_from_is_what_is_not_refused(given: dict[str, Any], offered: tuple[str, ...]) -> None:
    assert samplings_of(given) == offered
    for name in set(SAMPLINGS) - set(offered):
        with pytest.raises(ValueError, match=f"sampling {name}"):
            read_material({**given, "sampling": name})
