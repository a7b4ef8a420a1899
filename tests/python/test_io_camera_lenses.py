"""What camera files say of lenses: under which names, of which model, and what is refused."""

import json

import numpy as np
import pytest

from dqslam import Camera, Lens
from dqslam.io import CAMERA_FORMATS, FileError, read_camera
from dqslam.lens import camera_with, lens_of
from test_io_camera_formats import ENDINGS
from test_lens_model import LENSES

PLAIN = {"fx": 500.5, "fy": 501, "cx": 320.25, "cy": 240, "width": 640, "height": 480}
FIVE = [-0.28, 0.07, 2e-4, 2e-5, 0.01]
EIGHT = [0.5, -2.7, 5e-4, -2e-4, 1.5, 0.38, -2.5, 1.4]
EIGHT_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
FISHEYE = [-0.013, 0.02, -0.01, 0.002]
WRITERS = {format_.name: format_ for format_ in CAMERA_FORMATS if format_.write}


def json_camera(tmp_path, values):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(values, indent=1))
    return path


def lens(tmp_path, **changes):
    return lens_of(read_camera(json_camera(tmp_path, PLAIN | changes)))


@pytest.mark.parametrize(
    "key",
    [
        *("dist", "D", "d", "distortion", "distortion_coefficients", "dist_coeffs", "coeffs"),
        *("distCoeffs", "distortion_coeffs", "DistortionCoefficients", "distortionParams"),
    ],
)
@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (FIVE, Lens("plumb_bob", tuple(FIVE))),
        ([FIVE], Lens("plumb_bob", tuple(FIVE))),
        ([[one] for one in FIVE[:4]], Lens("plumb_bob", (*FIVE[:4], 0.0))),
        (EIGHT, Lens("rational", tuple(EIGHT))),
        ([*FIVE, 0, 0, 0], Lens("plumb_bob", tuple(FIVE))),
        ([*EIGHT, 1e-3, 0, 0, 0, 0, 0], Lens("thin_prism", (*EIGHT, 1e-3, 0, 0, 0))),
        ({"k1": 0.1, "p2": 0.2}, Lens("plumb_bob", (0.1, 0, 0, 0.2, 0))),
        ({"data": FIVE, "rows": 1, "cols": 5}, Lens("plumb_bob", tuple(FIVE))),
        (None, Lens("plumb_bob", (0,) * 5)),
    ],
)
def test_lists_under_many_names(tmp_path, key, given, expected):
    assert lens(tmp_path, **{key: given}) == expected


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (dict(zip(EIGHT_NAMES, EIGHT, strict=True)), Lens("rational", tuple(EIGHT))),
        ({"k1": 0.1, "k4": 0, "k5": 0, "k6": 0}, Lens("plumb_bob", (0.1, 0, 0, 0, 0))),
        ({"model": "rational", "k4": 0.1}, Lens("rational", (0, 0, 0, 0, 0, 0.1, 0, 0))),
        (
            {"model": "fisheye", "k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4},
            Lens("equidistant", (0.1, 0.2, 0.3, 0.4)),
        ),
        ({"camera_model": "OPENCV_FISHEYE", "D": FISHEYE}, Lens("equidistant", tuple(FISHEYE))),
        ({"distortion_model": "equidistant", "D": FISHEYE}, Lens("equidistant", tuple(FISHEYE))),
        (
            {"camera_model": "pinhole", "distortion_model": "equi", "dist": [*FISHEYE, 0]},
            Lens("equidistant", tuple(FISHEYE)),
        ),
        ({"is_fisheye": True, "dist": FISHEYE}, Lens("equidistant", tuple(FISHEYE))),
        ({"is_fisheye": False, "dist": FIVE}, Lens("plumb_bob", tuple(FIVE))),
        ({"model": "fov", "coeffs": [0.9]}, Lens("fov", (0.9,))),
        (
            {"distortion": {"model": "fisheye", "coefficients": FISHEYE}},
            Lens("equidistant", tuple(FISHEYE)),
        ),
        (
            {"distortion": {"type": "kannala_brandt", "k1": 0.1, "k2": 0, "k3": 0, "k4": 0}},
            Lens("equidistant", (0.1, 0, 0, 0)),
        ),
        ({"camera": {"intrinsics": {"fx": 500.5, "D": FIVE}}}, Lens("plumb_bob", tuple(FIVE))),
        ({"model": "none", "coeffs": [0] * 5}, Lens("plumb_bob", (0,) * 5)),
        # What is said twice agrees, and a device is no model of a lens.
        ({"k1": 0.1, "dist": [0.1, 0, 0, 0]}, Lens("plumb_bob", (0.1, 0, 0, 0, 0))),
        ({"model": "OAK-D", "type": "RGB", "dist": FIVE}, Lens("plumb_bob", tuple(FIVE))),
        ({"skew": 0, "roi": {"x_offset": 0}, "depth_scale": 1e-3}, Lens("plumb_bob", (0,) * 5)),
    ],
)
def test_models(tmp_path, changes, expected):
    assert lens(tmp_path, **changes) == expected


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dist": [1, 2, 3]}, r":8: dist: is not a list of 4, 5, 8, 12 or 14 numbers"),
        ({"dist": [0] * 12 + [0, 0.1]}, r":8: dist: tau_x and tau_y"),
        ({"dist": FIVE, "D": [0.1, 0, 0, 0, 0]}, r"distortion is given twice: dist, D"),
        ({"k1": 0.1, "k4": 0.1}, r":8: k1 k2 k3 k4 without p1 p2 may be of two models"),
        ({"model": "fisheye", "p1": 0.1}, r"p1 is no coefficient of the model equidistant"),
        ({"model": "equidistant", "D": FIVE}, r":9: D: 5 numbers, not the 4 of"),
        ({"model": "none", "D": FIVE}, r":9: D: the model has no distortion, but"),
        ({"distortion_model": "mystery"}, r":8: distortion_model is mystery, which is not known"),
        ({"camera_model": "double_sphere"}, r":8: camera_model is double_sphere: "),
        ({"model": "fov", "lens_model": "radtan", "D": FIVE}, r"two lens models: lens_model rad"),
        ({"k7": 0.1}, r":8: k7 is not known, but may be a part of the lens"),
        ({"radial_distortion": [0.1, 0.2]}, r":8: radial_distortion is not known, but may"),
        ({"lens": {"a": 1}}, r":8: lens is not known, but may be a part"),
        ({"xi": 1.1}, r":8: xi is not known"),
        ({"binning_x": 2}, r":8: binning_x is not known"),
        ({"crop": [0, 0, 10, 10]}, r":8: crop is not known"),
        ({"skew": 0.1}, r":8: skew is not known"),
        ({"rectified": True, "D": FIVE}, r":8: rectified is true, but there is a lens: D"),
        ({"intrinsics": {"fx": 501.0}}, r":2: fx is given twice, as 500.5 and 501.0"),
        ({"image_width": 641}, r":8: width is 640 by width, but 641 by image_width"),
        ({"fx": 10**400}, r":2: fx is inf, not a finite number below"),
        ({"K": [[1, 0, 320.25], [0, 501, 240], [0, 0, 1]]}, r"fx is 500.5 by fx, but 1 by K"),
        ({"cx": 1e5}, r":4: cx is 100000, far from an image with width 640"),
    ],
)
def test_what_contradicts_or_is_not_known_is_refused(tmp_path, changes, message):
    with pytest.raises(FileError, match=message):
        lens(tmp_path, **changes)


@pytest.mark.parametrize(
    "values",
    [
        {"K": [[500.5, 0, 320.25], [0, 501, 240], [0, 0, 1]], "w": 640, "h": 480},
        {"camera_matrix": [500.5, 0, 320.25, 0, 501, 240, 0, 0, 1], "image_size": [640, 480]},
        {"intrinsics": [500.5, 501, 320.25, 240], "resolution": [640, 480]},
        {"camera": PLAIN},
        {
            "intrinsics": {"fx": 500.5, "fy": 501, "cx": 320.25, "cy": 240},
            **{"width": 640, "height": 480},
        },
        {"f": [500.5, 501], "ppx": 320.25, "ppy": 240, "imageWidth": 640, "imageHeight": 480},
        {
            "cameraMatrix": {
                **{"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d"},
                "data": [500.5, 0, 320.25, 0, 501, 240, 0, 0, 1],
            },
            **{"image_width": 640, "image_height": 480},
        },
    ],
)
def test_intrinsics_under_many_names(tmp_path, values):
    camera = read_camera(json_camera(tmp_path, values))
    assert [getattr(camera, key) for key in PLAIN] == list(PLAIN.values())


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("model", LENSES)
def test_lenses_that_are_written_are_read_back(tmp_path, name, model):
    given = Lens(model, LENSES[model])
    camera = camera_with(Camera(500.1, 501.7, 320.3, 240.1, 640, 480), given)
    path = tmp_path / f"camera{ENDINGS[name]}"
    missing = {
        "ros": {"thin_prism_fisheye"},
        "colmap": {"thin_prism"},
        "kitti-calib": set(LENSES),
    }
    if model in missing.get(name, ()):
        with pytest.raises(FileError, match="no place for (the lens model|lens distortion)"):
            WRITERS[name].write(path, camera)
        assert not path.exists()
        return
    WRITERS[name].write(path, camera)
    again = read_camera(path)
    assert lens_of(again) == given
    np.testing.assert_allclose([again.cx, again.cy], [camera.cx, camera.cy], atol=1e-12)


def test_failures_of_parsers_are_those_of_the_file(tmp_path):
    texts = {
        "a.json": ('{"fx": ' + "1" * 5000 + "}", r"a\.json: not JSON: Exceeds the limit"),
        "a.yaml": ("? [1, 2]\n: 3\n", r"a\.yaml:1: not YAML: found unhashable key"),
        "b.yaml": (
            "width: 2024-13-45\n",
            r"b\.yaml: not YAML: a value .*month must be in 1..12",
        ),
        "c.yaml": ("a: !!python/object:os.system {}\n", r"c\.yaml:1: not YAML: could not"),
        "a.xml": ("<?xml version='1.0'?>\n<opencv_storage>\n<a></b>", r"a\.xml:3: not XML: mism"),
    }
    for name, (text, message) in texts.items():
        (tmp_path / name).write_text(text)
        with pytest.raises(FileError, match=message):
            read_camera(tmp_path / name)
