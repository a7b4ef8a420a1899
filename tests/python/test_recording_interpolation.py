"""Poses between poses, along arcs and screws; a split step is as uncertain as the whole one."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam import _core
from dqslam.recording import Odometry
from dqslam.recording.interpolation import (
    exponential,
    interpolate_poses,
    logarithm,
    split_steps,
)


def test_a_quarter_of_a_circle_is_halved_by_hand():
    """From (1, 0) heading north to (0, 1) heading west: at half of it, (1, 1) / sqrt(2)."""
    poses = np.array([[1.0, 0.0, np.pi / 2], [0.0, 1.0, np.pi]])
    half = interpolate_poses(np.array([0.0, 2.0]), poses, np.array([1.0]))
    np.testing.assert_allclose(half, [[np.sqrt(0.5), np.sqrt(0.5), 0.75 * np.pi]], atol=1e-12)


def test_a_screw_keeps_its_velocity():
    """Half a turn about z while rising by 2 m: after a quarter of it, 45 degrees and 0.5 m."""
    turn = Rotation.from_rotvec([0, 0, np.pi]).as_quat()
    poses = np.array([[1.0, 0, 0, 0, 0, 0, 1], [-1.0, 0, 2, *turn]])
    found = interpolate_poses(np.array([0.0, 4.0]), poses, np.array(1.0))
    np.testing.assert_allclose(found[:3], [np.sqrt(0.5), np.sqrt(0.5), 0.5], atol=1e-12)
    np.testing.assert_allclose(
        Rotation.from_quat(found[3:]).as_rotvec(), [0, 0, np.pi / 4], atol=1e-12
    )


def test_poses_at_their_times_are_themselves_and_ends_are_kept():
    random = np.random.default_rng(0)
    poses = exponential(random.normal(0, 1, (5, 6)))
    times = np.array([0.0, 1.0, 1.5, 4.0, 5.0])
    np.testing.assert_array_equal(interpolate_poses(times, poses, times), poses)
    np.testing.assert_array_equal(
        interpolate_poses(times, poses, np.array([[-3.0, 9.0]])), poses[[[0, -1]]]
    )


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e-7, 0.0])
def test_exponential_and_logarithm_against_matrices(scale):
    """The oracle is the exponential of 4 x 4 matrices."""
    twists = scale * np.random.default_rng(1).normal(0, 0.8, (20, 6))
    poses = exponential(twists)
    for twist, pose in zip(twists, poses, strict=True):
        x, y, z = twist[3:]
        generator = np.zeros((4, 4))
        generator[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        generator[:3, 3] = twist[:3]
        matrix = expm(generator)
        np.testing.assert_allclose(pose[:3], matrix[:3, 3], atol=1e-12)
        np.testing.assert_allclose(
            Rotation.from_quat(pose[3:]).as_matrix(), matrix[:3, :3], atol=1e-12
        )
    np.testing.assert_allclose(logarithm(poses), twists, atol=1e-12)
    flat = twists[:, [0, 1, 5]]
    np.testing.assert_allclose(logarithm(exponential(flat)), flat, atol=1e-12)


@pytest.mark.parametrize("size", [3, 6])
def test_parts_of_a_step_add_up_to_it(size):
    """Motions compose to the step, and covariances, carried to its end, add up to its own."""
    random = np.random.default_rng(2)
    model = _core.PoseModel.SE2 if size == 3 else _core.PoseModel.SE3
    steps = exponential(random.normal(0, 0.5, (3, size)))
    path = _core.dead_reckon(model, exponential(np.zeros((1, size)))[0], steps)
    root = random.normal(size=(3, size, size))
    odometry = Odometry.from_poses(path, covariance=root @ root.transpose(0, 2, 1) + np.eye(size))
    split, times = split_steps(odometry, np.arange(4.0), np.array([1.25, 1.5, 1.0, 7.0, -1.0]))
    assert times.tolist() == [0, 1, 1.25, 1.5, 2, 3]
    longer = _core.dead_reckon(model, split.first_pose, split.relative)
    np.testing.assert_allclose(longer[[0, 1, 4, 5]], path, atol=1e-12)
    np.testing.assert_array_equal(split.covariance[[0, 4]], odometry.covariance[[0, 2]])
    total = np.zeros((size, size))
    for part in (1, 2, 3):
        end = _core.between(model, longer[[4]], longer[[part + 1]])
        (carried,) = _core.adjoint(model, end)
        total += carried @ split.covariance[part] @ carried.T
    np.testing.assert_allclose(total, odometry.covariance[1], atol=1e-12)
    trace = np.trace(split.covariance, axis1=1, axis2=2)
    assert trace[3] == pytest.approx(0.5 * np.trace(odometry.covariance[1]))


def test_images_between_poses_get_their_own(tmp_path):
    """Every other pose is left out: its image is still used, from a pose between the others."""
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=5)
    dq.io.save_recording(recording, tmp_path)
    path = tmp_path / "odometry.txt"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[::2]))
    files = [tmp_path / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    thin, dropped = dq.load_recording(*files)
    near, _ = dq.load_recording(*files, interpolate=False)
    late = recording.detections.pose == 149
    assert late.any()
    assert thin.timestamps.tolist() == recording.timestamps[:149].tolist()
    assert len(near.timestamps) == 75
    assert (dropped.repeated, dropped.without_pose) == (0, np.sum(late))
    assert len(thin.detections) == np.sum(~late)
    # Along the geodesic, what was left out is nearly where it was: 8 cm a step, 1 cm of noise.
    path = _core.dead_reckon(_core.PoseModel.SE3, thin.odometry.first_pose, thin.odometry.relative)
    odometry = recording.odometry
    truth = _core.dead_reckon(_core.PoseModel.SE3, odometry.first_pose, odometry.relative)
    off = np.linalg.norm(path[1::2, :3] - truth[1:149:2, :3], axis=1)
    assert np.median(off) < 0.02
