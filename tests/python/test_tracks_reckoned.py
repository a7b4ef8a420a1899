"""How a path by odometry alone errs, against the sum over all steps."""

import numpy as np
import pytest

from dqslam import Odometry, PoseModel, _core
from dqslam.tracks import reckoned_covariance


def odometry(model, count, seed):
    random = np.random.default_rng(seed)
    size = 3 if model == PoseModel.SE2 else 6
    poses = random.normal(size=(count, 3 if size == 3 else 7))
    if size == 6:
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    roots = 0.1 * random.normal(size=(count - 1, size, size))
    covariance = roots @ roots.transpose(0, 2, 1) + 1e-4 * np.eye(size)
    return Odometry.from_poses(poses, covariance=covariance), poses


@pytest.mark.parametrize("model", [PoseModel.SE2, PoseModel.SE3])
def test_the_covariance_is_that_of_small_errors_of_all_steps(model):
    """Each step is disturbed along each axis, and the path reckoned again."""
    measured, poses = odometry(model, 6, 1)
    size, e = measured.covariance.shape[1], 1e-6
    images = np.array([1, 2, 5])
    change = np.zeros((3 * size, 5 * size))
    for step in range(5):
        for axis in range(size):
            noise = np.zeros((5, size))
            noise[step, axis] = e
            relative = _core.plus(model, measured.relative, noise)
            path = _core.dead_reckon(model, measured.first_pose, relative)
            off = _core.minus(model, path[images], poses[images])
            change[:, size * step + axis] = off.ravel() / e
    whole = np.zeros((5 * size, 5 * size))
    for step, own in enumerate(measured.covariance):
        place = slice(size * step, size * step + size)
        whole[place, place] = own
    expected = change @ whole @ change.T
    found = reckoned_covariance(measured, poses, images)
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def test_the_first_pose_is_exact():
    measured, poses = odometry(PoseModel.SE3, 4, 2)
    found = reckoned_covariance(measured, poses, np.array([0, 3]))
    np.testing.assert_array_equal(found[:6], 0.0)
    assert np.linalg.eigvalsh(found[6:, 6:]).min() > 0.0
