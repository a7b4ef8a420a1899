"""Camera files of other programs: OpenCV, ORB-SLAM, Kalibr, EuRoC, RealSense, Open3D, ROS, ..."""

import json

import pytest

from dqslam.io import FileError, read_camera
from dqslam.lens import lens_of

NUMBERS = (500.5, 501.0, 320.25, 240.0, 640, 480)
FIVE = [-0.28, 0.07, 2e-4, 2e-5, 0.01]
FISHEYE = [-0.013, 0.02, -0.01, 0.002]

OPENCV = """%YAML:1.0
---
calibration_time: "Tue 03 Feb 2015"
image_width: 640
image_height: 480
flags: 0
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.005e+02, 0., 3.2025e+02, 0., 501.,
       240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.28, 0.07, 2e-04, 2e-05, 0.01 ]
avg_reprojection_error: 2.8e-01
"""
OPENCV_XML = """<?xml version="1.0"?>
<opencv_storage>
<image_width>640</image_width> <image_height>480</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows> <cols>3</cols> <dt>d</dt>
  <data> 500.5 0. 320.25 0. 501.
    240. 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>1</rows> <cols>5</cols> <dt>d</dt>
  <data>-0.28 0.07 2e-4 2e-5 1e-2</data></distortion_coefficients>
</opencv_storage>
"""
ORBSLAM = """%YAML:1.0

# Camera calibration
Camera.type: "PinHole"
Camera.fx: 500.5
Camera.fy: 501.0
Camera.cx: 320.25
Camera.cy: 240.0
Camera.k1: -0.28
Camera.k2: 0.07
Camera.p1: 2e-4
Camera.p2: 0.00002
Camera.k3: 0.01
Camera.width: 640
Camera.height: 480
Camera.newWidth: 320
Camera.fps: 30.0
Camera.bf: 40.0
ThDepth: 40.0
ORBextractor.nFeatures: 1000
"""
ORBSLAM_PAIR = """%YAML:1.0
---
File.version: "1.0"
Camera.type: "KannalaBrandt8"
Camera1.fx: 500.5
Camera1.fy: 501.0
Camera1.cx: 320.25
Camera1.cy: 240.0
Camera1.k1: -0.013
Camera1.k2: 0.02
Camera1.k3: -0.01
Camera1.k4: 0.002
Camera2.fx: 400.0
Camera2.fy: 400.0
Camera2.cx: 320.0
Camera2.cy: 240.0
Camera2.k1: 0.0
Camera.width: 640
Camera.height: 480
Stereo.T_c1_c2: !!opencv-matrix
   rows: 4
   cols: 4
   dt: f
   data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
"""
KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.013, 0.02, -0.01, 0.002]
  distortion_model: equidistant
  intrinsics: [500.5, 501.0, 320.25, 240.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.1
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, 0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: omni
  distortion_coeffs: [0.1, 0.0, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [1.1, 500.5, 501.0, 320.25, 240.0]
  resolution: [640, 480]
"""
EUROC = """# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0
T_BS:
  cols: 4
  rows: 4
  data: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
rate_hz: 20
resolution: [640, 480]
camera_model: pinhole
intrinsics: [500.5, 501.0, 320.25, 240.0] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 2.0e-05]
"""
ROS = """height: 960
width: 1280
distortion_model: plumb_bob
d: [-0.28, 0.07, 0.0002, 2.0e-05, 0.01]
k: [1001.0, 0.0, 660.5, 0.0, 1002.0, 500.0, 0.0, 0.0, 1.0]
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [990.0, 0.0, 660.5, 0.0, 0.0, 990.0, 500.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: {binning}
binning_y: {binning}
roi:
  x_offset: {x}
  y_offset: {y}
  height: {height}
  width: {width}
  do_rectify: false
"""
COLMAP = (
    "1 PINHOLE 640 480 500.5 501 320.75 240.5\n7 OPENCV_FISHEYE 64 48 50 51 32 24 {} {} {} {}\n"
)


def ros(binning=0, x=0, y=0, width=0, height=0):
    return ROS.format(binning=binning, x=x, y=y, width=width, height=height)


def realsense(**changes):
    names = ("fx", "fy", "ppx", "ppy", "width", "height")
    values = dict(zip(names, NUMBERS, strict=True))
    return values | {"model": "Brown Conrady", "coeffs": FIVE} | changes


def open3d(*numbers):
    fx, fy, cx, cy, width, height = numbers
    matrix = [fx, 0, 0, 0, fy, 0, cx, cy, 1]
    return {"width": width, "height": height, "intrinsic_matrix": matrix}


def read(tmp_path, name, text, **options):
    path = tmp_path / name
    path.write_text(text if isinstance(text, str) else json.dumps(text, indent=1))
    return read_camera(path, **options)


def numbers(camera):
    return (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)


ONE_VIEW = {"class_name": "PinholeCameraParameters", "extrinsic": [1] * 16}
NERF = {
    **{"fl_x": 500.5, "fl_y": 501, "cx": 320.75, "cy": 240.5, "w": 640, "h": 480},
    **{"camera_model": "OPENCV", "k1": -0.28, "k2": 0.07, "p1": 2e-4, "p2": 2e-5},
    **{"camera_angle_x": 1.1, "frames": [{"file_path": "a.png"}]},
}


@pytest.mark.parametrize(
    ("name", "text", "lens"),
    [
        ("c.yaml", OPENCV, FIVE),
        ("c.yml", OPENCV.replace("---\n", ""), FIVE),
        ("c.yaml", OPENCV.replace(" !!opencv-matrix", ""), FIVE),
        ("c.yaml", OPENCV.removeprefix("%YAML:1.0\n---\n"), FIVE),
        ("c.xml", OPENCV_XML, FIVE),
        ("tum1.yaml", ORBSLAM, FIVE),
        ("sensor.yaml", EUROC, [*FIVE[:4], 0]),
        ("rs.json", realsense(), FIVE),
        ("rs.json", realsense(model="Modified Brown Conrady", coeffs=[0.1, 0, 0, 0, 0]), [0.1]),
        ("rs.json", realsense(model="Inverse Brown Conrady", coeffs=[0] * 5), []),
        ("rs.json", {"color": {"intrinsics": realsense()}, "serial": 7}, FIVE),
        ("o3d.json", open3d(*NUMBERS), []),
        ("o3d.json", {"parameters": [ONE_VIEW | {"intrinsic": open3d(*NUMBERS)}] * 2}, []),
        ("transforms.json", NERF, [*FIVE[:4], 0]),
        ("info.yaml", ros(binning=2, x=20, y=20, width=1280 - 20, height=960 - 20), FIVE),
        ("cameras.txt", COLMAP.splitlines()[0] + "\n", []),
    ],
)
def test_the_same_camera_of_all_programs(tmp_path, name, text, lens):
    camera = read(tmp_path, name, text)
    size = (630, 470) if name == "info.yaml" else (640, 480)
    assert numbers(camera) == (*NUMBERS[:4], *size)
    assert lens_of(camera).parameters == (*lens, *[0.0] * (5 - len(lens)))


@pytest.mark.parametrize(
    ("name", "text", "camera_id", "parameters"),
    [
        ("kalibr.yaml", KALIBR, "cam0", FISHEYE),
        ("orb.yaml", ORBSLAM_PAIR, "Camera1", FISHEYE),
        ("rs.json", realsense(model="Kannala Brandt4", coeffs=[*FISHEYE, 0]), "0", FISHEYE),
        (
            "c.yaml",
            OPENCV.replace("fisheye_model: 0", "fisheye_model: 1")
            .replace("rows: 5", "rows: 4")
            .replace("-0.28, 0.07, 2e-04, 2e-05, 0.01", "-0.013, 0.02, -0.01, 0.002"),
            "1",
            FISHEYE,
        ),
    ],
)
def test_fisheyes(tmp_path, name, text, camera_id, parameters):
    camera = read(tmp_path, name, text, camera_id=camera_id)
    assert lens_of(camera).model == "equidistant"
    assert list(lens_of(camera).parameters) == parameters
    assert numbers(camera) == NUMBERS


def test_f_theta_is_fov(tmp_path):
    camera = read(tmp_path, "rs.json", realsense(model="F-Theta", coeffs=[0.9, 0, 0, 0, 0]))
    assert (lens_of(camera).model, lens_of(camera).parameters) == ("fov", (0.9,))


PAIR = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n" + "".join(
    f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {data}\n"
    for name, rows, columns, data in (
        ("M1", 3, 3, [500.5, 0, 320.25, 0, 501, 240, 0, 0, 1]),
        ("D1", 1, 5, FIVE),
        ("M2", 3, 3, [400, 0, 320, 0, 400, 240, 0, 0, 1]),
        ("D2", 1, 5, [0] * 5),
        ("R1", 3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1]),
    )
)


@pytest.mark.parametrize(
    ("name", "text", "camera_id", "ids"),
    [
        ("kalibr.yaml", KALIBR, "cam0", "cam0, cam1"),
        ("orb.yaml", ORBSLAM_PAIR, "Camera1", "Camera1, Camera2"),
        ("cameras.txt", COLMAP.format(*FISHEYE), "1", "1, 7"),
        ("rs.json", {"color": realsense(), "depth": realsense(fx=300)}, "color", "color, depth"),
        (
            "o3d.json",
            {"parameters": [{"intrinsic": open3d(*NUMBERS)}, {"intrinsic": open3d(*[9] * 6)}]},
            "0",
            "0, 1",
        ),
        ("stereo.yml", PAIR, "1", "1, 2"),
    ],
)
def test_of_several_cameras_one_is_chosen_by_its_id(tmp_path, name, text, camera_id, ids):
    assert numbers(read(tmp_path, name, text, camera_id=camera_id)) == NUMBERS
    with pytest.raises(FileError, match=rf"holds 2 cameras, {ids}: choose one with --camera-id"):
        read(tmp_path, name, text)
    with pytest.raises(FileError, match=rf"has no camera 99 \(it has: {ids}\)"):
        read(tmp_path, name, text, camera_id="99")


def test_kitti_has_the_left_color_camera_unless_another_is_chosen(tmp_path):
    rows = "".join(f"P{i}: {500 + i} 0 320 0 0 500 240 0 0 0 1 0\n" for i in range(4))
    sizes = "S_rect_02: 640 480\nS_rect_03: 641 480\n"
    assert read(tmp_path, "calib.txt", rows + sizes).fx == 502
    third = read(tmp_path, "calib.txt", rows + sizes, camera_id="3")
    assert (third.fx, third.width) == (503, 641)
    with pytest.raises(FileError, match=r"no line P9 or P_rect_09 \(it has: P0"):
        read(tmp_path, "calib.txt", rows + sizes, camera_id="9")


@pytest.mark.parametrize(
    ("binning", "region", "expected"),
    [
        (0, {}, (1001, 1002, 660.5, 500, 1280, 960)),
        (1, {}, (1001, 1002, 660.5, 500, 1280, 960)),
        (2, {}, (500.5, 501, 330.25, 250, 640, 480)),
        (1, {"x": 100, "y": 50, "width": 640, "height": 480}, (1001, 1002, 560.5, 450, 640, 480)),
        (
            4,
            {"x": 100, "y": 60, "width": 640, "height": 480},
            (250.25, 250.5, 140.125, 110, 160, 120),
        ),
        (2, {"x": 100}, (500.5, 501, 280.25, 250, 590, 480)),
    ],
)
def test_region_and_binning_as_image_geometry_has_them(tmp_path, binning, region, expected):
    # fx / binning, (cx - x_offset) / binning, width / binning; 0 is 1, and all of the sensor.
    assert numbers(read(tmp_path, "info.yaml", ros(binning, **region))) == expected


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("k.yaml", KALIBR.split("cam1")[1].replace(":", "cam1:", 1), r"camera_model is omni; only"),
        (
            "o.yaml",
            ORBSLAM.replace("Camera.width: 640\n", ""),
            r"no image size: add lines like Cam",
        ),
        (
            "r.json",
            realsense(model="Inverse Brown Conrady"),
            r"model is Inverse Brown Conrady: the",
        ),
        ("r.json", realsense(model="Modified Brown Conrady"), r"whose tangential coefficients are"),
        ("i.yaml", ros(x=700, width=640, height=480), r":10: roi ends at 1340, beyond width 1280"),
        ("i.yaml", ros(binning=-2), r":8: binning_x is -2, not a whole number from 0"),
        ("s.yaml", EUROC.replace("radial-tangential", "ds"), r":12: distortion_model is ds: the"),
        ("c.yaml", OPENCV.replace("rows: 5", "rows: 4"), r":14: distortion_coefficients has 5 num"),
    ],
)
def test_what_is_refused(tmp_path, name, text, message):
    with pytest.raises(FileError, match=message):
        read(tmp_path, name, text)


def test_an_id_is_of_files_with_several_cameras(tmp_path):
    with pytest.raises(ValueError, match="camera 1: a file of format euroc-sensor has one camera"):
        read(tmp_path, "sensor.yaml", EUROC, camera_id="1")
