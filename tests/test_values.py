"""Every public class: a used value is pickled, copied and sent to a new process, and comes back equal."""

from __future__ import annotations

import copy
import importlib.util
import inspect
import json
import multiprocessing
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

import cuticle
from cuticle.grooms.density_grid import DensityGrid
from cuticle.grooms.procedural import hair_ball
from cuticle.scattering.by_name import model_of

FIBRE = cuticle.Fibre.preset("brown")
GREY = FIBRE.replace(eumelanin=None, sigma_a=0.6)  # one channel: tables among strands take a third of the time
ANGLES = (0.1, -0.2, 2.5)


def lambertian(theta_i: Any, theta_r: Any, phi: Any) -> Any:
    return 0.05 + 0 * theta_i


@cache
def used(name: str) -> Any:
    """Return a value whose lazy tables and core objects have been made."""
    value = MAKE[name]()
    if hasattr(value, "eval"):
        value.eval(*ANGLES)
    if hasattr(value, "pdf") and callable(value.pdf):
        value.pdf(*ANGLES, 0.0)
        value.pdf(*np.float32(ANGLES), 0.0)
    return value


def _tabulated() -> Any:
    theta, phi = np.linspace(-1.5, 1.5, 31), np.linspace(0, np.pi, 19)
    return cuticle.Tabulated(np.linspace(-1.5, 1.5, 9), theta, phi, np.full((9, 31, 19, 3), 0.05))


def _mitsuba() -> Any:
    if importlib.util.find_spec("mitsuba") is None:
        pytest.skip("Mitsuba is not installed")
    return cuticle.from_mitsuba("hair", h=0.3)


MAKE: dict[str, Callable[[], Any]] = {
    "Fibre": lambda: FIBRE,
    "Marschner": lambda: cuticle.Marschner(FIBRE),
    "DualScattering": lambda: cuticle.DualScattering(GREY, 2),
    "Chiang": lambda: cuticle.Chiang(eumelanin=1.3),
    "ChiangNear": lambda: cuticle.Chiang(eumelanin=1.3).near([0.3]),
    "Family": lambda: cuticle.family("marschner").sampler_at(FIBRE),  # which holds it, and is called without a fibre
    "FamilyAmong": lambda: cuticle.family("dual_scattering", cuticle.Chiang(sigma_a=0.8)).sampler_at(sigma_a=0.6, strands=2),
    "Fibres": lambda: cuticle.family("chiang").fibres(beta_m=[0.2, 0.3], eumelanin=1.3),
    "Strands": lambda: cuticle.Strands(used("Tabulated"), 2),
    "Tabulated": _tabulated,
    "Fit": lambda: cuticle.fit(used("Marschner"), 2),
    "Sampler": lambda: used("Fit").sampler,
    "Audit": lambda: cuticle.audit(used("ChiangNear").model.near(0.3), samples=10_000, theta_r=[0.2]),
    "Report": lambda: cuticle.check(used("Sampler"), used("Marschner"), samples=10_000, theta_r=[0.2]),
    "Document": lambda: cuticle.Document(
        name="brown",
        model=used("DualScattering"),
        axis=np.pi,
        table_1=(),
        table_2=(),
        table_3=(),
        found=None,
        reason="",
        claims=(),
        quality={"lobes": {"0": {"ess": 0.9}}},
        fits={"lobes": used("Fit")},
        mixing=(),
        printed=None,
    ),  # `document` takes 20 s
    "Distribution": lambda: cuticle.tabulate(used("Marschner"), 0.2, n_theta=20, n_phi=20),
    "Quality": lambda: cuticle.measure(used("Sampler"), used("Marschner"), 0.2),
    "ChannelBounds": lambda: cuticle.channel_bounds(used("Marschner"), 0.2),
    "Averages": lambda: used("DualScattering").averages(0.2),
    "Sample": lambda: used("Sampler").sample(0.2, [[0.1, 0.2, 0.3]]),
    # Not named at the top level, but what its functions return.
    "Function": lambda: cuticle.from_callable(lambertian),
    "MitsubaBsdf": _mitsuba,
    "Groom": lambda: hair_ball(10),
    "DensityGrid": lambda: DensityGrid.build(hair_ball(10), 4),
}
MODELS = ("Marschner", "DualScattering", "Chiang", "Tabulated", "Function", "MitsubaBsdf")
NO_VALUES = {"Bcsdf"}  # a protocol
TUPLES = {"Averages", "Sample"}  # of arrays, which NumPy compares element by element
EVALUATED_ONCE = {"Strands"}  # its tables take 5 s


def same(a: Any, b: Any) -> bool:
    if isinstance(a, tuple) and not hasattr(a, "__dict__"):
        return type(a) is type(b) and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b) and hash(a) == hash(b)


def in_another_process(values: list[Any]) -> list[Any]:
    """Return what the values give there."""
    return [v.eval(*ANGLES) if hasattr(v, "eval") and type(v).__name__ not in EVALUATED_ONCE else repr(v) for v in values]


def test_every_public_class_is_listed() -> None:
    classes = {n for n in cuticle.__all__ if inspect.isclass(getattr(cuticle, n))}
    assert classes - NO_VALUES - {"ChiangNear"} == classes & set(MAKE) - {"ChiangNear"}


@pytest.mark.parametrize("name", MAKE)
@pytest.mark.parametrize(
    "copied", [lambda v: pickle.loads(pickle.dumps(v)), copy.deepcopy, copy.copy], ids=["pickle", "deepcopy", "copy"]
)
def test_a_used_value_is_copied(name: str, copied: Callable[[Any], Any]) -> None:
    value = used(name)
    other = copied(value)
    assert same(value, other)
    for key, array in getattr(value, "__dict__", {}).items():
        if isinstance(array, np.ndarray) and key in vars(other):
            assert vars(other)[key].flags.writeable == array.flags.writeable, key
    if hasattr(value, "eval") and name not in EVALUATED_ONCE:
        assert np.array_equal(other.eval(*ANGLES), value.eval(*ANGLES))
    if name == "Sampler":
        assert np.array_equal(other.pdf(*ANGLES), value.pdf(*ANGLES))
    with pytest.raises(AssertionError):
        assert same(value, used("Fibre" if name != "Fibre" else "Chiang"))


def test_a_new_process_takes_values_and_returns_them() -> None:
    values = [used(n) for n in MAKE if n != "MitsubaBsdf"]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.apply(in_another_process, (values,))
    for here, other in zip(in_another_process(values), there, strict=True):
        assert np.array_equal(here, other)


def test_values_that_differ_are_not_equal() -> None:
    sampler, fitted = used("Sampler"), used("Fit")
    nodes = sampler.nodes.copy()
    nodes[0, 0, 1, 0] = np.nextafter(nodes[0, 0, 1, 0], 1)
    other = cuticle.Sampler(nodes, sampler.energy, sampler.strands, sampler.even, sampler.about, sampler.family)
    assert other != sampler
    assert len({sampler, other, copy.deepcopy(sampler)}) == 2
    assert used("Strands").with_strands(3) != used("Strands")
    assert used("ChiangNear").model.near([0.4]) != used("ChiangNear")
    assert hair_ball(11) != used("Groom")
    assert cuticle.Marschner(FIBRE, "energy_conserving") != used("Marschner")
    assert fitted != cuticle.fit(used("Marschner"), 1)


def test_a_material_without_parameters_says_why_it_cannot_be_copied() -> None:
    near = copy.copy(used("MitsubaBsdf"))
    near.parameters = None
    with pytest.raises(TypeError, match=r"give from_mitsuba a plugin's name"):
        pickle.dumps(near)


def test_a_fit_is_read_back_equal(tmp_path: Path) -> None:
    fitted = cuticle.fit(used("Marschner"), None)
    read = cuticle.Fit.load(fitted.save(tmp_path / "fit.json"))
    assert read == fitted
    assert (read.seconds, read.candidates, repr(read)) == (fitted.seconds, fitted.candidates, repr(fitted))
    assert model_of(read.sampler) == used("Marschner")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "cuticle-sampler"}, 'its "format" is not "cuticle-fit"'),
        ({"version": 2}, "newer than 1"),
        ({"ess": [[1.0]]}, r"ess must have shape \(1, 9\), got \(1, 1\)"),
        ({"sampler": {}}, 'its "format" is not "cuticle-sampler"'),
        ({"seconds": "long"}, "seconds must be of type number"),
    ],
)
def test_a_wrong_fit_is_refused_in_one_line(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    file = used("Fit").save(tmp_path / "fit.json")
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(ValueError, match=message) as refused:
        cuticle.Fit.load(file)
    assert "\n" not in str(refused.value)
    assert str(file) in str(refused.value)


@pytest.mark.parametrize("name", [n for n in MAKE if n not in EVALUATED_ONCE and (n in ("Sampler", "Fit") or n in MODELS)])
def test_a_plot_shows_the_values(name: str) -> None:
    value = used(name)
    axes = Figure().add_subplot()
    if name == "Fit":
        assert value.plot(axes=axes) is axes
        assert np.array_equal(axes.lines[0].get_ydata(), value.ess[0])
        return
    assert value.plot(0.3, axes=axes) is axes
    image = axes.images[0].get_array()
    row, column = 100, 37  # theta_i 10.5°, phi 56.25°
    theta, phi = np.radians([10.5, 56.25])
    if name == "Sampler":
        expected = value.pdf(theta, 0.3, phi)
    else:
        f = value.eval(theta, 0.3, phi).reshape(-1)
        expected = (f @ [0.2126, 0.7152, 0.0722] if len(f) == 3 else f.mean()) * np.cos(theta)
    np.testing.assert_allclose(image[row, column], expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("Fibre", "beta_N"),
        ("Chiang", "eumelanin"),
        ("Fit", "worst"),
        ("Report", "outcome"),
        ("Audit", "limit"),
        ("Document", "verdict"),
    ],
)
def test_notebooks_show_a_table(name: str, shown: str) -> None:
    text = used(name)._repr_html_()
    root = ElementTree.fromstring(text)  # well-formed: every text is escaped
    assert root.tag == "table"
    assert shown in "".join(root.itertext())
