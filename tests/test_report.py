"""The report: whole from what lies in its folder, refused with a reason, and opened in a real browser."""

from __future__ import annotations

import base64
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from browser import whole_page
from cuticle.draft.document import Document
from cuticle.report.page import LIMIT, number, write_report

SHOTS = Path(__file__).parents[1] / "out" / "report"


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory,
    document_model: cuticle.DualScattering,
    document_fit: cuticle.Fit,
    reproduced: Document,
) -> Path:
    from cuticle.fitting.result import fit_summary

    target = tmp_path_factory.mktemp("report")
    document_fit.sampler.save(target / "sampler.json")
    (target / "fit.json").write_text(json.dumps(fit_summary(document_fit)))
    report = cuticle.check(document_fit.sampler, document_model, theta_r=np.radians([-60]), strands=[0, 2], samples=200_000)
    (target / "check.json").write_text(json.dumps(report.to_dict()))
    reproduced.save(target)
    write_report(target)
    return target


class Reader(HTMLParser):
    """Collects what a page refers to, and checks that its tags close."""

    VOID = ("meta", "link", "img", "br", "hr")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.ids: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.references += [v for k, v in attrs if k in ("src", "href", "data", "action", "poster", "srcset") and v]
        self.ids |= {v for k, v in attrs if k == "id" and v}
        if tag == "img":
            self.images.append(values)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def read(path: Path) -> tuple[str, Reader]:
    text = path.read_text(encoding="utf-8")
    reader = Reader()
    reader.feed(text)
    assert reader.open == []
    return text, reader


def test_the_page_is_whole_and_stands_alone(folder: Path) -> None:
    text, page = read(folder / "report.html")
    assert len(text.encode()) <= LIMIT
    assert all(r.startswith(("#", "data:")) for r in page.references)
    assert {r[1:] for r in page.references if r.startswith("#")} <= page.ids
    assert len(page.images) == 6
    pictures = sorted((folder / "figures").glob("*.png"))  # of the same six
    assert [p.read_bytes()[:4] for p in pictures] == [b"\x89PNG"] * 6
    assert all(len(i["alt"] or "") > 40 for i in page.images)
    assert "url(" not in re.sub(r"data:[^\"]*", "", text)
    for words in ("all verdicts hold", "does not hold", "float sigma_V =", "Table 3", cuticle.__version__, "−60°"):
        assert words in text
    # Every verdict, claim and row of a table that the results hold is on the page.
    d, c = (json.loads((folder / n).read_text()) for n in ("document.json", "check.json"))
    for claim in d["claims"]:
        assert claim["quote"] in text.replace("&#39;", "'")
    for verdict in c["verdicts"]:
        assert verdict["name"] in text
    assert text.count("<tr>") >= sum(len(d[t]["rows"]) for t in ("table_1", "table_2", "table_3"))
    assert not re.search(r"\bnan\b", re.sub(r"data:[^\"]*", "", text).lower())


def test_a_part_makes_a_page_that_names_what_is_missing(folder: Path, tmp_path: Path) -> None:
    shutil.copy(folder / "fit.json", tmp_path)
    text, page = read(write_report(tmp_path))
    assert "There is no document.json here" in text
    assert f"cuticle check {tmp_path} -o {tmp_path}/check.json" in text
    assert page.images == []
    before = text
    assert write_report(tmp_path).read_text(encoding="utf-8") == before  # the same every time


def test_a_failed_check_is_told_first(folder: Path, tmp_path: Path) -> None:
    data = json.loads((folder / "check.json").read_text())
    data["ok"] = data["verdicts"][0]["passed"] = False
    (tmp_path / "check.json").write_text(json.dumps(data))
    text, _ = read(write_report(tmp_path))
    assert "a verdict fails" in text
    assert "all verdicts hold" not in text
    assert text.index("FAIL") < text.index(data["verdicts"][1]["name"])


def test_what_results_say_is_text_not_markup(folder: Path, tmp_path: Path) -> None:
    data = json.loads((folder / "check.json").read_text())
    data["verdicts"][0]["name"] = "<script>alert(1)</script>"
    (tmp_path / "check.json").write_text(json.dumps(data))
    text, _ = read(write_report(tmp_path))
    assert "<script" not in text
    assert "&lt;script&gt;alert(1)" in text


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("fit.json", lambda t: t[: len(t) // 2], "cut short or no JSON"),
        ("fit.json", lambda t: "[1]", "must hold one object"),
        ("fit.json", lambda t: "{}", "is not what `cuticle fit"),
        ("fit.json", lambda t: re.sub(r"\d+\.\d+", "1e400", t, count=1), "it holds 1e400, which is not a number"),
        ("check.json", lambda t: t.replace('"verdicts"', '"other"'), "is not what `cuticle check"),
        ("document.json", lambda t: t.replace('"combined"', '"other"'), "is not what `cuticle document"),
        ("document.json", lambda t: t.replace('"version": 1', '"version": 2'), "has version 2, newer than 1; upgrade"),
        ("document.json", lambda t: t.replace("figures/figure1.svg", "figures/gone.svg"), "cannot read figure"),
    ],
)
def test_broken_results_are_refused(folder: Path, tmp_path: Path, name: str, change: Any, words: str) -> None:
    shutil.copytree(folder, tmp_path / "broken")
    target = tmp_path / "broken"
    (target / "report.html").unlink()
    (target / name).write_text(change((target / name).read_text()))
    with pytest.raises(ValueError, match=words):
        write_report(target)
    assert not (target / "report.html").exists()


def test_numbers_read_well() -> None:
    assert number(None) == "–"
    assert number(-0.0001, 2) == "0.00"
    assert number(-1.25, 1) == "−1.2"
    assert number(0.5, 1, sign=True) == "+0.5"


# In a browser.


def visit(driver: Any, url: str) -> tuple[list[str], list[str]]:
    """Open a page; return what its console printed, and the requests that are not the page nor within it."""
    for kind in ("browser", "performance"):
        driver.get_log(kind)
    driver.get(url)
    console = [entry["message"] for entry in driver.get_log("browser")]
    requests = []
    for entry in driver.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            requests.append(message["params"]["request"]["url"])
    return console, [r for r in requests if r != url and not r.startswith("data:")]


def shoot(driver: Any, name: str, width: int) -> Path:
    """Keep a picture of the whole page at a width."""
    SHOTS.mkdir(parents=True, exist_ok=True)
    path = SHOTS / f"{name}.png"
    path.write_bytes(whole_page(driver, width))
    return path


def test_a_browser_opens_it_without_a_complaint_or_a_request(browser: Any, folder: Path) -> None:
    url = (folder / "report.html").as_uri()
    assert visit(browser, url) == ([], [])
    drawn = browser.execute_script("return [...document.images].map(i => i.complete ? i.naturalWidth : 0)")
    assert len(drawn) == 6
    assert min(drawn) > 300
    screen = base64.b64decode(browser.execute_cdp_cmd("Page.captureScreenshot", {})["data"])
    assert len(screen) > 20_000  # bytes: of an empty page 2,000, of this one's first screen 54,000


def test_the_browser_test_would_see_a_complaint_and_a_request(browser: Any, folder: Path, tmp_path: Path) -> None:
    text = (folder / "report.html").read_text(encoding="utf-8")
    broken = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", text)
    broken = broken.replace("</body>", '<img src="http://localhost:9/x.png"><script>console.error("x")</script></body>')
    (tmp_path / "broken.html").write_text(broken, encoding="utf-8")
    console, requests = visit(browser, (tmp_path / "broken.html").as_uri())
    assert console
    assert requests == ["http://localhost:9/x.png"]


@pytest.mark.slow
def test_it_reads_on_a_phone_in_the_dark_and_on_paper(browser: Any, folder: Path) -> None:
    visit(browser, (folder / "report.html").as_uri())
    light = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert shoot(browser, "light", 1280).stat().st_size > 100_000
    shoot(browser, "phone", 390)
    # Wide tables scroll by themselves: the page does not.
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "dark"}]})
    dark = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    shoot(browser, "dark", 1280)
    assert light == "rgb(255, 255, 255)"
    assert dark != light
    contrast = browser.execute_script(CONTRAST)
    assert contrast["worst"] >= 4.5, contrast  # WCAG AA for text
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert browser.execute_script(CONTRAST)["worst"] >= 4.5
    printed = browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": False})
    pdf = base64.b64decode(printed["data"])
    (SHOTS / "paper.pdf").write_bytes(pdf)
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 30


# The least contrast of any text with what lies behind it.
CONTRAST = """
const rgb = c => c.match(/[\\d.]+/g).map(Number);
const light = c => c.slice(0, 3).map(v => v / 255).map(v => v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4)
                    .reduce((s, v, i) => s + v * [.2126, .7152, .0722][i], 0);
let worst = {worst: 99};
for (const e of document.querySelectorAll('p, td, th, li, a, h1, h2, h3, figcaption, .badge, summary, dt, dd, pre, q')) {
  if (!e.textContent.trim()) continue;
  let b = e;
  while (b && (rgb(getComputedStyle(b).backgroundColor)[3] === 0)) b = b.parentElement;
  const back = light(rgb(b ? getComputedStyle(b).backgroundColor : 'rgb(255, 255, 255)'));
  const ink = light(rgb(getComputedStyle(e).color));
  const ratio = (Math.max(back, ink) + .05) / (Math.min(back, ink) + .05);
  if (ratio < worst.worst) worst = {worst: ratio, tag: e.tagName, text: e.textContent.slice(0, 40)};
}
return worst;
"""
