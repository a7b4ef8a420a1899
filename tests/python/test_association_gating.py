from itertools import product

import numpy as np
import pytest
from scipy.stats import chi2

from dqslam import PoseModel, _core
from dqslam.association import CHI2_GATE, gating
from dqslam.association.assignment import assign
from dqslam.association.gating import (
    GATE,
    PredictedBoxes,
    pair_costs,
    predict_boxes,
    predict_certain_boxes,
)
from dqslam.association.occlusion import hidden_edges
from dqslam.association.scene_map import SceneMap
from dqslam.assumptions import BoxNoise
from scenes import CAMERA, cut_by_the_border, outline

POSE = np.array([0.2, -0.1, 0.3, 0.0, 0.0, np.sin(0.1), np.cos(0.1)])
SIGMAS = np.concatenate([np.full(3, 0.02), np.full(3, 0.004), np.full(3, 0.05), np.full(6, 0.03)])
BOX_COVARIANCE = np.diag([4.0, 4.0, 9.0, 9.0])


def ellipsoid(center, semi_axes=(0.3, 0.2, 0.25)):
    return _core.ellipsoid_from_axes(np.array(center, float), np.array(semi_axes), [0, 0, 0, 1])


def joint_covariance(count):
    """Of a pose and so many objects, all correlated: (6 + 9 count,) squared."""
    size = 6 + 9 * count
    sigma = np.concatenate([SIGMAS[:6], np.tile(SIGMAS[6:], count)])
    mixed = np.eye(size) + 0.3 * np.random.default_rng(0).normal(size=(size, size)) / size**0.5
    root = sigma[:, None] * mixed
    return root @ root.T


def predicted_box():
    """One box, whose covariance is not diagonal."""
    return predict_boxes(
        CAMERA, PoseModel.SE3, POSE, ellipsoid([0, 0, 4])[None], joint_covariance(1)
    )


def costs(predicted, box, truncated=None, probability=1.0):
    box = np.atleast_2d(box)
    count = len(box)
    return pair_costs(
        CAMERA,
        predicted,
        box,
        np.tile(BOX_COVARIANCE, (count, 1, 1)),
        np.zeros((count, 4), dtype=bool) if truncated is None else np.atleast_2d(truncated),
        np.full((count, len(predicted.box)), probability),
    )


def test_distances_of_simulated_boxes_follow_chi_square():
    """Pose and object drawn together from their covariance, and the detector's noise."""
    samples = 6000
    random = np.random.default_rng(1)
    covariance = joint_covariance(1)
    tangent = random.multivariate_normal(np.zeros(15), covariance, samples)
    poses = _core.plus(PoseModel.SE3, np.tile(POSE, (samples, 1)), tangent[:, :6])
    box, _ = _core.project_to_boxes(
        PoseModel.SE3, CAMERA, poses, ellipsoid([0, 0, 4]) + tangent[:, 6:]
    )
    box = box + random.multivariate_normal(np.zeros(4), BOX_COVARIANCE, samples)
    predicted = predicted_box()
    spread = predicted.covariance[0] + BOX_COVARIANCE
    log_det = np.linalg.slogdet(2 * np.pi * spread)[1]
    distance = costs(predicted, box).cost[:, 0] - log_det
    inside = np.isfinite(distance)
    assert inside.mean() == pytest.approx(0.999, abs=0.003)
    # The mean below the gate, of 4 degrees of freedom: x f4(x) is 4 f6(x).
    expected = 4.0 * chi2.cdf(GATE[4], 6) / chi2.cdf(GATE[4], 4)
    assert distance[inside].mean() == pytest.approx(expected, abs=0.15)
    # Neither the pose alone nor the detector alone would do.
    alone = np.einsum(
        "ni,ij,nj->n", box - predicted.box, np.linalg.inv(BOX_COVARIANCE), box - predicted.box
    )
    assert alone.mean() > 8.0


def test_gates_are_those_of_chi_square():
    np.testing.assert_allclose(CHI2_GATE[1:], chi2.ppf(0.99, [1, 2, 3, 4]), atol=0.01)
    np.testing.assert_allclose(GATE[1:], chi2.ppf(0.999, [1, 2, 3, 4]), atol=0.01)


def test_a_cost_by_hand():
    predicted = PredictedBoxes(
        object_row=np.array([0]),
        box=np.array([[100.0, 100.0, 140.0, 160.0]]),
        covariance=np.diag([5.0, 5.0, 7.0, 7.0])[None],
        out_of_sight=np.zeros((1, 4), dtype=bool),
        hidden=np.zeros((1, 4), dtype=bool),
    )
    cost = costs(predicted, [103.0, 100.0, 140.0, 156.0], probability=0.5)
    d2 = 3.0**2 / 9.0 + 4.0**2 / 16.0
    log_det = np.log((2 * np.pi) ** 4 * 9.0 * 9.0 * 16.0 * 16.0)
    assert cost.cost[0, 0] == pytest.approx(d2 + log_det - 2 * np.log(0.5))
    # Anywhere in the image, up to half as wide and high: each of four numbers is uniform.
    assert cost.null[0] == pytest.approx(2 * np.log((640 / 2 * 480 / 2) * (640 * 480)))


def test_cut_edges_drop_out():
    predicted = predicted_box()
    truncated = np.array([False, True, False, True])
    box = predicted.box[0] + [3.0, 0.0, -2.0, 0.0]
    near, far = (costs(predicted, box + cut, truncated) for cut in (0.0, [0, 500, 0, -700]))
    np.testing.assert_array_equal(near.cost, far.cost)
    kept = np.ix_([0, 2], [0, 2])
    spread = (predicted.covariance[0] + BOX_COVARIANCE)[kept]
    error = np.array([3.0, -2.0])
    by_hand = error @ np.linalg.solve(spread, error) + np.linalg.slogdet(2 * np.pi * spread)[1]
    assert near.cost[0, 0] == pytest.approx(by_hand)
    assert near.null[0] == pytest.approx(costs(predicted, box).null[0] / 2)
    assert np.isinf(costs(predicted, box, np.ones(4, dtype=bool)).cost).all()


def test_only_what_the_image_shows_is_predicted():
    places = [[0, 0, 4], [0, 0, -4], [9, 0, 4], [0, 0, 0.2], [2.6, 0, 4]]
    objects = np.array([ellipsoid(place) for place in places])
    at_origin = np.eye(7)[6]
    found = predict_boxes(CAMERA, PoseModel.SE3, at_origin, objects, joint_covariance(5))
    np.testing.assert_array_equal(found.object_row, [0, 4])
    box = outline(at_origin, np.array(places[0]), np.array([0.3, 0.2, 0.25]), np.eye(3))
    np.testing.assert_allclose(found.box[0], box, atol=1e-9)
    # That of several objects is that of each with the pose, whatever the others.
    own = np.concatenate([np.arange(6), 6 + 9 * 4 + np.arange(9)])
    alone = predict_boxes(
        CAMERA, PoseModel.SE3, at_origin, objects[4:], joint_covariance(5)[np.ix_(own, own)]
    )
    np.testing.assert_allclose(found.covariance[1], alone.covariance[0], rtol=1e-12)


def test_no_object_in_the_image():
    behind = np.array([ellipsoid([0, 0, -4])])
    found = predict_boxes(CAMERA, PoseModel.SE3, POSE, behind, joint_covariance(1))
    assert (found.box.shape, found.covariance.shape) == ((0, 4), (0, 4, 4))
    assert costs(found, [1.0, 1.0, 9.0, 9.0]).cost.shape == (1, 0)


def test_what_nearly_touches_the_camera_is_not_predicted():
    """Its box exists, but not those of the objects and poses around it."""
    for distance in np.linspace(0.2501, 0.2503, 9):
        objects = np.array([ellipsoid([0, 0, distance]), ellipsoid([0, 0, 4])])
        found = predict_boxes(CAMERA, PoseModel.SE3, np.eye(7)[6], objects, joint_covariance(2))
        assert np.isfinite(found.covariance).all()
        assert 1 in found.object_row


def test_a_perfect_estimate_fits_its_boxes_where_the_border_cuts_them():
    """Top and bottom are where the border cuts the object, not where it is highest."""
    recording, ellipsoids = cut_by_the_border()
    rows = np.arange(4)
    scene = SceneMap(recording, rows, box_noise=BoxNoise())
    np.testing.assert_allclose(scene.chi2(rows, ellipsoids, blur=0.0), 0.0, atol=1e-4)
    # Not all goes: an object half as large again sticks out to the left, at least.
    larger = ellipsoids + np.r_[0, 0, 0, np.log([1.5] * 3), 0, 0, 0]
    assert (scene.chi2(rows, larger, blur=0.0) > 2.0).all()


def test_what_the_object_touches_outside_the_image_drops_out_too():
    """Where it reaches that far, and on boxes that the image cut."""
    recording, ellipsoids = cut_by_the_border()
    boxes = recording.detections
    here = recording.odometry.first_pose
    found = predict_boxes(recording.camera, PoseModel.SE3, here, ellipsoids, joint_covariance(4))
    np.testing.assert_array_equal(found.object_row, np.arange(4))
    expected = np.zeros((4, 4), dtype=bool)
    expected[:, 2] = expected[1:, 1] = expected[1:, 3] = True
    np.testing.assert_array_equal(found.out_of_sight, expected)
    table = costs(found, boxes.box, boxes.truncated)
    for row in range(4):
        kept = np.flatnonzero(~expected[row])
        spread = (found.covariance[row] + BOX_COVARIANCE)[np.ix_(kept, kept)]
        # d^2 is zero; what is not compared is as likely as if the box showed something else.
        same = table.null[row] * (1.0 - len(kept) / 3.0)
        log_det = np.linalg.slogdet(2 * np.pi * spread)[1]
        assert table.cost[row, row] == pytest.approx(log_det + same, abs=1e-4)
    # An object that ends inside is too low: that counts.
    sunk = np.array([0.0, -40.0, 0.0, 0.0])
    assert (
        (costs(found, boxes.box + sunk, boxes.truncated).cost > table.cost + 1.0).diagonal().all()
    )
    # And where no border cut the box, all edges do.
    whole = costs(found, boxes.box)
    assert np.isinf(whole.cost[3, 3])


# --- assignment


@pytest.mark.parametrize("pairs_at_a_time", [1, 500, 1_000_000])
def test_certain_boxes_of_many_images_are_those_of_each_by_itself(monkeypatch, pairs_at_a_time):
    """Also with objects behind the camera, outside the image, and that hide others."""
    monkeypatch.setattr(gating, "MOST_PAIRS_AT_A_TIME", pairs_at_a_time)
    random = np.random.default_rng(4)
    moves = random.normal(size=(17, 6)) * np.repeat([0.3, 0.5], 3)
    poses = _core.plus(PoseModel.SE3, np.tile(POSE, (17, 1)), moves)
    centers = random.uniform([-2, -1, -1], [2, 1, 6], (24, 3))
    objects = np.array([ellipsoid(center) for center in centers])
    certain = np.zeros((6 + 9 * 24,) * 2)
    found = list(predict_certain_boxes(CAMERA, PoseModel.SE3, poses, objects, sees_hidden=True))
    assert len(found) == 17
    for pose, together in zip(poses, found, strict=True):
        alone = predict_boxes(CAMERA, PoseModel.SE3, pose, objects, certain)
        np.testing.assert_array_equal(together.object_row, alone.object_row)
        np.testing.assert_array_equal(together.box, alone.box)
        np.testing.assert_array_equal(together.covariance, alone.covariance)
        np.testing.assert_array_equal(together.out_of_sight, alone.out_of_sight)
        shown = objects[alone.object_row]
        hidden = hidden_edges(CAMERA, PoseModel.SE3, pose[None], shown)[0]
        np.testing.assert_array_equal(together.hidden, hidden)
    assert sum(one.hidden.sum() for one in found) > 10
    assert len({len(one.box) for one in found}) > 2


def test_certain_boxes_without_objects_or_images():
    none = list(predict_certain_boxes(CAMERA, PoseModel.SE3, POSE[None], np.zeros((0, 9))))
    assert [len(one.box) for one in none] == [0]
    objects = ellipsoid([0, 0, 4])[None]
    assert not list(predict_certain_boxes(CAMERA, PoseModel.SE3, np.zeros((0, 7)), objects))


def total_costs(cost, null):
    """Return every assignment, and its total cost: an object for one box at most."""
    boxes, objects = cost.shape
    for choice in product(range(-1, objects), repeat=boxes):
        taken = [one for one in choice if one >= 0]
        if len(taken) == len(set(taken)):
            pairs = zip(range(boxes), choice, strict=True)
            yield choice, sum(null[i] if j < 0 else cost[i, j] for i, j in pairs)


@pytest.mark.parametrize("seed", range(40))
def test_assignment_and_margins_are_those_of_trying_all(seed):
    random = np.random.default_rng(seed)
    boxes, objects = random.integers(1, 5, 2)
    cost = random.uniform(0.0, 20.0, (boxes, objects))
    cost[random.random(cost.shape) < random.choice([0.1, 0.7])] = np.inf
    null = random.uniform(5.0, 15.0, boxes)
    all_of_them = list(total_costs(cost, null))
    best, least = min(all_of_them, key=lambda entry: entry[1])
    column, margin = assign(cost, null)
    np.testing.assert_array_equal(column, best)
    for row in range(boxes):
        others = [total for choice, total in all_of_them if choice[row] != best[row]]
        second = min(others, default=np.inf)
        assert margin[row] == pytest.approx(second - least)


def test_two_boxes_that_might_trade_places_are_both_unsure():
    """Each alone is sure of its object by 10; that both trade costs 1 only."""
    cost = np.array([[0.0, 0.5], [0.5, 0.0]])
    column, margin = assign(cost, np.array([10.0, 10.0]))
    np.testing.assert_array_equal(column, [0, 1])
    np.testing.assert_allclose(margin, [1.0, 1.0])


def test_no_objects_or_no_boxes():
    for shape in ((3, 0), (0, 3), (0, 0)):
        column, margin = assign(np.zeros(shape), np.zeros(shape[0]))
        np.testing.assert_array_equal(column, np.full(shape[0], -1))
        np.testing.assert_array_equal(margin, np.full(shape[0], np.inf))
