"""The mean and the covariance of all explanations of a track together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats
from dqslam.tracks.fit import TrackFit, covariance, with_information
from dqslam.tracks.motion import ABOVE, HEADING, SIZE, SPEED
from dqslam.tracks.problem import TrackProblem
from dqslam.tracks.switches import Explanation

# Explanations with less weight than this share of the likeliest are left out.
_LEAST_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class Moments:
    """Of the state of a thing at its images, and of its size."""

    state: Floats
    """Means, shape (n, 6)."""
    log_half: Floats
    """Mean, shape (3,)."""
    covariance: Floats
    """Of the state at each image and the size together, shape (n, 9, 9)."""
    moving: Floats
    """The probability that it moves at each image, shape (n,)."""


def mixed(
    problem: TrackProblem,
    ways: list[tuple[TrackFit, Explanation, float]],
    path: Floats | None,
) -> Moments:
    """Return the moments of fits of some explanations with weights, the likeliest first.

    What is unknown of the path, (6 n, 6 n), adds to all of them what it adds to the likeliest.
    """
    ways = [way for way in ways if way[2] >= _LEAST_SHARE * ways[0][2]]
    weights = np.array([weight for *_, weight in ways])
    weights /= weights.sum()
    states: list[Floats] = []
    sizes: list[Floats] = []
    spreads: list[Floats] = []
    of_path = np.zeros((1, SIZE + 3, SIZE + 3))
    for row, (fit, way, _) in enumerate(ways):
        state = _forward(fit.trajectory.state)
        if row:
            turn = state[:, HEADING] - states[0][:, HEADING]
            state[:, HEADING] -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        whole, by_camera = covariance(with_information(problem, fit, way.moves))
        places = _places(len(state))
        states.append(state)
        sizes.append(fit.trajectory.log_half)
        spreads.append(whole[places[:, :, None], places[:, None, :]])
        if row == 0 and path is not None:
            rows = by_camera[places]
            # A foot at the same height above a ground that follows the camera rises with it.
            rise = problem.rise(problem.feet(fit.trajectory.state)) / problem.above[:, None]
            for image, own in enumerate(rise):
                rows[image, ABOVE, 6 * image : 6 * image + 6] += own
            of_path = (rows @ path) @ rows.transpose(0, 2, 1)
    state = np.einsum("w,wni->ni", weights, states)
    log_half = weights @ np.array(sizes)
    total = np.einsum("w,wnij->nij", weights, spreads) + of_path
    for weight, one, size in zip(weights, states, sizes, strict=True):
        off = np.concatenate([one - state, np.tile(size - log_half, (len(state), 1))], axis=1)
        total += weight * off[:, :, None] * off[:, None, :]
    moving = np.einsum("w,wn->n", weights, [way.is_moving for _, way, _ in ways])
    return Moments(state, log_half, total, moving)


def _forward(state: Floats) -> Floats:
    """Turn states (n, 6) so that forward is where it goes: it looks the same from behind."""
    turned = state.copy()
    if state[:, SPEED].sum() < 0.0:
        turned[:, HEADING] += np.pi
        turned[:, SPEED] *= -1.0
    return turned


def _places(count: int) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Return the rows of the state of each image and of the size in a covariance, (n, 9)."""
    own = np.arange(SIZE * count).reshape(count, SIZE)
    return np.column_stack([own, np.tile(SIZE * count + np.arange(3), (count, 1))])
