"""The web page in a real browser, drawn in software: what it shows, how fast it answers, what its shaders return."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from cuticle.export import export
from cuticle.export.hosts import web
from test_report import visit

SHOTS = Path(__file__).parents[1] / "out" / "web"


@pytest.fixture(scope="module")
def model() -> cuticle.DualScattering:
    return cuticle.DualScattering(cuticle.Fibre.preset("brown"))


@pytest.fixture(scope="module")
def page(brown_sampler: cuticle.Sampler, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("web") / "brown.html"
    with pytest.MonkeyPatch.context() as patch:  # eight lobes take as long to fit as all others, and a row as any other
        patch.setattr(web, "LOBES", (1, 2, 4))
        patch.setattr(web, "fit", lambda model, k, **how: cuticle.fit(model, k, **how | {"strands": (0.0, 2.0)}))
        path.write_text(export(brown_sampler, "web", name="brown").text, encoding="utf-8")
    assert path.stat().st_size < 1_000_000
    return path


@pytest.fixture
def opened(browser: Any, page: Path) -> Any:
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    )
    assert visit(browser, page.as_uri()) == ([], [])  # no complaint on the console, no request
    browser.set_script_timeout(60)
    wait(browser, 2)
    return browser


def wait(browser: Any, frames: int = 2) -> None:
    browser.execute_async_script(
        "let n = arguments[0]; const done = arguments[1]; const f = () => n-- ? requestAnimationFrame(f) : done(); f()",
        frames,
    )


def answer(browser: Any, **values: float) -> dict[str, float]:
    return browser.execute_script("return cuticle.set(arguments[0])", values)


def shoot(browser: Any, name: str) -> np.ndarray:
    """Keep a picture of the page, and return it."""
    import io

    import matplotlib.image

    SHOTS.mkdir(parents=True, exist_ok=True)
    shot = base64.b64decode(browser.execute_cdp_cmd("Page.captureScreenshot", {})["data"])
    (SHOTS / f"{name}.png").write_bytes(shot)
    return matplotlib.image.imread(io.BytesIO(shot))[..., :3]


@pytest.mark.alone
def test_it_draws_within_a_second(opened: Any) -> None:
    # 0.7 s where measured (docs/screenshot.py): three times that on a busy machine still passes.
    assert opened.execute_script("return cuticle.result.first") < 2500
    assert not opened.execute_script("return document.getElementById('fail').textContent")
    box = opened.execute_script(
        "const r = document.querySelector('#f .view').getBoundingClientRect(); return [r.x, r.y, r.width, r.height]"
    )
    x, y, w, h = (round(v) for v in box)
    picture = shoot(opened, "first")[y : y + h, x : x + w]
    assert picture.mean(axis=2).max() > 0.9  # the bright transmission
    assert picture.mean() < 0.4  # on the dark


def test_its_density_and_its_function_are_pythons(opened: Any, model: Any, brown_sampler: cuticle.Sampler) -> None:
    for theta, n, lobes in ((25, 0, 4), (-70, 0.5, 4), (10, 3, 4), (85, 8, 4)):
        result = answer(opened, theta=theta, strands=n, lobes=lobes)
        size = opened.execute_script("return cuticle.SIZE")
        fields = opened.execute_script("return cuticle.fields()")
        f, p = (np.array(fields[k]).reshape(size, size, 4) for k in "fp")
        theta_i = ((np.arange(size) + 0.5) / size - 0.5) * np.pi
        phi = (np.arange(size) + 0.5) / size * np.pi
        theta_r = np.radians(theta)
        expected = brown_sampler.pdf(theta_i[:, None], theta_r, phi, n)
        np.testing.assert_allclose(p[..., 0], expected, rtol=1e-3, atol=1e-9)
        own = model.with_strands(n)
        scattered = own.eval(theta_i[:, None], theta_r, phi) * np.cos(theta_i)[:, None, None]
        # Thinned tables: within 1 % of the integral.
        assert np.abs(f[..., :3] - scattered).sum() <= 0.012 * scattered.sum()
        assert abs(result["ess"] - cuticle.measure(brown_sampler, own, theta_r, n).ess) <= 0.005
        assert abs(result["integral"] - 1) <= 2e-3


@pytest.mark.alone
def test_it_answers_a_turn_within_a_tenth_of_a_second(opened: Any) -> None:
    opened.execute_script("cuticle.state.live = false")
    for lobes in opened.execute_script("return cuticle.data.lobes"):
        answer(opened, lobes=lobes)  # compiles
        times = [answer(opened, theta=theta, strands=n)["milliseconds"] for theta in range(-80, 81, 20) for n in (0, 0.5, 4)]
        assert np.median(times) < 250, times  # 22 to 70 where measured; a busy machine is allowed more


def test_keyboard_mouse_and_touch(opened: Any) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    state = "return cuticle.state"
    slider = opened.find_element(By.ID, "theta")
    before = opened.execute_script(state)
    slider.send_keys(Keys.ARROW_RIGHT)
    slider.send_keys(Keys.ARROW_RIGHT)
    wait(opened)
    assert opened.execute_script(state)["theta"] == before["theta"] + 2
    assert opened.find_element(By.ID, "theta-out").text == f"{before['theta'] + 2}°"
    opened.find_element(By.ID, "strands").send_keys(Keys.END)
    wait(opened)
    assert opened.execute_script(state)["strands"] == 8
    ess = opened.find_element(By.ID, "ess").text
    opened.find_element(By.CSS_SELECTOR, "#lobes input[value='1']").click()
    wait(opened)
    assert opened.execute_script(state)["lobes"] == 1
    assert opened.find_element(By.ID, "ess").text < ess
    opened.find_element(By.CSS_SELECTOR, "#lobes input:checked").send_keys(Keys.ARROW_RIGHT)
    wait(opened)
    assert opened.execute_script(state)["lobes"] == 2
    ball = opened.find_element(By.CSS_SELECTOR, "#sphere .view")
    yaw = opened.execute_script(state)["yaw"]
    ActionChains(opened).drag_and_drop_by_offset(ball, 60, 20).perform()
    wait(opened)
    turned = opened.execute_script(state)
    assert abs(turned["yaw"] - yaw) > 0.2
    ball.send_keys(Keys.ARROW_LEFT)
    wait(opened)
    assert opened.execute_script(state)["yaw"] < turned["yaw"]
    # A finger.
    box = opened.execute_script(
        "const r = arguments[0].getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]", ball
    )
    yaw = opened.execute_script(state)["yaw"]
    for kind, shift in (("touchStart", 0), ("touchMove", 40), ("touchMove", 80), ("touchEnd", None)):
        points = [] if shift is None else [{"x": box[0] + shift, "y": box[1]}]
        opened.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    wait(opened)
    assert opened.execute_script(state)["yaw"] > yaw + 0.2


@pytest.mark.slow
def test_samples_keep_coming_until_they_are_paused(opened: Any) -> None:
    from selenium.webdriver.common.by import By

    seeds = []
    for _ in range(2):
        seeds.append(opened.execute_script("return cuticle.state.seed"))
        wait(opened, 30)
    assert seeds[1] > seeds[0]
    opened.find_element(By.ID, "live").click()
    wait(opened, 3)
    seed = opened.execute_script("return cuticle.state.seed")
    wait(opened, 30)
    assert opened.execute_script("return cuticle.state.seed") == seed


@pytest.mark.parametrize("width", [390, pytest.param(820, marks=pytest.mark.slow)])
def test_it_fits_a_phone_and_a_tablet(browser: Any, page: Path, width: int) -> None:
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
    )
    visit(browser, page.as_uri())
    wait(browser, 5)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    shoot(browser, f"width{width}")
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_without_webgl_it_says_so(browser: Any, page: Path, tmp_path: Path) -> None:
    text = page.read_text(encoding="utf-8")
    (tmp_path / "old.html").write_text(text.replace("getContext('webgl2'", "getContext('webgl9'"), encoding="utf-8")
    browser.get((tmp_path / "old.html").as_uri())
    assert "needs WebGL 2" in browser.execute_script("return document.getElementById('fail').textContent")


def test_an_escaped_name_and_an_unknown_fibre(brown_sampler: cuticle.Sampler) -> None:
    s = brown_sampler
    unknown = cuticle.Sampler(s.nodes, s.energy, s.strands, s.even)
    with pytest.raises(ValueError, match="does not say which scattering function"):
        export(unknown, "web")
