"""Take docs/images/web.png: the page that `cuticle export --to web` writes for brown hair, in headless Chromium."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import cuticle
from cuticle._support.files import write_bytes
from cuticle.cli.terminal import progress_bar
from cuticle.export import export

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from browser import start, whole_page  # noqa: E402


def main() -> None:
    model = cuticle.DualScattering(cuticle.Fibre.preset("brown"))
    sampler = cuticle.fit(model, 4, strands=(0, 1, 2, 4, 8)).sampler
    with progress_bar() as progress, tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "brown.html"
        page.write_text(export(sampler, "web", name="Brown", progress=progress).text, encoding="utf-8")
        try:
            driver = start()
        except RuntimeError as error:
            sys.exit(str(error))
        driver.get(page.as_uri())
        whole_page(driver, 1300)
        time.sleep(3)  # until the samples have come
        first = driver.execute_script("return cuticle.result.first")
        turn = "return cuticle.set({theta: arguments[0]}).milliseconds"
        times = [driver.execute_script(turn, theta) for theta in (*range(-80, 81, 20), 25)]
        print(f"first picture after {first:.0f} ms, a turn answered in {min(times):.0f} to {max(times):.0f} ms")
        write_bytes(ROOT / "docs/images/web.png", whole_page(driver, 1300))
        driver.quit()


if __name__ == "__main__":
    main()
