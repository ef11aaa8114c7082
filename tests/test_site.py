"""The site: every page and public name is in it; tutorials run; a browser opens it."""

from __future__ import annotations

import functools
import http.server
import importlib.util
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import cuticle

ROOT = Path(__file__).parents[1]
TUTORIALS = sorted((ROOT / "docs/tutorials").glob("*.py"))


def staging() -> Any:
    spec = importlib.util.spec_from_file_location("site_pages", ROOT / "docs/site.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_page_has_its_place() -> None:
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    listed = set(re.findall(r"\S+\.(?:md|py)$", nav, re.MULTILINE))
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("examples/*.md"), *TUTORIALS]
    assert {p.relative_to(ROOT).as_posix() for p in pages} | {"reference/python.md", "reference/headers.md"} == listed


def test_the_reference_has_every_public_name_and_header() -> None:
    module = staging()
    text = module.python()
    shown = {line.rsplit(".", 1)[1] for line in text.splitlines() if line.startswith(":::")}
    modules = {"draft", "export", "grooms", "reference", "render"}  # whose names stand under headings of their own
    assert {name for name in cuticle.__all__ if not name.startswith("_")} - shown <= modules | {"allow_large"}
    text = module.headers()
    for header in (ROOT / "include/cuticle").glob("*/*.h"):
        assert f"## cuticle/{header.parent.name}/{header.name}\n" in text
    assert "template<class Float> Float fresnel(const Float & cos_i, const Float & eta);" in text


@pytest.mark.slow
@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda p: p.stem)
def test_a_tutorial_runs(tutorial: Path, tmp_path: Path) -> None:
    environment = os.environ | {"MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, tutorial], cwd=tmp_path, capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout


@pytest.fixture(scope="module")
def site() -> Iterator[str]:
    """The address of the site, built here."""
    if importlib.util.find_spec("mkdocs") is None:
        pytest.skip("mkdocs is not installed: make site")
    for command in (["docs/site.py"], ["-m", "mkdocs", "build", "--quiet"]):
        done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    handler = functools.partial(Quiet, directory=str(ROOT / "build/site/html"))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        pass


def within(seconds: float, found: Any) -> bool:
    end = time.monotonic() + seconds
    while not (done := bool(found())) and time.monotonic() < end:
        time.sleep(0.2)
    return done


@pytest.mark.slow
def test_a_browser_reads_and_searches_it(site: str, browser: Any) -> None:
    browser.get_log("browser")
    for page in (
        "",
        "docs/family/",
        "docs/tutorials/first_sampler/",
        "reference/python/",
        "reference/headers/",
        "docs/gallery/",
    ):
        for width, mobile in ((1280, False), (390, True)):
            metrics = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": mobile}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            browser.get(site + page)
            across = browser.execute_script("return document.documentElement.scrollWidth")
            assert across <= width, (page, width, across)
            broken = "return [...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src)"
            assert within(20, lambda: browser.execute_script("return [...document.images].every(i => i.complete)"))
            assert browser.execute_script(broken) == []
        assert [line for line in browser.get_log("browser") if line["level"] == "SEVERE"] == []
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.get(site)
    look = "const q = document.querySelector('.md-search__input'); q.focus(); q.value = 'family';"
    browser.execute_script(look + "q.dispatchEvent(new Event('keyup', {bubbles: true}));")
    hits = "return document.querySelectorAll('.md-search-result__item').length"
    assert within(20, lambda: browser.execute_script(hits))
    shade = "return getComputedStyle(document.body).backgroundColor"
    light = browser.execute_script(shade)
    media = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    browser.get(site + "sitemap.xml")  # where no script writes down a palette
    browser.execute_script("localStorage.clear()")
    browser.get(site)
    assert within(10, lambda: browser.execute_script(shade) != light)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
