"""docs/extending/export_host.md: its host and its row of the conformance tests, as printed."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from conformance import hosts as conformance
from conformance import replay
from cuticle.export import export_family, hosts, registry
from cuticle.export.registry import Job
from cuticle.scattering.frames import FRAMES

PAGE = Path(__file__).parents[1] / "docs/extending/export_host.md"


def test_the_worked_example_is_a_host(document_fit: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    module, row = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(module.splitlines()) + len(row.splitlines()) <= 60
    (tmp_path / "csv.py").write_text(module)
    monkeypatch.setattr(hosts, "__path__", [*hosts.__path__, str(tmp_path)])
    importlib.invalidate_caches()
    assert registry.host_names() == tuple(sorted((*registry.HOSTS, "csv")))
    try:
        host = registry.host("csv")
    finally:
        sys.modules.pop("cuticle.export.hosts.csv", None)
    sampler = document_fit.sampler
    made = host.write(Job(sampler, "fibre", FRAMES["local-x"], lambda: ["four lobes"], None, None, lambda *_: None))
    names = {**vars(conformance), "HOSTS": {}}
    exec(row, names)
    x = replay.inputs()
    assert replay.compare("csv", sampler, x, names["HOSTS"]["csv"].answers(made, x, tmp_path, None)).ok


FAMILY = """
from cuticle.export.registry import Export, Host
HOST = Host("families alone", None, lambda job: Export(f"{job.form} {job.name} {job.frame.viewer}", 0), ("chiang",))
"""


def test_a_host_that_takes_a_family_is_one_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(FAMILY)
    monkeypatch.setattr(hosts, "__path__", [*hosts.__path__, str(tmp_path)])
    importlib.invalidate_caches()
    try:
        assert export_family("chiang", "mine", frame="pbrt", name="grey").text == "chiang grey wo"
        with pytest.raises(ValueError, match="^mine takes the family chiang, got 'marschner'"):
            export_family("marschner", "mine")
        with pytest.raises(ValueError, match="^to must be one of cpp, cuda, .*, metal, mine, pbrt, slang, wgsl; got 'web'"):
            export_family("chiang", "web")
    finally:
        sys.modules.pop("cuticle.export.hosts.mine", None)
