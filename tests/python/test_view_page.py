"""The static page in a real browser: what is on the screen is counted."""

import numpy as np
import pytest

import planted
from browser import on_screen, open_page, settle, start_browser, web_server
from dqslam import _core
from dqslam._colors import ESTIMATE, ODOMETRY, TRUTH
from dqslam.cli import main
from dqslam.io import load_results, read_trajectory, read_true_objects
from dqslam.view import build_scene, rgb, write_page


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    files = planted.write_planted(tmp_path_factory.mktemp("results"), drift=0.3)
    results = load_results(files.results)
    results.objects.center_covariances[:2] = np.diag([1e-4, 4e-4, 9e-4])
    results.covariances[5:8] = 1e-4 * np.eye(6)
    return build_scene(
        results,
        groundtruth=read_trajectory(files.groundtruth),
        objects=read_true_objects(files.objects),
    )


@pytest.fixture(scope="module")
def browser():
    with start_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def page(browser, scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    write_page(scene, folder)
    with web_server(folder) as address, open_page(browser, address) as page:
        page.wait_for_function("window.onScreen")
        yield page


def pixels(page, color, canvas="space"):
    """Count the pixels of a canvas that have nearly a color."""
    settle(page)
    return page.evaluate(
        """([id, [r, g, b]]) => {
          const canvas = document.getElementById(id);
          const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
          let count = 0;
          for (let k = 0; k < data.length; k += 4)
            count += data[k + 3] > 200 && Math.abs(data[k] - r) + Math.abs(data[k + 1] - g)
              + Math.abs(data[k + 2] - b) < 60;
          return count;
        }""",
        [canvas, rgb(color)],
    )


def test_all_of_the_map_is_on_the_screen(page, scene):
    shown = on_screen(page)
    assert (shown["ellipsoids"], shown["trueObjects"]) == (5, 6)
    assert 1 <= shown["labels"] <= 5
    assert (shown["estimate"], shown["odometry"], shown["truth"]) == (19, 19, 19)  # segments
    assert shown["cameras"] == 20
    assert page.locator("#objects button").count() == 5
    assert page.locator("#switches label").count() == 8
    assert page.locator("#overview dt").all_inner_texts() == [name for name, _ in scene.overview]
    for one in scene.objects:
        assert pixels(page, one.color) > 20
    assert pixels(page, ESTIMATE) > 100


@pytest.mark.parametrize(
    ("name", "color", "counted"),
    [("odometry", ODOMETRY, "odometry"), ("truth", TRUTH, "trueObjects")],
)
def test_switches(page, name, color, counted):
    before = pixels(page, color)
    assert before > 100
    page.uncheck(f"#show-{name}")
    assert on_screen(page)[counted] == 0
    assert pixels(page, color) < 0.1 * before
    page.check(f"#show-{name}")
    # Not to the pixel: a canvas that is read back is drawn by other means.
    assert pixels(page, color) == pytest.approx(before, rel=0.2)


def test_covariances_are_shown_if_asked_for(page):
    assert on_screen(page)["covariances"] == 0
    page.check("#show-covariance")
    assert on_screen(page)["covariances"] == 5  # of two objects and three poses
    page.uncheck("#show-covariance")


def test_the_eye_follows_the_camera(page):
    page.locator("#time").focus()
    page.keyboard.press("Home")
    before = on_screen(page)["places"]
    page.check("#show-follow")
    moved = on_screen(page)["places"]
    assert max(abs(a["u"] - b["u"]) for a, b in zip(before, moved, strict=True)) > 5.0
    page.uncheck("#show-follow")
    page.reload()
    page.wait_for_function("window.onScreen")


def test_names_and_objects_can_be_hidden(page):
    page.uncheck("#show-names")
    page.uncheck("#show-objects")
    shown = on_screen(page)
    assert (shown["labels"], shown["ellipsoids"]) == (0, 0)
    page.check("#show-names")
    page.check("#show-objects")
    assert on_screen(page)["ellipsoids"] == 5


def test_the_slider_moves_through_the_images(page, scene):
    page.locator("#time").focus()
    page.keyboard.press("Home")
    drawn = set()
    for frame in range(4):
        shown = on_screen(page)
        assert shown["image"]["boxes"] == np.sum(scene.boxes.pose == frame) == 5
        time = f"{scene.timestamps[frame] - scene.timestamps[0]:.3g}"
        text = page.locator("#status").inner_text()
        assert text.startswith(f"image {frame + 1} of 20, {time} s: 5 boxes, ")
        drawn.add(page.evaluate("document.getElementById('image').toDataURL()"))
        page.keyboard.press("ArrowRight")
    assert len(drawn) == 4
    page.click("#play")
    page.wait_for_function("document.getElementById('time').value === '19'")
    page.wait_for_function("document.getElementById('play').textContent === 'Play'")
    settle(page)
    assert page.locator("#status").inner_text().startswith("image 20 of 20")


@pytest.mark.parametrize("number", [10, 12, 99])
def test_a_click_on_an_object_shows_its_numbers(page, scene, number):
    (place,) = [one for one in on_screen(page)["places"] if one["id"] == number]
    page.locator("#space").click(position={"x": place["u"], "y": place["v"]})
    one = next(one for one in scene.objects if one.id == number)
    assert page.locator("#selected h2").inner_text() == f"{one.class_name} {number}"
    names = page.locator("#selected dt").all_inner_texts()
    values = page.locator("#selected dd").all_inner_texts()
    assert tuple(zip(names, values, strict=True)) == one.numbers
    pressed = page.locator("#objects button[aria-pressed=true]")
    assert pressed.all_inner_texts()[0].split() == [one.class_name, str(number)]
    page.locator("#space").click(position={"x": 500, "y": 5})  # where nothing is
    assert page.locator("#selected h2").count() == 0


def test_the_list_selects_for_who_uses_no_mouse(page):
    page.locator("#objects button").nth(1).focus()
    page.keyboard.press("Enter")
    assert page.locator("#selected h2").inner_text() == "book 11"
    page.keyboard.press("Enter")
    assert page.locator("#selected h2").count() == 0


def test_the_eye_turns_moves_and_zooms(page):
    def places():
        return np.array([[one["u"], one["v"]] for one in on_screen(page)["places"]])

    before = places()
    canvas = page.locator("#space")
    canvas.focus()
    page.keyboard.press("ArrowLeft")
    assert np.abs(places() - before).max() > 5.0
    page.keyboard.press("ArrowRight")
    np.testing.assert_allclose(places(), before, atol=1e-6)
    page.keyboard.press("-")
    assert np.ptp(places(), axis=0).max() < np.ptp(before, axis=0).max()
    page.keyboard.press("+")
    page.mouse.move(450, 700)
    page.keyboard.down("Shift")
    page.mouse.down()
    page.mouse.move(480, 690)
    page.mouse.up()
    page.keyboard.up("Shift")
    assert (np.sign(places() - before) == [1, -1]).all()


def test_outlines_on_the_page_are_those_of_the_core(page, scene):
    """The page has its own few lines of projection: each outline fills the exact box."""
    outlines = page.evaluate(
        """() => scene.estimate.map((pose) => scene.objects.map((object) => {
          const shape = geometry.shapeOf(object.semiAxes, object.orientation);
          const view = geometry.viewOf(pose);
          const found = geometry.outlineOf(view, scene.camera, object.center, shape);
          return found && [found.u - found.halfWidth, found.v - found.halfHeight,
                           found.u + found.halfWidth, found.v + found.halfHeight];
        }))"""
    )
    checked = 0
    for pose, found in zip(scene.estimate, outlines, strict=True):
        for one, box in zip(scene.objects, found, strict=True):
            expected, in_front = _core.project_to_boxes(
                _core.PoseModel.SE3, scene.camera, [pose], [one.ellipsoid]
            )
            assert (box is not None) == in_front[0]
            if in_front[0]:
                # The page's numbers have six decimals, and some objects are far out of the image.
                np.testing.assert_allclose(box, expected[0], atol=0.01, rtol=1e-4)
                checked += 1
    assert checked >= 80


def test_a_screenshot_is_not_blank(page, tmp_path):
    from PIL import Image

    page.screenshot(path=tmp_path / "page.png")
    colors = np.asarray(Image.open(tmp_path / "page.png").convert("RGB")).reshape(-1, 3)
    assert len(np.unique(colors, axis=0)) > 200


def test_the_command_and_a_page_without_a_server(browser, tmp_path, capsys):
    files = planted.write_planted(tmp_path)
    (files.results / "groundtruth.txt").write_text(files.groundtruth.read_text())
    assert main(["view", str(files.results), "--export", str(tmp_path / "page")]) == 0
    assert "wrote" in capsys.readouterr().out
    with open_page(browser, f"file://{tmp_path}/page/index.html") as page:
        page.wait_for_function("window.onScreen")
        shown = on_screen(page)
    assert (shown["ellipsoids"], shown["truth"], shown["trueObjects"]) == (5, 19, 0)


def test_one_pose_and_no_object(browser, tmp_path):
    results = planted.write_planted(tmp_path).results
    for name in ("trajectory.txt", "odometry.txt"):
        lines = (results / name).read_text().splitlines(keepends=True)
        (results / name).write_text(next(line for line in lines if not line.startswith("#")))
    (results / "boxes.csv").unlink()
    (results / "map.json").write_text('{"objects": [], "dropped": []}')
    write_page(build_scene(load_results(results)), tmp_path / "page")
    with open_page(browser, f"file://{tmp_path}/page/index.html") as page:
        page.wait_for_function("window.onScreen")
        assert on_screen(page)["cameras"] == 1
        assert page.locator("#status").inner_text() == "image 1 of 1, 0 s: 0 boxes, 0 objects"


def test_hostile_names_stay_text(browser, tmp_path):
    files = planted.write_planted(tmp_path)
    path = files.results / "map.json"
    path.write_text(path.read_text().replace('"cup"', '"</script><img src=x onerror=alert(1)>"'))
    write_page(build_scene(load_results(files.results)), tmp_path / "page")
    with open_page(browser, f"file://{tmp_path}/page/index.html") as page:
        page.wait_for_function("window.onScreen")
        assert "<img" in page.locator("#objects button").first.inner_text()
        assert page.locator("img").count() == 0
