"""The page of a simulated recording of 300 images, beside the files that the run wrote."""

import csv
from collections import Counter
from pathlib import Path

import pytest

from browser import on_screen, open_page, settle, start_browser
from dqslam.cli import main

SCENARIOS = Path(__file__).parents[2] / "data" / "scenarios"
IMAGES = 300


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with results and their page."""
    folder = tmp_path_factory.mktemp("long")
    orbit = (SCENARIOS / "orbit.toml").read_text()
    longer = orbit.replace("poses = 150 ", f"poses = {IMAGES} ").replace(
        "turns = 1.5", "turns = 3.0"
    )
    (folder / "long.toml").write_text(longer)
    made = folder / "recording"
    for words in (
        ["simulate", folder / "long.toml", "--seed", 2, "--out", made],
        ["run", "--config", made / "run.toml", "--hold-out", 0.2, "--out", folder / "results"],
        ["view", folder / "results", "--export", folder / "page"],
    ):
        assert main([*map(str, words), "-q"]) == 0
    return folder


@pytest.fixture(scope="module")
def page(folder):
    with (
        start_browser() as browser,
        open_page(browser, f"file://{folder}/page/index.html") as page,
    ):
        page.wait_for_function("window.onScreen")
        yield page


def to_image(page, number):
    """Move the slider to an image, counted from 1, as a hand would."""
    page.locator("#time").evaluate(
        """(slider, value) => {
          slider.value = value;
          slider.dispatchEvent(new Event("input", { bubbles: true }));
        }""",
        str(number - 1),
    )
    return on_screen(page)["image"]


def test_each_image_has_its_boxes(folder, page):
    """Those of the file, with the held-out ones counted apart."""
    with (folder / "results" / "boxes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    poses = [round(float(row["timestamp"]) / 0.2) for row in rows]
    boxes = Counter(poses)
    held_out = Counter(
        pose for pose, row in zip(poses, rows, strict=True) if row["held_out"] == "1"
    )
    assert sum(held_out.values()) == pytest.approx(0.2 * len(rows), rel=0.15)
    status = page.locator("#status")
    assert status.inner_text().startswith(f"image {IMAGES} of {IMAGES}, ")
    for number in (1, 100, 101, 102, 103, 250, IMAGES):
        seen, pose = to_image(page, number), number - 1
        assert (seen["boxes"], seen["heldOut"]) == (boxes[pose], held_out[pose])
        apart = f", {held_out[pose]} held out" if held_out[pose] else ""
        assert status.inner_text().startswith(
            f"image {number} of {IMAGES}, {round(0.2 * pose, 1):g} s"
        )
        assert f": {boxes[pose]} boxes{apart}, " in status.inner_text()


def test_numbers_that_are_out_of_sight_are_scrolled_to(page):
    page.set_viewport_size({"width": 1280, "height": 420})
    page.locator("#objects button").last.click()
    settle(page)
    box = page.locator("#selected h2").bounding_box()
    assert 0 <= box["y"] <= 420
    page.set_viewport_size({"width": 1280, "height": 800})


def test_names_in_the_image_do_not_cover_each_other(page):
    """A name is that of the object; of two that overlap, one is written."""
    page.evaluate(
        """() => {
          window.written = [];
          const write = CanvasRenderingContext2D.prototype.fillText;
          CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
            if (this.canvas.id === "image")
              window.written.push([text, x, y, this.measureText(text).width]);
            return write.call(this, text, x, y);
          };
        }"""
    )
    to_image(page, 40)
    page.evaluate("window.written.length = 0")
    shown = to_image(page, 60)
    written = page.evaluate("window.written")
    names = [name for name, *_ in written]
    assert 1 < len(names) == len(set(names)) <= shown["boxes"]
    assert all(name.startswith("ellipsoid ") for name in names)
    scale = page.evaluate("document.getElementById('image').clientWidth / scene.camera.width")
    for k, (_, x, y, width) in enumerate(written):
        for _, other_x, other_y, other_width in written[:k]:
            beside = x >= other_x + other_width or other_x >= x + width
            assert beside or abs(y - other_y) >= 10 / scale


def test_playing_takes_the_time_of_the_recording(page):
    """Played at 5 times the speed, image follows image to the last."""
    to_image(page, 280)
    page.select_option("#speed", "5")
    page.click("#play")
    page.wait_for_function("document.getElementById('play').textContent === 'Play'")
    settle(page)
    assert page.locator("#status").inner_text().startswith(f"image {IMAGES} of {IMAGES}")
