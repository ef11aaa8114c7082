"""What the tests share: fits made once, and the folder of reference data."""

from __future__ import annotations

import importlib.util
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from browser import start
from conformance.cuda_compiler import has_gpu
from cuticle.draft.document import Document, document
from cuticle.draft.printed import Printed
from cuticle.grooms.groom import Groom
from cuticle.grooms.procedural import hair_ball

# karellen-llvm-core puts LLVM here; Dr.Jit wants to be told before it is imported.
LLVM = sorted(Path(sys.prefix, "lib").glob("libLLVM.so*")) + sorted(Path(sys.prefix, "lib").glob("libLLVM.dylib"))
if LLVM:
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(LLVM[-1]))

COUNTS = (0.0, 1.0, 2.0, 4.0, 8.0)


SLOW_EXAMPLES = ("cuticle.draft.document.document",)  # of docstrings: test_document.py calls it

# Files whose tests one process runs, for it keeps what they fit and tabulate: the presets' lobes; light through the presets;
# the draft's document and brown hair's sampler.
TOGETHER = (
    ("test_mitsuba.py", "test_mitsuba_functions.py", "test_mitsuba_updates.py"),
    ("test_dual_scattering_integrator.py", "test_render.py"),
    ("test_document.py", "test_document_figures.py", "test_report.py", "test_examples.py", "test_web.py"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as slow Mitsuba's other variants, which repeat what the scalar one shows after minutes of compiling, and hosts
    whose compilers `make test` does not install. Skip wrong numbers in CUDA where no GPU runs them: what is only compiled
    catches none.
    """
    unseen = pytest.mark.skip(reason="no GPU: a wrong number compiles as a right one does, and is caught only where it runs")
    for item in items:
        call = getattr(item, "callspec", None)
        other = call is not None and call.params.get("variant", "scalar_rgb") != "scalar_rgb"
        large = call is not None and call.params.get("to") == "slang"  # what runs it is not there in `make test`
        compiled = item.path.parent.name == "conformance" and "cuda" in item.name  # by nvcc, nor is that
        if other or large or compiled or item.name in SLOW_EXAMPLES:
            item.add_marker(pytest.mark.slow)
        if compiled and item.name.startswith("test_a_wrong_") and not has_gpu():
            item.add_marker(unseen)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give the files of one line of TOGETHER to one process, and every other file as a whole, as `--dist loadfile` does."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return next((group[0] for group in TOGETHER if Path(file).name in group), file)

    return Scheduling(config, log) if config.getvalue("dist") == "loadfile" else None


@pytest.fixture(scope="session")
def document_model() -> cuticle.DualScattering:
    return cuticle.DualScattering(cuticle.Fibre.preset("document"))


@pytest.fixture(scope="session")
def document_fit(document_model: cuticle.DualScattering, tmp_path_factory: pytest.TempPathFactory) -> cuticle.Fit:
    """Made once in a run: the process that has made it leaves it to the others."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    if (shared / "document").exists():
        return pickle.loads((shared / "document").read_bytes())  # type: ignore[no-any-return]
    made = cuticle.fit(document_model, 4, strands=COUNTS)
    own = shared / f"document-{os.getpid()}"
    own.write_bytes(pickle.dumps(made))
    own.replace(shared / "document")  # whole, or not there
    return made


@pytest.fixture(scope="session")
def brown_fit() -> cuticle.Fit:
    return cuticle.fit(cuticle.DualScattering(cuticle.Fibre.preset("brown")), 4, strands=COUNTS)


@pytest.fixture(scope="session")
def brown_sampler(brown_fit: cuticle.Fit) -> cuticle.Sampler:
    return brown_fit.sampler


@pytest.fixture(scope="session")
def sharp_fit() -> tuple[cuticle.DualScattering, cuticle.Fit]:
    model = cuticle.DualScattering(cuticle.Fibre(alpha_R=-7.5, beta_R=7.5, sigma_a=0.6, beta_N=3))
    return model, cuticle.fit(model, 8, strands=COUNTS)


@pytest.fixture(scope="session")
def reproduced(document_model: cuticle.DualScattering, document_fit: cuticle.Fit) -> Document:
    """The draft for its own fibre, beside the printed tables where they are at hand."""
    return document(document_model, printed=Printed.find(), lobes=document_fit, name="document")


@pytest.fixture(scope="session")
def ball() -> Groom:
    return hair_ball(4000)


@pytest.fixture(scope="session")
def strand() -> Groom:
    line = np.stack([np.zeros(6), np.linspace(-1, 1, 6), np.zeros(6)], axis=1)
    return Groom(line.astype(np.float32), np.array([0, 6]), np.array(0.3, np.float32))


@pytest.fixture
def groom() -> Groom:
    """Four strands of random points, of 2, 5, 3 and 4."""
    rng = np.random.default_rng(2)
    offsets = np.array([0, 2, 7, 10, 14])
    return Groom(rng.normal(size=(14, 3)), offsets, rng.uniform(0.01, 0.02, 14))


@pytest.fixture(scope="session")
def data() -> Path:
    folder = Path(os.environ.get("CUTICLE_DATA", Path(__file__).parents[1] / "../shared/data"))
    if not (folder / "document" / "table2.csv").exists():
        pytest.skip(f"reference data is not at {folder}; set CUTICLE_DATA")
    return folder


@pytest.fixture(autouse=True)
def first_variant() -> Iterator[None]:
    """Leave Mitsuba in the variant that its first user gets, whatever a test has set: which test came before is chance."""
    yield
    if (mi := sys.modules.get("mitsuba")) is not None and mi.variant() not in (None, "scalar_rgb"):
        mi.set_variant("scalar_rgb")


@pytest.fixture
def use_variant() -> Callable[[str], Any]:
    """Set a variant of Mitsuba and return Mitsuba; skip where it cannot run."""

    def use(variant: str) -> Any:
        if importlib.util.find_spec("mitsuba") is None:
            pytest.skip("Mitsuba is not installed: pip install 'cuticle[mitsuba]'")
        from cuticle.render.scene import mitsuba

        try:
            return mitsuba(variant)
        except RuntimeError as error:
            if variant.startswith("scalar"):  # which run wherever the plugins were built
                raise
            pytest.skip(str(error))

    return use


@pytest.fixture(scope="session")
def driver() -> Iterator[Any]:
    """Headless Chromium, drawing in software."""
    try:
        started = start()
    except RuntimeError as error:
        pytest.skip(str(error))
    yield started
    started.quit()


@pytest.fixture
def browser(driver: Any) -> Iterator[Any]:
    """The same for one test: a page left open would go on drawing, on half a core."""
    yield driver
    driver.get("about:blank")


def sphere(n_theta: int, n_phi: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Midpoints over the sphere, and a cell's d theta d phi."""
    theta = (np.arange(n_theta) + 0.5) / n_theta * np.pi - np.pi / 2
    phi = (np.arange(n_phi) + 0.5) / n_phi * 2 * np.pi - np.pi
    return theta[:, None], phi[None, :], np.pi / n_theta * 2 * np.pi / n_phi
