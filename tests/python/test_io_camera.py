import json

import numpy as np
import pytest

from dqslam.io import FileError, read_camera

PLAIN = {"fx": 500.5, "fy": 501, "cx": 320.25, "cy": 240, "width": 640, "height": 480}
LENS = {"k1": 0.1, "k2": -0.2, "p1": 0.003, "p2": -0.004, "k3": 0.05}


def write(path, text):
    path.write_text(text)
    return path


def json_camera(tmp_path, **changes):
    return write(tmp_path / "camera.json", json.dumps(PLAIN | changes, indent=1))


def test_json_and_toml_read_alike(tmp_path):
    toml = "\n".join(f"{key} = {value}" for key, value in (PLAIN | LENS).items())
    for path in (json_camera(tmp_path, **LENS), write(tmp_path / "camera.toml", toml)):
        camera = read_camera(path)
        assert (camera.fx, camera.fy, camera.cx, camera.cy) == (500.5, 501.0, 320.25, 240.0)
        assert (camera.width, camera.height) == (640, 480)
        np.testing.assert_array_equal(camera.distortion, list(LENS.values()))


@pytest.mark.parametrize(
    ("changes", "distortion"),
    [
        ({}, [0, 0, 0, 0, 0]),
        ({"p1": 0.003}, [0, 0, 0.003, 0, 0]),
        ({"distortion": [0.1, -0.2, 0.003, -0.004]}, [0.1, -0.2, 0.003, -0.004, 0]),
        ({"distortion": list(LENS.values())}, list(LENS.values())),
        ({"dist_k1k2p1p2k3": list(LENS.values())}, list(LENS.values())),
        ({"distortion": {"k3": 0.05, "k1": 0.1}}, [0.1, 0, 0, 0, 0.05]),
        ({"name": "left", "model": "pinhole_radtan", "source": ["a", {}]}, [0, 0, 0, 0, 0]),
    ],
)
def test_distortion_in_all_its_spellings(tmp_path, changes, distortion):
    np.testing.assert_array_equal(
        read_camera(json_camera(tmp_path, **changes)).distortion, distortion
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fx": 0}, r"camera\.json:2: fx is 0, not positive"),
        ({"fy": -501.0}, r":3: fy is -501, not positive"),
        ({"width": -640}, r":6: width is -640, not positive"),
        ({"height": 480.5}, r":7: height is 480.5, not a whole number"),
        ({"width": 10**12}, r":6: width is 1e\+12, not a whole number of pixels up to 1e6"),
        ({"cx": float("nan")}, r":4: cx is nan, not a finite number below"),
        ({"cy": float("-inf")}, r":5: cy is -inf, not a finite number below"),
        ({"fx": "500"}, r":2: fx is '500', not a number"),
        ({"fx": None}, r":2: fx is None, not a number"),
        ({"fx": True}, r":2: fx is True, not a number"),
        ({"k1": float("nan")}, r":8: k1 is nan, not a finite number below"),
        ({"distortion": [0.1, 0.2]}, r":8: distortion: is not a list of 4, 5, 8, 12 or 14"),
        ({"distortion": "none"}, r":8: distortion is no list of numbers"),
        ({"distortion": [0, 0, 0, "a"]}, r":8: distortion is 'a', not a number"),
        ({"distortion": {"k7": 0.1}}, r":9: distortion knows no k7, only k1 k2 p1 p2 k3"),
        ({"k1": 0.1, "distortion": [0] * 5}, r"distortion is given twice: distortion, k1"),
        ({"model": "omni"}, r":8: model is omni: .* only pinhole, plumb_bob, rational"),
        ({"model": "fisheye"}, r"the lens model is equidistant, but it has no coefficients"),
    ],
)
def test_bad_values_name_line_and_key(tmp_path, changes, message):
    with pytest.raises(FileError, match=message):
        read_camera(json_camera(tmp_path, **changes))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.json", "", r"a\.json: is empty"),
        ("a.json", " \n\n", r"a\.json: is empty"),
        ("a.json", '{"fx": 1,\n "fy": }', r"a\.json:2: not JSON"),
        ("a.json", "[1, 2]", r"a\.json: holds no table"),
        ("a.json", "[" * 100_000, r"a\.json: nested too deeply"),
        ("a.json", '{"fx": 1, "fy": 1, "cx": 1, "cy": 1}', r"missing width, height \(it has: fx"),
        ("a.toml", "fx = 1\nfy = = 2\n", r"a\.toml:2: not TOML"),
        ("a.toml", "fx = nan\nfy=1\ncx=1\ncy=1\nwidth=1\nheight=1", r"a\.toml:1: fx is nan"),
        ("a.toml", "fx = 1\n", r"missing fy, cx, cy, width, height"),
    ],
)
def test_broken_files(tmp_path, name, text, message):
    with pytest.raises(FileError, match=message):
        read_camera(write(tmp_path / name, text))


def test_missing_and_unreadable_files(tmp_path):
    with pytest.raises(FileError, match=r"none\.json: no such file"):
        read_camera(tmp_path / "none.json")
    with pytest.raises(FileError, match=r"cannot be read: Is a directory"):
        read_camera(tmp_path)
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00{")
    with pytest.raises(FileError, match="not a text file"):
        read_camera(tmp_path / "binary.json")
