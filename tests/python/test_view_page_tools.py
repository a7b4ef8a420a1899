"""The tools of the page in a real browser: search, classes, photographs, measuring, playing."""

import numpy as np
import pytest

import planted
from browser import on_screen, open_page, settle, start_browser, web_server
from dqslam import Camera
from dqslam._colors import FIRST
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.view import build_scene
from dqslam.view.page import write_page_files

Image = pytest.importorskip("PIL.Image", reason="Pillow is not installed: the extra plot")


@pytest.fixture(scope="module")
def browser():
    with start_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return planted.write_planted(tmp_path_factory.mktemp("results")).results


@pytest.fixture(scope="module")
def address(results, tmp_path_factory):
    """Serve a page with a green photograph for each pose but the last."""
    folder = tmp_path_factory.mktemp("made")
    images = folder / "rgb"
    images.mkdir()
    for moment in load_results(results).timestamps[:-1]:
        size = (planted.CAMERA.width, planted.CAMERA.height)
        Image.new("RGB", size, (0, 160, 0)).save(images / f"{moment:.6f}.png")
    words = ["--export", str(folder / "page"), "--images", str(images)]
    assert main(["view", str(results), *words, "-q"]) == 0
    with web_server(folder / "page") as address:
        yield address


@pytest.fixture
def page(browser, address):
    with open_page(browser, address) as page:
        page.wait_for_function("window.onScreen")
        yield page


def names(page):
    return page.locator("#objects button").all_inner_texts()


def test_search(page):
    assert len(names(page)) == 5
    page.fill("#search", "CUP")
    assert [one.split() for one in names(page)] == [["cup", "10"], ["cup", "99"]]
    page.fill("#search", "cup 99")
    assert [one.split() for one in names(page)] == [["cup", "99"]]
    page.fill("#search", "nothing")
    assert names(page) == []
    page.fill("#search", "")
    assert len(names(page)) == 5


def test_classes_are_a_legend_and_can_be_hidden(page):
    shown = page.locator("#classes button").all_inner_texts()
    assert shown == ["book 1", "box 1", "cup 2", "lamp 1"]
    before = on_screen(page)
    page.locator("#classes button", has_text="cup").click()
    after = on_screen(page)
    assert (before["ellipsoids"], after["ellipsoids"]) == (5, 3)
    assert after["image"]["boxes"] < before["image"]["boxes"]
    assert len(names(page)) == 3
    page.locator("#classes button", has_text="cup").click()
    assert on_screen(page)["ellipsoids"] == 5


def test_photographs_are_behind_the_boxes(page):
    page.wait_for_function("!window.onScreen.image.photograph")  # the last pose has none
    page.locator("#time").focus()
    page.keyboard.press("Home")
    page.wait_for_function("window.onScreen.image.photograph")
    color = page.evaluate(
        "[...document.getElementById('image').getContext('2d').getImageData(2, 2, 1, 1).data]"
    )
    np.testing.assert_allclose(color, [0, 160, 0, 255], atol=4)


def test_flying_there_and_seeing_everything_again(page):
    def middle(number):
        (place,) = [one for one in on_screen(page)["places"] if one["id"] == number]
        return np.array([place["u"], place["v"]])

    before = middle(11)
    page.locator("#objects button", has_text="book").click()
    page.click("#fly")
    page.wait_for_timeout(600)
    box = page.locator("#space").bounding_box()
    # The middle of an outline is not quite that of the object.
    np.testing.assert_allclose(middle(11), [box["width"] / 2, box["height"] / 2], atol=6.0)
    page.click("#fit")
    np.testing.assert_allclose(middle(11), before, atol=0.01)


def test_the_wheel_zooms_to_the_cursor(page):
    """What is under the cursor, at the distance that is looked at, stays there."""
    seen = page.evaluate(
        """() => {
          const canvas = document.getElementById("space");
          const orbit = new Orbit(canvas, [0, 0, 1], [[0, 0, 0], [4, 2, 1]], () => {});
          const under = (x, y) => {
            const { view, lens } = orbit.look(), d = orbit.distance;
            const ray = [(x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1];
            return geometry.toWorld(view, geometry.scale(d, ray));
          };
          const before = [under(100, 200), orbit.distance];
          orbit.zoom(0.5, 100, 200);
          return [...before, under(100, 200), orbit.distance];
        }"""
    )
    np.testing.assert_allclose(seen[2], seen[0], atol=1e-9)
    assert seen[3] == pytest.approx(0.5 * seen[1])
    before = {one["id"]: one for one in on_screen(page)["places"]}
    page.mouse.move(before[11]["u"], before[11]["v"])
    page.mouse.wheel(0, -300)
    after = {one["id"]: one for one in on_screen(page)["places"]}
    spread = [np.ptp([one["u"] for one in places.values()]) for places in (before, after)]
    assert spread[1] > 1.2 * spread[0]


def test_measuring(page, results):
    """The distance of two clicked objects is that of their centers."""
    objects = load_results(results).objects
    page.click("#measure")
    places = {one["id"]: one for one in on_screen(page)["places"]}
    for number in (11, 12):
        place = {"x": places[number]["u"], "y": places[number]["v"]}
        page.locator("#space").click(position=place)
    settle(page)
    rows = [list(objects.object_ids).index(number) for number in (11, 12)]
    meters = np.linalg.norm(objects.centers[rows[0]] - objects.centers[rows[1]])
    assert page.locator("#hint").inner_text() == f"book 11 to lamp 12: {meters:.3f} m"
    assert page.locator("#selected h2").count() == 0
    page.click("#measure")
    settle(page)
    assert page.locator("#hint").inner_text().startswith("Grid")


def test_space_bar_speed_and_time(page):
    page.locator("#space").click(position={"x": 500, "y": 5})
    page.select_option("#speed", "5")
    page.locator("#space").focus()
    page.keyboard.press(" ")
    assert page.locator("#play").inner_text() == "Pause"
    page.wait_for_function("document.getElementById('play').textContent === 'Play'")
    settle(page)
    assert page.locator("#status").inner_text().startswith("image 20 of 20, 1.9 s: ")
    assert page.locator("#status").get_attribute("title") == "at 101.9 s"


def test_color_by_fit(page):
    """One object, whose boxes fit exactly, is blue: a quarter of the usual 3.36 and less."""
    chi_squares = page.evaluate("scene.objects.map((one) => one.chiSquare)")
    assert sum(value is not None and value < 0.1 for value in chi_squares) == 1

    def count():
        settle(page)
        return page.evaluate(
            """() => {
              const canvas = document.getElementById("image");
              const { width, height } = canvas;
              const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
              let count = 0;
              for (let k = 0; k < data.length; k += 4)
                count += Math.hypot(data[k] - 33, data[k + 1] - 102, data[k + 2] - 172) < 30;
              return count;
            }"""
        )

    before = count()
    page.check("#by-fit")
    assert count() > before + 20


def test_dark(page):
    def background():
        return page.evaluate("getComputedStyle(document.body).backgroundColor")

    assert background() == "rgb(255, 255, 255)"
    page.click("#dark")
    settle(page)
    assert background() == "rgb(20, 23, 27)"
    assert page.evaluate("theme.colors.text") == "#e6e9ec"


def test_on_a_phone_no_switch_is_over_the_map(page):
    page.set_viewport_size({"width": 390, "height": 800})
    settle(page)
    space, switches = (page.locator(name).bounding_box() for name in ("#space", "#switches"))
    assert space["y"] + space["height"] <= switches["y"] + 0.5
    assert space["height"] > 300
    assert switches["x"] + switches["width"] <= 390.5


def many(results, objects, poses):
    """Return a scene with so many objects and poses around those of a small map."""
    from dataclasses import replace

    scene = build_scene(load_results(results))
    random = np.random.default_rng(0)
    centers = random.uniform(-50, 50, (objects, 3)) * [1, 1, 0.02]
    turn = np.linspace(0, 20 * np.pi, poses)
    path = np.zeros((poses, 7))
    path[:, :3] = np.stack([40 * np.cos(turn), 40 * np.sin(turn), 0 * turn], axis=1)
    path[:, 6] = 1.0
    one = scene.objects[0]
    return replace(
        scene,
        timestamps=np.arange(poses) * 0.1,
        estimate=path,
        odometry=path,
        cameras=np.zeros(1, dtype=np.int64),
        pose_spreads=(),
        objects=tuple(
            replace(one, id=row, center=center, class_name=f"class {row % 9}", color=FIRST[0])
            for row, center in enumerate(centers)
        ),
    )


def test_the_slider_begins_at_the_last_of_many_images(browser, results, tmp_path):
    write_page_files(many(results, 3, 250), tmp_path)
    with open_page(browser, f"file://{tmp_path}/index.html") as page:
        page.wait_for_function("window.onScreen")
        assert page.evaluate("document.getElementById('time').value") == "249"


def test_many_objects_and_poses(browser, results, tmp_path):
    """What is drawn of them is bounded by what can be seen, and nothing is lost from sight."""
    write_page_files(many(results, 10_000, 100_000), tmp_path)
    with open_page(browser, f"file://{tmp_path}/index.html") as page:
        page.wait_for_function("window.onScreen")
        shown = on_screen(page)
        assert 1000 < shown["estimate"] < 20_000
        assert 5_000 < shown["ellipsoids"] <= 10_000
        assert shown["ellipsoids"] - shown["specks"] < 400  # with a shape of their own
        assert 50 < shown["labels"] <= 150
        assert page.locator("#objects button").count() == 300
        assert page.locator("#more").inner_text() == "and 9700 more: search for them"
        page.fill("#search", "9999")
        assert len(names(page)) == 1


def test_images_of_a_lens_are_undistorted():
    """A pixel of the copy shows the place of the recorded image that the lens takes it to."""
    from dqslam.view.photographs import _sampled, _sources

    camera = Camera(100, 100, 49.5, 39.5, 100, 80, distortion=[-0.2, 0.05, 0, 0, 0])
    v, u = np.mgrid[:80, :100]
    recorded = np.stack([u, v, np.full_like(u, 255)], axis=2).astype(np.uint8)
    copy = np.asarray(_sampled(Image.fromarray(recorded), _sources(camera, 50, 40)))
    for row, column in ((2, 3), (20, 25), (30, 44)):
        ideal = np.array([[2 * column + 0.5, 2 * row + 0.5]])
        expected = camera.distort_points(ideal)[0]
        assert np.abs(copy[row, column, :2] - expected).max() <= 0.51
    assert _sources(Camera(100, 100, 49.5, 39.5, 100, 80), 50, 40) is None


def test_images_that_do_not_belong(results, tmp_path, capsys):
    small = tmp_path / "rgb"
    small.mkdir()
    for moment in load_results(results).timestamps:
        Image.new("RGB", (32, 24)).save(small / f"{moment:.6f}.png")
    page = tmp_path / "page"
    assert main(["view", str(results), "--export", str(page), "--images", str(small)]) == 2
    assert "is 32 x 24, but the camera's are 640 x 480" in capsys.readouterr().err
    assert not page.exists()
    assert main(["view", str(results), "--images", str(small)]) == 2
    assert "--images are shown by the page of --export only" in capsys.readouterr().err
