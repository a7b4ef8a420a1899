import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import Detections, Odometry, PoseModel, Recording
from dqslam.association import link_tracklets
from dqslam.association.keyframes import (
    MIN_GROWTH,
    MIN_PARALLAX,
    _quantile,
    choose_keyframes,
)
from scenes import CAMERA, Thing, film, street_poses

STILL = np.array([0, 0, 0, 0, 0, 0, 1.0])


def recording(boxes, relative=None):
    """Boxes (pose, left, top, side[, class]), at poses that stand still by default."""
    count = max(int(row[0]) for row in boxes) + 1
    if relative is None:
        relative = np.tile(STILL, (count - 1, 1))
    table = np.array([row[:4] for row in boxes], dtype=float)
    detections = Detections(
        pose=table[:, 0],
        box=np.column_stack([table[:, 1:3], table[:, 1:3] + table[:, 3:]]),
        score=np.ones(len(boxes)),
        class_id=[row[4] if len(row) > 4 else 1 for row in boxes],
        object_id=np.full(len(boxes), -1),
        class_names={1: "cup", 2: "car"},
    )
    covariance = np.tile(1e-4 * np.eye(6), (len(relative), 1, 1))
    odometry = Odometry(PoseModel.SE3, STILL, relative, covariance)
    return Recording(CAMERA, np.arange(len(relative) + 1), odometry, detections)


def test_boxes_that_overlap_are_linked_and_others_are_not():
    boxes = [(0, 100, 100, 40), (1, 105, 100, 40), (1, 400, 100, 40), (2, 405, 100, 40)]
    np.testing.assert_array_equal(link_tracklets(recording(boxes)), [0, 0, 1, 1])


def test_two_of_a_class_that_cross_keep_their_tracklets():
    """They approach at 30 px an image and meet in image 5, 12 px one above the other."""
    boxes = []
    for pose in range(11):
        boxes += [(pose, 100 + 15 * pose, 200, 40), (pose, 250 - 15 * pose, 212, 40)]
    np.testing.assert_array_equal(link_tracklets(recording(boxes)), [0, 1] * 11)


def test_the_turn_of_the_camera_is_foreseen():
    """A turn of 0.12 rad an image moves boxes of 30 px by 60 px: nothing overlaps."""
    turn = np.concatenate([np.zeros(3), Rotation.from_euler("y", 0.12).as_quat()])
    boxes = []
    for pose in range(4):
        # Where a turned camera sees a direction: u = cx + fx tan(angle - turn).
        for angle in (0.3, 0.18):
            u = CAMERA.cx + CAMERA.fx * np.tan(angle - 0.12 * pose)
            boxes.append((pose, u - 15, 225, 30))
    turning = recording(boxes, np.tile(turn, (3, 1)))
    np.testing.assert_array_equal(link_tracklets(turning), [0, 1] * 4)
    unforeseen = link_tracklets(recording(boxes))
    # Each is taken for the other, where that one was before.
    assert not np.array_equal(unforeseen, [0, 1] * 4)


def test_another_class_is_another_tracklet():
    boxes = [(0, 100, 100, 40, 1), (1, 100, 100, 40, 2), (2, 100, 100, 40, 1)]
    np.testing.assert_array_equal(link_tracklets(recording(boxes)), [0, 1, 0])


@pytest.mark.parametrize(("again", "expected"), [(5, [0, 0]), (6, [0, 1])])
def test_an_object_may_go_unseen_for_a_while(again, expected):
    boxes = [(0, 100, 100, 40), (again, 100, 100, 40)]
    np.testing.assert_array_equal(link_tracklets(recording(boxes)), expected)


@pytest.mark.parametrize(
    ("jump", "rival", "expected"),
    [(38, None, [0, 0]), (42, None, [0, 1]), (38, 70, [0, 1, 2])],
)
def test_without_overlap_only_what_has_no_choice_is_linked(jump, rival, expected):
    """Half a box side aside nothing overlaps enough; a second box within two sides is a choice."""
    boxes = [(0, 100, 100, 40), (1, 100 + jump, 100, 40)]
    if rival is not None:
        boxes.append((1, 100 - rival, 100, 40))
    np.testing.assert_array_equal(link_tracklets(recording(boxes)), expected)


def test_ids_of_a_tracker_join_and_separate():
    boxes = [(0, 100, 100, 40), (1, 100, 100, 40), (9, 400, 100, 40), (10, 400, 100, 40)]
    ids = np.array([7, 8, 7, -1])
    np.testing.assert_array_equal(link_tracklets(recording(boxes), tracker_ids=ids), [0, 1, 0, 2])


def test_the_order_of_the_rows_does_not_matter():
    boxes = []
    for pose in range(11):
        boxes += [(pose, 100 + 15 * pose, 200, 40), (pose, 250 - 15 * pose, 212, 40)]
    order = np.random.default_rng(0).permutation(len(boxes))
    numbers = link_tracklets(recording([boxes[row] for row in order]))
    assert len(set(zip(order % 2, numbers, strict=True))) == 2


def test_nothing_is_no_tracklet():
    none = recording([(0, 1, 1, 9), (1, 1, 1, 9)])
    empty = none.detections.select(np.zeros(2, dtype=bool))
    without = Recording(none.camera, none.timestamps, none.odometry, empty)
    assert link_tracklets(without).shape == (0,)
    np.testing.assert_array_equal(choose_keyframes(without, link_tracklets(without)), [0])


# --- keyframes


def seen(poses, things):
    made = film(poses, things, noise_px=0.0)
    return choose_keyframes(made.recording, made.thing)


def test_keyframes_of_a_path_of_known_parallax():
    """An object 10 m ahead, passed in steps of 0.11 m: five times 0.011 rad are a new side."""
    poses = np.tile(STILL, (21, 1))
    poses[:, 0] = np.linspace(-1.1, 1.1, 21)
    thing = Thing(np.array([0.0, 0.0, 10.0]), np.full(3, 0.3))
    assert 4 * 0.011 < MIN_PARALLAX < 5 * 0.0107
    np.testing.assert_array_equal(seen(poses, [thing]), [0, 5, 10, 15, 20])


def test_keyframes_of_a_drive_towards_an_object():
    """The image of what is ahead grows as the distance shrinks, by 1 + ``MIN_GROWTH``."""
    distance = 10.0 - np.arange(40) * 0.2
    expected = [0]
    for pose in range(40):
        if distance[expected[-1]] / distance[pose] >= 1.0 + MIN_GROWTH:
            expected.append(pose)
    thing = Thing(np.array([0.0, 0.0, 10.0]), np.full(3, 0.01))
    assert len(expected) > 8
    np.testing.assert_array_equal(seen(street_poses(40, step=0.2), [thing]), expected)


def test_a_camera_that_stands_still_has_one_keyframe():
    thing = Thing(np.array([0.0, 0.0, 10.0]), np.full(3, 0.3))
    np.testing.assert_array_equal(seen(np.tile(STILL, (9, 1)), [thing]), [0])


def test_an_image_of_new_objects_is_a_keyframe():
    boxes = [(0, 100, 100, 40), (1, 100, 100, 40), (2, 100, 100, 40), (2, 300, 100, 40)]
    boxes += [(2, 500, 100, 40), (3, 300, 100, 40), (3, 500, 100, 40)]
    still = recording(boxes)
    np.testing.assert_array_equal(choose_keyframes(still, link_tracklets(still)), [0, 2])


def test_a_quarter_of_the_tracklets_may_stay():
    """Three near objects pass, one far one does not: its parallax does not count."""
    poses = np.tile(STILL, (11, 1))
    poses[:, 0] = np.linspace(-0.55, 0.55, 11)
    near = [Thing(np.array([x, 0.0, 10.0]), np.full(3, 0.3)) for x in (-2.0, 0.0, 2.0)]
    far = [Thing(np.array([0.0, -300.0, 1000.0]), np.full(3, 30.0))]
    assert seen(poses, near + far).tolist() == [0, 5, 10]
    assert seen(poses, near[:1] + 3 * far).tolist() == [0]


@pytest.mark.parametrize("count", [1, 2, 5, 8])
def test_quantiles_are_those_of_numpy(count):
    values = np.random.default_rng(count).normal(size=count)
    assert _quantile(values, 0.75) == pytest.approx(np.quantile(values, 0.75), rel=1e-12)
