"""Takes view.png: a simulated recording is run, shown on a page, and that is photographed.

Run by hand after a change: ``./run python docs/figures/view.py``, after ``./run test``, which gets
playwright and Chromium.
"""

import shutil
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from dqslam.cli import main

PICTURE = Path(__file__).with_suffix(".png")


def make_page(folder):
    """Write the page of a simulated recording, and return it."""
    recording, page = folder / "orbit", folder / "page"
    main(["simulate", "orbit", "--seed", "1", "--out", str(recording), "--quiet"])
    main(["run", "--config", str(recording / "run.toml"), "--quiet"])
    main(["view", str(recording), "--export", str(page), "--quiet"])
    return page / "index.html"


def photograph(page):
    """Select an object half way, and take the picture."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        shown = browser.new_page(viewport={"width": 1200, "height": 760}, device_scale_factor=1.25)
        shown.goto(page.as_uri())
        shown.locator("#time").fill("75")
        shown.locator("#objects button").nth(1).click()
        shown.wait_for_timeout(1000)
        shown.screenshot(path=PICTURE)
        browser.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        photograph(make_page(Path(folder)))
