"""Scattering functions of every kind in every host that carries them, against the core in double precision."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from conformance import hosts
from conformance.hosts import HOSTS
from cuticle.export import registry
from cuticle.export.registry import Export, Job
from cuticle.scattering.compact_table import FunctionTable
from cuticle.scattering.fibre_tables import FibreTables
from cuticle.scattering.frames import FRAMES

SINGLE, DOUBLE = dict(rtol=2e-3, atol=1e-6), dict(rtol=1e-4, atol=1e-9)
FIBRE = cuticle.Fibre(alpha_R=-3, beta_R=9, beta_N=12, sigma_a=(0.2, 0.5, 1.1), eta=1.55)
WIDE = cuticle.Fibre(
    alpha_R=3.2, beta_R=15.6, beta_TT=7.7, beta_N=12, sigma_a=(0.6, 0.9, 1.4)
)  # its sums converge as printed
BEHIND = (0.0, 2.5, float(np.finfo(np.float32).max))  # none, some, no end of them


def fibre(model: Any) -> FibreTables:
    """A fibre's tables, thinned for short files."""
    tables: FibreTables = model.host_tables()
    return tables.thinned(9, 8)


def table(counts: tuple[float, ...], *, even: bool) -> FunctionTable:
    """A table that stands for no fibre, rough in every direction."""
    rng = np.random.default_rng(5)
    shape = rng.uniform(0.02, 0.4, (len(counts), 7, 13, 9, 2)).astype(np.float32)
    log_energy = np.cumsum(rng.uniform(-0.7, 0.1, (len(counts), 21, 2)), axis=0).astype(np.float32)
    return FunctionTable(counts, shape, log_energy, 3.0, even, 0.0)


@cache
def tables_of(kind: str) -> FibreTables | FunctionTable:
    makers: dict[str, Callable[[], FibreTables | FunctionTable]] = {
        "strand": lambda: fibre(cuticle.Marschner(FIBRE, "energy_conserving")),
        "strand, Gaussian": lambda: fibre(cuticle.Marschner(FIBRE)),
        "chiang": lambda: fibre(cuticle.Chiang(beta_m=0.5, beta_n=0.6, eumelanin=1.3)),
        "dual, exact": lambda: fibre(cuticle.DualScattering(FIBRE, formulation="exact")),
        "dual, zinke2008": lambda: fibre(cuticle.DualScattering(WIDE, formulation="zinke2008")),
        "table": lambda: table((0.0,), even=True),
        "table among strands": lambda: table((0.0, 1.0, 2.0, 4.0), even=False),
    }
    return makers[kind]()


KINDS = ("strand", "strand, Gaussian", "chiang", "dual, exact", "dual, zinke2008", "table", "table among strands")
CARRIERS = tuple(to for to in HOSTS if registry.host(to).model != "never")


@cache
def cases(around: bool) -> np.ndarray:
    """(theta_i, theta_r, phi, strands[, behind, random]) over their ranges, poles and whole turns among them."""
    rng = np.random.default_rng(6)
    x = rng.random((4000, 6))
    out = np.empty_like(x)
    out[:, :2] = (x[:, :2] - 0.5) * np.radians(178)
    out[:, 2] = (x[:, 2] - 0.5) * 4 * np.pi
    out[:, 3] = np.choose(rng.integers(0, 4, len(x)), [0, 1, x[:, 3], 9 * x[:, 3]])
    out[:, 4] = rng.choice(BEHIND, len(x))
    out[:, 5] = rng.integers(0, 2, len(x))
    out[:60, 0] = np.tile([-np.pi / 2 + 1e-4, 0, np.pi / 2 - 1e-4], 20)
    out[60:100, 2] = np.tile([-np.pi, 0, np.pi - 1e-6, 2 * np.pi], 10)
    return (out if around else out[:, :4]).astype(np.float32).astype(float)


def expected(kind: str, x: np.ndarray) -> np.ndarray:
    """f by the core in double precision; not known (NaN) for a given number of strands with an end behind."""
    made = tables_of(kind)
    theta_i, theta_r, phi, n = (np.ascontiguousarray(c) for c in x[:, :4].T)
    out = np.empty((len(x), made.channels))
    if isinstance(made, FunctionTable):
        made.core.eval(theta_i, theta_r, phi, n, out)
    else:
        made.core().eval(theta_i, theta_r, phi, n, 15, out)
        if x.shape[1] == hosts.AROUND:
            random = np.empty_like(out)
            made.core().expected(theta_i, theta_r, phi, n, np.ascontiguousarray(x[:, 4]), 15, random)
            out = np.where(x[:, 5:] > 0, random, np.where(x[:, 4:5] > 1e30, out, np.nan))
    return out


def written(kind: str, to: str) -> Export:
    made = tables_of(kind)
    counts = made.strands if isinstance(made, FunctionTable) else (0.0,)
    nodes = np.tile(np.array([1.0, 0.1, 2.0, 0.5, 0.5]).reshape(1, 1, 5, 1), (len(counts), 3, 1, 1))
    sampler = cuticle.Sampler(nodes, np.ones(nodes.shape[:2]), counts, even=True)
    job = Job(sampler, "fibre", FRAMES["local-x"], list, made, None, lambda phase, fraction: None)
    return registry.host(to).write(job)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("to", CARRIERS)
def test_f_is_the_cores(kind: str, to: str, browser: Any, tmp_path: Path) -> None:
    x = cases(False)
    got = HOSTS[to].answers(written(kind, to), x, tmp_path, browser)
    np.testing.assert_allclose(got, expected(kind, x), **SINGLE)


@pytest.fixture(scope="module")
def in_double(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], np.ndarray]:
    """What a program in double precision says to all that may be around a strand: compiled and run once a kind."""

    @cache
    def answers(kind: str) -> np.ndarray:
        return hosts.cpp(written(kind, "cpp"), cases(True), tmp_path_factory.mktemp("double"), precision="double")

    return answers


@pytest.mark.parametrize("kind", ["dual, exact", pytest.param("dual, zinke2008", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "to", [pytest.param(to, marks=pytest.mark.slow if to in ("hlsl", "metal", "wgsl") else ()) for to in CARRIERS]
)
def test_f_among_strands_that_are_random_or_have_an_end(
    kind: str, to: str, in_double: Callable[[str], np.ndarray], browser: Any, tmp_path: Path
) -> None:
    x = cases(True)
    reference = in_double(kind)
    known = np.isfinite(wanted := expected(kind, x))
    assert known.mean() > 0.6
    np.testing.assert_allclose(reference[known], wanted[known], **DOUBLE)
    got = HOSTS[to].answers(written(kind, to), x, tmp_path, browser)
    np.testing.assert_allclose(got, reference, **SINGLE)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_f_on_arm(kind: str, tmp_path: Path) -> None:
    x = cases(False)
    np.testing.assert_allclose(hosts.cpp(written(kind, "cpp"), x, tmp_path, compiler=hosts.ARM), expected(kind, x), **SINGLE)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("around", [False, True])
def test_f_in_wgsl_by_another_compiler(kind: str, around: bool, tmp_path: Path) -> None:
    if around and not kind.startswith("dual"):
        pytest.skip("only dual scattering has strands around it")
    x = cases(around)
    got, wanted = hosts.wgsl(written(kind, "wgsl"), x, tmp_path, None), expected(kind, x)
    known = np.isfinite(wanted)
    np.testing.assert_allclose(got[known], wanted[known], **SINGLE)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("compiler", ["glslang", "dxc"])
def test_f_in_hlsl_without_another_language_between(kind: str, compiler: str, tmp_path: Path) -> None:
    x = cases(False)
    got = hosts.hlsl_as_spirv(written(kind, "hlsl"), x, tmp_path, compiler)
    np.testing.assert_allclose(got, expected(kind, x), **SINGLE)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("to", ["cpp", "cuda"])
def test_f_in_double_precision(kind: str, to: str, tmp_path: Path) -> None:
    x = cases(False)
    got = getattr(hosts, to)(written(kind, to), x, tmp_path, precision="double")
    np.testing.assert_allclose(got, expected(kind, x), **DOUBLE)


@pytest.mark.parametrize("to", CARRIERS)
def test_a_wrong_constant_is_caught(to: str, browser: Any, tmp_path: Path) -> None:
    """A coefficient of exp(-x) I0(x)."""
    made = written("strand", to)
    right = ".02635537"
    assert right in made.text
    wrong = Export(made.text.replace(right, ".03635537"), made.table_bytes, made.data, made.model)
    got = HOSTS[to].answers(wrong, cases(False), tmp_path, browser)
    assert not np.allclose(got, expected("strand", cases(False)), **SINGLE)
