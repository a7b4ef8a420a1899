"""Edges of boxes that nearer objects may hide."""

import numpy as np

from dqslam import (
    Camera,
    Detections,
    Odometry,
    PoseModel,
    Recording,
    RunOptions,
    _core,
    load_scenario,
    run,
    simulate,
)
from dqslam.association import associate
from dqslam.association.gating import pair_costs, predict_certain_boxes
from dqslam.association.occlusion import hidden_edges, shortened_edges

CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
HERE = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
CROWD = load_scenario("occlusion")


def ball(center, radius):
    return _core.ellipsoid_from_axes(np.array(center, float), np.full(3, radius), [0, 0, 0, 1])


def flags(*balls, poses=HERE):
    return hidden_edges(CAMERA, PoseModel.SE3, poses, np.array(balls))


def test_a_ball_before_the_right_edge_of_another_by_hand():
    """The far one spans 256 to 383 px, the near one 369 to 420: u = 319.5 + 500 x / z."""
    far, near = ball([0, 0, 4], 0.5), ball([0.3, 0, 2], 0.1)
    hidden = flags(far, near)
    assert hidden.shape == (1, 2, 4)
    assert hidden[0].tolist() == [[False, False, True, False], [False] * 4]
    assert flags(near, far)[0, 1].tolist() == [False, False, True, False]


def test_what_hides_only_the_middle_or_lies_behind_or_beside_hides_no_edge():
    far = ball([0, 0, 4], 0.5)
    assert not flags(far, ball([0, 0, 2], 0.1)).any()  # before its middle
    assert not flags(far, ball([0.6, 0, 6], 0.3))[0, 0].any()  # behind its right edge
    assert not flags(far, ball([0.6, 0, 2], 0.1)).any()  # beside it
    assert not flags(far, ball([0.3, 0, -2], 0.1)).any()  # behind the camera
    assert not flags(far).any()
    assert flags(far, poses=HERE[:0]).shape == (0, 1, 4)


def test_what_is_wholly_behind_another_has_no_edge_left():
    far, near = ball([0, 0, 4], 0.5), ball([0, 0, 2], 0.5)
    assert flags(far, near)[0].tolist() == [[True] * 4, [False] * 4]


def seen_from(poses, pose, box):
    """A recording of some boxes at poses by exact odometry."""
    boxes = Detections.from_xyxy(pose, np.array(box) + 0.5)
    steps = _core.between(PoseModel.SE3, poses[:-1], poses[1:])
    noise = np.tile(1e-6 * np.eye(6), (len(steps), 1, 1))
    odometry = Odometry(PoseModel.SE3, poses[0], steps, noise)
    return Recording(CAMERA, np.arange(float(len(poses))), odometry, boxes)


def test_only_an_edge_that_the_box_falls_short_of_is_one_sided():
    objects = np.array([ball([0, 0, 4], 0.5), ball([0.3, 0, 2], 0.1)])
    poses = np.concatenate([HERE + [[5.0, 0, 0, 0, 0, 0, 0]], HERE])
    whole = [256.5, 176.5, 382.5, 302.5]
    part, more, less = (whole[:2] + [u, 302.5] for u in (369.5, 396.0, 380.5))
    low = [256.5, 176.5, 382.5, 280.0]  # nothing hides its lower edge
    recording = seen_from(poses, [1] * 6, [whole, part, more, less, low, part])
    row = np.array([0, 0, 0, 0, 0, -1])
    found = shortened_edges(recording, poses, objects, row, np.full((6, 4), 9.0))
    assert np.argwhere(found).tolist() == [[1, 2]]
    # Behind an object that hides all of it, there would be no box.
    objects[1] = ball([0, 0, 2], 0.5)
    assert not shortened_edges(recording, poses, objects, row, np.full((6, 4), 9.0)).any()


def test_edges_that_are_not_flagged_are_those_of_the_whole_object():
    """The simulator finds what is seen of a crowd line by line."""
    exact = {"edge_sigma_px": 0.0, "occlusion_max_hidden": 0.9}
    crowd = CROWD.model_copy(update={"detector": CROWD.detector.model_copy(update=exact)})
    recording, truth = simulate(crowd, seed=3)
    boxes = recording.detections
    row = np.searchsorted(truth.object_ids, truth.box_object_id)
    model, objects = recording.odometry.pose_model, truth.ellipsoids
    flagged = hidden_edges(recording.camera, model, truth.poses, objects)[boxes.pose, row]
    whole, _ = _core.project_to_boxes(
        model, recording.camera, truth.poses[boxes.pose], objects[row]
    )
    shrunk = np.abs(boxes.box - whole) > 1.0
    assert shrunk.sum() > 50
    # Objects that are hidden by more than nine tenths hide, too, and have no boxes themselves.
    assert not (shrunk & ~flagged).any()
    # The margin flags edges that are just in view.
    assert flagged.sum() < 4 * shrunk.sum()
    one = np.ones((len(boxes), 4))
    short = shortened_edges(recording, truth.poses, objects, row, one)
    np.testing.assert_array_equal(short, shrunk & ~flagged.all(axis=1, keepdims=True))


def test_a_box_that_ends_before_a_hidden_edge_costs_nothing():
    far, near = ball([0, 0, 4], 0.5), ball([0.3, 0, 2], 0.1)
    objects = np.array([far, near])
    predicted = next(predict_certain_boxes(CAMERA, PoseModel.SE3, HERE, objects, sees_hidden=True))
    box = predicted.box[:1].copy()
    covariance, uncut = np.eye(4)[None], np.zeros((1, 4), dtype=np.bool_)
    whole = pair_costs(CAMERA, predicted, box, covariance, uncut, np.ones((1, 2))).cost[0, 0]
    box[0, 2] -= 14.0  # where the near one begins
    part = pair_costs(CAMERA, predicted, box, covariance, uncut, np.ones((1, 2))).cost[0, 0]
    anywhere = 2 * np.log((640 * 480) ** 2 / 4.0) / 4.0  # an edge that is not compared
    np.testing.assert_allclose(part, whole - np.log(2 * np.pi) + anywhere)
    box[0, 2] += 28.0  # beyond it: that is no part of what is predicted
    assert (
        pair_costs(CAMERA, predicted, box, covariance, uncut, np.ones((1, 2))).cost[0, 0] == np.inf
    )
    blind = next(predict_certain_boxes(CAMERA, PoseModel.SE3, HERE, objects))
    assert not blind.hidden.any()


def test_boxes_of_what_is_partly_hidden_fit_and_say_so():
    recording, truth = simulate(CROWD, seed=1)
    result = run(recording, RunOptions())
    assert len(result.estimate.object_ids) == len(truth.object_ids)
    added = result.detections.truncated & ~recording.detections.truncated
    assert 0.02 < added.mean() < 0.2
    # Hidden boxes that are taken for whole ones are 8 to 9 % of outliers here.
    assert result.report["boxes"]["outlier_share"] < 0.04
    error = np.linalg.norm(result.estimate.poses[:, :2] - truth.poses[:, :2], axis=1).mean()
    assert error < 0.04  # odometry: meters


def test_an_association_says_which_edges_may_be_hidden():
    recording, _ = simulate(load_scenario("orbit"), seed=1)
    found = associate(recording)
    assert found.hidden.shape == (len(recording.detections), 4)
    assert not found.hidden[found.object_id < 0].any()
