from dataclasses import replace

import numpy as np
import pytest

from dqslam import Camera, Detections, Odometry, PoseModel, Recording, RelativePositions
from dqslam.lens import undistort_boxes
from dqslam.recording import Truth

CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)


def odometry(**changes):
    values = {
        "pose_model": PoseModel.SE2,
        "first_pose": [0.0, 0.0, 0.0],
        "relative": [[1.0, 0.0, 0.0], [1.0, 0.0, 0.1]],
        "covariance": np.tile(0.01 * np.eye(3), (2, 1, 1)),
    }
    return Odometry(**values | changes)


def detections(**changes):
    values = {
        "pose": [0, 2],
        "box": [[10.0, 10.0, 50.0, 60.0], [100.0, 100.0, 200.0, 150.0]],
        "score": [1.0, 0.5],
        "class_id": [3, 3],
        "object_id": [7, -1],
        "class_names": {3: "cup"},
    }
    return Detections(**values | changes)


def positions(**changes):
    values = {
        "pose": [1],
        "object_id": [7],
        "object_in_robot": [[1.0, 2.0, 0.0]],
        "covariance": [0.01 * np.eye(3)],
    }
    return RelativePositions(**values | changes)


def xyxy(**changes):
    values = {"pose": [0, 2], "xyxy": [[10.5, 10.5, 50.5, 60.5], [100.5, 100.5, 200.5, 150.5]]}
    return Detections.from_xyxy(**values | changes)


def from_poses(**changes):
    values = {
        "poses": [[1.0, 2.0, 0.0], [2.0, 2.0, np.pi / 2], [2.0, 5.0, np.pi]],
        "covariance": np.diag([0.04, 0.01, 0.09]),
    }
    return Odometry.from_poses(**values | changes)


def recording(**changes):
    values = {
        "camera": CAMERA,
        "timestamps": [0.0, 0.5, 1.0],
        "odometry": odometry(),
        "detections": detections(),
        "positions": positions(),
    }
    return Recording(**values | changes)


def truth(**changes):
    values = {
        "pose_model": PoseModel.SE2,
        "poses": np.zeros((3, 3)),
        "object_ids": [0, 1],
        "centers": np.zeros((2, 3)),
        "volumes": [1.0, 2.0],
        "class_names": ("cup", "cup"),
    }
    return Truth(**values | changes)


def test_arrays_are_copied_and_read_only():
    box = np.array([[10.0, 10.0, 50.0, 60.0], [100.0, 100.0, 200.0, 150.0]])
    kept = detections(box=box)
    box[:] = 0.0
    assert kept.box[1].tolist() == [100.0, 100.0, 200.0, 150.0]
    with pytest.raises(ValueError, match="read-only"):
        kept.box[0, 0] = 1.0
    assert kept.object_id.dtype == np.int64


def test_a_recording_may_have_no_boxes_and_no_positions():
    none = Detections(pose=[], box=[], score=[], class_id=[], object_id=[])
    assert none.box.shape == (0, 4)
    assert len(recording(detections=none, positions=None).detections) == 0


NOT_SYMMETRIC = np.eye(3) + np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
SINGULAR = np.diag([1.0, 0.0, 1.0])
HALF_TURN = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.1]


@pytest.mark.parametrize(
    ("make", "changes", "message"),
    [
        (odometry, {"relative": [[1.0, 0.0, np.nan]] * 2}, r"odometry\.relative row 0: not finite"),
        (
            odometry,
            {"relative": [[1.0, 0.0]] * 2},
            r"relative: expected shape \(n, 3\), got \(2, 2",
        ),
        (odometry, {"first_pose": [0.0, 0.0]}, r"first_pose: expected shape"),
        (odometry, {"first_pose": "abc"}, r"first_pose: not an array of numbers"),
        (odometry, {"covariance": [np.eye(3)]}, r"covariance: expected shape \(2, 3, 3\), got \(1"),
        (odometry, {"covariance": [np.eye(3), SINGULAR]}, r"covariance row 1: .*positive definite"),
        (odometry, {"covariance": [np.eye(3), NOT_SYMMETRIC]}, r"covariance row 1: .*symmetric"),
        (
            odometry,
            {"pose_model": PoseModel.SE3, "first_pose": HALF_TURN},
            r"odometry\.first_pose row 0: quaternion is not of unit length",
        ),
        (
            detections,
            {"box": [[0, 0, 9, 9], [5, 0, 5, 9]]},
            r"box row 1: inverted or empty box: \[5",
        ),
        (detections, {"box": [[0, 0, 9, 9], [0, 9, 5, 2]]}, r"box row 1: inverted or empty box"),
        (detections, {"box": [[0, 0, 9, np.inf], [0, 0, 9, 9]]}, r"detections\.box row 0: not fin"),
        (detections, {"pose": [0]}, r"detections\.pose: expected shape \(2\), got \(1,\)"),
        (detections, {"pose": [0, 0.5]}, r"detections\.pose row 1: not a whole number: 0\.5"),
        (detections, {"score": [1.0, np.nan]}, r"detections\.score row 1: not finite"),
        (detections, {"class_id": [3, 4]}, r"class_id row 1: class has no name: 4"),
        (detections, {"object_id": [7, -2]}, r"object_id row 1: not an object id: -2"),
        (detections, {"truncated": [[True] * 4]}, r"truncated: expected shape \(2, 4\), got \(1"),
        (
            detections,
            {"truncated": [[0, 1, 0, 0], [0, 0, 2, 0]]},
            r"truncated row 1: not true or false: \[0, 0, 2, 0\]",
        ),
        (
            xyxy,
            {"pose": [0]},
            r"^pose: expected shape \(2\), got \(1,\)",
        ),
        (xyxy, {"xyxy": [[0, 0, 9, 9], [0, 0, 9]]}, r"^xyxy: not an array of numbers"),
        (xyxy, {"xyxy": [[0, 0, 9, 9], [0, 0, 9, np.nan]]}, r"^xyxy row 1: not finite"),
        (xyxy, {"score": [1.0]}, r"^score: expected shape \(2\), got \(1,\)"),
        (xyxy, {"object_id": [1, 0.5]}, r"^object_id row 1: not a whole number: 0\.5"),
        (xyxy, {"class_id": [0, 2], "class_names": ["cup"]}, r"class_id row 1: class has no name"),
        (from_poses, {"poses": np.zeros((3, 4))}, r"^poses: expected 3 .* got shape \(3, 4\)"),
        (from_poses, {"poses": []}, r"^poses: expected 3 \(SE2\) or 7 \(SE3\)"),
        (from_poses, {"poses": np.zeros((0, 3))}, r"^poses: there are none"),
        (from_poses, {"poses": [[0, 0, 0], [0, np.inf, 0]]}, r"^poses row 1: not finite"),
        (from_poses, {"poses": [HALF_TURN]}, r"^poses row 0: quaternion is not of unit length"),
        (from_poses, {"covariance": np.eye(6)}, r"covariance: expected shape \(3, 3\), got \(6"),
        (from_poses, {"covariance": [np.eye(3)] * 3}, r"covariance: expected shape \(2, 3, 3\)"),
        (from_poses, {"covariance": -np.eye(3)}, r"covariance row 0: .*positive definite"),
        (positions, {"covariance": [-np.eye(3)]}, r"positions\.covariance row 0: .*positive def"),
        (positions, {"object_in_robot": [[1.0, 2.0]]}, r"object_in_robot: expected shape \(n, 3"),
        (recording, {"timestamps": [0.0, 1.0, 1.0]}, r"timestamps row 2: time does not increase"),
        (recording, {"timestamps": [0.0, 1.0]}, r"timestamps: expected 3, .* got 2"),
        (
            recording,
            {"detections": detections(pose=[0, 3])},
            r"detections\.pose row 1: no such pose",
        ),
        (recording, {"positions": positions(pose=[-1])}, r"positions\.pose row 0: no such pose"),
        (
            recording,
            {"detections": detections(box=[[700.0, 0, 800, 9], [0, 0, 9, 9]])},
            r"detections\.box row 0: box outside the image: \[700",
        ),
        (truth, {"object_ids": [1, 1]}, r"truth\.object_ids: an id occurs twice"),
        (truth, {"volumes": [1.0, 0.0]}, r"truth\.volumes row 1: not positive: 0"),
        (truth, {"class_names": ("cup",)}, r"truth\.class_names: expected 2, got 1"),
        (truth, {"ellipsoids": np.zeros((1, 9))}, r"truth\.ellipsoids: expected shape \(2, 9\)"),
        (truth, {"box_object_id": [1, 2]}, r"truth\.box_object_id row 1: no such object: 2"),
    ],
)
def test_bad_input_names_the_array_and_the_row(make, changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


def test_boxes_can_be_selected_by_row_and_by_flag():
    cut = [[False] * 4, [True, False, False, False]]
    all_boxes = detections(truncated=cut)
    for rows in (np.array([1]), np.array([False, True])):
        one = all_boxes.select(rows)
        assert (len(one), one.pose.tolist(), one.object_id.tolist()) == (1, [2], [-1])
        assert one.truncated.tolist() == [cut[1]]
        assert one.class_names == {3: "cup"}
    assert not detections().truncated.any()


def test_undistorted_boxes_may_lie_outside_of_the_rectangle_of_the_image():
    lens = Camera(500.0, 500.0, 319.5, 239.5, 640, 480, distortion=[-0.3, 0.1, 0.0, 0.0, 0.0])
    boxes = detections(box=[[-90.0, 10.0, -1.0, 60.0], [100.0, 100.0, 200.0, 150.0]])
    assert len(recording(camera=lens, detections=boxes).detections) == 2


def test_a_replaced_part_is_checked_again():
    with pytest.raises(ValueError, match="timestamps row 1"):
        replace(recording(), timestamps=[0.0, -1.0, 1.0])


def test_odometry_from_poses_of_the_plane():
    made = from_poses()
    assert made.pose_model == PoseModel.SE2
    assert made.first_pose.tolist() == [1.0, 2.0, 0.0]
    expected = [[1.0, 0.0, np.pi / 2], [3.0, 0.0, np.pi / 2]]  # the second drive is due north
    np.testing.assert_allclose(made.relative, expected, atol=1e-15)
    assert made.covariance.tolist() == [np.diag([0.04, 0.01, 0.09]).tolist()] * 2
    each = np.array([np.eye(3), 2.0 * np.eye(3)])
    np.testing.assert_array_equal(from_poses(covariance=each).covariance, each)


def test_odometry_from_poses_in_space():
    half = np.sqrt(0.5)
    rounded = [0.0, 0.0, 0.7071, 0.7071]  # as a file of four digits has it: 1e-5 too short
    made = from_poses(
        poses=[[0.0, 0.0, 1.0, *rounded], [0.0, 2.0, 1.0, *rounded], [0.0, 2.0, 1.5, 0, 0, 0, 1]],
        covariance=np.eye(6),
    )
    assert made.pose_model == PoseModel.SE3
    expected = [[2.0, 0.0, 0.0, 0, 0, 0, 1], [0.0, 0.0, 0.5, 0, 0, -half, half]]
    np.testing.assert_allclose(made.relative, expected, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(made.first_pose[3:]), 1.0, atol=1e-15)


def test_a_single_pose_has_no_steps():
    made = from_poses(poses=[[0.0, 0.0, 0.0]])
    assert (made.relative.shape, made.covariance.shape) == ((0, 3), (0, 3, 3))


def test_detections_from_corners():
    made = xyxy()
    assert made.box.tolist() == [[10.0, 10.0, 50.0, 60.0], [100.0, 100.0, 200.0, 150.0]]
    assert (made.score.tolist(), made.object_id.tolist()) == ([1.0, 1.0], [-1, -1])
    assert (made.class_id.tolist(), made.class_names) == ([0, 0], {0: "object"})
    assert xyxy(pose=2).pose.tolist() == [2, 2]
    assert xyxy(object_id=7).object_id.tolist() == [7, 7]
    assert xyxy(score=[0.5, 0.25]).score.tolist() == [0.5, 0.25]
    assert xyxy(class_id=[3, 5]).class_names == {3: "3", 5: "5"}
    assert xyxy(class_id=[0, 1], class_names=["cup", "book"]).class_names == {0: "cup", 1: "book"}
    assert xyxy(class_id=4, class_names={4: "cup"}).class_names == {4: "cup"}
    assert Detections.from_xyxy([], []).box.shape == (0, 4)


def test_detections_from_corners_in_distorted_images():
    lens = Camera(500.0, 500.0, 319.5, 239.5, 640, 480, distortion=[-0.3, 0.1, 0.0, 0.0, 0.0])
    made = xyxy(camera=lens)
    np.testing.assert_array_equal(made.box, undistort_boxes(lens, xyxy().box))
    assert made.box[0, 0] < -10.0


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (odometry(), "Odometry(SE2, 2 steps)"),
        (
            from_poses(poses=[[0, 0, 0, 0, 0, 0, 1]] * 2, covariance=np.eye(6)),
            "Odometry(SE3, 1 step)",
        ),
        (detections(), "Detections(2 boxes of 1 object, 1 without id, 1 class)"),
        (detections(object_id=[7, 8]), "Detections(2 boxes of 2 objects, 1 class)"),
        (xyxy(class_id=[1, 2]), "Detections(2 boxes without ids, 2 classes)"),
        (Detections.from_xyxy([], []), "Detections(0 boxes)"),
        (positions(), "RelativePositions(1 position of 1 object)"),
        (
            recording(positions=None),
            "Recording(SE2, 3 poses, 2 boxes of 1 object, 1 without id, 1 class)",
        ),
        (
            recording(detections=detections(object_id=[1, 2])),
            "Recording(SE2, 3 poses, 2 boxes of 2 objects, 1 class, 1 position)",
        ),
        (truth(), "Truth(SE2, 3 poses, 2 objects)"),
    ],
)
def test_what_there_is_in_a_line(made, text):
    assert repr(made) == text
