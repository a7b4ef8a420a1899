from types import SimpleNamespace

import numpy as np
import pytest

from dqslam import PoseModel, _core
from dqslam.association.noise import (
    PRIOR_RESIDUALS,
    StepNoise,
    better_variances,
    corrected,
    is_impossible,
    jump_inflation,
    usual_intervals,
)
from dqslam.association.refine import ROUNDS, settle
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Odometry, Recording
from scenes import CAMERA, film, map_truly, orbit_poses, table_things


def straight(steps, motion=(2.0, 0.0, 0.0), timestamps=None):
    """Drive by the same motion in SE(2) again and again."""
    odometry = Odometry(
        PoseModel.SE2, np.zeros(3), np.tile(motion, (steps, 1)), np.tile(np.eye(3), (steps, 1, 1))
    )
    made = film(orbit_poses(2), table_things(1))
    times = np.arange(steps + 1.0) if timestamps is None else timestamps
    return Recording(CAMERA, times, odometry, made.recording.detections.select(slice(0)))


@pytest.fixture(scope="module")
def drive():
    return film(orbit_poses(120, turns=3), table_things(10), noise=OdometryNoise(), seed=3)


@pytest.mark.parametrize("factors", [(5.0, 5.0), (0.2, 0.2), (5.0, 0.2), (0.2, 5.0)])
def test_noise_is_recovered_from_a_start_far_off(drive, factors):
    units = StepNoise.between(drive.recording, np.arange(len(drive.poses)))
    isotropic = StepNoise.isotropic(units.units[:3].sum(axis=0), units.units[3:6].sum(axis=0))
    levels = np.array([0.01, 0.005]) * factors
    scene = map_truly(drive, step_noise=isotropic, levels=levels)
    believed = np.sqrt(scene.recording.odometry.covariance[0, [0, 5], [0, 5]])
    np.testing.assert_allclose(believed, levels, rtol=1e-6)
    for _ in range(ROUNDS):
        settle(scene)
    # What was drawn; 357 numbers of each kind tell a sigma to 4 %.
    drawn = _core.minus(
        PoseModel.SE3,
        drive.recording.odometry.relative,
        _core.between(PoseModel.SE3, drive.poses[:-1], drive.poses[1:]),
    )
    found = scene.odometry_noise
    assert found.translation_m == pytest.approx(drawn[:, :3].std(), rel=0.15)
    # Low: the robust loss takes weight from boxes that fit, too.
    assert found.rotation_rad == pytest.approx(drawn[:, 3:].std(), rel=0.2)


def test_a_correction_by_hand():
    """Squares of 4 + 4 for a redundancy of 1 + 1, and one more of each for the damping."""
    fit = SimpleNamespace(
        odometry_residuals=np.array([[2.0, 0.0, 2.0, 0.5, 0.0, 0.0]]),
        odometry_leverage=np.array([[0.5, 0.5, 0.0, 1.0, 1.0, 1.0]]),
    )
    noise = StepNoise.isotropic(
        np.diag([1.0] * 3 + [0] * 3)[None], np.diag([0] * 3 + [1.0] * 3)[None]
    )
    found = corrected(noise, np.array([0.1, 0.01]), np.ones(1), fit, lowest=np.zeros(2))
    # Of what the boxes determine by themselves nothing can be learned: damped to what is believed.
    factors = np.sqrt([(8 + 1) / (2 + 1), (0.25 + 1) / (0 + 1)])
    np.testing.assert_allclose(found.levels, [0.1, 0.01] * factors)
    # The mean over the redundancies: only translations have one, 2 in all.
    assert found.change == pytest.approx(np.log(factors[0]))
    floor = corrected(noise, np.array([0.1, 0.01]), np.ones(1), fit, lowest=np.array([1.0, 0.0]))
    assert floor.levels[0] == 1.0


def test_levels_add_up_between_keyframes():
    """Three steps of 2 m straight ahead in SE(2): see the lever of what follows each turn."""
    noise = StepNoise.between(straight(3), np.array([0, 3]))
    assert noise.names == (
        "translation_x",
        "translation_y",
        "rotation_z",
        "length",
        "angle",
    )
    x, y, turn, length, angle = noise.units[:, 0]
    np.testing.assert_allclose(x, np.diag([3.0, 0.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(y, np.diag([0.0, 3.0, 0.0]), atol=1e-12)
    turned = [[0, 0, 0], [0, 16 + 4 + 0, 4 + 2 + 0], [0, 6, 3]]
    np.testing.assert_allclose(turn, turned, atol=1e-12)
    np.testing.assert_allclose(length, np.diag([3 * 2.0**2, 0, 0]), atol=1e-12)
    np.testing.assert_allclose(angle, 0.0, atol=1e-12)
    levels = np.array([0.1, 0.2, 0.02, 0.05, 9.0])
    both = noise.covariance(levels, np.array([4.0]))[0]
    by_hand = np.diag([0.01 * 3 + 0.0025 * 12, 0.04 * 3, 0]) + 4e-4 * np.array(turned)
    np.testing.assert_allclose(both, 4.0 * by_hand, atol=1e-12)
    # A step: 0.01 + 0.05^2 2^2 along x, 0.04 along y.
    typical = noise.typical(levels)
    assert typical.translation_m == pytest.approx(np.sqrt((0.02 + 0.04) / 2))
    assert typical.rotation_rad == pytest.approx(0.02)


def test_an_angle_counts_about_the_axis_that_is_turned_about():
    noise = StepNoise.between(straight(2, (0.0, 0.0, 0.5)), np.array([0, 1, 2]))
    np.testing.assert_allclose(noise.units[4], np.tile(np.diag([0, 0, 0.25]), (2, 1, 1)))


def test_a_gap_is_as_uncertain_as_the_steps_that_are_missing():
    times = np.array([0.0, 1.0, 2.0, 4.0, 14.0, 15.0])
    np.testing.assert_array_equal(usual_intervals(times), [1, 1, 1, 10, 1])  # twice is no gap
    noise = StepNoise.between(straight(5, timestamps=times), np.arange(6))
    np.testing.assert_allclose(noise.units[2, :, 2, 2], [1, 1, 1, 10, 1])
    np.testing.assert_array_equal(usual_intervals(np.zeros(1)), np.zeros(0))


def test_drawn_residuals_give_back_their_levels():
    """Noise of a robot: 2 cm ahead, 0.02 rad, and a quarter of the angle in turns; none sideways.

    Boxes that tell each step to a tenth of its noise: leverages are 0.01 once levels are right.
    """
    random = np.random.default_rng(5)
    recording = straight(400)
    turn = np.where(np.arange(400) % 16 < 4, 0.4, 0.0)
    relative = np.column_stack([np.full(400, 0.5), np.zeros(400), turn])
    odometry = Odometry(PoseModel.SE2, np.zeros(3), relative, recording.odometry.covariance)
    recording = Recording(CAMERA, np.arange(401.0), odometry, recording.detections)
    noise = StepNoise.between(recording, np.arange(401))
    sigma = np.column_stack([np.full(400, 0.02), np.full(400, 1e-4), np.hypot(0.02, 0.25 * turn)])
    error, measured = sigma * random.normal(size=sigma.shape), 0.01 * sigma**2
    error[100, 0] = 1.0  # a jump
    levels, inflation = np.array([0.3, 0.3, 0.05, 0.2, 0.2]), np.ones(400)
    lowest = 1e-4 * levels
    for _ in range(60):
        believed = np.einsum("sii->si", noise.covariance(levels, inflation))
        leverage = measured / (believed + measured)
        observed = error + np.sqrt(measured) * random.normal(size=sigma.shape)
        residuals = observed * (1.0 - leverage) / np.sqrt(believed)
        fit = SimpleNamespace(odometry_residuals=residuals, odometry_leverage=leverage)
        better = corrected(noise, levels, inflation, fit, lowest=lowest)
        levels, inflation = better.levels, better.inflation
    # All steps have one length: the sum of both parts is what can be told. 5 % are two sigmas.
    assert np.hypot(levels[0], 0.5 * levels[3]) == pytest.approx(0.02, rel=0.1)
    assert levels[1] < 1e-3
    assert levels[2] == pytest.approx(0.02, rel=0.15)
    assert levels[4] == pytest.approx(0.25, rel=0.2)
    assert np.flatnonzero(inflation > 1.0).tolist() == [100]
    assert np.sqrt(inflation[100]) * 0.02 == pytest.approx(1.0 / np.sqrt(3), rel=0.3)


def test_axes_that_differ_little_are_alike_and_others_are_not():
    kinds = np.zeros(3, dtype=int)
    one = np.ones(3)
    # One residual each, squares of 1, 1 and 3: nothing speaks against one level.
    alike = better_variances(one, np.array([1.0, 1.0, 3.0]), one, kinds)
    usual = (5.0 + PRIOR_RESIDUALS) / (3.0 + PRIOR_RESIDUALS)
    np.testing.assert_allclose(alike, usual, rtol=0.3)
    # A hundred residuals each, and hardly any noise on an axis: that one is left alone.
    told = better_variances(one, np.array([100.0, 100.0, 0.01]), 100.0 * one, kinds)
    np.testing.assert_allclose(told[:2], 1.0, rtol=0.1)
    assert told[2] < 0.05
    # Where all agree with what was believed, nothing changes.
    np.testing.assert_allclose(better_variances(one, 7.0 * one, 7.0 * one, kinds), 1.0, rtol=1e-5)


def test_a_jump_by_hand():
    """A step known to a tenth of its variance: redundancy 0.9, an error of 1 is a residual of 0.9.

    Over the redundancy, its variance is 1 + 0.1 / 0.9, so chi-square is e^2 / 1.111.
    """
    redundancy = np.full((3, 1), 0.9)
    error = np.array([[1.0], [5.0], [5.3]])  # chi-square 0.9, 22.5, 25.3: above 23.9 is impossible
    squares = (0.9 * error) ** 2
    found = is_impossible(np.ones((3, 1)), squares, redundancy)
    assert found.tolist() == [False, False, True]
    # Its variance and that of the boxes' sum to the square of the error.
    factor = jump_inflation(np.ones(1), squares[2], redundancy[2])
    assert factor + 0.1 / 0.9 == pytest.approx(5.3**2, rel=1e-6)
    # Where boxes say nothing, nothing is impossible.
    assert not is_impossible(np.ones((1, 3)), np.full((1, 3), 1e3), np.full((1, 3), 0.01)).any()
