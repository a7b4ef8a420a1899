"""Drives on the plane other than the paper's."""

import numpy as np
import pytest

from dqslam import _core, load_scenario, simulate
from dqslam._core import PoseModel
from dqslam.simulation.path import move, poses_later
from dqslam.simulation.scenario import FigureOfEightSettings, StraightSettings

RANDOM = np.random.default_rng(0)


def eight(**values):
    settings = {"radius_m": 6.0, "laps": 1, "step_m": 0.5, "period_s": 1.0} | values
    return move(FigureOfEightSettings(kind="figure_of_eight", **settings), RANDOM)


def straight(length_m, step_m):
    settings = StraightSettings(kind="straight", length_m=length_m, step_m=step_m, period_s=1.0)
    return move(settings, RANDOM)


def test_an_eight_is_two_circles_that_close():
    path = eight(laps=2)
    steps = 75  # 2 pi 6 m / 0.5 m = 75.4
    assert path.poses.shape == (4 * steps + 1, 3)
    np.testing.assert_allclose(path.poses[:: 2 * steps], 0.0, atol=1e-9)
    np.testing.assert_allclose(path.poses[steps], [0.0, 0.0, 2.0 * np.pi], atol=1e-9)
    side = 12.0 * np.sin(np.pi / steps)
    height = 6.0 * np.cos(np.pi / steps)
    for circle, sign in ((path.poses[:steps], 1.0), (path.poses[steps : 2 * steps], -1.0)):
        away = circle[:, :2] - [side / 2.0, sign * height]
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), 6.0)
    np.testing.assert_allclose(path.relative[:, 0], side)
    np.testing.assert_allclose(path.relative[:steps, 2], 2.0 * np.pi / steps)
    np.testing.assert_allclose(path.relative[steps : 2 * steps, 2], -2.0 * np.pi / steps)
    assert path.is_turn.all()


def test_the_shortest_eight_is_two_triangles():
    assert len(eight(radius_m=0.1).poses) == 7


def test_a_straight_drive_has_the_steps_nearest_to_its_length():
    path = straight(60.2, 0.5)
    np.testing.assert_allclose(path.poses[:, 0], 0.5 * np.arange(121))
    np.testing.assert_array_equal(path.poses[:, 1:], 0.0)
    assert not path.is_turn.any()
    assert len(straight(0.1, 0.5).poses) == 2


def test_a_large_rectangle_is_driven_twice():
    _, truth = simulate(load_scenario("loop_200m"), seed=0)
    np.testing.assert_allclose(np.ptp(truth.poses[:, :2], axis=0), 200.0, atol=0.3)
    half = len(truth.poses) // 2
    np.testing.assert_allclose(truth.poses[half, :2], truth.poses[0, :2], atol=1e-9)


# --- between two poses ---------------------------------------------------------------------------


def test_half_a_step_later_on_a_straight_line():
    path = straight(10.0, 0.5)
    np.testing.assert_allclose(poses_later(path, 0.1)[:, 0], 0.5 * (np.arange(21) + 0.1))
    np.testing.assert_allclose(poses_later(path, -0.1)[:, 0], 0.5 * (np.arange(21) - 0.1))


@pytest.mark.parametrize("steps", [1.0, 3.0, -2.0])
def test_whole_steps_later_are_the_poses_themselves(steps):
    path = eight()
    later, count = poses_later(path, steps), int(steps)
    expected = path.poses[count:] if count > 0 else path.poses[:count]
    rows = slice(0, -count) if count > 0 else slice(-count, None)
    np.testing.assert_allclose(later[rows], expected, atol=1e-12)


def test_two_halves_are_a_whole_step():
    """From half a step to the next pose the robot moves as from the pose to half a step."""
    path = eight()
    middle = poses_later(path, 0.5)[:-1]
    first = _core.minus(PoseModel.SE2, middle, path.poses[:-1])
    second = _core.minus(PoseModel.SE2, path.poses[1:], middle)
    turned = np.hypot(*(first - second)[:, :2].T)
    np.testing.assert_allclose(first[:, 2], second[:, 2], atol=1e-12)
    assert turned.max() < 0.05 * 0.5  # the tangents turn by half the step's angle
