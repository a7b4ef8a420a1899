"""What moves, as viewers show it: in the scene, on the page in a real browser, and as MCAP."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import planted
from browser import on_screen, open_page, settle, start_browser
from dqslam._colors import FIRST, class_colors, moving_colors
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.io.results.tracks import write_tracks
from dqslam.track import Track
from dqslam.view import build_scene, write_page
from test_view_foxglove import quaternion, read, vector

POSES = np.array([2, 3, 6, 7])  # not shown in the images 4 and 5
HEADING = 0.5
SIDES = np.array([0.4, 0.2, 0.15])


def made(track_id=3, class_name="cart", pose=POSES):
    """Return a track that goes 0.1 m in an image, along its heading."""
    count = len(pose)
    ahead = np.array([np.cos(HEADING), np.sin(HEADING), 0.0])
    return Track(
        track_id,
        class_name,
        "moves",
        0.999,
        pose,
        np.array([-0.2, 0.1 * track_id, 0.3]) + 0.1 * (pose - pose[0])[:, None] * ahead,
        np.tile(Rotation.from_euler("z", HEADING).as_quat(), (count, 1)),
        np.full(count, HEADING),
        1.0 + 0.5 * np.arange(count),
        np.zeros(count),
        np.full(count, True),
        SIDES,
        np.tile(1e-4 * np.eye(3), (count, 1, 1)),
        *np.full((3, count), 0.25),
        np.full(3, 0.1),
    )


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    """Results with a cart, which the map does not have, and a cup, which it has."""
    found = planted.write_planted(tmp_path_factory.mktemp("results")).results
    tracks = made(), made(5, "cup", np.array([10, 11, 12, 13]))
    write_tracks(found / "tracks.csv", tracks, load_results(found).timestamps)
    (found / "manifest.json").unlink()  # it does not list the tracks
    return found


@pytest.fixture(scope="module")
def scene(directory):
    return build_scene(load_results(directory))


def test_a_thing_is_where_its_last_image_has_it_until_it_is_gone(scene):
    rows = [scene.tracks[0].row_at(frame) for frame in range(9)]
    assert rows == [None, None, 0, 1, 1, 1, 2, 3, None]
    assert scene.tracks[0].name_at(2) == "cart T3, 2.0 m/s"


def test_colors_are_those_of_classes_and_of_no_object_that_has_its_own(scene):
    cart, cup = scene.tracks
    assert cup.color == next(one.color for one in scene.objects if one.class_name == "cup")
    assert cart.color == FIRST[4]  # after box, book, cup and lamp
    of_class = class_colors(["cup", "cup"], ["cup", "cart"])
    assert moving_colors(["cup", "cup"], ["cup", "cart"], of_class) == {
        "cart": FIRST[2],
        "cup": FIRST[3],
    }
    # True classes keep the colors that they have without what moves.
    assert (
        class_colors(["cup"], ["vase"], ["cart"])["vase"] == class_colors(["cup"], ["vase"])["vase"]
    )


def test_the_page_has_the_tracks(directory, scene, tmp_path):
    assert main(["view", str(directory), "--export", str(tmp_path / "page"), "-q"]) == 0
    text = (tmp_path / "page" / "scene.js").read_text()
    shown = json.loads(text.removeprefix("const scene = ").rstrip().removesuffix(";"))["tracks"]
    assert [one["id"] for one in shown] == [3, 5]
    assert (shown[0]["className"], shown[0]["color"]) == ("cart", scene.tracks[0].color)
    assert shown[0]["pose"] == [2, 3, 6, 7]
    assert shown[0]["sides"] == [0.4, 0.2, 0.15]
    np.testing.assert_allclose(shown[0]["centers"], made().centers, atol=1e-6)
    np.testing.assert_allclose(shown[0]["orientations"], made().orientations, atol=1e-6)
    assert shown[0]["names"][0] == "cart T3, 1.0 m/s"


@pytest.fixture(scope="module")
def browser():
    with start_browser() as browser:
        yield browser


@pytest.fixture
def page(browser, scene, tmp_path):
    write_page(scene, tmp_path / "page")
    with open_page(browser, f"file://{tmp_path}/page/index.html") as page:
        page.wait_for_function("window.onScreen")
        yield page


def canvas(page):
    settle(page)
    return page.evaluate("document.getElementById('space').toDataURL()")


def test_the_slider_shows_cuboids_and_the_switch_hides_them(page):
    page.locator("#time").focus()
    page.keyboard.press("Home")
    counts, names = [], []
    for _ in range(15):
        shown = on_screen(page)
        counts.append(shown["tracks"])
        names.append(shown["labels"])
        page.keyboard.press("ArrowRight")
    assert counts == [0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 1, 1, 1, 1, 0]
    assert names[2] >= 1
    before = canvas(page)  # of the paths alone
    page.uncheck("#show-tracks")
    assert on_screen(page)["tracks"] == 0
    assert canvas(page) != before
    page.check("#show-tracks")
    assert canvas(page) == before


def test_a_hidden_class_does_not_move_either(page):
    page.locator("#time").fill("11")
    assert on_screen(page)["tracks"] == 1
    page.locator("#classes button", has_text="cup").click()
    assert on_screen(page)["tracks"] == 0


def test_corners_on_the_page_are_those_of_the_track(page):
    corners = page.evaluate(
        "() => scene.tracks[0].pose.map((_, row) => new MovingThing(scene.tracks[0]).corners(row))"
    )
    np.testing.assert_allclose(corners, made().corners(), atol=3e-6)
    # Forward, left and up are the first, second and third digit of a corner's number.
    ahead = np.subtract(corners[0][4], corners[0][0])
    expected = SIDES[0] * np.array([np.cos(HEADING), np.sin(HEADING), 0.0])
    np.testing.assert_allclose(ahead, expected, atol=3e-6)


def test_a_page_without_objects_has_names_of_what_moves(browser, scene, tmp_path):
    boxes = replace(scene.boxes, object=np.full(len(scene.boxes), -1))
    write_page(replace(scene, objects=(), boxes=boxes), tmp_path / "page")
    with open_page(browser, f"file://{tmp_path}/page/index.html") as page:
        page.wait_for_function("window.onScreen")
        page.locator("#time").fill("2")
        shown = on_screen(page)
        assert (shown["tracks"], shown["labels"], shown["ellipsoids"]) == (1, 1, 0)


def test_mcap_has_cubes_at_each_time(directory, scene, tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed: the extra mcap")
    assert main(["view", str(directory), "--mcap", str(tmp_path / "map.mcap"), "-q"]) == 0
    messages, schemas = read(tmp_path / "map.mcap")
    assert schemas["/tracks"] == "foxglove.SceneUpdate"
    assert [at for at, _ in messages["/tracks"]] == [round(at * 1e9) for at in scene.timestamps]
    updates = [update for _, update in messages["/tracks"]]
    shown = [[one.id for one in update.entities] for update in updates]
    cart, cup = ["track 3"], ["track 5"]
    assert shown == [[]] * 2 + [cart] * 6 + [[]] * 2 + [cup] * 4 + [[]] * 6
    # Each update takes away what the one before it has shown: 1 is the type for all entities.
    assert [[one.type for one in update.deletions] for update in updates] == [[1]] * 20
    track, row = made(), 1
    (entity,) = updates[5].entities  # as in image 3, the last that shows it
    (cube,), (arrow,), (text,) = entity.cubes, entity.arrows, entity.texts
    for one in (cube, arrow):
        np.testing.assert_allclose(vector(one.pose.position), track.centers[row], atol=1e-8)
        turn = quaternion(one.pose.orientation)
        np.testing.assert_allclose(turn, track.orientations[row], atol=1e-8)
    np.testing.assert_allclose(vector(cube.size), SIDES, atol=1e-9)
    # From the center along its first axis, which is ahead, half a length beyond the front.
    assert arrow.shaft_length + arrow.head_length == pytest.approx(SIDES[0])
    assert text.text == "cart T3, 1.5 m/s"
    told = {pair.key: pair.value for pair in entity.metadata}
    assert told == {
        "id": "3",
        "class": "cart",
        "behavior": "moves",
        "is moving": "yes",
        "speed": "1.50 ± 0.25 m/s",
        "size": "0.40 × 0.20 × 0.15 m",
    }
    ((_, paths),) = messages["/paths"]
    assert [one.id for one in paths.entities] == ["estimate", "odometry", "track 3", "track 5"]
    line = np.array([vector(point) for point in paths.entities[2].lines[0].points])
    np.testing.assert_allclose(line, track.centers, atol=1e-8)
