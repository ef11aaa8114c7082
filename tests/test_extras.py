"""What `pip install cuticle` leaves out is told in one line, and is missed nowhere else."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from cuticle._support.extras import EXTRAS, MissingExtraError, needed
from cuticle._support.files import tomllib

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
NEAR = "cuticle.Chiang(eumelanin=1.3).near(0)"


def without_extras(code: str) -> subprocess.CompletedProcess[str]:
    """Run code where no package of an extra can be imported."""
    blocked = f"import sys; sys.modules.update(dict.fromkeys({list(EXTRAS)}))\nimport cuticle\n"
    return subprocess.run([sys.executable, "-c", blocked + code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("code", "line"),
    [
        ("import cuticle.export", "cuticle.export needs jinja2, which is not installed: pip install 'cuticle[export]'"),
        ("import cuticle.report.page", "cuticle.report needs jinja2, which is not installed: pip install 'cuticle[export]'"),
        (f"cuticle.audit({NEAR}, samples=10_000, theta_r=[0]).figure()", "a picture needs matplotlib"),
        ("cuticle.Chiang(eumelanin=1.3).plot(0)", "a plot needs matplotlib"),
        ("import cuticle.render.compare", "a comparison needs matplotlib"),
        ("import cuticle.mitsuba", "cuticle.mitsuba needs mitsuba, which is not installed: pip install 'cuticle[mitsuba]'"),
        ("cuticle.from_mitsuba('hair')", "from_mitsuba needs mitsuba"),
    ],
)
def test_what_is_missing_is_one_line(code: str, line: str) -> None:
    done = without_extras(code)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert line in last
    assert re.search(r"pip install 'cuticle\[\w+\]'$", last)


def test_the_command_line_without_its_extra_is_one_line() -> None:
    done = without_extras("import cuticle.cli; cuticle.cli.main()")
    assert done.returncode == 2
    assert done.stderr == "cuticle: the command line needs typer, which is not installed: pip install 'cuticle[cli]'\n"


def test_the_rest_needs_numpy_and_scipy_only() -> None:
    code = (
        "import numpy as np\n"
        "cuticle.family('chiang').sample(0.3, np.full((2, 3), 0.4), eumelanin=1.3)\n"
        "fit = cuticle.fit(cuticle.Marschner(cuticle.Fibre.preset('black')), 1)\n"
        f"cuticle.Sampler.from_json(fit.sampler.to_json()); assert cuticle.audit({NEAR}, samples=10_000, theta_r=[0]).ok\n"
        # NumPy takes the second where it is; Python 3.10 reads no TOML itself.
        "own = {'cython_runtime', 'charset_normalizer', *(['tomli'] if sys.version_info < (3, 11) else [])}\n"
        "others = {m.partition('.')[0] for m in sys.modules} - sys.stdlib_module_names - own\n"
        "print(sorted(n for n in others if sys.modules.get(n) and not n.startswith('_')))\n"
    )
    done = without_extras(code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "['cuticle', 'numpy', 'scipy']"


def test_the_extras_are_those_of_the_project() -> None:
    required = {re.split(r"[^\w-]", d)[0] for d in PROJECT["dependencies"]}
    assert required == {"numpy", "scipy", "tomli"}
    assert set(EXTRAS.values()) <= set(PROJECT["optional-dependencies"])


def test_other_failures_pass_unchanged() -> None:
    with pytest.raises(ModuleNotFoundError, match="nowhere"), needed("this"):
        import nowhere  # type: ignore[import-not-found]  # noqa: F401
    with pytest.raises(ImportError) as caught, needed("this"):
        raise ImportError("libtyper.so: cannot open", name="typer")
    assert not isinstance(caught.value, MissingExtraError)  # it is installed, and broken
