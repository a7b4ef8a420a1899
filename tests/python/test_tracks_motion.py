"""The motion of what moves: its errors, their covariance and their derivatives."""

import numpy as np
import pytest

from dqslam.tracks.motion import (
    ABOVE,
    ANYTHING,
    CYCLE,
    HEADING,
    PERSON,
    SPEED,
    STILL,
    STILL_SPEED,
    TURN,
    VEHICLE,
    compare_steps,
    motion_noise,
)

ALWAYS = np.ones(1, dtype=bool)


def compared(state, seconds, moves, noise, drift):
    """Compare states on a level ground at the height 0, heights in meters."""
    level, meters = np.zeros((len(state), 3)), np.ones(len(state))
    return compare_steps(state, seconds, moves, noise, drift, level, meters)


def two_states(dt, speed=5.0, heading=0.3, turn=0.0):
    """A thing that goes along an arc, whose chord has the direction in the middle of the time."""
    before = np.array([1.0, 2.0, 0.1, heading, speed, turn])
    middle = heading + 0.5 * dt * turn
    after = before + [
        dt * speed * np.cos(middle),
        dt * speed * np.sin(middle),
        0.0,
        dt * turn,
        0.0,
        0.0,
    ]
    return np.array([before, after])


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_constant_motion_has_no_error(turn):
    steps = compared(two_states(0.2, turn=turn), np.array([0.2]), ALWAYS, VEHICLE, 0.3)
    np.testing.assert_allclose(steps.error, 0.0, atol=1e-12)


def test_a_sigma_of_speed_is_the_density_times_the_root_of_the_time():
    """White noise of density q has the covariance q^2 [dt^3/3 dt^2/2; dt^2/2 dt]."""
    dt, q = 0.2, VEHICLE.acceleration
    covariance = q**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    states = two_states(dt, heading=0.0)
    for distance, speed in ((0.0, 0.7), (0.05, 0.0), (-0.1, 0.3)):
        off = states.copy()
        off[1, 0] += distance
        off[1, SPEED] += speed
        error = compared(off, np.array([dt]), ALWAYS, VEHICLE, 0.3).error
        expected = np.array([distance, speed])
        expected = expected @ np.linalg.solve(covariance, expected)
        assert np.sum(error**2) == pytest.approx(expected)


def test_the_log_density_is_that_of_the_covariances():
    dt = 0.2
    block = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    sizes = [VEHICLE.acceleration, VEHICLE.turn]
    expected = -0.5 * sum(np.log(np.linalg.det(q**2 * block)) for q in sizes)
    expected -= 0.5 * np.log(VEHICLE.slip**2 * dt) + 0.5 * np.log(0.3**2 * dt)
    steps = compared(two_states(dt), np.array([dt]), ALWAYS, VEHICLE, 0.3)
    assert steps.log_density == pytest.approx(expected)


@pytest.mark.parametrize("moves", [(1, 1, 1), (0, 0, 0), (1, 0, 1)])
def test_derivatives_are_those_of_small_differences(moves):
    random = np.random.default_rng(0)
    state, seconds = random.normal(size=(4, 6)), np.array([0.1, 0.2, 0.1])
    plane, above = 0.1 * random.normal(size=(4, 3)), random.uniform(0.2, 0.5, 4)
    arguments = seconds, np.array(moves, dtype=bool), CYCLE, 0.3, plane, above
    steps, e = compare_steps(state, *arguments), 1e-6
    for column in range(6):
        for which, found in ((slice(0, 3), steps.by_from), (slice(1, 4), steps.by_to)):
            for row in range(3):
                more, less = state.copy(), state.copy()
                more[which][row, column] += e
                less[which][row, column] -= e
                change = (
                    compare_steps(more, *arguments).error - compare_steps(less, *arguments).error
                )
                np.testing.assert_allclose(
                    found[row, :, column], change[row] / (2 * e), rtol=1e-5, atol=1e-4
                )


def test_at_a_stop_the_speed_is_that_of_rest_whatever_it_was():
    state = np.zeros((3, 6))
    state[:, SPEED] = [3.0, 2.0, 0.04]
    state[:, 0] = [0.0, 0.25, 0.3]
    moves = np.array([True, False])
    error = compared(state, np.full(2, 0.1), moves, VEHICLE, 0.3).error
    assert error[1, SPEED] == pytest.approx(0.04 / STILL_SPEED)


def test_what_rests_hardly_moves():
    state = two_states(0.1, speed=0.0)
    state[1, 0] += 0.1
    rest = compared(state, np.array([0.1]), ~ALWAYS, VEHICLE, 0.3).error
    motion = compared(state, np.array([0.1]), ALWAYS, VEHICLE, 0.3).error
    np.testing.assert_allclose(rest, motion / STILL)
    assert state[1, HEADING] == state[0, HEADING] and state[1, TURN] == 0.0


def test_what_rests_keeps_its_height_and_what_moves_follows_the_ground():
    """The second image has the ground 0.3 m lower; heights are in units of 0.2 m."""
    state, dt = np.zeros((2, 6)), np.array([0.25])
    plane, above = np.array([[0.0, 0.0, 0.0], [-0.3, 0.0, 0.0]]), np.full(2, 0.2)
    for moves, height, expected in (
        (ALWAYS, 0.0, 0.0),
        (ALWAYS, 1.5, 1.5 / (0.4 * 0.5)),
        (~ALWAYS, 1.5, 0.0),
        (~ALWAYS, 0.0, -1.5 / (STILL * 0.4 * 0.5)),
    ):
        state[1, ABOVE] = height
        error = compare_steps(state, dt, moves, VEHICLE, 0.4, plane, above).error
        assert error[0, ABOVE] == pytest.approx(expected)


def test_classes_have_their_motion_by_any_case():
    assert motion_noise("Car") is VEHICLE and motion_noise("Pedestrian") is PERSON
    assert motion_noise("bicycle") is CYCLE and motion_noise("kite") is ANYTHING
