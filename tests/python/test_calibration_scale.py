"""The scale of the odometry: unknown, and told by sizes; or drifting slowly."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dqslam as dq
from dqslam.uncertainty import normalized_squares, tangent_errors

HONEST = dq.load_scenario("honest")
SIZE = HONEST.world.log_normal_size
PRIOR = dq.SizePrior(np.log(SIZE.median_m), np.log(SIZE.spread))
NOISE = dq.BoxNoise(pixels=1.0, relative=0.0)


@cache
def drive(seed):
    recording, truth = dq.simulate(HONEST, seed=seed)
    return replace(recording, positions=None), truth


def mean_error(estimate, truth):
    return np.linalg.norm(estimate.poses[:, :2] - truth.poses[:, :2], axis=1).mean()


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_sizes_that_are_told_give_monocular_odometry_its_scale(factor):
    """The steps have no unit: they are a factor too long. The objects' median size is known."""
    for seed in range(2):
        recording, truth = drive(seed)
        odometry = recording.odometry
        units = np.array([factor, factor, 1.0])
        odometry = replace(
            odometry,
            relative=odometry.relative * units,
            covariance=odometry.covariance * units[:, None] * units,
        )
        graph = dq.build_graph(
            replace(recording, odometry=odometry), box_noise=NOISE, size_prior=PRIOR
        )
        calibrated, estimate, _, findings = dq.solve_with_calibration(graph, ["odometry_scale"])
        (scale,) = findings
        # Ten objects with three axes each: log(1.22) / sqrt(30) = 0.036.
        assert factor * scale.sigma == pytest.approx(np.log(SIZE.spread) / np.sqrt(30), rel=0.1)
        assert abs(factor * (1.0 + scale.value) - 1.0) < 3.0 * factor * scale.sigma
        # The path of 126 m is off by what the scale is off, and the covariance says so.
        assert mean_error(estimate, truth) < 0.1 * 12.0
        marginals = dq.calibrated_covariances(calibrated, estimate, findings)
        errors = tangent_errors(truth.pose_model, truth.poses, estimate.poses)[1:]
        assert normalized_squares(errors, marginals.poses[1:]).mean() < 3.0


def drifting(recording, sigma, steps, seed):
    """Scale each step by 1 + z, where z wanders and is forgotten over a number of steps."""
    random = np.random.default_rng(seed)
    kept = np.exp(-1.0 / steps)
    drift = np.zeros(len(recording.odometry.relative))
    last = random.normal() * sigma
    for row in range(len(drift)):
        last = kept * last + np.sqrt(1.0 - kept**2) * sigma * random.normal()
        drift[row] = last
    relative = recording.odometry.relative.copy()
    relative[:, :2] *= (1.0 + drift)[:, None]
    return replace(recording.odometry, relative=relative)


def test_a_scale_that_drifts_is_honest_once_the_covariance_allows_for_it():
    """5 %, forgotten over 20 m."""
    nees = []
    for seed in range(8):
        recording, truth = drive(seed)
        odometry = drifting(recording, 0.05, 40, 100 + seed)
        length = 40 * np.linalg.norm(odometry.relative[:, :2], axis=1).mean()
        for one in (odometry, odometry.with_scale_drift(0.05, length)):
            graph = dq.build_graph(
                replace(recording, odometry=one), box_noise=NOISE, size_prior=PRIOR
            )
            estimate, _ = dq.solve(graph)
            marginals = dq.marginal_covariances(graph, estimate)
            errors = tangent_errors(truth.pose_model, truth.poses, estimate.poses)[1:]
            nees.append(normalized_squares(errors, marginals.poses[1:]).mean())
    unaware, aware = np.array(nees).reshape(-1, 2).mean(axis=0)
    assert unaware > 10.0
    assert 0.5 < aware < 1.6


def test_the_drift_is_along_the_motion_in_the_frame_of_the_next_pose():
    """A step of 2 m to the left, and a turn by 90 degrees to the left: then it came from ahead."""
    covariance = np.diag([1e-4, 1e-4, 1e-6])
    step = np.array([[0.0, 2.0, np.pi / 2.0]])
    odometry = dq.Odometry(dq.PoseModel.SE2, np.zeros(3), step, covariance[None])
    wider = odometry.with_scale_drift(0.1, length_m=5.0).covariance[0]
    # 2 * 0.1^2 * 5 m * 2 m = 0.2 m^2, along x of the next pose
    np.testing.assert_allclose(wider - covariance, np.diag([0.2, 0.0, 0.0]), atol=1e-12)
    turn = np.array([[0.0, 2.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]])
    in_space = dq.Odometry(
        dq.PoseModel.SE3, np.array([0, 0, 0, 0, 0, 0, 1.0]), turn, 1e-4 * np.eye(6)[None]
    )
    wider = in_space.with_scale_drift(0.1, length_m=5.0).covariance[0]
    np.testing.assert_allclose(wider - 1e-4 * np.eye(6), np.diag([0.2, 0, 0, 0, 0, 0]), atol=1e-12)


def test_a_step_without_motion_stays_as_it_is():
    odometry = dq.Odometry.from_poses(np.zeros((2, 3)), covariance=np.eye(3) * 1e-4)
    wider = odometry.with_scale_drift(0.1, length_m=5.0)
    np.testing.assert_array_equal(wider.covariance, odometry.covariance)


@pytest.mark.parametrize(("sigma", "length"), [(-0.1, 5.0), (np.nan, 5.0), (0.1, 0.0)])
def test_a_drift_that_is_none_is_refused(sigma, length):
    recording, _ = drive(0)
    with pytest.raises(ValueError, match="scale drift"):
        recording.odometry.with_scale_drift(sigma, length)
