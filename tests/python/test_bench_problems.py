"""The problems of the benchmarks, at tiny sizes."""

import numpy as np
import pytest
from benchmarks.cases import CASES
from benchmarks.files import load_problem, save_problem
from benchmarks.problems import BOX_SIGMA_PX, chain, paper

from bench import tiny
from dqslam import _core
from oracle import bounding_box, ellipsoid_surface, se2_matrix


@pytest.mark.parametrize(
    ("case", "size"),
    [
        ("peer-1", (521, 10, 1825)),
        ("peer-9", (5321, 99, 22357)),
        ("peer-84", (50321, 1008, 236810)),
    ],
)
def test_sizes_are_those_published(case, size):
    problem = CASES[case].problem(seed=0)
    objects = np.unique(problem.recording.detections.object_id)
    boxes = problem.recording.detections
    assert (len(problem.truth.poses), len(objects), len(boxes)) == size
    assert problem.peer_centers.shape == (size[1], 3)
    assert (np.diff(boxes.pose) >= 0).all()


def test_loop_by_hand():
    poses = chain(2, 1, 0, 1.0).truth.poses
    np.testing.assert_allclose(poses[79], [19.75, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(poses[80], [20.0, 0.0, np.pi / 2.0], atol=1e-12)
    np.testing.assert_allclose(poses[130], [20.0, 12.5, np.pi], atol=1e-12)
    np.testing.assert_allclose(poses[[260, 520], :2], np.zeros((2, 2)), atol=1e-12)
    np.testing.assert_allclose(poses[600, :2], [20.0, 0.0], atol=1e-12)  # the second area
    assert len(poses) == 1121


def test_a_seed_is_one_problem():
    first, again, other = (chain(1, 4, seed, 0.5) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.recording.detections.box, again.recording.detections.box)
    np.testing.assert_array_equal(first.peer_centers, again.peer_centers)
    assert not np.array_equal(first.truth.centers, other.truth.centers)


def test_noise_is_a_factor_on_odometry():
    errors = [
        chain(1, 2, 5, noise).recording.odometry.relative
        - chain(1, 2, 5, 1e-9).recording.odometry.relative
        for noise in (0.5, 1.0)
    ]
    np.testing.assert_allclose(errors[1], 2.0 * errors[0], atol=1e-9)
    is_turn = np.zeros(520, dtype=bool)
    is_turn[[79, 129, 209, 259, 339, 389, 469, 519]] = True
    assert errors[1][:, 0].std() == pytest.approx(0.02, rel=0.1)
    assert errors[1][~is_turn, 2].std() == pytest.approx(0.02, rel=0.1)
    assert 0.04 < errors[1][is_turn, 2].std() < 0.2


def test_covariance_is_along_the_axes_of_the_next_pose():
    odometry = chain(1, 2, 0, 1.0).recording.odometry
    turned = odometry.relative[0, 2]
    axes = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    np.testing.assert_allclose(
        odometry.covariance[0, :2, :2], axes.T @ np.diag([0.02**2, 0.005**2]) @ axes, atol=1e-15
    )
    assert odometry.covariance[0, 2, 2] == pytest.approx(0.02**2)
    assert odometry.covariance[79, 2, 2] == pytest.approx(0.1**2)


def test_boxes_are_those_of_sampled_ellipsoids_and_a_pixel_of_noise():
    problem = chain(1, 2, 0, 1.0)
    boxes, truth = problem.recording.detections, problem.truth
    errors = []
    for row in range(0, len(boxes), 10):
        center, axes, turn = _core.axes_from_ellipsoid(truth.ellipsoids[boxes.object_id[row]])
        np.testing.assert_allclose(axes, [0.5, 0.4, 0.3], rtol=1e-12)
        robot = se2_matrix(truth.poses[boxes.pose[row]])
        surface = ellipsoid_surface(center, axes, turn, count=100)
        errors.append(boxes.box[row] - bounding_box(problem.recording.camera, robot, surface))
    assert len(errors) > 30
    assert np.std(errors) == pytest.approx(BOX_SIGMA_PX, rel=0.2)
    assert abs(np.mean(errors)) < 0.2


def test_peers_start_near_the_truth():
    problem = chain(4, 10, 0, 1e-6)
    assert np.std(problem.peer_centers - problem.truth.centers) == pytest.approx(0.3, rel=0.2)


def test_paper_has_ellipsoids_and_boxes_only():
    problem = paper(0, 1.0)
    assert len(problem.truth.poses) == 253
    assert problem.recording.positions is None
    assert problem.truth.ellipsoids.shape == (10, 9)
    half = paper(0, 0.5).recording.odometry
    whole = problem.recording.odometry
    np.testing.assert_allclose(half.covariance[:, 2, 2], 0.25 * whole.covariance[:, 2, 2])


def test_problem_survives_its_file(tmp_path):
    problem = tiny()
    save_problem(problem, tmp_path / "problem.npz")
    recording, centers = load_problem(tmp_path / "problem.npz")
    np.testing.assert_array_equal(centers, problem.peer_centers)
    np.testing.assert_array_equal(recording.detections.box, problem.recording.detections.box)
    np.testing.assert_array_equal(
        recording.odometry.covariance, problem.recording.odometry.covariance
    )
    with np.load(tmp_path / "problem.npz") as arrays:
        chained = arrays["camera_poses"][0]
        for step in arrays["camera_steps"]:
            chained = chained @ step
        np.testing.assert_allclose(chained, arrays["camera_poses"][-1], atol=1e-12)
        robot = se2_matrix(problem.recording.odometry.first_pose)
        np.testing.assert_allclose(
            arrays["camera_poses"][0], robot @ arrays["camera_in_robot"], atol=1e-12
        )
