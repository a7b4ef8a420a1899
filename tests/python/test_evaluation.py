import numpy as np
import pytest
from scipy.optimize import least_squares

import oracle
from dqslam import Camera, Estimate, PoseModel, _core, evaluate
from dqslam.metrics import (
    box_volumes,
    cube_volumes,
    ellipsoid_volumes,
    position_error,
)
from dqslam.recording import Truth

RANDOM = np.random.default_rng(5)


def quadric(center, shape):
    """q1 .. q9 of center and shape, written out: upper triangle of c c^T - S, and c."""
    c, m = np.asarray(center), np.outer(center, center) - np.asarray(shape)
    return [m[0, 0], m[0, 1], m[0, 2], c[0], m[1, 1], m[1, 2], c[1], m[2, 2], c[2]]


def estimate(poses, quadrics, object_ids, ellipsoids=None):
    poses, quadrics = np.array(poses, dtype=float), np.array(quadrics, dtype=float)
    return Estimate(
        pose_model=PoseModel.SE2,
        camera=Camera(500.0, 500.0, 319.5, 239.5, 640, 480),
        timestamps=np.arange(len(poses), dtype=float),
        poses=poses,
        initial_poses=poses + [3.0, 4.0, 0.0],
        object_ids=np.array(object_ids),
        class_names=("cube",) * len(object_ids),
        observations=np.ones(len(object_ids), dtype=np.int64),
        dual_quadrics=quadrics,
        ellipsoids=np.zeros((len(object_ids), 9)) if ellipsoids is None else ellipsoids,
    )


def truth(poses, center, volume):
    return Truth(
        pose_model=PoseModel.SE2,
        poses=poses,
        object_ids=[4, 5, 6],
        centers=center,
        volumes=volume,
        class_names=("cube",) * 3,
    )


TRUE_POSES = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
TRUE_CENTERS = [[9.0, 9.0, 9.0], [1.0, 2.0, 0.0], [5.0, 5.0, 1.0]]


def test_the_papers_metrics_by_hand():
    # Errors of 0, 5 and 1 m; a wrong heading does not count. Objects 6 and 5 are 2 and 1 m off.
    found = estimate(
        poses=[[0.0, 0.0, 3.0], [4.0, 4.0, 0.0], [2.0, -1.0, 0.0]],
        quadrics=[
            quadric([5.0, 7.0, 1.0], np.diag([0.25, 1.0, 4.0])),  # cube of side 2 * 0.5
            quadric([1.0, 2.0, -1.0], np.diag([4.0, 1.0, 9.0])),  # cube of side 2 * 1
        ],
        object_ids=[6, 5],
    )
    report = evaluate(found, truth(TRUE_POSES, TRUE_CENTERS, [100.0, 2.0, 1.5]))
    assert report.rmse_pos == pytest.approx((0.0 + 5.0 + 1.0) / 3.0)
    assert report.odometry_rmse_pos == pytest.approx(
        (5.0 + np.hypot(6.0, 8.0) + np.hypot(3.0, 3.0)) / 3.0
    )
    assert report.rmse_landmark == pytest.approx((2.0 + 1.0) / 2.0)
    assert report.rmse_volume == pytest.approx((abs(1.0 - 1.5) + abs(8.0 - 2.0)) / 2.0)
    assert (report.mapped, report.not_ellipsoids) == (2, 0)
    assert "position error     2.000 m   (odometry 6.414 m)" in str(report)


def test_objects_that_are_no_ellipsoids_are_counted():
    no_ellipsoid = np.array([[np.nan] * 9, [0.0] * 9])
    quadrics = [quadric([1, 2, 0], -np.eye(3)), quadric([5, 5, 1], np.eye(3))]
    found = estimate(TRUE_POSES, quadrics, [5, 6], no_ellipsoid)
    report = evaluate(found, truth(TRUE_POSES, TRUE_CENTERS, [1.0, 8.0, 8.0]))
    assert report.not_ellipsoids == 1
    # S = -I, the paper's own start: its cube has the side 2 sqrt|-1|.
    assert report.rmse_volume == pytest.approx(0.0)


def test_cube_volume_is_of_the_smallest_axis_whatever_the_orientation():
    semi_axes = np.array([0.7, 0.2, 0.4])
    for _ in range(5):
        xyzw = RANDOM.normal(size=4)
        rotation = oracle.quaternion_matrix(xyzw / np.linalg.norm(xyzw))
        shape = rotation @ np.diag(semi_axes**2) @ rotation.T
        np.testing.assert_allclose(cube_volumes(shape[None]), 0.4**3)


def test_an_object_that_the_truth_does_not_know_is_refused():
    found = estimate(TRUE_POSES, [quadric([0, 0, 0], np.eye(3))], [9])
    with pytest.raises(ValueError, match="object 9 of the estimate is not in the truth"):
        evaluate(found, truth(TRUE_POSES, TRUE_CENTERS, [1.0] * 3))


def test_position_error_of_se3_has_three_axes():
    true = np.tile([0.0, 0, 0, 0, 0, 0, 1], (2, 1))
    moved = true + [[2.0, 3.0, 6.0, 0, 0, 0, 0], [0.0] * 7]
    assert position_error(PoseModel.SE3, moved, true) == pytest.approx(3.5)


def test_estimate_reads_centers_and_shapes_from_quadrics():
    ellipsoid = _core.ellipsoid_from_axes([1.0, -2.0, 0.5], [0.5, 0.3, 0.2], [0.6, 0.0, 0.0, 0.8])
    found = estimate(TRUE_POSES, [_core.dual_quadric_from_ellipsoid(ellipsoid)], [4])
    rotation = oracle.quaternion_matrix([0.6, 0.0, 0.0, 0.8])
    np.testing.assert_allclose(found.centers, [[1.0, -2.0, 0.5]])
    shape = rotation @ np.diag([0.25, 0.09, 0.04]) @ rotation.T
    np.testing.assert_allclose(found.shapes[0], shape, atol=1e-12)


# --- volumes -------------------------------------------------------------------------------------


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_volume_of_an_ellipsoid_is_that_of_a_turned_one():
    shape = turned(0.7) @ np.diag([4.0, 1.0, 0.25]) @ turned(0.7).T
    np.testing.assert_allclose(ellipsoid_volumes(shape[None]), 4.0 / 3.0 * np.pi * 2.0 * 1.0 * 0.5)


@pytest.mark.parametrize(
    ("sides", "tolerance"),
    [((0.5, 0.5, 0.5), 1e-3), ((0.6, 0.4, 0.9), 0.02), ((1.0, 0.4, 0.3), 0.09)],
)
def test_volume_of_a_box_seen_from_all_around(sides, tolerance):
    """Fit an ellipse to the half widths of a box from all sides; its height is seen from afar."""
    angle = np.linspace(0.0, np.pi, 400, endpoint=False)
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    half_width = np.abs(normal) @ np.array(sides[:2]) / 2.0

    def misfit(ground):
        xx, xy, yy = ground
        squared = xx * normal[:, 0] ** 2 + 2.0 * xy * normal.prod(axis=1) + yy * normal[:, 1] ** 2
        return np.sqrt(squared) - half_width

    xx, xy, yy = least_squares(misfit, [sides[0] ** 2 / 4.0, 0.0, sides[1] ** 2 / 4.0]).x
    shape = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, sides[2] ** 2 / 4.0]])
    shape = turned(0.4) @ shape @ turned(0.4).T
    np.testing.assert_allclose(box_volumes(shape[None]), np.prod(sides), rtol=tolerance)


def test_relative_errors_of_volumes_leave_out_what_is_no_ellipsoid():
    shape = np.diag([0.04, 0.01, 0.09])
    found = estimate(
        TRUE_POSES,
        [quadric([1, 2, 3], shape), quadric([1, 2, 3], -np.eye(3))],
        [4, 5],
        ellipsoids=np.array([np.zeros(9), np.full(9, np.nan)]),
    )
    report = evaluate(found, truth(TRUE_POSES, TRUE_CENTERS, [0.02, 1.0, 1.0]))
    box = 8.0 * (np.pi / 4.0) ** 2 * 0.2 * 0.1 * 0.3
    assert report.volume_relative_errors == pytest.approx((box / 0.02 - 1.0,))
    assert f"{box / 0.02 - 1.0:.0%} off" in str(report)
