"""Parts of a recording in time."""

import json

import numpy as np
import pytest

from console import assert_one_line_of_error
from dqslam.cli import main
from dqslam.io import (
    Extras,
    FileError,
    ReadOptions,
    TimeSpan,
    load_recording,
    read_detections,
    read_trajectory,
)
from dqslam.io.span import seconds


def call(command, files, *more):
    names = ("--camera", "--odometry", "--detections")
    arguments = [str(word) for pair in zip(names, files, strict=True) for word in pair]
    return main([command, *arguments, *more])


def test_both_ends_are_within_to_the_microsecond():
    times = np.array([1.0, 2.0, 2.9999996, 3.0000004, 3.1])
    assert TimeSpan(2.0, 3.0).contains(times).tolist() == [False, True, True, True, False]
    assert TimeSpan(begin=3.0).contains(times).tolist() == [False, False, True, True, True]
    with pytest.raises(ValueError, match="from 3 until 2"):
        TimeSpan(3.0, 2.0)


def test_times_are_written_so_that_they_are_read_again():
    assert seconds(1305031452.791720) == "1305031452.79172"
    assert seconds(12.0) == "12"
    assert str(TimeSpan(1305031452.5, 1305031460.0)) == "from 1305031452.5 until 1305031460 s"


def test_poses_and_boxes_of_the_time_are_read(files):
    whole, _ = load_recording(*files)
    times = whole.timestamps
    first, last = 10, 30
    span = TimeSpan(times[first], times[last])
    part, dropped = load_recording(*files, reading=ReadOptions(span=span))
    np.testing.assert_array_equal(part.timestamps, times[first : last + 1])
    inside = (whole.detections.pose >= first) & (whole.detections.pose <= last)
    np.testing.assert_array_equal(part.detections.box, whole.detections.box[inside])
    np.testing.assert_array_equal(part.detections.pose, whole.detections.pose[inside] - first)
    np.testing.assert_allclose(part.odometry.relative, whole.odometry.relative[first:last])
    assert dropped.without_pose == 0


def test_other_measurements_are_of_the_poses_of_the_file(files, tmp_path):
    """Rows of poses count those of the whole file, and steps have their own covariances."""
    times, _ = read_trajectory(files[1])
    absolute = tmp_path / "absolute.csv"
    absolute.write_text("pose,x,y,z,sigma\n5,0,0,5,1\n12,0,0,12,1\n38,0,0,38,1\n")
    closures = tmp_path / "closures.csv"
    columns = "from_pose,to_pose,x,y,z,qx,qy,qz,qw,sigma_translation,sigma_rotation"
    closures.write_text(f"{columns}\n5,20,1,0,0,0,0,0,1,1,1\n12,20,2,0,0,0,0,0,1,1,1\n")
    part, _ = load_recording(
        *files,
        reading=ReadOptions(span=TimeSpan(times[10], times[30])),
        extras=Extras(absolute=absolute, closures=closures),
    )
    assert part.absolute.pose.tolist() == [2]
    assert part.absolute.position.tolist() == [[0.0, 0.0, 12.0]]
    assert (part.closures.from_pose.tolist(), part.closures.to_pose.tolist()) == ([2], [10])
    empty = ReadOptions(span=TimeSpan(times[20], times[30]))
    none, _ = load_recording(*files, reading=empty, extras=Extras(absolute=absolute))
    assert none.absolute is None


def test_a_time_without_poses_is_one_error(files):
    with pytest.raises(FileError, match=r"none of \d+ poses is from 1000 s: they are from 100 to "):
        load_recording(*files, reading=ReadOptions(span=TimeSpan(begin=1000.0)))


def test_run_inspect_convert_and_evaluate_take_a_part(files, tmp_path, capsys):
    times, _ = read_trajectory(files[1])
    middle = seconds(times[len(times) // 2])
    out = tmp_path / "out"
    assert call("run", files, "--until", middle, "--ids", "none", "--out", str(out), "-q") == 0
    assert f"until = {float(middle)!r}" in (out / "config.toml").read_text()
    found, _ = read_trajectory(out / "trajectory.txt")
    assert found[-1] == pytest.approx(float(middle), abs=1e-6)
    capsys.readouterr()
    assert call("inspect", files, "--from", middle, "--json", "-q") == 0
    seen = json.loads(capsys.readouterr().out)
    assert seen["trajectory"]["start_s"] == pytest.approx(float(middle), abs=1e-6)
    assert seen["overlap"]["boxes_without_pose"] == 0
    for number, name in ((1, "odometry.txt"), (2, "boxes.csv")):
        target = str(tmp_path / f"part_{name}")
        assert main(["convert", str(files[number]), target, "--until", "102", "-q"]) == 0
    assert read_trajectory(tmp_path / "part_odometry.txt").timestamps[-1] <= 102.0 + 1e-6
    assert read_detections(tmp_path / "part_boxes.csv").timestamp.max() <= 102.0 + 1e-6
    truth = ["--groundtruth", str(files[1])]
    assert main(["evaluate", str(out), *truth, "--from", "101", "--until", "102", "-q"]) == 0
    compared = json.loads((out / "evaluation.json").read_text())["poses"]
    assert compared == np.sum((found >= 101.0 - 1e-6) & (found <= 102.0 + 1e-6))


def test_the_end_must_not_be_before_the_beginning(files, capsys):
    assert call("inspect", files, "--from", "3", "--until", "2") == 2
    assert_one_line_of_error(capsys, "--from 3 is not before --until 2")
