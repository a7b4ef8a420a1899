"""The least-squares estimate of a track under one hypothesis, its evidence and its covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam.tracks.motion import SIZE
from dqslam.tracks.problem import Equations, TrackProblem, Trajectory, linearize

TrackFit = _core.TrackFit

MAX_ITERATIONS = 40
# A start far from the boxes is brought near with boxes whose sigmas are so many times larger.
LESS_SURE = (20.0, 4.0)
COARSE_ITERATIONS = 15
# The path is moved in so many rounds at most, as long as that lowers the cost by more than this, by
# one of these shares of a step.
_PATH_ROUNDS, _PATH_TOLERANCE = 6, 0.05
_SHARES_OF_STEP = (1.0, 0.5, 0.2)


def fit_track(
    problem: TrackProblem,
    start: Trajectory,
    moves: Bools,
    *,
    max_iterations: int = MAX_ITERATIONS,
) -> TrackFit | None:
    """Minimize from a start, by Levenberg-Marquardt; None where a box is undefined at the start.

    ``moves`` (n - 1,) tells whether the thing moves between two images: the hypothesis.
    """
    return _core.fit_track(problem.core, start, moves, max_iterations)


def fit_from_afar(
    problem: TrackProblem,
    start: Trajectory,
    moves: Bools,
    *,
    less_sure: tuple[float, ...] = LESS_SURE,
) -> TrackFit | None:
    """Minimize from a start that may be far off: first with boxes that are less sure."""
    at = start
    for factor in less_sure:
        coarse = replace(problem, variance=problem.variance * factor**2)
        near = fit_track(coarse, at, moves, max_iterations=COARSE_ITERATIONS)
        if near is None:
            return None
        at = near.trajectory
    return fit_track(problem, at, moves)


def with_information(problem: TrackProblem, fit: TrackFit, moves: Bools) -> Equations:
    """Return equations of a fit that tell as much as the boxes do, for covariances.

    The weights of a robust loss minimize the cost, but those of boxes that fit by chance are too
    large: a covariance with them is too small, by a fifth where boxes alone tell a state. Where a
    box is undefined, the equations are those of the fit.
    """
    at, share = fit.trajectory, _core.SHARE_OF_INFORMATION
    equations = linearize(problem, at, moves, at.state[0], information=share)
    return fit.equations if equations is None else equations


def evidence_with_path(problem: TrackProblem, fit: TrackFit, moves: Bools, path: Floats) -> float:
    """Return the log evidence if the cameras are not exact, but have a joint covariance.

    The covariance P (6 n, 6 n) is of small motions c of the cameras, each in its frame [m, rad].
    They are moved to where boxes and P together have them, for boxes that seem to be wrong may fit
    then: with g and M the gradient and the second derivative of the cost by the motions, the states
    eliminated, to (1 + P M)^-1 P (M c - g). The motions cost c^T P^-1 c / 2 there, and their volume
    log |1 + P M| / 2.
    """
    found = [_move_path(problem, fit, moves, path, np.zeros(6 * len(problem.box)))]
    # A box that fits nowhere near pulls too little to bring the path to where it does.
    coarse = replace(problem, variance=problem.variance * LESS_SURE[-1] ** 2)
    near = fit_track(coarse, fit.trajectory, moves, max_iterations=COARSE_ITERATIONS)
    if near is not None:
        near, force, _ = _move_path(coarse, near, moves, path, np.zeros(6 * len(problem.box)))
        there = problem.moved((path @ force).reshape(-1, 6))
        at = fit_track(there, near.trajectory, moves)
        if at is not None:
            found.append(_move_path(problem, at, moves, path, force))
    at, force, cost = min(found, key=lambda one: one[2])
    both = np.eye(len(force)) + path @ _information_of_cameras(at)
    volume = float(np.linalg.slogdet(both)[1])
    return at.log_evidence + at.equations.cost - cost - 0.5 * volume


def _move_path(
    problem: TrackProblem, fit: TrackFit, moves: Bools, path: Floats, force: Floats
) -> tuple[TrackFit, Floats, float]:
    """Move the cameras by the path's covariance times forces (6 n,), to where the cost is lowest.

    ``fit`` is that of the cameras moved by the given forces. Return the last one, its forces, and
    the cost with that of the motions.
    """
    at, motion = fit, path @ force
    cost = fit.equations.cost + 0.5 * float(motion @ force)
    for _ in range(_PATH_ROUNDS):
        information = _information_of_cameras(at)
        pull = information @ motion - at.equations.gradient_camera.ravel()
        both = np.eye(len(force)) + path @ information
        step = np.linalg.solve(both, path @ pull) - motion
        change = pull - information @ (motion + step) - force
        for share in _SHARES_OF_STEP:
            moved, forced = motion + share * step, force + share * change
            there = problem.moved(moved.reshape(-1, 6))
            after = fit_track(there, at.trajectory, moves, max_iterations=COARSE_ITERATIONS)
            total = np.inf if after is None else after.equations.cost + 0.5 * float(moved @ forced)
            if after is not None and total < cost:
                break
        else:
            break
        gain, at, motion, force, cost = cost - total, after, moved, forced, total
        if gain < _PATH_TOLERANCE:
            break
    return at, force, cost


def _information_of_cameras(fit: TrackFit) -> Floats:
    """Return the second derivative by motions of the cameras, the states eliminated, (6 n, 6 n)."""
    from scipy.sparse import csr_array

    coupling = _coupling(fit.equations)
    information = -(csr_array(coupling.T) @ fit.equations.solve(coupling))
    rest = fit.equations.rest_by_camera
    _add_blocks(information, fit.equations.of_camera, rest[:, :, None] * rest[:, None])
    return np.asarray(information)


def covariance(equations: Equations) -> tuple[Floats, Floats]:
    """Return the covariance (6 n + 3, 6 n + 3) of states and size, and the change by the cameras.

    The change (6 n + 3, 6 n) is that of the estimate by a small motion of each camera in its own
    frame [m, rad]: with the joint covariance P of these motions, that of the estimate grows by
    change P change^T.
    """
    inverse = equations.solve(np.eye(equations.gradient.size + 3))
    return inverse, -inverse @ _coupling(equations)


def _coupling(equations: Equations) -> Floats:
    """Return the second derivatives by states and size, and motions of cameras, (6 n + 3, 6 n)."""
    count = len(equations.gradient)
    coupling = np.zeros((SIZE * count + 3, 6 * count))
    by_camera = equations.by_camera
    rest = equations.rest_by_state[:, :, None] * equations.rest_by_camera[:, None]
    _add_blocks(coupling[:-3], by_camera[:, :SIZE], rest)
    coupling[-3:] = by_camera[:, SIZE:].transpose(1, 0, 2).reshape(3, -1)
    return coupling


def _add_blocks(square: Floats, own: Floats, pairs: Floats) -> None:
    """Add blocks (n, 6, 6) of images and (n - 1, 12, 12) of successive ones to a matrix."""
    count = len(own)
    blocks, rows = square.reshape(count, 6, count, 6), np.arange(count)
    blocks[rows, :, rows] += own
    halves = (slice(0, 6), rows[:-1]), (slice(6, 12), rows[1:])
    for below, down in halves:
        for beside, across in halves:
            blocks[down, :, across] += pairs[:, below, beside]
