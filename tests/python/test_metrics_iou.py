import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import orbit
from dqslam import Camera, _core
from dqslam.metrics import box_iou, ellipsoid_iou, match_boxes, reprojection_iou
from dqslam.solids import Solids


def test_boxes_by_hand():
    boxes = np.array([[0, 0, 2, 2], [0, 0, 2, 2], [0, 0, 2, 2], [0, 0, 2, 2.0]])
    others = np.array([[0, 0, 2, 2], [1, 1, 3, 3], [2, 0, 4, 2], [0.5, 0.5, 1, 1.5]])
    np.testing.assert_allclose(box_iou(boxes, others), [1, 1 / 7, 0, 0.5 / 4])


def ball(center, radius):
    return _core.ellipsoid_from_axes(center, [radius] * 3, [0, 0, 0, 1])


def test_balls_by_hand():
    """The lens of two balls of radius r at distance d: pi (4 r + d) (2 r - d)^2 / 12."""
    for distance in (0.2, 1.0, 1.7):
        lens = np.pi * (4 + distance) * (2 - distance) ** 2 / 12
        expected = lens / (8 / 3 * np.pi - lens)
        found = ellipsoid_iou(ball([1, 2, 3], 1), ball([1, 2, 3 + distance], 1))
        assert found == pytest.approx(expected, abs=0.002)
    assert ellipsoid_iou(ball([0, 0, 0], 1), ball([0, 0, 2.01], 1)) == 0.0
    assert ellipsoid_iou(ball([0, 0, 0], 1), ball([0.1, 0, 0], 2)) == pytest.approx(1 / 8)
    assert ellipsoid_iou(ball([0, 0, 0], 1), ball([0, 0, 0], 1)) == pytest.approx(1.0, abs=1e-3)


def stretched(ellipsoid, factor):
    """Return the image of an ellipsoid under x -> factor x, from its dual quadric."""
    homogeneous = np.eye(4)
    homogeneous[:3, :3] = factor
    quadric = _core.dual_quadric_matrix(_core.dual_quadric_from_ellipsoid(ellipsoid))
    image = homogeneous @ quadric @ homogeneous.T
    return _core.ellipsoid_from_dual_quadric(image[np.triu_indices(4)][:9])


def test_ellipsoids_overlap_as_the_balls_they_are_images_of():
    factor = np.array([[2.0, 0.3, 0.0], [0.0, 0.5, -0.4], [0.7, 0.0, 1.0]])
    balls = ball([0.3, -0.2, 0.1], 1.0), ball([0.8, 0.4, -0.3], 0.8)
    found = ellipsoid_iou(*(stretched(one, factor) for one in balls))
    assert found == pytest.approx(ellipsoid_iou(*balls), abs=0.003)
    assert found == pytest.approx(ellipsoid_iou(*(stretched(b, factor) for b in balls[::-1])))


def test_sampling_agrees_with_brute_force():
    random = np.random.default_rng(0)
    axes, turns = random.uniform(0.5, 1.5, (2, 3)), Rotation.random(2, random_state=1)
    centers = np.array([[0, 0, 0], [0.4, 0.3, -0.2]])
    points = random.uniform(-2.5, 2.5, (400_000, 3))
    inside = [
        np.linalg.norm(turn.inv().apply(points - c) / a, axis=1) <= 1.0
        for c, a, turn in zip(centers, axes, turns, strict=True)
    ]
    expected = np.mean(inside[0] & inside[1]) / np.mean(inside[0] | inside[1])
    ellipsoids = [
        _core.ellipsoid_from_axes(c, a, turn.as_quat())
        for c, a, turn in zip(centers, axes, turns, strict=True)
    ]
    assert ellipsoid_iou(*ellipsoids) == pytest.approx(expected, abs=0.01)
    assert ellipsoid_iou(*ellipsoids) == ellipsoid_iou(*ellipsoids)


def test_boxes_find_their_true_ones_pose_by_pose():
    boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [0, 0, 10, 10], [50, 50, 60, 60.0]])
    true = np.array([[0, 0, 10, 10], [4, 0, 14, 10], [0, 0, 10, 10.0]])
    # In pose 0 both boxes prefer true box 0; together (0, 0) and (1, 1) overlap the most.
    found = match_boxes(np.array([0, 0, 1, 1]), boxes, np.array([0, 0, 1]), true)
    np.testing.assert_array_equal(found, [0, 1, 2, -1])
    strict = match_boxes(np.array([0, 0, 1, 1]), boxes, np.array([0, 0, 1]), true, min_iou=0.9)
    np.testing.assert_array_equal(strict, [0, -1, 2, -1])
    none = match_boxes(np.array([0, 0, 1, 1]), boxes, np.array([5, 5, 5]), true)
    np.testing.assert_array_equal(none, [-1, -1, -1, -1])


CAMERA = Camera(*(orbit.CAMERA[name] for name in ("fx", "fy", "cx", "cy", "width", "height")))


def test_projections_of_the_truth_are_its_boxes():
    truth = orbit.make_orbit(count=5)
    # A ball: orbit.py keeps its turns to itself.
    (pose, name), _ = next(iter(truth.boxes.items()))
    center, poses = truth.centers[name], truth.poses[[pose]]
    turn = Rotation.from_quat(poses[0, 3:]).as_matrix()
    surface = center + 0.07 * orbit.sphere(200)
    box = orbit.bounding_box((surface - poses[0, :3]) @ turn)[None]
    whole = np.zeros((1, 4), dtype=bool)
    one = Solids.of_ellipsoids(ball(center, 0.07)[None])
    assert reprojection_iou(CAMERA, poses, one, box, whole)[0] == pytest.approx(1.0, abs=1e-3)
    half = box.copy()
    half[0, 2] = half[0, [0, 2]].mean()
    assert reprojection_iou(CAMERA, poses, one, half, whole)[0] == pytest.approx(0.5, abs=1e-3)
    cut = np.array([[False, False, True, False]])
    assert reprojection_iou(CAMERA, poses, one, half, cut)[0] == pytest.approx(1.0, abs=1e-3)
    # Wholly beyond the cut edge: nothing of it is in the box.
    beyond = box.copy()
    beyond[0, [0, 2]] = box[0, 0] - [60, 20]
    assert reprojection_iou(CAMERA, poses, one, beyond, cut)[0] == 0.0


def test_what_is_behind_or_no_ellipsoid_overlaps_nothing():
    poses = np.tile([0.0, 0, 0, 0, 0, 0, 1], (2, 1))
    boxes, whole = np.tile([0.0, 0, 100, 100], (2, 1)), np.zeros((2, 4), dtype=bool)
    solids = Solids.of_ellipsoids(np.array([ball([0, 0, -5], 1), np.full(9, np.nan)]))
    np.testing.assert_array_equal(reprojection_iou(CAMERA, poses, solids, boxes, whole), 0.0)
