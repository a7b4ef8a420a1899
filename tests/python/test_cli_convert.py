import gzip
import json

import numpy as np
import pytest

from dqslam.cli import main
from dqslam.io import (
    ConvertContext,
    FileError,
    ReadOptions,
    convert,
    frame_rate,
    read_camera,
    read_detections,
    read_mount,
    read_trajectory,
)
from dqslam.lens import Lens

CAMERA = {"fx": 500.5, "fy": 501, "cx": 320.25, "cy": 240, "width": 640, "height": 480}
BOXES = """frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id
0,100.5,449.24,314.81,501.57,377.39,0.9841,1,cup,4
7,100.75,0.1,0.2,639,479.5,1,0,"jar, blue",-1
"""
PATH = """100.5 1.000000000 2.000000000 3.000000000 0.000000000 0.000000000 0.600000000 0.800000000
100.75 4.000000000 5.000000000 6.000000000 1.000000000 0.000000000 0.000000000 0.000000000
"""
MOT = "1,-1,11,21,30,40,0.5,-1,-1,-1\n3,2,11,21,30,40,1,-1,-1,-1\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "camera.json").write_text(json.dumps(CAMERA))
    (tmp_path / "boxes.csv").write_text(BOXES)
    (tmp_path / "traj.txt").write_text(PATH)
    (tmp_path / "mot.txt").write_text(MOT)
    return tmp_path


@pytest.fixture
def call(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)

    def run(line):
        code = main(["convert", *line.split()])
        shown = capsys.readouterr()
        assert (code == 0) == (shown.err == "")
        return shown.out if code == 0 else shown.err

    return run


@pytest.mark.parametrize(
    ("out", "option"),
    [
        ("camera.toml", ""),
        ("left.yaml", ""),
        ("cameras.txt", "--to colmap"),
        ("c.txt", "--to kitti-calib"),
    ],
)
def test_cameras_there_and_back(folder, call, out, option):
    shown = call(f"camera.json {out} {option}")
    assert shown.startswith(f"wrote {out}: camera of 640 x 480 px as ")
    call(f"{out} back.json")
    back = read_camera(folder / "back.json")
    assert {name: getattr(back, name) for name in CAMERA} == CAMERA


@pytest.mark.parametrize(
    ("there", "back"),
    [
        ("boxes.json", ""),
        ("labels --to yolo --camera camera.json", "--camera camera.json"),
        ("boxes.txt --to mot", "--frame-times boxes.frames.csv --classes names.txt"),
    ],
)
def test_boxes_there_and_back_to_the_digit(folder, call, there, back):
    (folder / "names.txt").write_text("jar, blue\ncup\n")
    shown = call(f"boxes.csv {there}")
    assert f"wrote {there.split()[0]}: 2 boxes as " in shown
    call(f"{there.split()[0]} back.csv {back}")
    assert (folder / "back.csv").read_text() == BOXES


@pytest.mark.parametrize(
    ("there", "back"),
    [("data.csv", ""), ("poses.txt --to kitti", "--frame-times poses.frames.csv")],
)
def test_trajectories_there_and_back_to_the_digit(folder, call, there, back):
    call(f"traj.txt {there}")
    call(f"{there.split()[0]} back.txt --to tum {back}")
    assert (folder / "back.txt").read_text() == PATH


def test_what_is_lost_is_said_and_times_are_kept_beside(folder, call):
    lines = call("boxes.csv boxes.txt").splitlines()
    assert lines == [
        "wrote boxes.txt: 2 boxes as mot; no place for times and class names",
        "wrote boxes.frames.csv: times of its frames, for --frame-times",
    ]
    assert (folder / "boxes.frames.csv").read_text() == "frame,timestamp\n0,100.5\n7,100.75\n"


def test_formats_without_times_need_none_between_them(folder, call):
    call("mot.txt boxes.json")
    entries = json.loads((folder / "boxes.json").read_text())
    assert [entry["image_id"] for entry in entries] == [0, 2]
    assert "timestamp" not in entries[0]
    call("mot.txt labels --camera camera.json")
    names = sorted(path.name for path in (folder / "labels").iterdir())
    assert names == ["000000.txt", "000002.txt", "classes.txt"]
    call("boxes.json again.txt")
    rows = np.loadtxt(folder / "again.txt", delimiter=",")
    np.testing.assert_array_equal(rows[:, :7], np.loadtxt(folder / "mot.txt", delimiter=",")[:, :7])
    assert not (folder / "again.frames.csv").exists()


def test_frame_rate(folder, call):
    call("mot.txt out.csv --frame-rate 10")
    assert read_detections(folder / "out.csv").timestamp.tolist() == [0, 0.2]


def test_nothing_is_cut(folder, call):
    (folder / "mot.txt").write_text("1,-1,-99,21,1030,40,0.5,-1,-1,-1\n")
    call("mot.txt out.csv --frame-rate 10 --camera camera.json")
    np.testing.assert_array_equal(read_detections(folder / "out.csv").box, [[-100, 20, 930, 60]])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("mount.txt", "0.1 0 0 0 0 0 1\n"),
        ("mount.txt", "[[1, 0, 0, 0.1],\n [0, 1, 0, 0],\n [0, 0, 1, 0]]\n"),
        ("sensor.yaml", "T_BS:\n  rows: 4\n  data: [1, 0, 0, 0.1, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n"),
    ],
)
def test_the_camera_in_the_body(folder, call, name, text):
    (folder / name).write_text(text)
    call(f"traj.txt out.txt --camera-in-body {name}")
    # A turn of 0.6, 0.8 about z takes x to (0.28, 0.96).
    poses = read_trajectory(folder / "out.txt").world_from_camera
    np.testing.assert_allclose(poses[0, :3], [1.028, 2.096, 3], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3", "m.txt: holds 3 numbers, not 7, 12 or 16"),
        ("0 0 0 0 0 0 2", "m.txt: quaternion has length 2, not 1"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0", "m.txt: is no rotation and translation"),
        ("0 0 0\n0 0 x 1", "m.txt:2: a number is 'x', not a number"),
    ],
)
def test_bad_mounts(tmp_path, text, message):
    (tmp_path / "m.txt").write_text(text)
    with pytest.raises(FileError, match=message):
        read_mount(tmp_path / "m.txt")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("none.csv out.json", "none.csv: no such file"),
        (
            "boxes.csv out.dat",
            "out.dat: its ending is of no format of detections",
        ),
        ("boxes.csv out.json --to tum", "boxes.csv: it is of detections, which tum is not"),
        ("boxes.csv out.json --to bvh", "--to: format 'bvh' is none of rosbag, realsense"),
        ("boxes.csv out.json --format bvh", "--format: format 'bvh' is none of rosbag"),
        ("boxes.csv out --to rosbag", "bags are read, not written"),
        ("boxes.csv out --to yolo", "out: yolo's boxes are shares of the image"),
        ("boxes.csv boxes.csv", "boxes.csv: the file would be written over itself"),
        (
            "mot.txt out.csv",
            "mot has no times: give them with --frame-times",
        ),
        ("mot.txt out.csv --frame-rate 0", "frame rate is 0 Hz, not positive"),
        ("mot.txt out.csv --frame-rate 1 --frame-times x", "both give the times of frames"),
        ("bad.csv out.json", "bad.csv:3: x1 is not a finite number below"),
        ("empty.csv out.json", "empty.csv: is empty"),
        ("notes.md out.json", "notes.md: is in no known format; name it with --format"),
        ("void out.json", "void: is in no known format"),
        ("camera.json out.txt --to tum", "camera.json: it is of camera, which tum is not"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(folder, call, line, message):
    (folder / "bad.csv").write_text(BOXES.replace("7,100.75,0.1", "7,100.75,nan"))
    (folder / "empty.csv").write_text("")
    (folder / "notes.md").write_text("# notes\nhello\n")
    (folder / "void").mkdir()
    before = sorted(folder.rglob("*"))
    shown = call(line)
    assert message in shown
    assert shown.count("\n") == 1
    assert sorted(folder.rglob("*")) == before


def test_a_bag_becomes_a_folder(folder, call):
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    from test_io_rosbag import CUP, ODOMETRY, Bag

    bag = Bag()
    path = [bag.odometry(*row) for row in ODOMETRY]
    topics = {"/odom": path, "/boxes": [bag.boxes(100.25, CUP)], "/info": [bag.camera()]}
    bag.write(folder / "bag", topics)
    assert call("bag out").splitlines() == [
        "wrote out/camera.json: camera of 640 x 480 px as json",
        "wrote out/trajectory.txt: 2 poses as tum",
        "wrote out/boxes.csv: 1 boxes as csv",
    ]
    assert sorted(file.name for file in (folder / "out").iterdir()) == [
        "boxes.csv",
        "camera.json",
        "trajectory.txt",
    ]
    shares = []
    convert(folder / "bag", folder / "told", progress=shares.append)
    # The camera; two messages of odometry, and their file; one of boxes, and its file.
    np.testing.assert_allclose(shares, [1 / 3, 1 / 2, 2 / 3, 2 / 3, 1.0, 1.0])
    assert "no place" not in call("bag alone.txt --to tum")
    assert (folder / "alone.txt").read_text() == (folder / "out/trajectory.txt").read_text()
    assert "out: is there already, and not empty" in call("bag out")
    bag.write(folder / "two", {"/a": path, "/b": path[1:], "/boxes": topics["/boxes"]})
    assert "has topics /a, /b: name one with --topic" in call("two twice")
    assert not (folder / "twice").exists()
    assert "1 poses as tum" in call("two twice --topic /b")
    assert "no topic /c that can be read (it has: /a, /b, /boxes)" in call("two third --topic /c")


def test_a_folder_tells_how_many_of_its_files_are_read(folder):
    (folder / "yolo").mkdir()
    for frame in range(4):
        (folder / "yolo" / f"{frame}.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    shares = []
    context = ConvertContext(reading=ReadOptions(image_size=(640, 480), frames=frame_rate(10.0)))
    convert(folder / "yolo", folder / "o.csv", context=context, progress=shares.append)
    assert shares == [0.25, 0.5, 0.75, 1.0]
    shares.clear()
    convert(folder / "o.csv", folder / "o.json", progress=shares.append)
    assert shares == []  # of one file it is not known


def test_quiet_and_json(folder, call):
    assert call("camera.json c.toml --quiet") == ""
    (written,) = json.loads(call("boxes.csv boxes.json --json"))["written"]
    assert written == {"path": "boxes.json", "what": "2 boxes as coco", "loses": []}


def test_one_of_several_cameras_is_converted_by_its_id(tmp_path, capsys):
    rows = "1 PINHOLE 640 480 500 500 320 240\n2 OPENCV_FISHEYE 64 48 50 51 32 24 0.1 0 0 0\n"
    (tmp_path / "cameras.txt").write_text(rows)
    source, out = str(tmp_path / "cameras.txt"), str(tmp_path / "camera.json")
    assert main(["convert", source, out, "--camera-id", "2"]) == 0
    assert read_camera(out).lens == Lens("equidistant", (0.1, 0.0, 0.0, 0.0))
    assert main(["convert", source, out]) == 2
    assert "holds 2 cameras, 1, 2: choose one with --camera-id" in capsys.readouterr().err
    assert main(["convert", source, out, "--to", "kalibr"]) == 2
    assert "--to: kalibr is read, not written" in capsys.readouterr().err


def test_numbers_are_written_as_they_are_meant(folder, call):
    """Millimeters and quaternions w first; corner and size in a square image with bars."""
    rows = [line.split() for line in PATH.splitlines()]
    w_first = [
        [row[0], *(str(1000 * float(x)) for x in row[1:4]), row[7], *row[4:7]] for row in rows
    ]
    (folder / "mm.txt").write_text("".join(" ".join(row) + "\n" for row in w_first))
    call("mm.txt m.txt --to tum --poses w_first --length-scale 0.001")
    np.testing.assert_allclose(read_trajectory("m.txt")[1], read_trajectory("traj.txt")[1])
    (folder / "square.csv").write_text("frame,timestamp,x1,y1,x2,y2\n0,1,99.5,179.5,100,120\n")
    options = "--box-form xywh --box-image 640x640 --letterbox --time-offset -0.5"
    call(f"square.csv b.csv --camera camera.json {options}")
    table = read_detections("b.csv")
    np.testing.assert_allclose(table.box, [[99.5, 99.5, 199.5, 219.5]])
    assert table.timestamp.tolist() == [0.5]
    assert "boxes of another image need the size of the camera's" in call(
        f"square.csv c.csv {options}"
    )


def test_a_target_of_gzip_is_packed(folder, call):
    assert call("boxes.csv packed.csv.gz") == "wrote packed.csv.gz: 2 boxes as csv\n"
    assert gzip.decompress((folder / "packed.csv.gz").read_bytes()).decode() == BOXES
    assert call("packed.csv.gz again.csv") == "wrote again.csv: 2 boxes as csv\n"
    assert (folder / "again.csv").read_text() == BOXES
    call("boxes.csv mot.txt.gz --to mot")
    assert (folder / "mot.frames.csv").is_file()
    assert "p.gz: its ending is of no format of detections" in call("boxes.csv p.gz")
    assert "a folder of files" in call("boxes.csv b.gz --to yolo --camera camera.json")


def test_a_target_is_standard_output(folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    assert main(["convert", "boxes.csv", "-", "--to", "csv"]) == 0
    assert capfd.readouterr() == (BOXES, "")
    # There is no place for the times beside it.
    assert main(["convert", "boxes.csv", "-", "--to", "mot"]) == 0
    assert capfd.readouterr().out.startswith("1,4,450.24,315.81,")
    assert sorted(file.name for file in folder.iterdir()) == [
        "boxes.csv",
        "camera.json",
        "mot.txt",
        "traj.txt",
    ]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("", "-: standard output has no ending: name a format with --to"),
        ("--to yolo --camera camera.json", "-: yolo is a folder, which standard output cannot be"),
        ("--to csv --json", "-: standard output has what is converted"),
    ],
)
def test_what_standard_output_cannot_be(call, options, message):
    assert message in call(f"boxes.csv - {options}")
