"""Numbers that no unit makes sense of: refused as they are read, before anything overflows."""

import json
import warnings

import numpy as np
import pytest

from dqslam import io
from dqslam._limits import LARGEST_NUMBER
from dqslam.io.files import in_reach

LARGE = ("1e308", "-1e308", "1e400", "inf", "1e41")
TUM = "0 0 0 0 0 0 0 1\n1 {} 0 0 0 0 0 1\n"
KITTI = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 {} 0 1 0 0 0 0 1 0\n"
CSV = "frame,timestamp,x1,y1,x2,y2\n0,0,1,1,9,9\n1,1,{},1,9,9\n"
MOT = "1,-1,1,1,9,9,1\n2,-1,1,1,{},9,1\n"
COCO = (
    '[{"image_id": 0, "category_id": 0, "bbox": [1, 1, 9, 9]},\n'
    '{"image_id": 1, "category_id": 0, "bbox": [1, 1, %s, 9]}]'
)


@pytest.fixture(autouse=True)
def no_warning_of_numpy():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield


def test_reach():
    values = np.array([0.0, LARGEST_NUMBER, -LARGEST_NUMBER, 1.01e40, -np.inf, np.nan])
    np.testing.assert_array_equal(in_reach(values), [*values[:3], np.nan, np.nan, np.nan])


@pytest.mark.parametrize("large", LARGE)
def test_poses(tmp_path, large):
    for name, text, column in (("t.txt", TUM, "tx"), ("k.txt", KITTI, "tx")):
        (tmp_path / name).write_text(text.format(large))
        with pytest.raises(io.FileError, match=rf"{name}:2: {column} is not a finite number below"):
            io.read_trajectory(tmp_path / name, frames=io.frame_rate(1.0))


@pytest.mark.parametrize("large", LARGE)
def test_boxes(tmp_path, large):
    texts = {
        "a.csv": CSV.format(large),
        "m.txt": MOT.format(large),
        "c.json": COCO % large.replace("inf", "Infinity"),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        with pytest.raises(io.FileError, match=rf"{name}:\d: x[12] is not a finite number below"):
            io.read_detections(tmp_path / name, frames=io.frame_rate(1.0), width=640, height=480)
    (tmp_path / "yolo").mkdir()
    (tmp_path / "yolo" / "1.txt").write_text(f"0 0.5 0.5 {large} 0.1\n")
    with pytest.raises(io.FileError, match=r"1\.txt:1: x1 is not a finite number below"):
        io.read_detections(tmp_path / "yolo", frames=io.frame_rate(1.0), width=640, height=480)


@pytest.mark.parametrize("large", LARGE)
def test_camera(tmp_path, large):
    camera = {"fx": 500, "fy": 500, "cx": 320, "cy": 240, "width": 640, "height": 480}
    text = json.dumps(camera | {"k1": "?"}).replace('"?"', large.replace("inf", "Infinity"))
    (tmp_path / "c.json").write_text(text)
    with pytest.raises(io.FileError, match=r"c\.json:1: k1 is \S+, not a finite number below"):
        io.read_camera(tmp_path / "c.json")


@pytest.mark.parametrize("large", LARGE)
def test_formats_are_recognized_without_an_overflow(tmp_path, large):
    """What may be a quaternion is not one of length 1."""
    (tmp_path / "images.txt").write_text(f"1 {large} 0 0 0 0 0 0 1 a_000001.png\n\n")
    with pytest.raises(io.FileError, match=r"images\.txt.*in no known format"):
        io.read_trajectory(tmp_path / "images.txt")
    (tmp_path / "m.txt").write_text(f"1,-1,1,1,{large},9,1,-1\n")
    with pytest.raises(io.FileError, match=r"m\.txt:1: x2 is not a finite number below"):
        io.read_detections(tmp_path / "m.txt", frames=io.frame_rate(1.0))
