"""Files as other programs write them: `tests/corpus/formats` has a small one of each kind."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from dqslam import io

FORMATS = Path(__file__).resolve().parents[1] / "corpus" / "formats"
# What each of these files says, in this package's conventions.
POSES = [[0, 0, 0, 0, 0, 0, 1], [0.1, 0, 0, 0, 0, 0, 1], [0.2, 0, 0.1, 0, 0, 0, 1]]
BOXES = [[10, 20, 40, 60], [100, 50, 200, 170], [12, 20, 42, 60]]
CUP, BOTTLE = {"cup", "41", "Car"}, {"bottle", "39", "Van"}
WITHOUT_SCORE = {"minimal.csv", "image_names.csv", "corner_size.csv", "label_2", "obb", "segments"}
WITHOUT_CLASS = {"minimal.csv", "gt.txt", "spaces.txt"}
WITH_IDS = {
    *("boxes.jsonl", "ultralytics.jsonl", "0000.txt", "gt.txt", "spaces.txt", "detections.json"),
    *("supervision.csv", "tracks", "boxes.mcap"),
}


BAGS = pytest.mark.skipif(find_spec("rosbags") is None, reason="rosbags is not installed")


def files(kind):
    return [
        pytest.param(
            path,
            name,
            id=f"{path.parent.name}/{path.name}{', named' * (name is not None)}",
            marks=[BAGS] if folder.name == "rosbag" else [],
        )
        for folder in sorted((FORMATS / kind).iterdir())
        for path in sorted(folder.iterdir())
        for name in (None, folder.name)
    ]


def variants(path, folder):
    """Give the file, with line ends of Windows and a mark of UTF-8, and with blank lines."""
    yield path
    if path.is_dir() or path.suffix == ".mcap":
        return
    text = path.read_text()
    windows = folder / path.name
    windows.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    yield windows
    blank = folder / f"blank_{path.name}"
    blank.write_text(text + "\n\n")
    yield blank


@pytest.mark.parametrize(("path", "name"), files("camera"))
def test_cameras(path, name, tmp_path):
    for file in variants(path, tmp_path):
        camera = io.read_camera(file, name)
        assert (camera.fx, camera.fy, camera.cx, camera.cy) == (525, 525, 319.5, 239.5)
        assert (camera.width, camera.height) == (640, 480)
        assert not camera.has_distortion


@pytest.mark.parametrize(("path", "name"), files("trajectory"))
def test_trajectories(path, name, tmp_path):
    for file in variants(path, tmp_path):
        times, poses = io.read_trajectory(
            file, name, frames=io.frame_rate(10.0), notes=io.Notes(max_bad=0.0)
        )
        np.testing.assert_allclose(times - times[0], [0, 0.1, 0.3], atol=1e-6)
        np.testing.assert_allclose(poses, POSES, atol=1e-12)


@pytest.mark.parametrize(("path", "name"), files("detections"))
def test_detections(path, name, tmp_path):
    frames = None if path.name == "minimal.csv" or path.suffix == ".mcap" else io.frame_rate(10.0)
    for file in variants(path, tmp_path):
        notes = io.Notes(max_bad=0.0)
        table = io.read_detections(file, name, frames=frames, width=640, height=480, notes=notes)
        np.testing.assert_allclose(table.box, BOXES, atol=5e-4)
        assert table.frame.tolist() == [0, 0, 1]
        np.testing.assert_allclose(table.timestamp - table.timestamp[0], [0, 0, 0.1], atol=1e-6)
        scores = [1, 1, 1] if path.name in WITHOUT_SCORE else [0.9, 0.8, 0.7]
        assert table.score.tolist() == scores
        first, second, third = table.class_name
        if path.name not in WITHOUT_CLASS:
            assert first == third
            assert (first in CUP, second in BOTTLE) == (True, True)
        if path.name in WITH_IDS and path.parent.name != "oaslam":
            assert table.track_id.tolist() == [1, 2, 1]
        else:
            assert table.track_id is None


def test_x_and_y_of_a_corner_are_noted():
    notes = io.Notes()
    path = FORMATS / "detections" / "csv" / "corner_size.csv"
    io.read_detections(path, frames=io.frame_rate(10.0), notes=notes)
    (note,) = notes.sentences()
    assert "x and y are taken for the corner of a box: --box-form cxcywh if its center" in note
    table = io.read_boxes_file(
        path,
        (640, 480),
        io.ReadOptions(
            frames=io.frame_rate(10.0), readings=io.Readings(boxes=io.BoxReading(form="cxcywh"))
        ),
        io.Notes(),
    )
    np.testing.assert_allclose(table.box[1], [50, -0.5, 150, 110])


def test_places_of_other_things_are_no_boxes(tmp_path):
    """x and y beside corners are something else, and a matrix is no turned camera."""
    path = tmp_path / "a.csv"
    path.write_text("frame,x1,y1,x2,y2,x,y,z,width,height\n0,10,20,40,60,1,2,3,4,5\n")
    notes = io.Notes()
    table = io.read_detections(path, frames=io.frame_rate(10.0), notes=notes)
    np.testing.assert_allclose(table.box, [[10, 20, 40, 60]])
    assert "not used: x, y, z" in notes.sentences()[0]
