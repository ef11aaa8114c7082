"""The structure, read from the import statements: packages import downward only, and no import runs in a circle."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import cuticle
from cuticle._support.moved import MOVED

SOURCE = Path(cuticle.__file__).parent
# From the bottom to the top: a package may import those before it. CONTRIBUTING.md says what each holds.
LAYERS = (
    "_support",
    "scattering",
    "sampling",
    "fitting",
    "checking",
    "reference",
    "draft",
    "grooms",
    "export",
    "mitsuba",
    "render",
    "report",
    "cli",
)


def modules(root: Path) -> dict[str, Path]:
    """Return every module below `root` by its dotted name within the package; "" is the package itself."""
    return {
        ".".join(p.relative_to(root).with_suffix("").parts).removesuffix("__init__").rstrip("."): p
        for p in root.rglob("*.py")
    }


def imports(root: Path) -> dict[str, set[str]]:
    """Return what each module of the package imports of it, at its top, in a function or for types alone."""
    known = modules(root)

    def target(name: str) -> str:
        while name not in known:  # a name in a module, not a module
            name = name.rpartition(".")[0]
        return name

    found: dict[str, set[str]] = {name: set() for name in known}
    for name, path in known.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named: list[str] = []
            if isinstance(node, ast.Import):
                named = [a.name for a in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                named = [f"{node.module}.{a.name}" for a in node.names]
            for full in named:
                if full.split(".")[0] == "cuticle" and full != "cuticle._core" and full != f"cuticle.{name}":
                    found[name].add(target(full.removeprefix("cuticle").lstrip(".")))
        found[name].discard(name)
    return found


def upward(root: Path) -> list[str]:
    """Return the imports that run upward, or between modules that are in no layer."""
    wrong = []
    for name, used in imports(root).items():
        layer = name.split(".")[0]
        for other in used:
            below = other.split(".")[0]
            if layer in LAYERS and below == "":
                continue  # `from cuticle import _core`, or a submodule by way of the package
            if layer in LAYERS and (below not in LAYERS or LAYERS.index(below) > LAYERS.index(layer)):
                wrong.append(f"{name} imports {other}")
    return sorted(wrong)


def circle(root: Path) -> list[str]:
    """Return the modules of a circle of imports, an empty list where there is none."""
    graph = {name: {u for u in used if u} for name, used in imports(root).items()}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        return list(error.args[1])
    return []


def test_imports_run_downward() -> None:
    assert upward(SOURCE) == []


def test_no_circle_of_imports() -> None:
    assert circle(SOURCE) == []


def test_every_package_has_its_layer() -> None:
    packages = {p.name for p in SOURCE.iterdir() if (p / "__init__.py").is_file()}
    assert packages == set(LAYERS)


def test_few_modules_in_the_root() -> None:
    assert len(list(SOURCE.glob("*.py"))) <= 10


@pytest.mark.parametrize(
    ("place", "line", "found"),
    [
        ("scattering/fibre.py", "from cuticle.fitting.fit import fit\n", ["scattering.fibre imports fitting.fit"]),
        ("grooms/groom.py", "def f():\n    import cuticle.cli.app\n", ["grooms.groom imports cli.app"]),
    ],
)
def test_a_planted_upward_import_is_found(place: str, line: str, found: list[str], tmp_path: Path) -> None:
    for name, path in modules(SOURCE).items():
        copy = tmp_path / path.relative_to(SOURCE)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text(encoding="utf-8") + (line if path == SOURCE / place else ""), encoding="utf-8")
        assert name is not None
    assert upward(tmp_path) == found


def test_a_planted_circle_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("import cuticle.b\n")
    (tmp_path / "b.py").write_text("def f():\n    from cuticle.a import x\n")
    assert set(circle(tmp_path)) == {"a", "b"}


def test_public_names_resolve_and_hide_no_module() -> None:
    for name in cuticle.__all__:
        assert getattr(cuticle, name) is not None
    for package in ("", *(f".{layer}" for layer in LAYERS if layer != "mitsuba")):
        whole = importlib.import_module(f"cuticle{package}")
        inside = {m.name for m in pkgutil.iter_modules(whole.__path__)}
        hidden = {n for n in inside & set(dir(whole)) if not inspect.ismodule(getattr(whole, n))}
        assert hidden == set(), f"{whole.__name__}: {hidden}"


@pytest.mark.parametrize("old", MOVED)
def test_old_import_paths_warn_and_work(old: str) -> None:
    new = importlib.import_module(f"cuticle.{MOVED[old]}")
    moved = importlib.import_module(f"cuticle.{old}")
    name = "table_1" if old == "document" else next(n for n, v in vars(new).items() if inspect.isfunction(v))
    with pytest.warns(DeprecationWarning, match="has moved"):
        assert callable(getattr(moved, name))


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = "import sys, cuticle; print(*(m for m in ('numpy', 'scipy', 'typing', 'pathlib', 'ast') if m in sys.modules))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == ""


def test_a_material_loads_no_scene() -> None:
    """Materials are made while a scene loads, in one of several threads, and `load_dict` swaps the one file resolver.

    The others read it meanwhile: the first scene of a process, in a spectral variant, failed now and then
    ("basic_string::_M_create").
    """
    loads = {"load_dict", "load_file", "load_string", "set_file_resolver"}
    called = [
        f"{path.name}: {node.attr}"
        for path in (SOURCE / "mitsuba").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and node.attr in loads
    ]
    assert called == []
