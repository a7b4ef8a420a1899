"""What `dqslam inspect` prints, and its exit codes."""

import json

import pytest

import realdata
from console import assert_one_line_of_error
from dqslam.cli import main

TOO_STILL = "too few boxes move from view to view"
TOO_FEW = "only 4 objects to compare lenses with"


def call(files, *more):
    names = ("--camera", "--odometry", "--detections")
    arguments = [str(word) for pair in zip(names, files, strict=True) for word in pair]
    return main(["inspect", *arguments, *more])


def test_the_summary(files, capsys):
    assert call(files, "--ids", "track_id", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["warnings"] == content["notes"] == []
    assert content["unchecked"] == {"distortion": TOO_FEW, "clock": TOO_STILL}
    assert content["clock"] is None
    # Poses and boxes are exact, but boxes are of ellipsoids, whose middles are not quite points.
    assert content["fit"]["explained"] == "yes"
    assert content["fit"]["unexplained"] < 0.05
    assert content["fit"]["track_px"] < 2
    path, boxes = content["trajectory"], content["detections"]
    assert (path["poses"], path["start_s"], path["gaps"]) == (40, 100, [])
    assert path["rate_hz"] == pytest.approx(10)
    assert path["length_m"] == pytest.approx(7.46, abs=0.5)  # round a circle of 1.2 m
    assert (boxes["boxes"], boxes["frames"], boxes["boxes_a_frame"]) == (160, 40, [4.0] * 5)
    assert boxes["classes"] == {"box": 40, "lamp": 40, "book": 40, "cup": 40}
    assert (boxes["objects"], boxes["boxes_without_object"]) == (4, 0)
    assert boxes["at_border"] == {"left": 0, "top": 0, "right": 0, "bottom": 0, "any": 0}
    overlap = content["overlap"]
    assert (overlap["boxes_with_pose"], overlap["boxes_without_pose"]) == (160, 0)
    assert overlap["seconds"] == pytest.approx(3.9)


def test_gaps_borders_and_boxes_without_poses_are_counted(files, capsys):
    camera, path, boxes = files
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:10] + lines[20:]))
    text = boxes.read_text().splitlines(keepends=True)
    text.append("39,103.9,-0.5,10,30,479.2,0.9,1,cup,101\n")
    boxes.write_text("".join(text))
    assert call(files, "--ids", "track_id", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    (gap,) = content["trajectory"]["gaps"]
    assert (gap["after_s"], gap["seconds"]) == (pytest.approx(100.9), pytest.approx(1.1))
    # The boxes at 101.0 to 101.9 s have no pose within half an interval.
    assert content["overlap"]["boxes_without_pose"] == 40
    assert content["detections"]["at_border"]["left"] == 1
    assert content["detections"]["at_border"]["bottom"] == 1
    assert content["detections"]["at_border"]["any"] == 1


def test_printed_and_strict(files, capsys):
    assert call(files, "--ids", "track_id", "--strict") == 0
    shown = capsys.readouterr().out
    assert "no mistake found" in shown
    assert f"not checked: distortion: {TOO_FEW}" in shown
    camera = json.loads(files[0].read_text())
    files[0].write_text(json.dumps(camera | {"width": 480, "height": 640}))
    assert call(files, "--ids", "track_id") == 0
    assert "warning: image size: the principal point" in capsys.readouterr().out
    assert call(files, "--ids", "track_id", "--strict") == 3


def test_boxes_of_one_image_tell_nothing_of_the_clock(files, capsys):
    lines = files[2].read_text().splitlines(keepends=True)
    files[2].write_text("".join([lines[0], *(line for line in lines if line.startswith("7,"))]))
    assert call(files, "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert (content["detections"]["boxes"], content["detections"]["frames"]) == (4, 1)
    assert content["unchecked"]["clock"] == "all boxes are of one time"
    assert content["clock"] is content["fit"] is None


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--format", "bvh"), "format 'bvh' is none of"),
        (("--camera", "none.json"), "none.json: no such file"),
        (("--frame-rate", "0"), "frame rate is 0 Hz"),
    ],
)
def test_bad_arguments_are_one_line_and_code_2(files, capsys, more, message):
    assert call(files, *more) == 2
    assert_one_line_of_error(capsys, message)


def test_a_street_in_the_formats_of_kitti_and_mot(tmp_path, capsys):
    """No file has times: frames are counted."""
    folder = realdata.recording("kitti_tracking") / "0005"
    boxes = tmp_path / "boxes.txt"
    assert main(["convert", str(folder / "boxes_gt.csv"), str(boxes)]) == 0
    calib = tmp_path / "calib.txt"
    calib.write_text((folder / "calib.txt").read_text() + "S_rect_02: 1242 375\n")
    path = folder / "poses_orbslam3_stereo_kitti3x4.txt"
    capsys.readouterr()
    assert call((calib, path, boxes), "--ids", "track_id", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert (content["warnings"], content["unchecked"]) == ([], {})
    assert content["overlap"]["boxes_with_pose"] == 1476


def test_quiet_says_nothing_but_the_exit_code(files, capsys):
    camera = json.loads(files[0].read_text())
    files[0].write_text(json.dumps(camera | {"width": 480, "height": 640}))
    assert call(files, "--ids", "track_id", "--strict", "--quiet") == 3
    assert capsys.readouterr() == ("", "")
