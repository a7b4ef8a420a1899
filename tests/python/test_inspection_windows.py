"""Windows of views and the points that explain them, by hand."""

import numpy as np
import pytest

from dqslam.inspection.comparison import Explanation, alike, clearly_better, difference
from dqslam.inspection.pose_readings import ALL_MAPS, TURNS, usual_readings
from dqslam.inspection.windows import (
    BEHIND,
    Windows,
    find_windows,
    fit_points,
    log_shares,
    motions,
    persistence,
)

THERE = np.ones((1, 5), dtype=bool)
SIDEWAYS = np.array([-0.4, -0.2, 0.0, 0.2, 0.4])


def sideways(depth):
    """Cameras that look along z and move along x, and the rays to a point at x = 0.2."""
    turn = np.broadcast_to(np.eye(3), (1, 5, 3, 3))
    position = np.zeros((1, 5, 3))
    position[0, :, 0] = SIDEWAYS
    ray = np.zeros((1, 5, 2))
    ray[0, :, 0] = (0.2 - SIDEWAYS) / depth
    return turn, position, ray


def test_a_point_at_rest_is_found():
    fit = fit_points(*sideways(2.0), THERE)
    assert fit.miss == pytest.approx([0], abs=1e-9)
    np.testing.assert_allclose(fit.depth, 2.0)
    np.testing.assert_allclose(fit.error, 0, atol=1e-9)


def test_what_is_left_of_a_view_that_is_off_is_its_error():
    turn, position, ray = sideways(2.0)
    ray[0, 2, 1] += 0.1
    fit = fit_points(turn, position, ray, THERE)
    assert fit.error[0, 2, 1] == pytest.approx(0.1, abs=5e-3)
    assert fit.miss[0] == pytest.approx(0.02, abs=3e-3)


def test_a_camera_that_turns_sees_a_direction():
    """Without parallax the point is at infinity, and nothing is left."""
    angle = np.array([-0.2, -0.1, 0.0, 0.1, 0.2])
    turn = np.zeros((1, 5, 3, 3))
    turn[0, :, 1, 1] = 1
    turn[0, :, 0, 0] = turn[0, :, 2, 2] = np.cos(angle)
    turn[0, :, 0, 2], turn[0, :, 2, 0] = np.sin(angle), -np.sin(angle)
    ray = np.zeros((1, 5, 2))
    ray[0, :, 0] = np.tan(-angle)
    assert fit_points(turn, np.zeros((1, 5, 3)), ray, THERE).miss == pytest.approx([0], abs=1e-9)


def test_a_point_behind_all_cameras_explains_nothing():
    """Rays that spread meet behind: no point in front is better than the best direction."""
    turn, position, ray = sideways(2.0)
    left = fit_points(turn, position, -ray, THERE)
    assert left.miss[0] == pytest.approx(motions(ray, THERE)[0], rel=0.05)
    assert left.miss[0] < BEHIND


def test_shares_have_a_floor_and_a_ceiling():
    assert np.exp(log_shares(np.array([0.0, 0.3, 1e9]), np.ones(3))) == pytest.approx(
        [0.02, np.hypot(0.3, 0.02), 100]
    )


def test_windows_end_where_middles_have_moved():
    """A track of 1 px a frame among middles that spread over 100 px: 10 px a short window."""
    track = np.arange(101)
    middle = np.column_stack([np.arange(101.0), np.zeros(101)])
    windows = find_windows([track], middle, np.arange(101.0))
    short = windows.rows[windows.length == 0]
    extent = 0.9 * 100
    assert np.all(np.ptp(middle[short, 0], axis=1) == np.ceil(0.1 * extent))
    assert np.sum(windows.length == 2) == 1
    assert windows.rows[windows.length == 2][0, [0, -1]].tolist() == [0, 100]
    assert len(find_windows([track[:3]], middle, np.arange(101.0))) == 0


def some_windows(count):
    rows = np.tile(np.arange(6), (count, 1))
    zeros = np.zeros(count, dtype=np.int64)
    return Windows(rows, np.ones_like(rows, dtype=bool), zeros, np.arange(count) % 8)


def test_what_persists_is_told_from_noise():
    windows = some_windows(200)
    random = np.random.default_rng(0)
    steady = np.tile(random.normal(size=(200, 1, 2)), (1, 5, 1))
    assert persistence(steady, windows) == pytest.approx(1)
    assert persistence(random.normal(size=(200, 5, 2)), windows) == pytest.approx(0, abs=0.1)
    places = random.normal(size=(200, 6, 2))
    assert persistence(np.diff(places, axis=1), windows) == pytest.approx(-0.33, abs=0.1)
    assert np.isnan(persistence(steady[:5], some_windows(5)))


def explained(share, persists, count=80):
    shares = np.log(np.asarray(share) * np.random.default_rng(1).uniform(0.95, 1.05, count))
    return Explanation(some_windows(count), np.exp(shares), shares, persists)


def test_better_is_less_by_far_and_surely_and_no_more_persistent():
    given, other = explained(0.8, 0.5), explained(0.2, 0.0)
    change, sigmas = difference(given.windows, given.log_share, other.log_share)
    assert change == pytest.approx(np.log(0.25), abs=1e-9)
    assert clearly_better(given, other)
    assert not clearly_better(other, given)
    assert not clearly_better(given, explained(0.7, 0.0))
    assert not clearly_better(given, explained(0.2, 0.6))
    assert alike(other, explained(0.21, 0.0))
    assert not alike(other, given)
    assert sigmas < -100


def test_readings_are_all_different():
    assert len(set(ALL_MAPS)) == 48
    assert len(TURNS) == 24
    assert len(set(usual_readings())) == 11
