import numpy as np
import pytest

from dqslam import PoseModel, _core
from dqslam.association.noise import StepNoise, corrected
from dqslam.association.refine import ROUNDS, settle
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Odometry, Recording
from scenes import CAMERA, film, map_truly, orbit_poses, table_things


@pytest.fixture(scope="module")
def drive():
    return film(orbit_poses(120, turns=3), table_things(10), noise=OdometryNoise(), seed=3)


@pytest.mark.parametrize("factors", [(5.0, 5.0), (0.2, 0.2), (5.0, 0.2), (0.2, 5.0)])
def test_noise_is_recovered_from_a_start_far_off(drive, factors):
    units = StepNoise.between(drive.recording, np.arange(len(drive.poses)))
    # With units that are so much larger, the default is believed to be so much more.
    translation, rotation = np.square(factors)
    larger = StepNoise(translation * units.per_translation, rotation * units.per_rotation)
    scene = map_truly(drive, step_noise=larger)
    believed = np.sqrt(scene.recording.odometry.covariance[0, [0, 5], [0, 5]])
    np.testing.assert_allclose(believed, [0.01 * factors[0], 0.005 * factors[1]], rtol=1e-6)
    for _ in range(ROUNDS):
        settle(scene)
    # What was drawn; 357 numbers of each kind tell a sigma to 4 %.
    drawn = _core.minus(
        PoseModel.SE3,
        drive.recording.odometry.relative,
        _core.between(PoseModel.SE3, drive.poses[:-1], drive.poses[1:]),
    )
    found = scene.odometry_noise
    assert found.translation_m * factors[0] == pytest.approx(drawn[:, :3].std(), rel=0.15)
    # Low: the robust loss takes weight from boxes that fit, too.
    assert found.rotation_rad * factors[1] == pytest.approx(drawn[:, 3:].std(), rel=0.2)


def test_a_correction_by_hand():
    """Squares of 4 + 4 for a redundancy of 1 + 1, and one more of each for the damping."""

    class Fit:
        odometry_residuals = np.array([[2.0, 0.0, 2.0, 0.5, 0.0, 0.0]])
        odometry_leverage = np.array([[0.5, 0.5, 0.0, 1.0, 1.0, 1.0]])

    found = corrected(OdometryNoise(0.1, 0.01), Fit)
    assert found.translation_m == pytest.approx(0.1 * np.sqrt((8 + 1) / (2 + 1)))
    # Of what the boxes determine by themselves nothing can be learned: damped to what is believed.
    assert found.rotation_rad == pytest.approx(0.01 * np.sqrt((0.25 + 1) / (0 + 1)))


def test_levels_add_up_between_keyframes():
    """Three steps of 2 m straight ahead in SE(2): see the lever of what follows each turn."""
    odometry = Odometry(
        PoseModel.SE2, np.zeros(3), np.tile([2.0, 0.0, 0.0], (3, 1)), np.tile(np.eye(3), (3, 1, 1))
    )
    made = film(orbit_poses(4), table_things(1))
    recording = Recording(CAMERA, np.arange(4), odometry, made.recording.detections)
    noise = StepNoise.between(recording, np.array([0, 3]))
    np.testing.assert_allclose(noise.per_translation[0], np.diag([3.0, 3.0, 0.0]), atol=1e-12)
    turned = [[0, 0, 0], [0, 16 + 4 + 0, 4 + 2 + 0], [0, 6, 3]]
    np.testing.assert_allclose(noise.per_rotation[0], turned, atol=1e-12)
    both = noise.covariance(OdometryNoise(0.1, 0.02))[0]
    np.testing.assert_allclose(both, 0.01 * np.diag([3, 3, 0]) + 4e-4 * np.array(turned))
