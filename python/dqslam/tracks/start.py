"""Where the estimate of a track starts: by the size of its class, and a straight line."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats
from dqslam.tracks.ground import feet_of_boxes
from dqslam.tracks.motion import HEADING, SIZE, SPEED, TURN, X, Y
from dqslam.tracks.problem import TrackProblem, Trajectory

# Headings of a thing at rest that are tried: those half a turn away look alike.
RESTING_HEADINGS = np.radians([0.0, 60.0, 120.0])


def rough_places(problem: TrackProblem, cameras: Floats) -> tuple[Floats, Floats]:
    """Return where a thing stands by the height of each box, (n, 2), and their weights, (n,).

    ``cameras`` (n, 7) are world_from_camera. Boxes whose upper or lower edge is cut have no weight,
    unless all have; far places are worth less.
    """
    views, turn = problem.views, problem.ground.world_from_ground
    height = np.full(len(cameras), 2.0 * np.exp(problem.size.log_half[2]))
    usable = np.ones(len(cameras), dtype=np.bool_)
    feet = feet_of_boxes(views.camera, cameras, problem.box, usable, height) @ turn
    whole = ~problem.truncated[:, [1, 3]].any(axis=1)
    distance = np.linalg.norm(feet - views.position, axis=1)
    weight = np.where(whole | (not whole.any()), 1.0, 1e-3) / distance**2
    return feet[:, :2], weight / weight.sum()


def moving_start(problem: TrackProblem, places: Floats, weight: Floats) -> Trajectory:
    """Start on the straight line through rough places (n, 2), at a constant speed."""
    time = problem.seconds - weight @ problem.seconds
    middle = weight @ places
    spread = float(weight @ time**2)
    velocity = (weight * time) @ places / spread if spread > 0.0 else np.zeros(2)
    state = np.zeros((len(places), SIZE))
    state[:, X : Y + 1] = middle + time[:, None] * velocity
    state[:, HEADING] = np.arctan2(velocity[1], velocity[0])
    state[:, SPEED] = np.linalg.norm(velocity)
    return Trajectory(state, problem.size.log_half.copy())


def resting_starts(problem: TrackProblem, places: Floats, weight: Floats) -> list[Trajectory]:
    """Start at the middle of the rough places (n, 2), and at the nearest one, in some headings."""
    starts = []
    for place in (weight @ places, places[int(np.argmax(weight))]):
        for heading in RESTING_HEADINGS:
            state = np.zeros((len(places), SIZE))
            state[:, X : Y + 1], state[:, HEADING] = place, heading
            starts.append(Trajectory(state, problem.size.log_half.copy()))
    return starts


def stopping_start(moving: Trajectory, rests: Floats) -> Trajectory:
    """Start from an estimate that moves all along, at rest in the images that ``rests`` flags (n,).

    Each run of such images has the place and heading of the middle one.
    """
    state = moving.state.copy()
    rows = np.flatnonzero(rests)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        state[run] = state[run[len(run) // 2]]
    state[rows, SPEED] = state[rows, TURN] = 0.0
    return Trajectory(state, moving.log_half.copy())
