"""Where the estimate of a track starts: by the size of its class, and straight lines."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.tracks.motion import HEADING, SIZE, SPEED, TURN, X, Y
from dqslam.tracks.problem import TrackProblem, Trajectory

# A line is drawn through the places of about so many seconds on either side.
SMOOTHED_OVER_S = 1.5
# Headings of a thing at rest that are tried: those half a turn away look alike.
RESTING_HEADINGS = np.radians([0.0, 60.0, 120.0])


def rough_places(problem: TrackProblem) -> tuple[Floats, Floats]:
    """Return where a thing stands by the height of each box, (n, 2), and their weights, (n,).

    Boxes whose upper or lower edge is cut have no weight, unless all have; far places are worth
    less.
    """
    views, camera, box = problem.views, problem.views.camera, problem.box
    depth = camera.fy * 2.0 * np.exp(problem.size.log_half[2]) / (box[:, 3] - box[:, 1])
    middle = 0.5 * (box[:, 0] + box[:, 2])
    ray = [(middle - camera.cx) / camera.fx, (box[:, 3] - camera.cy) / camera.fy]
    seen = depth[:, None] * np.column_stack([*ray, np.ones(len(box))])
    feet = views.position + np.einsum("nij,nj->ni", views.rotation, seen)
    whole = ~problem.truncated[:, [1, 3]].any(axis=1)
    weight = np.where(whole | (not whole.any()), 1.0, 1e-3) / np.sum(seen**2, axis=1)
    return feet[:, :2], weight / weight.sum()


def moving_start(problem: TrackProblem, places: Floats, weight: Floats) -> Trajectory:
    """Start on straight lines through rough places (n, 2), at the speeds along them.

    The line at an image is that through the places of the seconds around it.
    """
    time = problem.seconds - problem.seconds[:, None]
    near = weight * np.exp(-0.5 * (time / SMOOTHED_OVER_S) ** 2)
    near /= near.sum(axis=1, keepdims=True)
    middle_time = np.sum(near * time, axis=1)
    middle = near @ places
    spread = np.sum(near * time**2, axis=1) - middle_time**2
    velocity = (near * (time - middle_time[:, None])) @ places
    velocity /= np.maximum(spread, np.finfo(np.float64).tiny)[:, None]
    state = np.zeros((len(places), SIZE))
    state[:, X : Y + 1] = middle - middle_time[:, None] * velocity
    state[:, HEADING] = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    state[:, SPEED] = np.linalg.norm(velocity, axis=1)
    return Trajectory(state, problem.size.log_half.copy())


def mirrored_start(problem: TrackProblem, moving: Trajectory) -> Trajectory:
    """Start from an estimate that moves, turned the other way: a cuboid looks nearly the same."""
    state = moving.state.copy()
    line = state[:, X : Y + 1] - problem.views.position[:, :2]
    sight = np.arctan2(line[:, 1], line[:, 0])
    away = state[:, HEADING] - sight
    away = np.unwrap(np.arctan2(np.sin(away), np.cos(away)))
    state[:, HEADING] = np.unwrap(sight) - away
    state[:, TURN] *= -1.0
    return Trajectory(state, moving.log_half.copy())


def resting_starts(problem: TrackProblem, places: Floats, weight: Floats) -> list[Trajectory]:
    """Start at the middle of the rough places (n, 2), and at the nearest one, in some headings."""
    starts = []
    for place in (weight @ places, places[int(np.argmax(weight))]):
        for heading in RESTING_HEADINGS:
            state = np.zeros((len(places), SIZE))
            state[:, X : Y + 1], state[:, HEADING] = place, heading
            starts.append(Trajectory(state, problem.size.log_half.copy()))
    return starts


def stopping_start(moving: Trajectory, rests: Bools) -> Trajectory:
    """Start from an estimate that moves all along, at rest in the images that ``rests`` flags (n,).

    Each run of such images has their mean state.
    """
    state = moving.state.copy()
    rows = np.flatnonzero(rests)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        state[run] = state[run].mean(axis=0)
    state[rows, SPEED] = state[rows, TURN] = 0.0
    return Trajectory(state, moving.log_half.copy())
