"""The live page in a real browser, and the command that serves it."""

import signal
import subprocess
import sys
import urllib.request
from io import BytesIO

import numpy as np
import pytest

import planted
from browser import open_page, start_browser
from dqslam._colors import ODOMETRY
from dqslam.cli import main
from dqslam.io import load_results, read_trajectory, read_true_objects
from dqslam.view import build_scene, rgb, serve
from dqslam.view.live import FIELD_OF_VIEW, place_eye

viser = pytest.importorskip("viser", reason="viser is not installed")
PORT = 18080


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    files = planted.write_planted(tmp_path_factory.mktemp("results"), drift=0.3)
    results = load_results(files.results)
    results.objects.center_covariances[:2] = np.diag([1e-4, 4e-4, 9e-4])
    return build_scene(
        results,
        groundtruth=read_trajectory(files.groundtruth),
        objects=read_true_objects(files.objects),
    )


@pytest.fixture(scope="module")
def page(scene):
    with (
        start_browser() as browser,
        serve(scene, port=PORT) as address,
        open_page(browser, address) as page,
    ):
        page.wait_for_selector("svg .box")
        yield page


def test_the_boxes_of_the_image_and_the_objects_in_it(page):
    assert page.locator("svg .box").count() == 5
    assert page.locator("svg .outline").count() >= 4


def test_the_slider_moves_through_the_images(page, scene):
    drawn = page.locator("svg .box").first.evaluate("(box) => box.ownerSVGElement.outerHTML")
    page.locator("[role=slider]").first.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"document.body.innerText.includes('{scene.timestamps[1]:.3f} s')")
    assert page.locator("svg .box").count() == 5
    now = page.locator("svg .box").first.evaluate("(box) => box.ownerSVGElement.outerHTML")
    assert now != drawn


def count_pixels(page, color):
    """Count the pixels of the map that have the hue of a color."""
    from PIL import Image

    seen = np.asarray(Image.open(BytesIO(page.screenshot())).convert("RGB"))[:, :900].astype(float)
    wanted = np.array(rgb(color)) / np.linalg.norm(rgb(color))
    likeness = seen @ wanted / np.linalg.norm(seen + 1e-9, axis=2)
    return int(np.sum((likeness > 0.99) & (np.ptp(seen, axis=2) > 60.0)))


def wait_until(page, is_so):
    """Wait for what a graphics card that is no card draws."""
    for _ in range(100):
        if is_so():
            return
        page.wait_for_timeout(200)
    raise AssertionError("nothing changed")


def test_a_switch_hides_what_it_names(page):
    wait_until(page, lambda: count_pixels(page, ODOMETRY) > 300)
    before = count_pixels(page, ODOMETRY)
    switch = page.get_by_role("checkbox", name="odometry")
    switch.uncheck(force=True)
    wait_until(page, lambda: count_pixels(page, ODOMETRY) < 0.3 * before)
    switch.check(force=True)
    wait_until(page, lambda: count_pixels(page, ODOMETRY) > 0.8 * before)


def test_a_click_on_an_object_shows_its_numbers(page, scene):
    (one,) = (one for one in scene.objects if one.id == 12)
    position, target, _ = place_eye(scene)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, scene.up)
    right /= np.linalg.norm(right)
    ray = one.center - position
    size = page.viewport_size
    focal = 0.5 * size["height"] / np.tan(0.5 * FIELD_OF_VIEW)
    depth, down = ray @ forward, np.cross(forward, right)
    place = np.array([ray @ right, ray @ down]) * focal / depth
    page.mouse.click(0.5 * size["width"] + place[0], 0.5 * size["height"] + place[1])
    page.locator("tr:has-text('orientation error') >> text='10.0°'").wait_for()
    assert page.get_by_role("combobox").first.input_value() == "lamp 12"


def test_a_choice_shows_the_numbers(page, scene):
    page.get_by_role("combobox").first.click()
    page.get_by_role("option", name="book 11").click()
    (one,) = (one for one in scene.objects if one.id == 11)
    for name, value in one.numbers:
        page.locator(f"tr:has-text('{name}') >> text='{value}'").first.wait_for()


def test_the_command_serves_until_ctrl_c(tmp_path):
    files = planted.write_planted(tmp_path)
    program = "import sys; from dqslam.cli import main; sys.exit(main())"
    words = ["view", str(files.results), "--port", str(PORT + 1)]
    served = subprocess.Popen(
        [sys.executable, "-c", program, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell that runs the tests in the background has it ignored, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        line = served.stdout.readline()
        address = line.split()[0]
        assert line == f"{address} shows {tmp_path.name}/out; Ctrl-C stops\n"
        with urllib.request.urlopen(address, timeout=30) as answer:
            assert answer.status == 200
            assert b"<title>" in answer.read()
        served.send_signal(signal.SIGINT)
        out, err = served.communicate(timeout=60)
    finally:
        served.kill()
        served.wait()
    assert (served.returncode, out, err) == (0, "stopped\n", "")


def test_without_viser_it_says_what_is_missing(tmp_path, monkeypatch, capsys):
    files = planted.write_planted(tmp_path)
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["view", str(files.results)]) == 2
    assert "pip install 'dqslam[view]'" in capsys.readouterr().err
