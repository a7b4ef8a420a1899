import numpy as np
import pytest

import realdata
from dqslam import Camera
from dqslam.io import CAMERA_FORMATS, FileError, read_camera

LENS = [0.1, -0.2, 0.003, -0.004, 0.05]
WRITERS = {format_.name: format_ for format_ in CAMERA_FORMATS if format_.write}
ENDINGS = {
    "json": ".json",
    "toml": ".toml",
    "ros": ".yaml",
    "colmap": ".txt",
    "kitti-calib": ".txt",
}

ROS = """image_width: 640
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [500.5, 0.000000, 320.25, 0.000000, 501, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 3e-3, -0.004, 0.05]
"""
MESSAGE = """height: 480
width: 640
distortion_model: "plumb_bob"
D: [0.1, -0.2, 0.003, -0.004, 0.05]
K: [500.5, 0.0, 320.25, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]
---
height: 480
"""
COLMAP = "# Camera list\n1 PINHOLE 640 480 500.5 501 320.75 240.5\n"
KITTI = "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nP2: 500.5 0 320.25 44.8 0 501 240 0.2 0 0 1 0.003\n"


def write(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def values(camera):
    plain = [camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height]
    return plain + camera.distortion.tolist()


@pytest.mark.parametrize(
    ("name", "text", "lens"),
    [
        ("left.yaml", ROS, LENS),
        ("left.yml", MESSAGE, LENS),
        ("left.yaml", ROS.replace("plumb_bob", "rational_polynomial"), LENS),
        (
            "left.yaml",
            ROS.replace("cols: 5", "cols: 4")[: ROS.rindex("data")]
            + "data: [0.1, -0.2, 0.003, -0.004]",
            [*LENS[:4], 0],
        ),
        ("left.yaml", MESSAGE.replace("[0.1, -0.2, 0.003, -0.004, 0.05]", "[]"), [0] * 5),
        ("cameras.txt", COLMAP, [0] * 5),
        (
            "cameras.txt",
            "3 FULL_OPENCV 640 480 500.5 501 320.75 240.5 0.1 -0.2 0.003 -0.004 0.05 0 0 0",
            LENS,
        ),
        ("calib.txt", KITTI + "S_rect_02: 640 480\n", [0] * 5),
        (
            "calib_cam_to_cam.txt",
            "calib_time: 09-Jan-2012 13:57:47\nS_rect_02: 6.4e+02 4.8e+02\n"
            "P_rect_02: 500.5 0 320.25 44.8 0 501 240 0.2 0 0 1 0.003\n",
            [0] * 5,
        ),
    ],
)
def test_the_same_camera_in_all_formats(tmp_path, name, text, lens):
    camera = read_camera(write(tmp_path, name, text))
    assert values(camera) == [500.5, 501, 320.25, 240, 640, 480, *lens]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("1 SIMPLE_PINHOLE 64 48 50 32 24", [50, 50, 31.5, 23.5, 64, 48, 0, 0, 0, 0, 0]),
        ("1 SIMPLE_RADIAL 64 48 50 32 24 0.1", [50, 50, 31.5, 23.5, 64, 48, 0.1, 0, 0, 0, 0]),
        ("1 RADIAL 64 48 50 32 24 0.1 0.2", [50, 50, 31.5, 23.5, 64, 48, 0.1, 0.2, 0, 0, 0]),
        ("1 OPENCV 64 48 50 51 32 24 1 2 3 4", [50, 51, 31.5, 23.5, 64, 48, 1, 2, 3, 4, 0]),
    ],
)
def test_models_of_colmap(tmp_path, line, expected):
    assert values(read_camera(write(tmp_path, "cameras.txt", line))) == expected


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("lens", [[0.0] * 5, LENS, [*LENS[:4], 0.0], [1e-5, 0.0, 0.0, 0.0, 0.0]])
def test_what_is_written_is_read_back(tmp_path, name, lens):
    camera = Camera(500.1, 501.7, 320.3, 1 / 3, 640, 480, distortion=lens)
    path = tmp_path / f"camera{ENDINGS[name]}"
    if name == "kitti-calib" and any(lens):
        with pytest.raises(FileError, match="no place for lens distortion"):
            WRITERS[name].write(path, camera)
        assert not path.exists()
        return
    WRITERS[name].write(path, camera)
    again = read_camera(path)
    if name == "colmap":  # half a pixel more and less
        np.testing.assert_allclose(values(again), values(camera), rtol=0, atol=1e-13)
    else:
        assert values(again) == values(camera)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (
            "a.yaml",
            ROS.replace("plumb_bob", "double_sphere"),
            r"yaml:8: distortion_model is dou",
        ),
        ("a.yaml", ROS.replace("500.5", "-1"), r":4: fx is -1, not positive"),
        (
            "a.yaml",
            ROS.replace("500.5", ".nan"),
            r":4: camera_matrix is nan, not a finite number below",
        ),
        ("a.yaml", ROS.replace("500.5", "ten"), r":4: camera_matrix holds 'ten', not a number"),
        ("a.yaml", ROS.replace("500.5, 0.0", "500.5, 1.0"), r":4: camera_matrix is not fx 0 cx"),
        (
            "a.yaml",
            ROS.replace("0.05]", "0.05, 1, 0, 0]"),
            r":9: distortion_coefficients has 8 numbers, not 1 rows of 5",
        ),
        ("a.yaml", ROS.replace("image_width", "x"), r"missing width \(it has: x,"),
        ("a.yaml", ROS.replace("640", "640.5"), r":1: width is 640\.5, not a whole number"),
        ("a.yaml", "a: [1, 2\nb: 3\n", r"a\.yaml:2: not YAML"),
        ("a.yaml", "- 1\n", r"holds no table of named values"),
        (
            "a.txt",
            "1 THIN_PRISM_FISHEYE 64 48 1 2 3 4",
            r":1: 4 parameters, but THIN",
        ),
        ("a.txt", "1 PINHOLE 64 48 1 2 3", r":1: 3 parameters, but PINHOLE has fx fy cx cy"),
        ("a.txt", "1 PINHOLE 64 48 1 2 x 4", r":1: cx is 'x', not a number"),
        ("a.txt", COLMAP + COLMAP, r":4: camera 1 occurs twice"),
        ("a.txt", "1 FOV 6 4 1 1 3 2 4", r":1: lens model fov: omega is 4, not"),
        ("a.txt", KITTI, r'a\.txt: no image size: add a line "S_rect_02: WIDTH HEIGHT"'),
        ("a.txt", KITTI + "S_rect_02: 0 480", r":3: width is 0, not positive"),
        ("a.txt", KITTI + "S_rect_02: 640", r":3: S_rect_02 has 1 numbers, not 2"),
        ("a.txt", "P0: 1 2\nP1: 3", r"no line P2 or P_rect_02 \(it has: P0, P1\)"),
        ("a.txt", "P2: 1 5 3 0 0 1 2 0 0 0 1 0\nS_rect_02: 6 4", r":1: P2 is no projection"),
        ("a.txt", "hello\n", r"camera in no known format \(rosbag: .*; json: .*colmap: "),
    ],
)
def test_bad_files_name_file_and_line(tmp_path, name, text, message):
    with pytest.raises(FileError, match=message):
        read_camera(write(tmp_path, name, text))


def test_format_by_name(tmp_path):
    path = write(tmp_path, "left.dat", ROS)
    assert read_camera(path, "ros").width == 640
    with pytest.raises(
        ValueError, match="none of camera formats: rosbag, realsense, open3d, nerf, json"
    ):
        read_camera(path, "tum")


def test_a_real_kitti_calibration(tmp_path):
    folder = realdata.recording("kitti_tracking") / "0005"
    text = (folder / "calib.txt").read_text()
    camera = read_camera(write(tmp_path, "calib.txt", text + "S_rect_02: 1242 375\n"))
    assert values(camera) == values(read_camera(folder / "camera.json"))
