"""Poses at the end of paths without loops: their errors in exponential coordinates."""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam import _core
from dqslam.io import Trajectory
from dqslam.uncertainty import Marginals, chi_square_interval, normalized_squares, tangent_errors

DRIVES = 120
AHEAD = [0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5]


def in_plane(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def in_space(pose):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(pose[3:]).as_matrix()
    matrix[:3, 3] = pose[:3]
    return matrix


def test_on_the_plane_errors_are_the_logarithm_of_matrices():
    random = np.random.default_rng(0)
    true, estimated = random.normal(size=(2, 20, 3))
    found = tangent_errors(dq.PoseModel.SE2, true, estimated)
    for error, one, other in zip(found, true, estimated, strict=True):
        log = logm(np.linalg.inv(in_plane(other)) @ in_plane(one)).real
        np.testing.assert_allclose(error, [log[0, 2], log[1, 2], log[1, 0]], atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-6, 1e-3, 1.0, 3.0])
def test_in_space_errors_are_those_whose_exponential_is_the_motion(angle):
    random = np.random.default_rng(1)
    axis = random.normal(size=3)
    vector = np.concatenate([random.normal(size=3), angle * axis / np.linalg.norm(axis)])
    x, y, z = vector[3:]
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    generator[:3, 3] = vector[:3]
    estimated = np.array([1.0, -2.0, 0.5, *Rotation.random(random_state=2).as_quat()])
    moved = in_space(estimated) @ expm(generator)
    true = np.concatenate([moved[:3, 3], Rotation.from_matrix(moved[:3, :3]).as_quat()])
    found = tangent_errors(dq.PoseModel.SE3, true[None], estimated[None])[0]
    np.testing.assert_allclose(found, vector, atol=1e-8)


def straight_drive(seed, yaw, steps=400):
    """Return truth and estimate of the end of a straight drive of 200 m, and its covariance.

    An object is seen at its beginning only, so that the rest is odometry.
    """
    random = np.random.default_rng(seed)
    true = np.column_stack([np.arange(steps + 1) * 0.5, np.zeros((steps + 1, 2))])
    sigma = np.array([0.02, 0.005, yaw])
    measured = _core.plus(
        dq.PoseModel.SE2,
        np.tile([0.5, 0.0, 0.0], (steps, 1)),
        random.normal(size=(steps, 3)) * sigma,
    )
    camera = dq.Camera(500, 500, 319.5, 239.5, 640, 480, robot_from_camera=AHEAD)
    ellipsoid = _core.ellipsoid_from_axes([8.0, 0.5, 0.2], [0.4, 0.3, 0.5], [0, 0, 0, 1])
    box, _ = _core.project_to_boxes(dq.PoseModel.SE2, camera, true[:4], np.tile(ellipsoid, (4, 1)))
    recording = dq.Recording(
        camera,
        np.arange(steps + 1.0),
        dq.Odometry(
            dq.PoseModel.SE2, np.zeros(3), measured, np.tile(np.diag(sigma**2), (steps, 1, 1))
        ),
        dq.Detections.from_xyxy(np.arange(4), box + 0.5 + random.normal(size=(4, 4)), object_id=0),
    )
    prior = dq.SizePrior(np.log(0.4), 0.3)
    graph = dq.build_graph(recording, box_noise=dq.BoxNoise(1.0, 0.0), size_prior=prior)
    estimate, _ = dq.solve(graph)
    return true[-1], estimate.poses[-1], dq.marginal_covariances(graph, estimate)


@cache
def nees_of_the_end(yaw):
    """Mean NEES of the last pose: in exponential coordinates, and with position and angle apart."""
    ends = [straight_drive(seed, yaw) for seed in range(DRIVES)]
    true, estimated = (np.array([one[i] for one in ends]) for i in (0, 1))
    covariance = np.array([one[2].poses[-1] for one in ends])
    model = dq.PoseModel.SE2
    errors = (tangent_errors(model, true, estimated), _core.minus(model, true, estimated))
    bent = np.mean([one[2].is_bent[-1] for one in ends])
    return *(normalized_squares(error, covariance).mean() for error in errors), bent


def test_a_straight_drive_of_200_m_is_honest_in_exponential_coordinates():
    """The heading at its end has a sigma of 5 degrees, and the position 10 m across."""
    low, high = chi_square_interval(3 * DRIVES)
    straight, split, bent = nees_of_the_end(0.0045)
    assert low < straight < high
    assert split > high
    assert bent == 0.0


def test_a_pose_whose_heading_is_lost_is_said_to_be_bent():
    """With a sigma of 11 degrees, the covariance is too narrow in any coordinates."""
    low, high = chi_square_interval(3 * DRIVES)
    straight, split, bent = nees_of_the_end(0.01)
    assert high < straight < split
    assert bent == 1.0


def test_only_rotations_bend():
    poses = np.array([np.diag([9.0, 9.0, 0.09**2]), np.diag([0.0, 0.0, 0.11**2])])
    assert Marginals(poses, np.zeros((0, 9, 9)), ()).is_bent.tolist() == [False, True]
    poses = np.array([np.diag([9.0] * 3 + [0.0, 0.0, 0.11**2]), np.full((6, 6), np.nan)])
    assert Marginals(poses, np.zeros((0, 9, 9)), ()).is_bent.tolist() == [True, False]


def test_evaluation_has_the_nees_of_the_poses_in_files(tmp_path):
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph = dq.build_graph(recording)
    estimate, _ = dq.solve(graph)
    marginals = dq.marginal_covariances(graph, estimate)
    dq.save_estimate(estimate, tmp_path, marginals=marginals)
    cameras = _core.world_from_camera(truth.pose_model, recording.camera, truth.poses)
    true = Trajectory(recording.timestamps, cameras)
    errors = tangent_errors(truth.pose_model, truth.poses, estimate.poses)[1:]
    expected = normalized_squares(errors, marginals.poses[1:])
    found = dq.evaluate_results(dq.load_results(tmp_path), true)["nees"]
    assert found["poses"] == 252
    assert found["mean"] == pytest.approx(expected.mean(), rel=1e-3)
    assert found["median"] == pytest.approx(np.median(expected), rel=1e-3)
    later = Trajectory(true.timestamps[5:], true.world_from_camera[5:])
    assert dq.evaluate_results(dq.load_results(tmp_path), later)["nees"] is None
