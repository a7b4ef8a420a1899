"""Files of a recording into what an estimator sees."""

import numpy as np
import pytest

from dqslam import _core
from dqslam.assumptions import OdometryNoise
from dqslam.io import FileError, ReadOptions, load_recording, nearest_pose
from orbit import NAMES, write_orbit


def edit(path, change):
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


def add_rows(path, *rows):
    edit(path, lambda lines: lines + list(rows))


def test_recording_holds_what_the_files_hold(files, orbit):
    recording, dropped = load_recording(*files)
    assert dropped.total == 0
    np.testing.assert_array_equal(recording.timestamps, orbit.times)
    detections = recording.detections
    assert detections.class_names == NAMES
    keys = zip(detections.pose, detections.object_id - 100, strict=True)
    expected = np.array([orbit.boxes[int(pose), int(name)] for pose, name in keys])
    np.testing.assert_allclose(detections.box, expected, atol=1e-12)
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    np.testing.assert_allclose(path[:, :3], orbit.poses[:, :3], atol=1e-12)
    np.testing.assert_allclose(
        odometry.covariance[7], np.diag([1e-4] * 3 + [2.5e-5] * 3), rtol=1e-12
    )


def test_ids_come_from_the_named_column(files):
    recording, _ = load_recording(*files, ids="class_id")
    assert sorted(set(recording.detections.object_id.tolist())) == list(NAMES)


def test_distorted_boxes_are_undistorted(files, orbit):
    edit(files[0], lambda lines: [lines[0][:-1] + ', "distortion": [-0.3, 0.1, 0.001, -5e-4]}'])
    recording, _ = load_recording(*files)
    box = recording.detections.box
    original = load_recording(*write_orbit(files[0].parent, orbit))[0].detections.box
    assert np.abs(box - original).max() > 2
    middle_v = 0.5 * (box[:, 1] + box[:, 3])
    left = recording.camera.distort_points(np.column_stack([box[:, 0], middle_v]))[:, 0]
    # An edge is undistorted at the middle of the distorted box, at not quite the same height.
    np.testing.assert_allclose(left, original[:, 0], atol=0.1)


def test_boxes_beyond_the_range_of_the_lens_are_left_out_and_counted(files, orbit):
    edit(files[0], lambda lines: [lines[0][:-1] + ', "distortion": [-0.9, 0, 0, 0]}'])
    times = orbit.times.tolist()
    places = ("300,238,302,240", "310,238,312,240", "0,0,2,2")
    rows = [f"{i},{times[i]!r},{place},0.9,1,cup,55" for i, place in enumerate(places)]
    add_rows(files[2], *rows)
    recording, dropped = load_recording(*files)
    assert (dropped.beyond_lens, dropped.below_min_score) == (1, 0)
    assert dropped.few_boxes == {55: 2}
    assert len(recording.detections) == len(orbit.boxes)


def test_every_dropped_box_is_counted(files, orbit):
    t = orbit.times.tolist()
    add_rows(
        files[2],
        f"3,{t[3]!r},1,1,9,9,0.4999,1,cup,101",
        f"3,{t[3]!r},1,1,9,9,0.5,1,cup,-1",
        f"3,{t[3]!r},1,1,9,9,0.5,1,cup,",
        f"3,{t[3]!r},1,1,9,9,0.89,1,cup,101",
        f"2000,{t[-1] + 1!r},1,1,9,9,0.9,1,cup,101",
        f"3,{t[3]!r},1,1,9,9,0.9,1,cup,7",
        f"4,{t[4]!r},1,1,9,9,0.9,1,cup,7",
    )
    recording, dropped = load_recording(*files)
    assert (dropped.below_min_score, dropped.without_id, dropped.without_pose) == (1, 2, 1)
    assert (dropped.repeated, dropped.few_boxes, dropped.total) == (1, {7: 2}, 7)
    assert len(recording.detections) == len(orbit.boxes)
    assert np.all(recording.detections.box[:, 2] > 9)


def test_of_several_boxes_the_nearest_in_time_wins_then_the_best(files, orbit):
    # The image between poses 3 and 4 has its own, better scored box of the cup.
    time = orbit.times[3].item()
    edit(
        files[2],
        lambda lines: [
            line.replace(",0.9,1,", ",0.6,1,") if line.startswith("3,") else line for line in lines
        ],
    )
    edit(
        files[2],
        lambda lines: [
            lines[0],
            f"3,{time!r},5,5,9,9,0.7,1,cup,101",
            *(line for line in lines[1:] if not line.startswith("4,")),
            f"4,{time + 0.03!r},1,1,9,9,0.99,1,cup,101",
        ],
    )
    recording, dropped = load_recording(*files, interpolate=False)
    detections = recording.detections
    row = np.flatnonzero((detections.pose == 3) & (detections.object_id == 101))
    np.testing.assert_array_equal(detections.box[row], [[5, 5, 9, 9]])
    assert dropped.repeated == 2


def test_of_several_images_at_a_pose_the_nearest_is_whole(files, orbit):
    """An image 0.03 s late has two boxes: all of it is left out, or all of another."""

    def tenfold(lines):
        rows = (line.split(",", 1) for line in lines[1:])
        return [lines[0], *(f"{frame}0,{rest}" for frame, rest in rows)]

    edit(files[2], tenfold)
    time = orbit.times[3].item() + 0.03
    add_rows(files[2], *(f"35,{time!r},{x},5,{x + 9},14,0.9,1,cup,{x}" for x in (5, 50)))
    recording, dropped = load_recording(*files, ids="none", interpolate=False)
    assert dropped.repeated == 2
    assert np.sum(recording.detections.pose == 3) == 4
    edit(files[2], lambda lines: [line for line in lines if not line.startswith("30,")])
    recording, dropped = load_recording(*files, ids="none", interpolate=False)
    assert dropped.repeated == 0
    np.testing.assert_array_equal(
        recording.detections.box[recording.detections.pose == 3], [[5, 5, 14, 14], [50, 5, 59, 14]]
    )


def test_ids_that_are_not_final_keep_boxes_without_one(files, orbit):
    time = orbit.times[3].item()
    add_rows(files[2], f"3,{time!r},1,1,9,9,0.5,1,cup,", f"3,{time!r},20,1,30,9,0.8,1,cup,101")
    final, dropped = load_recording(*files)
    assert (len(final.detections), dropped.without_id, dropped.repeated) == (160, 1, 1)
    open_, dropped = load_recording(*files, final_ids=False)
    assert (len(open_.detections), dropped.total) == (162, 0)
    assert np.sum(open_.detections.object_id == -1) == 1


def test_boxes_meet_the_nearest_pose(files, orbit):
    pose, late = nearest_pose(orbit.times, np.array([-5, 100.04, 100.06, 1e4]))
    np.testing.assert_array_equal(pose, [0, 0, 1, len(orbit.times) - 1])
    np.testing.assert_allclose(late[1:3], 0.04, atol=1e-9)
    shift = 0.03
    edit(
        files[1],
        lambda lines: [
            f"{float(line.split()[0]) + shift!r} " + line.split(" ", 1)[1] for line in lines
        ],
    )
    assert load_recording(*files, interpolate=False)[1].without_pose == 0
    # The four boxes of the first image are before the first pose; others are between two.
    recording, dropped = load_recording(*files)
    assert dropped.without_pose == 4
    assert len(recording.timestamps) == 2 * len(orbit.times) - 1
    with pytest.raises(FileError, match="160 further than 0.02 s from a pose"):
        load_recording(*files, reading=ReadOptions(max_time_difference=0.02))


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"min_score": 0.95}, r"boxes\.csv: no object is left of 160 boxes: 160 below"),
        ({"min_score": 1.5}, "min_score is 1.5, not between 0 and 1"),
        ({"min_score": float("nan")}, "min_score is nan"),
        ({"ids": "name"}, "ids is 'name', not 'track_id', 'class_id' or 'none'"),
    ],
)
def test_settings_that_make_no_sense(files, keywords, message):
    with pytest.raises(ValueError, match=message):
        load_recording(*files, **keywords)


def test_a_file_without_track_ids_says_what_it_has(files):
    edit(files[2], lambda lines: [lines[0].replace("track_id", "derived_track_id"), *lines[1:]])
    with pytest.raises(FileError, match=r"boxes\.csv:1: no column track_id \(.*derived_track_id\)"):
        load_recording(*files)
    assert len(load_recording(*files, ids="class_id")[0].detections) == 160


def test_one_pose_is_no_trajectory(files):
    edit(files[1], lambda lines: lines[:1])
    with pytest.raises(FileError, match=r"traj\.txt: one pose only"):
        load_recording(*files)


@pytest.mark.parametrize("sigma", [0.0, -0.1, 1e-200, 1e200, float("nan"), float("inf")])
def test_sigmas_must_make_sense(sigma):
    with pytest.raises(ValueError, match="odometry noise: rotation is .*, not between"):
        OdometryNoise(0.1, sigma)
