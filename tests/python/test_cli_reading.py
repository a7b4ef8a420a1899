"""How files are read, from the command line: bad records, first frame, mount, size, input."""

import gzip
import json

import numpy as np
import pytest

from console import assert_one_line_of_error
from dqslam.cli import main


def edit(path, change):
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


def call(command, files, *more):
    names = ("--camera", "--odometry", "--detections")
    arguments = [str(word) for pair in zip(names, files, strict=True) for word in pair]
    return main([command, *arguments, *more])


def spoil(lines, count=1):
    """Give boxes no width; the first is that of line 11."""
    spoiled = [line.split(",") for line in lines[10 : 10 + count]]
    for cells in spoiled:
        cells[4] = cells[2]
    return [*lines[:10], *(",".join(cells) for cells in spoiled), *lines[10 + count :]]


def test_a_bad_box_is_said_and_in_the_report(files, tmp_path, capsys):
    edit(files[2], spoil)
    out = tmp_path / "out"
    assert call("run", files, "--out", str(out), "--ids", "class_id", "--quiet") == 0
    assert "1 of 160 boxes left out" in capsys.readouterr().err
    report = json.loads((out / "report.json").read_text())
    (left,) = report["input_notes"]["left_out"]
    assert (left["what"], left["count"], left["of"]) == ("boxes", 1, 160)
    assert "boxes.csv:11: empty box" in left["first"]
    assert report["warnings"][0].endswith(left["first"])
    assert call("run", files, "--out", str(out), "--ids", "class_id", "--strict") == 2
    assert_one_line_of_error(capsys, "boxes.csv:11: empty box")


@pytest.mark.parametrize(
    ("order", "message"),
    [
        ((0, 2, 1), "boxes.csv: looks like boxes, not like a trajectory: are two files exchanged?"),
        ((0, 0, 2), "camera.json: looks like a camera, not like a trajectory"),
        ((1, 1, 2), "traj.txt: looks like a trajectory, not like a camera"),
        ((0, 1, 1), "traj.txt: looks like a trajectory, not like boxes"),
    ],
)
@pytest.mark.parametrize("more", [(), ("--frame-rate", "10")])
def test_files_that_are_exchanged_are_named(files, tmp_path, capsys, order, message, more):
    exchanged = [files[index] for index in order]
    assert call("inspect", exchanged, *more) == 2
    assert_one_line_of_error(capsys, message)
    assert call("run", exchanged, "--out", str(tmp_path / "out"), *more) == 2
    assert_one_line_of_error(capsys, message)


def test_inspect_says_it_too(files, capsys):
    assert call("inspect", files, "--strict") == 0
    edit(files[2], spoil)
    capsys.readouterr()
    assert call("inspect", files, "--json") == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["input_notes"]["left_out"][0]["count"] == 1
    assert "1 of 160 boxes left out" in printed.err
    assert call("inspect", files, "--strict") == 3
    edit(files[2], lambda lines: spoil(lines, 10))
    assert call("inspect", files, "--max-bad", "0.1", "--json") == 0
    capsys.readouterr()
    assert call("inspect", files, "--json") == 0
    assert "will be refused" in json.loads(capsys.readouterr().out)["warnings"][0]["message"]


def test_packed_files_and_the_mount(files, orbit, tmp_path, capsys):
    """Poses of a body 0.5 m to the left of the camera, which looks the same way."""
    body = orbit.poses.copy()
    from scipy.spatial.transform import Rotation

    body[:, :3] -= Rotation.from_quat(body[:, 3:]).apply([0.5, 0, 0])
    rows = [
        " ".join(map(repr, [time, *pose]))
        for time, pose in zip(orbit.times.tolist(), body.tolist(), strict=True)
    ]
    packed = tmp_path / "body.txt.gz"
    packed.write_bytes(gzip.compress("\n".join(rows).encode()))
    mount = tmp_path / "mount.txt"
    mount.write_text("0.5 0 0 0 0 0 1\n")
    out = tmp_path / "out"
    inputs = (files[0], packed, files[2])
    more = ("--out", str(out), "--ids", "class_id", "--camera-in-body", str(mount), "--quiet")
    assert call("run", inputs, *more) == 0
    odometry = np.loadtxt(out / "odometry.txt")
    np.testing.assert_allclose(odometry[:, 1:4], orbit.poses[:, :3], atol=1e-6)


def test_one_standard_input_only(files, tmp_path, capsys):
    inputs = (files[0], "-", "-")
    for command, more in (("run", ("--out", str(tmp_path / "out"))), ("inspect", ())):
        assert call(command, inputs, *more) == 2
        assert_one_line_of_error(capsys, "standard input can be only one of the inputs")
    assert not (tmp_path / "out").exists()
    more = ("--groundtruth", "-", "--out", str(tmp_path / "out"))
    assert call("run", (files[0], files[1], "-"), *more) == 2
    assert_one_line_of_error(capsys, "standard input can be only one of the inputs")


@pytest.mark.parametrize(("text", "code"), [("640x480", 0), ("640x481", 2), ("640", 2)])
def test_the_size_of_the_image(files, capsys, text, code):
    assert call("inspect", files, "--image-size", text, "--json") == code


def test_a_camera_without_a_size(tmp_path, capsys):
    calib = tmp_path / "calib.txt"
    calib.write_text("P2: 700 0 600 0 0 700 180 0 0 0 1 0\n")
    labels = tmp_path / "labels"
    labels.mkdir()
    (labels / "0.txt").write_text("0 0.5 0.5 0.2 0.2\n")
    size = ("--image-size", "1242x375")
    boxes = str(tmp_path / "boxes.csv")
    assert main(["convert", str(labels), boxes, "--frame-rate", "10", *size]) == 0
    row = (tmp_path / "boxes.csv").read_text().splitlines()[1].split(",")
    np.testing.assert_allclose(
        [float(cell) for cell in row[2:6]], [0.4 * 1242 - 0.5, 149.5, 0.6 * 1242 - 0.5, 224.5]
    )
    path = tmp_path / "path.txt"
    path.write_text("0 0 0 0 0 0 0 1\n1 0 0 1 0 0 0 1\n")
    files = (calib, path, tmp_path / "boxes.csv")
    assert call("inspect", files, *size, "--json") == 0
    capsys.readouterr()
    assert call("inspect", files) == 2
    assert_one_line_of_error(capsys, "or say --image-size")


def test_the_first_frame_and_suppression_in_convert(tmp_path, capsys):
    boxes = tmp_path / "det.txt"
    boxes.write_text("5,-1,10,10,50,50,0.9\n5,-1,11,10,50,50,0.8\n6,-1,10,10,50,50,0.7\n")
    out = tmp_path / "boxes.csv"
    more = ("--frame-rate", "10", "--first-frame", "5", "--nms", "0.5")
    assert main(["convert", str(boxes), str(out), *more]) == 0
    rows = [line.split(",") for line in out.read_text().splitlines()[1:]]
    assert [(row[0], row[1], row[6]) for row in rows] == [("0", "0.0", "0.9"), ("1", "0.1", "0.7")]
    assert "1 of 3 boxes left out" in capsys.readouterr().err


def test_what_other_commands_find_in_a_file_is_one_line(files, orbit, tmp_path, capsys):
    out = tmp_path / "out"
    assert call("run", files, "--out", str(out), "--ids", "class_id", "--quiet") == 0
    truth = tmp_path / "truth.txt"
    rows = files[1].read_text().splitlines()
    rows[5] = rows[5].split()[0] + " nan" * 7
    truth.write_text("\n".join(rows) + "\n")
    capsys.readouterr()
    assert main(["evaluate", str(out), "--groundtruth", str(truth), "--quiet"]) == 0
    error = capsys.readouterr().err
    assert error.startswith("warning: ")
    assert "1 of 40 poses left out" in error
    assert error.count("\n") == 1
