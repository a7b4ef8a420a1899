"""The least-squares estimate of a track under one hypothesis, its evidence and its covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.tracks.motion import SIZE
from dqslam.tracks.problem import FREEDOM, Equations, TrackProblem, Trajectory, linearize

MAX_ITERATIONS = 40
# The cost is as low as it gets if a step lowers it by less.
TOLERANCE = 1e-3
_FIRST_DAMPING, _MOST_DAMPING = 1e-3, 1e8
# A start far from the boxes is brought near with boxes whose sigmas are so many times larger.
LESS_SURE = (20.0, 4.0)
COARSE_ITERATIONS = 15
# The path is moved in so many rounds at most, as long as that lowers the cost by more than this, by
# one of these shares of a step.
_PATH_ROUNDS, _PATH_TOLERANCE = 6, 0.05
_SHARES_OF_STEP = (1.0, 0.5, 0.2)
# The Fisher information of four errors of a Student t distribution, as a share of their mean weight
# in the normal equations.
SHARE_OF_INFORMATION = (FREEDOM + 4.0) / (FREEDOM + 6.0)


@dataclass(frozen=True, eq=False)
class TrackFit:
    """The estimate of a track under one hypothesis."""

    trajectory: Trajectory
    equations: Equations
    """At the estimate."""
    log_evidence: float
    """Log of the marginal likelihood, by Laplace's method, up to what all hypotheses share."""
    converged: bool


class _Factor:
    """The factor of normal equations: a banded chain, and its border."""

    def __init__(self, equations: Equations, damping: float = 0.0) -> None:
        """Factorize, with ``damping`` times what boxes tell; LinAlgError where that is impossible.

        What rests is bound so stiffly from image to image that a share of the whole diagonal would
        keep it where it is.
        """
        from scipy.linalg.lapack import dpbtrf  # thousands of small ones: no wrapper

        count = len(equations.diagonal)
        band = np.zeros((2 * SIZE, SIZE * count))
        rows, columns = np.tril_indices(SIZE)
        place = np.arange(count)[:, None] * SIZE + columns
        band[rows - columns, place] = equations.diagonal[:, rows, columns]
        rows, columns = (index.ravel() for index in np.indices((SIZE, SIZE)))
        place = np.arange(count - 1)[:, None] * SIZE + columns
        band[SIZE + rows - columns, place] = equations.below[:, rows, columns]
        band[0] += damping * equations.of_boxes.ravel()
        chain, failed_at = dpbtrf(band, lower=1, overwrite_ab=1)
        if failed_at:
            raise np.linalg.LinAlgError(f"the chain is not positive definite at {failed_at}")
        self._chain: Floats = chain
        self._border = equations.border.reshape(-1, 3)
        self._reduced = self._solve_chain(self._border)
        corner = equations.corner + damping * np.diag(np.diag(equations.corner))
        self._corner: Floats = np.asarray(corner - self._border.T @ self._reduced)
        np.linalg.cholesky(self._corner)

    def solve(self, states: Floats, size: Floats) -> tuple[Floats, Floats]:
        """Solve for right sides of the states (6 n, r) and of the size (3, r)."""
        chain = self._solve_chain(states)
        of_size = np.asarray(np.linalg.solve(self._corner, size - self._border.T @ chain))
        return chain - self._reduced @ of_size, of_size

    def _solve_chain(self, right: Floats) -> Floats:
        from scipy.linalg.lapack import dpbtrs

        return np.asarray(dpbtrs(self._chain, right, lower=1)[0])

    @property
    def log_determinant(self) -> float:
        """Of the whole matrix."""
        chain = 2.0 * float(np.log(self._chain[0]).sum())
        return chain + float(np.linalg.slogdet(self._corner)[1])


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
    first, at = start.state[0], start
    equations = linearize(problem, at, moves, first)
    if equations is None:
        return None
    damping, converged = _FIRST_DAMPING, False
    for _ in range(max_iterations):
        try:
            step, size = _Factor(equations, damping).solve(
                -equations.gradient.reshape(-1, 1), -equations.gradient_size[:, None]
            )
        except np.linalg.LinAlgError:
            damping *= 10.0
            continue
        next_at = Trajectory(
            at.state + step.reshape(-1, SIZE), at.log_half + np.clip(size[:, 0], -1.0, 1.0)
        )
        after = linearize(problem, next_at, moves, first)
        if after is None or not after.cost < equations.cost:
            converged = damping > _MOST_DAMPING
            if converged:
                break
            damping *= 10.0
            continue
        gain = equations.cost - after.cost
        at, equations, damping = next_at, after, max(0.2 * damping, 1e-9)
        if gain < TOLERANCE:
            converged = True
            break
    try:
        determinant = _Factor(equations).log_determinant
    except np.linalg.LinAlgError:
        return None
    evidence = equations.log_density - equations.cost - 0.5 * determinant
    return TrackFit(at, equations, evidence, converged)


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


def with_information(problem: TrackProblem, fit: TrackFit, moves: Bools) -> TrackFit:
    """Return a fit whose equations tell as much as the boxes do, for covariances.

    The weights of a robust loss minimize the cost, but those of boxes that fit by chance are too
    large: a covariance with them is too small, by a fifth where boxes alone tell a state. Where a
    box is undefined, the equations stay.
    """
    at = fit.trajectory
    equations = linearize(problem, at, moves, at.state[0], information=SHARE_OF_INFORMATION)
    return fit if equations is None else replace(fit, equations=equations)


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
        pull = information @ motion - at.equations.cameras.gradient.ravel()
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
    coupling = _coupling(fit.equations)
    information = -coupling.T @ np.vstack(
        _Factor(fit.equations).solve(coupling[:-3], coupling[-3:])
    )
    for row, own in enumerate(fit.equations.cameras.of_camera):
        place = slice(6 * row, 6 * row + 6)
        information[place, place] += own
    for row, own in enumerate(fit.equations.cameras.rest_by_camera):
        place = slice(6 * row, 6 * row + 12)
        information[place, place] += np.outer(own, own)
    return np.asarray(information)


def covariance(fit: TrackFit) -> tuple[Floats, Floats]:
    """Return the covariance (6 n + 3, 6 n + 3) of states and size, and the change by the cameras.

    The change (6 n + 3, 6 n) is that of the estimate by a small motion of each camera in its own
    frame [m, rad]: with the joint covariance P of these motions, that of the estimate grows by
    change P change^T.
    """
    equations, count = fit.equations, len(fit.equations.diagonal)
    factor = _Factor(equations)
    full = SIZE * count + 3
    states, size = np.eye(full)[:-3], np.eye(full)[-3:]
    inverse = np.vstack(factor.solve(states, size))
    return inverse, -inverse @ _coupling(equations)


def _coupling(equations: Equations) -> Floats:
    """Return the second derivatives by states and size, and motions of cameras, (6 n + 3, 6 n)."""
    count, cameras = len(equations.diagonal), equations.cameras
    coupling = np.zeros((SIZE * count + 3, 6 * count))
    for row in range(count):
        columns = slice(6 * row, 6 * row + 6)
        coupling[SIZE * row : SIZE * row + SIZE, columns] = cameras.by_camera[row, :SIZE]
        coupling[-3:, columns] = cameras.by_camera[row, SIZE:]
    steps = zip(cameras.rest_by_state, cameras.rest_by_camera, strict=True)
    for row, (by_state, by_camera) in enumerate(steps):
        place = slice(6 * row, 6 * row + 12)
        coupling[place, place] += np.outer(by_state, by_camera)
    return coupling
