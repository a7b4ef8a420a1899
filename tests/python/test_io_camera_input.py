"""Camera files that are packed, come from standard input, or would end their parser."""

import gzip
import io
import json

import pytest

from dqslam import _input
from dqslam.io import (
    ConvertContext,
    FileError,
    ReadOptions,
    convert,
    load_recording,
    read_camera,
    split_formats,
)
from test_io_camera_programs import (
    COLMAP,
    EUROC,
    KALIBR,
    NUMBERS,
    OPENCV,
    OPENCV_XML,
    ORBSLAM,
    numbers,
    open3d,
    realsense,
    ros,
)

KEYS = ("fx", "fy", "cx", "cy", "width", "height")
TOML = "".join(f"{key} = {value}\n" for key, value in zip(KEYS, NUMBERS, strict=True))
KITTI = "P2: 500.5 0 320.25 0 0 501 240 0 0 0 1 0\nS_rect_02: 640 480\n"
INFO = ros().replace("1001.0, 0.0, 660.5, 0.0, 1002.0, 500.0", "500.5, 0, 320.25, 0, 501, 240")
INFO = INFO.replace("height: 960\nwidth: 1280", "height: 480\nwidth: 640").split("binning_x")[0]
FILES = {
    "colmap.txt": COLMAP.splitlines()[0] + "\n",
    "euroc.yaml": EUROC,
    "kalibr.yaml": KALIBR.split("cam1:")[0],
    "kitti.txt": KITTI,
    "opencv.yml": OPENCV,
    "opencv.xml": OPENCV_XML,
    "orbslam.yaml": ORBSLAM,
    "open3d.json": json.dumps(open3d(*NUMBERS)),
    "realsense.json": json.dumps(realsense()),
    "ros.yaml": INFO,
    "table.toml": TOML,
}


@pytest.fixture
def stdin(monkeypatch):
    def give(text):
        _input._stdin.cache_clear()
        stream = io.TextIOWrapper(io.BytesIO(text.encode()))
        monkeypatch.setattr("sys.stdin", stream)

    yield give
    _input._stdin.cache_clear()


@pytest.mark.parametrize("name", FILES)
def test_a_packed_camera_and_one_from_standard_input_are_the_same(tmp_path, stdin, name):
    path = tmp_path / f"{name}.gz"
    path.write_bytes(gzip.compress(FILES[name].encode()))
    assert numbers(read_camera(path)) == NUMBERS
    stdin(FILES[name])
    assert numbers(read_camera("-")) == NUMBERS


@pytest.mark.parametrize("name", ["kalibr.yaml", "opencv.xml", "realsense.json", "table.toml"])
def test_a_camera_from_standard_input_is_converted(tmp_path, stdin, name):
    stdin(FILES[name])
    convert("-", tmp_path / "camera.json")
    assert numbers(read_camera(tmp_path / "camera.json")) == NUMBERS


def test_another_camera_of_kitti_has_the_size_that_is_given(tmp_path):
    path = tmp_path / "calib.txt"
    path.write_text("".join(f"P{i}: {500 + i} 0 320 0 0 500 240 0 0 0 1 0\n" for i in range(4)))
    with pytest.raises(FileError, match='add a line "S_rect_03: WIDTH HEIGHT", or say --image'):
        read_camera(path, camera_id="3")
    camera = read_camera(path, camera_id="3", image_size=(640, 480))
    assert numbers(camera) == (503, 500, 320, 240, 640, 480)
    context = ConvertContext(reading=ReadOptions(image_size=(640, 480), camera_id="3"))
    convert(path, tmp_path / "camera.json", context=context)
    assert numbers(read_camera(tmp_path / "camera.json")) == numbers(camera)


def test_a_recording_has_the_camera_of_an_id(files, tmp_path):
    own = read_camera(files[0])
    chain = "".join(
        f"cam{i}:\n  camera_model: pinhole\n  distortion_model: none\n"
        f"  intrinsics: [{own.fx + i}, {own.fy}, {own.cx}, {own.cy}]\n"
        f"  resolution: [{own.width}, {own.height}]\n"
        for i in range(2)
    )
    path = tmp_path / "chain.yaml"
    path.write_text(chain)
    recording, _ = load_recording(path, *files[1:], reading=ReadOptions(camera_id="cam1"))
    assert recording.camera.fx == own.fx + 1
    with pytest.raises(FileError, match=r"chain\.yaml: holds 2 cameras, cam0, cam1: choose one"):
        load_recording(path, *files[1:])
    formats = split_formats(["kalibr"])
    recording, _ = load_recording(
        path, *files[1:], reading=ReadOptions(formats=formats, camera_id="cam0")
    )
    assert recording.camera.fx == own.fx


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (
            "a.xml",
            '<!DOCTYPE z [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;">]>\n'
            "<opencv_storage><camera_matrix>&b;</camera_matrix></opencv_storage>",
            r"a\.xml: has a document type: not read",
        ),
        ("a.yml", "%YAML:1.0\n---\na: &x [1]\nb: *x\n", r"a\.yml:4: has an alias, \*x"),
        ("a.yml", "%YAML:1.0\n---\n---\na: &x [1]\nb: *x\n", r"a\.yml:5: has an alias, \*x"),
        ("a.yaml", "cam0: " + "[" * 5000, r"a\.yaml:1: nested too deeply"),
        ("a.xml", "<opencv_storage><a>", r"a\.xml:1: not XML"),
        ("a.json", '{"ppx": 1e999, "ppy": 1, "fx": 1, "fy": 1}', r"a\.json:1: ppx is inf"),
    ],
)
def test_what_would_end_a_parser_is_an_error_of_the_file(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(FileError, match=message):
        read_camera(path)


def test_a_key_that_is_there_twice_has_one_value(tmp_path):
    text = json.dumps(dict(zip(KEYS, NUMBERS, strict=True)))
    path = tmp_path / "camera.json"
    path.write_text('{"fx": 500.5, ' + text[1:])
    assert read_camera(path).fx == 500.5
    path.write_text('{"fx": 600, ' + text[1:])
    with pytest.raises(FileError, match="camera.json: fx is there twice, with different values"):
        read_camera(path)
