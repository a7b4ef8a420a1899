"""The drive of the paper's scenario, and the view of its camera."""

import numpy as np

import oracle
from dqslam import load_scenario, simulate

PAPER = load_scenario("paper")


def test_path_is_two_closed_laps_counter_clockwise():
    _, truth = simulate(PAPER, seed=0)
    steps = np.diff(truth.poses, axis=0)
    assert len(truth.poses) == 253
    np.testing.assert_allclose(np.hypot(*steps[:, :2].T), 0.5, atol=1e-12)  # 126 m
    np.testing.assert_allclose(truth.poses[[0, 126, 252], :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(truth.poses[252, 2], 4.0 * np.pi)
    extent = np.ptp(truth.poses[:, :2], axis=0)
    np.testing.assert_allclose(extent, [20.0, 12.5], atol=0.02)
    assert (
        truth.poses[:, 1].min() > -1e-12
    )  # the first side is straight ahead, the loop to the left


def started_at(fraction):
    """Poses of the drive that starts at a share of the first side."""
    path = PAPER.path.model_copy(update={"start_fraction": fraction})
    return simulate(PAPER.model_copy(update={"path": path}), seed=0)[1].poses


def test_the_robot_can_start_anywhere_on_the_first_side():
    from_corner = started_at(0.0)
    halfway = started_at(18 / 35)
    np.testing.assert_allclose(halfway[:235, :2], from_corner[18:, :2] - [9.0, 0.0], atol=1e-12)


def test_turns_take_four_steps_and_the_robot_turns_after_driving():
    _, truth = simulate(PAPER, seed=0)
    turning = np.diff(truth.poses[:, 2]) > 0.0
    assert turning.sum() == 8 * 4
    np.testing.assert_allclose(np.diff(truth.poses[:, 2])[turning], np.pi / 8.0)
    first = int(np.argmax(turning))  # still straight ahead in the first step of a turn
    np.testing.assert_allclose(truth.poses[first + 1] - truth.poses[first], [0.5, 0, np.pi / 8.0])


def test_camera_looks_left_from_the_robots_origin():
    recording, _ = simulate(PAPER, seed=0)
    camera = recording.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (1500.0, 1500.0, 639.5, 511.5)
    robot = oracle.se2_matrix([3.0, -1.0, 0.0])
    # 4 m to the left, 1 m ahead, 0.5 m up: right of the middle, and above it.
    pixels, depth = oracle.to_pixels(camera, robot, np.array([[4.0, 3.0, 0.5]]))
    np.testing.assert_allclose(depth, 4.0)
    np.testing.assert_allclose(pixels[0], [639.5 + 1500.0 / 4.0, 511.5 - 750.0 / 4.0])
