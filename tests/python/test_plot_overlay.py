"""Outlines over images: where they are, and that files are whole."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from PIL import Image

import planted
from dqslam import Camera, _core, io
from dqslam.evaluation import fit_boxes
from dqslam.plot.overlay import Overlay, save_stills, save_video, usual_rate

SIZE = (planted.CAMERA.width, planted.CAMERA.height)
GRAY = (128, 128, 128)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return io.load_results(planted.write_planted(tmp_path_factory.mktemp("planted")).results)


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    """Return an even image for each of three poses."""
    folder = tmp_path_factory.mktemp("images")
    for pose in (0, 4, 9):
        Image.new("RGB", SIZE, GRAY).save(folder / f"{pose:04}.png")
    return {pose: folder / f"{pose:04}.png" for pose in (0, 4, 9)}


def outlines(figure):
    (axes,) = figure.axes
    return [one for one in axes.lines if one.get_gid() == "outline"]


def test_each_side_of_the_box_touches_the_outline(results, images):
    fits = fit_boxes(results)
    drawn = outlines(Overlay(results).draw(4, images[4]))
    touched = [one.get_xydata() for one in drawn if one.get_linestyle() == "-"]
    touched = [np.concatenate([one.min(axis=0), one.max(axis=0)]) for one in touched]
    boxes = fits.predicted[(fits.boxes.pose == 4) & (fits.object_row >= 0)]
    assert len(touched) == len(boxes) == 4
    for box in boxes:
        assert min(np.abs(one - box).max() for one in touched) < 0.5


def test_an_object_without_a_box_is_dashed_and_has_no_name(results, images):
    figure = Overlay(replace(results, boxes=None)).draw(4, images[4])
    assert {one.get_linestyle() for one in outlines(figure)} == {"--"}
    assert not figure.axes[0].texts
    figure = Overlay(results).draw(4, images[4])
    names = sorted(one.get_text() for one in figure.axes[0].texts)
    assert names == ["book 11", "box 14", "cup 10", "lamp 12"]


def test_pixels_of_the_outline_are_painted(tmp_path, results, images):
    """The leftmost point of an outline, in the file: no longer what the image was."""
    fits = fit_boxes(results)
    (path,) = save_stills(Overlay(results), {9: images[9]}, tmp_path)
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    assert pixels.shape == (SIZE[1], SIZE[0], 3)
    row = int(np.flatnonzero((fits.boxes.pose == 9) & (fits.boxes.object_id == 14))[0])
    outline = _outline(results, 9, 14)
    for at in outline[::16]:
        u, v = np.round(at).astype(int)
        assert np.abs(pixels[v, u] - GRAY).max() > 20
    inside = fits.predicted[row].reshape(2, 2).mean(axis=0).round().astype(int)
    np.testing.assert_array_equal(pixels[inside[1], inside[0]], GRAY)


def _outline(results, pose, number):
    """Project points of the ellipsoid's rim: the dual conic in plain numpy."""
    row = int(np.flatnonzero(results.objects.object_ids == number)[0])
    quadric = _core.dual_quadric_matrix(
        _core.dual_quadric_from_ellipsoid(results.objects.ellipsoids[row])
    )
    world_from_camera = np.eye(4)
    x, y, z, w = results.poses[pose, 3:]
    world_from_camera[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    world_from_camera[:3, 3] = results.poses[pose, :3]
    camera = results.camera
    k = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    projection = k @ np.linalg.inv(world_from_camera)[:3]
    conic = projection @ quadric @ projection.T
    line_of = np.linalg.inv(conic)  # points x of the conic: x^T C x = 0
    middle = conic[:2, 2] / conic[2, 2]
    points = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 128):
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        start = np.append(middle, 1.0)
        reach = np.sqrt(-(start @ line_of @ start) / (way @ line_of @ way))
        points.append(middle + reach * way[:2])
    return np.array(points)


def test_a_lens_bends_the_outlines(results, images):
    camera = results.camera
    lens = Camera(
        camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height,
        distortion=[0.2, -0.3, 1e-3, -1e-3, 0.1],
    )  # fmt: skip
    straight = outlines(Overlay(results).draw(4, images[4]))
    bent = replace(results, camera=lens)
    curved = outlines(Overlay(bent).draw(4, images[4]))
    for one, other in zip(straight, curved, strict=True):
        expected = lens.distort_points(one.get_xydata())
        np.testing.assert_allclose(other.get_xydata(), expected, atol=1e-6)
        assert np.abs(expected - one.get_xydata()).max() > 0.1


def test_stills_have_the_names_of_the_images(tmp_path, results, images):
    told = []
    overlay = Overlay(results)
    written = save_stills(overlay, images, tmp_path / "new", told.append)
    assert [path.name for path in written] == ["0000.png", "0004.png", "0009.png"]
    assert sorted(tmp_path.rglob("*.*")) == written
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_an_image_is_never_overwritten_by_itself(tmp_path, results, images):
    image = shutil.copy(images[4], tmp_path / "0004.png")
    before = image.read_bytes()
    with pytest.raises(io.FileError, match=r"0004.png: is the image itself"):
        save_stills(Overlay(results), {4: image}, tmp_path)
    assert image.read_bytes() == before


def test_a_gif_has_a_frame_for_each_image(tmp_path, results, images):
    path = tmp_path / "new" / "film.gif"
    save_video(Overlay(results), images, path, rate=5.0)
    with Image.open(path) as film:
        assert (film.n_frames, film.size, film.info["duration"]) == (3, SIZE, 200)
    assert [one.name for one in path.parent.iterdir()] == ["film.gif"]


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg")
def test_an_mp4_is_one(tmp_path, results, images):
    path = tmp_path / "film.mp4"
    save_video(Overlay(results), images, path, rate=5.0)
    assert path.read_bytes()[4:8] == b"ftyp"
    assert [one.name for one in tmp_path.iterdir()] == ["film.mp4"]


def test_without_ffmpeg_there_is_no_mp4(tmp_path, results, images, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(io.FileError, match=r"MP4 needs ffmpeg .*\.gif does not"):
        save_video(Overlay(results), images, tmp_path / "film.mp4", rate=5.0)
    with pytest.raises(io.FileError, match=r"none of .mp4, .gif"):
        save_video(Overlay(results), images, tmp_path / "film.avi", rate=5.0)


@pytest.mark.parametrize("suffix", ["gif", "mp4"])
def test_a_film_that_fails_half_way_is_not_there(tmp_path, results, images, suffix):
    if suffix == "mp4" and shutil.which("ffmpeg") is None:
        pytest.skip("no ffmpeg")
    Image.new("RGB", (10, 20)).save(tmp_path / "small.png")
    mixed = images | {12: tmp_path / "small.png"}
    with pytest.raises(io.FileError, match=r"small.png: is 10 x 20, but the camera's are"):
        save_video(Overlay(results), mixed, tmp_path / f"film.{suffix}", rate=5.0)
    assert [path.name for path in tmp_path.iterdir()] == ["small.png"]


def test_what_is_no_image_is_named(tmp_path, results):
    path = tmp_path / "0001.png"
    path.write_text("no image")
    with pytest.raises(io.FileError, match=r"0001.png: cannot be read as an image"):
        Overlay(results).draw(1, path)


def test_a_gray_image_stays_gray(tmp_path, results):
    Image.new("L", SIZE, 77).save(tmp_path / "gray.png")
    (path,) = save_stills(Overlay(results), {0: tmp_path / "gray.png"}, tmp_path / "out")
    pixels = np.asarray(Image.open(path).convert("RGB"))
    np.testing.assert_array_equal(pixels[2, 2], [77, 77, 77])


def test_a_film_runs_as_the_recording_did_where_one_can_watch_that():
    assert usual_rate(0.1 * np.arange(5)) == pytest.approx(10.0)
    assert usual_rate(np.arange(5) / 25.0) == pytest.approx(25.0)
    assert usual_rate(np.array([703.0, 707, 711])) == 10.0
    assert usual_rate(np.array([1.0])) == 10.0
