"""The covariance of the present pose, step by step."""

import dataclasses
import math

import numpy as np
import pytest

import dqslam as dq
from dqslam.uncertainty import normalized_squares, tangent_errors


def fed(recording, **settings):
    """Return a session after all steps of a recording, and the reports of these."""
    slam = dq.OnlineSlam(recording.camera, **settings)
    steps = dq.steps_of(recording)
    return slam, [slam.add(one.odometry, one.boxes, timestamp=one.timestamp) for one in steps]


def test_without_boxes_it_is_that_of_the_odometry():
    """Two steps of 2 m ahead: a turn of the first moves the end sideways by 2 m a radian."""
    camera = dq.Camera(fx=500, fy=500, cx=320, cy=240, width=640, height=480)
    slam = dq.OnlineSlam(camera)
    assert not slam.pose_covariance.any()
    slam.add(None)
    assert not slam.pose_covariance.any()  # the first pose is exact
    of_step = np.diag([0.04, 0.01, 0.0025])
    slam.add(dq.Motion(np.array([2.0, 0.0, 0.0]), of_step))
    np.testing.assert_allclose(slam.pose_covariance, of_step, rtol=1e-9)
    report = slam.add(dq.Motion(np.array([2.0, 0.0, 0.0]), of_step))
    expected = [[0.08, 0, 0], [0, 0.01 + 0.01 + 4 * 0.0025, 2 * 0.0025], [0, 2 * 0.0025, 0.005]]
    np.testing.assert_allclose(report.covariance, expected, atol=1e-12)
    np.testing.assert_array_equal(report.covariance, slam.pose_covariance)


def test_without_boxes_it_grows_as_that_of_the_odometry_over_all_smoothings():
    """Along a line, the variance ahead is that of the steps, one after the other."""
    camera = dq.Camera(fx=500, fy=500, cx=320, cy=240, width=640, height=480)
    slam = dq.OnlineSlam(camera, first_covariance=np.diag([0.5, 0.5, 1e-8]))
    slam.add(None)
    np.testing.assert_allclose(slam.pose_covariance, np.diag([0.5, 0.5, 1e-8]), rtol=1e-9)
    for count in range(1, 300):
        slam.add(dq.Motion(np.array([0.1, 0.0, 0.0]), np.diag([0.01, 0.01, 1e-8])))
        assert slam.pose_covariance[0, 0] == pytest.approx(0.5 + 0.01 * count, rel=1e-4)


@pytest.mark.parametrize("scenario", ["paper", "orbit"])
def test_where_all_poses_are_smoothed_it_is_the_marginal_of_the_whole_problem(scenario):
    recording, truth = dq.simulate(dq.load_scenario(scenario), seed=3)
    all_poses = dq.OnlineOptions(medium_smoothing=dq.SmoothingLevel(10**6, 1, 20))
    options = dq.SolveOptions(loss=dq.Loss.NONE)
    slam, reports = fed(recording, options=options, online=all_poses, first_pose=truth.poses[0])
    slam.polish()  # at the optimum both have the same linearization
    slam._state.core.smooth(1, 0)
    problem, rows = slam._state.core.to_graph()
    graph = dataclasses.replace(dq.build_graph(recording), core=problem)
    ellipsoids = slam._state.core.ellipsoids[rows]  # in the order of the problem
    estimate = dataclasses.replace(slam.estimate(), ellipsoids=ellipsoids)
    exact = dq.marginal_covariances(graph, estimate, options).poses[-1]
    np.testing.assert_allclose(slam.pose_covariance, exact, atol=1e-3 * np.abs(exact).max())
    sigma, expected = np.sqrt(np.diag(reports[-1].covariance)), np.sqrt(np.diag(exact))
    np.testing.assert_allclose(sigma, expected, rtol=0.1)  # before the polish


@pytest.mark.parametrize(
    ("scenario", "median_m", "spread"), [("honest", 0.25, 1.22), ("honest_orbit", 0.07, 1.3)]
)
def test_the_errors_of_all_steps_are_as_large_as_it_says(scenario, median_m, spread):
    """The mean NEES a degree of freedom, of drives whose assumptions hold; 1 if it is right."""
    prior = dq.SizePrior(math.log(median_m), math.log(spread))
    means = []
    for seed in range(6):
        recording, truth = dq.simulate(dq.load_scenario(scenario), seed=seed)
        slam = dq.OnlineSlam(recording.camera, first_pose=truth.poses[0], size_prior=prior)
        poses, covariances = [], []
        for step in dq.steps_of(recording):
            report = slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
            poses.append(slam.pose)
            covariances.append(report.covariance)
        errors = tangent_errors(slam.pose_model, truth.poses[1:], np.array(poses[1:]))
        squares = normalized_squares(errors, np.array(covariances[1:]))
        means.append(squares.mean())
    assert 0.2 < np.mean(means) < 1.5
    assert max(means) < 3.0


def test_a_loop_makes_it_small_again():
    """The drive comes back to its first objects: its end is known better than its middle."""
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=1)
    _, reports = fed(recording)
    sigma = [math.sqrt(np.trace(one.covariance[:2, :2])) for one in reports]
    assert sigma[-1] < 0.3 * max(sigma)


def test_boxes_without_ids_count_when_they_are_identified():
    recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=1)
    slam = dq.OnlineSlam(recording.camera, trust_ids=0.9, first_pose=truth.poses[0])
    odometry = dq.OnlineSlam(recording.camera, first_pose=truth.poses[0])
    for step in list(dq.steps_of(recording))[:100]:
        boxes = dq.StepBoxes(
            step.boxes.box,
            np.full(len(step.boxes.box), -1),
            step.boxes.class_name,
            truncated=step.boxes.truncated,
        )
        report = slam.add(step.odometry, boxes, timestamp=step.timestamp)
        odometry.add(step.odometry, timestamp=step.timestamp)
        np.testing.assert_array_equal(report.covariance, slam.pose_covariance)
    assert np.trace(slam.pose_covariance) < 0.25 * np.trace(odometry.pose_covariance)
