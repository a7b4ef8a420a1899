"""How things move on the ground: along their heading, with a speed and a turn rate that wander.

A state is x, y [m], the height of the foot above the ground in sigmas, the heading [rad], the speed
[m/s] along it, and the turn rate [rad/s]. Speed and turn rate change by white noise of a density.
What rests has neither speed nor turn rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats

X, Y, ABOVE, HEADING, SPEED, TURN = range(6)
SIZE = 6
"""Numbers in a state."""
# What rests moves by this share of the noise of what moves: next to nothing, and not singular.
STILL = 1e-2
# Sigmas of speed [m/s] and turn rate [rad/s] at rest.
STILL_SPEED, STILL_TURN = 0.02, 0.01


@dataclass(frozen=True)
class MotionNoise:
    """How restlessly things of a kind move."""

    acceleration: float
    """Density of the white acceleration, m/s^2 / sqrt(Hz): speed changes by so much in 1 s."""
    turn: float
    """The same of the turn rate, rad/s^2 / sqrt(Hz)."""
    slip: float
    """Density of the motion across the heading, m / sqrt(s)."""
    usual_speed: float
    """Sigma of the speed of what moves, m/s."""
    usual_turn: float
    """Sigma of the turn rate of what moves, rad/s."""


VEHICLE = MotionNoise(1.0, 0.15, 0.05, 12.0, 0.2)
CYCLE = MotionNoise(1.0, 0.3, 0.1, 6.0, 0.3)
PERSON = MotionNoise(0.5, 0.7, 0.1, 1.5, 0.5)
ANYTHING = MotionNoise(1.0, 0.5, 0.1, 4.0, 0.5)

_OF_CLASS = (
    dict.fromkeys(("car", "van", "truck", "bus", "tram"), VEHICLE)
    | dict.fromkeys(("bicycle", "cyclist", "motorcycle"), CYCLE)
    | dict.fromkeys(("person", "pedestrian"), PERSON)
)


def motion_noise(class_name: str) -> MotionNoise:
    """Return how things of a class move; a class without a known motion has a broad one."""
    return _OF_CLASS.get(class_name.lower(), ANYTHING)


@dataclass(frozen=True, eq=False)
class Steps:
    """Errors of the motion between successive states, in sigmas, and their derivatives."""

    error: Floats
    """Shape (n - 1, 6)."""
    by_from: Floats
    """By the earlier state, shape (n - 1, 6, 6)."""
    by_to: Floats
    """By the later state, shape (n - 1, 6, 6)."""
    log_density: float
    """Sum of the logarithms of the determinants of what the errors are whitened by."""


def compare_steps(
    state: Floats,
    seconds: Floats,
    moves: Bools,
    noise: MotionNoise,
    drift: float,
    plane: Floats,
    above: Floats,
) -> Steps:
    """Compare successive states (n, 6) with a motion over ``seconds`` (n - 1,).

    What moves stays at its height above the ground, as an image shows that; what rests stays where
    it is in the world, whatever the images say of the ground.

    Parameters
    ----------
    moves
        Whether the thing moves between two states, shape (n - 1,); else it rests at the later one.
    drift
        Density of the height above the ground, sigmas / sqrt(s).
    plane, above
        The ground c + a x + b y of each image, rows of c, a, b, (n, 3), and what heights above it
        are in units of, meters, (n,).
    """
    before, after = state[:-1], state[1:]
    count, dt = len(seconds), seconds
    middle = before[:, HEADING] + 0.5 * dt * before[:, TURN]
    cos, sin = np.cos(middle), np.sin(middle)
    length = dt * before[:, SPEED]
    dx, dy = after[:, X] - before[:, X], after[:, Y] - before[:, Y]
    along, across = cos * dx + sin * dy, cos * dy - sin * dx
    error = np.zeros((count, SIZE))
    by_from, by_to = np.zeros((2, count, SIZE, SIZE))
    error[:, 0], error[:, 1] = along - length, across
    for row, (of_x, of_y, of_middle) in enumerate(((cos, sin, across), (-sin, cos, -along))):
        by_to[:, row, X], by_to[:, row, Y] = of_x, of_y
        by_from[:, row, X], by_from[:, row, Y] = -of_x, -of_y
        by_from[:, row, HEADING], by_from[:, row, TURN] = of_middle, 0.5 * dt * of_middle
    by_from[:, 0, SPEED] = -dt
    for row in (ABOVE, HEADING, SPEED, TURN):
        error[:, row] = after[:, row] - before[:, row]
        by_to[:, row, row], by_from[:, row, row] = 1.0, -1.0
    rests = ~moves
    height = (
        plane[:, 0] + np.sum(plane[:, 1:] * state[:, X : Y + 1], axis=1) + above * state[:, ABOVE]
    )
    unit = above[1:][rests]
    error[rests, ABOVE] = np.diff(height)[rests] / unit
    by_to[rests, ABOVE, X : Y + 1] = plane[1:, 1:][rests] / unit[:, None]
    by_from[rests, ABOVE, X : Y + 1] = -plane[:-1, 1:][rests] / unit[:, None]
    by_from[rests, ABOVE, ABOVE] = -above[:-1][rests] / unit
    error[:, HEADING] -= dt * before[:, TURN]
    by_from[:, HEADING, TURN] = -dt
    stops = ~moves & np.append(True, moves[:-1])  # the first state has its own prior
    stops[0] = False
    for row in (SPEED, TURN):
        error[stops, row], by_from[stops, row, row] = after[stops, row], 0.0
    white = _whitening(dt, moves, stops, noise, drift)
    return Steps(
        np.einsum("nij,nj->ni", white, error),
        white @ by_from,
        white @ by_to,
        float(np.log(np.diagonal(white, axis1=1, axis2=2)).sum()),
    )


def _whitening(dt: Floats, moves: Bools, stops: Bools, noise: MotionNoise, drift: float) -> Floats:
    """Return lower triangular matrices (n - 1, 6, 6) that turn errors into sigmas.

    White noise of a rate, over dt, has the covariance q^2 [dt^3/3 dt^2/2; dt^2/2 dt] of the
    distance and the rate. At a stop, the rate is that of rest, whatever it was.
    """
    share = np.where(moves, 1.0, STILL)
    white = np.zeros((len(dt), SIZE, SIZE))
    white[:, 1, 1] = 1.0 / (share * noise.slip * np.sqrt(dt))
    white[:, ABOVE, ABOVE] = 1.0 / (share * drift * np.sqrt(dt))
    for distance, rate, density, still in (
        (0, SPEED, noise.acceleration, STILL_SPEED),
        (HEADING, TURN, noise.turn, STILL_TURN),
    ):
        q = np.where(moves | stops, 1.0, STILL) * density
        white[:, distance, distance] = np.sqrt(3.0 / dt**3) / q
        # The rate less what the distance says of it: 3 / (2 dt) of that, with half the sigma.
        white[:, rate, rate] = np.where(stops, 1.0 / still, 2.0 / (q * np.sqrt(dt)))
        white[:, rate, distance] = np.where(stops, 0.0, -3.0 / (q * dt * np.sqrt(dt)))
    return white


def first_sigmas(moves: bool, noise: MotionNoise) -> Floats:
    """Return the sigmas (6,) of the first state: anywhere, as fast as what moves, or rests, is."""
    speed = noise.usual_speed if moves else STILL_SPEED
    turn = noise.usual_turn if moves else STILL_TURN
    return np.array([ANYWHERE_M, ANYWHERE_M, 1.0, np.pi, speed, turn])


# Sigma of the first place along each axis.
ANYWHERE_M = 100.0
