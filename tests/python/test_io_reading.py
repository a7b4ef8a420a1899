"""What numbers mean, bad records, lenses and other measurements, in one recording."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam.inspection import inspect_recording
from dqslam.io import (
    BoxReading,
    Extras,
    FileError,
    Notes,
    Readings,
    ReadOptions,
    load_recording,
    read_detections,
    read_trajectory,
)
from dqslam.io.readings import OPENGL_AXES
from test_pipeline_lens import CASES, through

MOUNT = (0.1, 0.2, 0.3, 0.5, -0.5, 0.5, -0.5)


def edit(path, change):
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


def test_poses_are_read_as_meant_before_the_mount_is_applied(files):
    given, _ = load_recording(*files)
    times, poses = read_trajectory(files[1])
    # The body of the trajectory: its camera, mounted so, is the camera of the boxes.
    back = dq._core.inverse(dq.PoseModel.SE3, np.array([MOUNT]))
    body = dq._core.compose(dq.PoseModel.SE3, poses, np.tile(back, (len(poses), 1)))
    turned = Rotation.from_quat(body[:, 3:]) * Rotation.from_matrix(OPENGL_AXES)
    rows = np.column_stack([times, 1000 * body[:, :3], turned.as_quat()[:, [3, 0, 1, 2]]])
    np.savetxt(files[1], rows, fmt="%.17g")
    readings = Readings(("w_first", "opengl"), body_from_camera=MOUNT, length_scale=1e-3)
    read, _ = load_recording(*files, reading=ReadOptions(readings=readings))
    np.testing.assert_allclose(read.odometry.relative, given.odometry.relative, atol=1e-9)


def test_boxes_are_checked_as_they_are_meant(files):
    """Corner and size under the names of corners: half of them look inverted."""
    given, _ = load_recording(*files)

    def sizes(lines):
        cells = [line.split(",") for line in lines[1:]]
        for row in cells:
            x1, y1, x2, y2 = map(float, row[2:6])
            row[4:6] = repr(x2 - x1), repr(y2 - y1)
        cells[3][4] = "-5"
        return [lines[0], *(",".join(row) for row in cells)]

    edit(files[2], sizes)
    notes = Notes()
    options = ReadOptions(readings=Readings(boxes=BoxReading(form="xywh")))
    read, _ = load_recording(*files, reading=options, notes=notes)
    assert [(one.count, one.of) for one in notes.left_out] == [(1, 160)]
    assert "boxes.csv:5: inverted box" in notes.left_out[0].first
    assert len(read.detections) == len(given.detections) - 1
    with pytest.raises(FileError, match="boxes are bad, 5% may be"):
        load_recording(*files)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"max_time_difference": -1.0}, "max_time_difference is -1, negative"),
        ({"image_size": (0, 480)}, "image_size is 0 x 480, not positive"),
        ({"max_bad": 1.5}, "max_bad is 1.5"),
    ],
)
def test_options_that_make_no_sense(keywords, message):
    with pytest.raises(ValueError, match=message):
        ReadOptions(**keywords)


def test_measurements_count_the_poses_of_the_file(files, tmp_path):
    """Images between poses add poses to the recording."""
    edit(files[2], lambda lines: [lines[0], *map(_later, lines[1:])])
    times = read_trajectory(files[1]).timestamps
    path = tmp_path / "closures.csv"
    names = "x,y,z,qx,qy,qz,qw,sigma_translation,sigma_rotation"
    path.write_text(f"from_pose,to_pose,{names}\n3,39,1,2,3,0,0,0,1,0.1,0.1\n")
    recording, _ = load_recording(*files, extras=Extras(closures=path))
    assert len(recording.timestamps) > len(times)
    rows = [recording.closures.from_pose[0], recording.closures.to_pose[0]]
    np.testing.assert_array_equal(recording.timestamps[rows], times[[3, 39]])
    path.write_text(f"from_pose,to_pose,{names}\n3,40,1,2,3,0,0,0,1,0.1,0.1\n")
    with pytest.raises(FileError, match="to_pose is 40, but there are 40 poses"):
        load_recording(*files, extras=Extras(closures=path))
    # A time belongs to the nearest of all poses: here to one between those of the file.
    between = 0.5 * (times[3] + times[4])
    path.write_text(f"from_timestamp,to_pose,{names}\n".replace("to_pose", "to_timestamp"))
    edit(
        path,
        lambda lines: [*lines, f"{float(between)!r},{float(times[39])!r},1,2,3,0,0,0,1,0.1,0.1"],
    )
    recording, _ = load_recording(*files, extras=Extras(closures=path))
    found = recording.timestamps[recording.closures.from_pose[0]]
    assert found == pytest.approx(between, abs=1e-6)


def _later(line):
    cells = line.split(",")
    return ",".join([cells[0], repr(float(cells[1]) + 0.05), *cells[2:]])


def test_a_recording_through_a_lens_fits_together(tmp_path):
    """Boxes of a fisheye, explained by its poses, also if one is far beyond its range."""
    recording, _, _ = through(*CASES["fisheye"])
    dq.io.save_recording(recording, tmp_path)
    files = [tmp_path / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    table = read_detections(files[2], check=False, cut=False)
    trajectory = read_trajectory(files[1])
    box = table.box.copy()
    for far in (False, True):
        if far:
            box[0] = [-1e5, -1e5, -9e4, -9e4]
        seen = inspect_recording(
            recording.camera, trajectory, replace(table, box=box), ids="track_id"
        )
        assert seen.verdict.explained == "yes"
        assert not {"poses", "clock", "unexplained"} & {one.check for one in seen.findings}
    report = dq.run_files(*files).report
    assert report["doubts"] == []
    assert len(report["objects"]) == 8
