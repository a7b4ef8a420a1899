"""The least-squares estimate of a track under one hypothesis, its evidence and its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.tracks.motion import SIZE
from dqslam.tracks.problem import Equations, TrackProblem, Trajectory, linearize

MAX_ITERATIONS = 40
# The cost is as low as it gets if a step lowers it by less.
TOLERANCE = 1e-3
_FIRST_DAMPING, _MOST_DAMPING = 1e-3, 1e8


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
        """Factorize, the diagonal times 1 + ``damping``; LinAlgError where that is impossible."""
        from scipy.linalg import cholesky_banded

        count = len(equations.diagonal)
        band = np.zeros((2 * SIZE, SIZE * count))
        rows, columns = np.tril_indices(SIZE)
        place = np.arange(count)[:, None] * SIZE + columns
        band[rows - columns, place] = equations.diagonal[:, rows, columns]
        rows, columns = (index.ravel() for index in np.indices((SIZE, SIZE)))
        place = np.arange(count - 1)[:, None] * SIZE + columns
        band[SIZE + rows - columns, place] = equations.below[:, rows, columns]
        band[0] *= 1.0 + damping
        self._chain: Floats = cholesky_banded(band, lower=True, check_finite=False)
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
        from scipy.linalg import cho_solve_banded

        return np.asarray(cho_solve_banded((self._chain, True), right, check_finite=False))

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


def evidence_of_path(fit: TrackFit, path: Floats) -> float:
    """Return what the log evidence gains if the cameras are not exact, but have a joint covariance.

    The covariance (6 n, 6 n) is of small motions of the cameras, each in its own frame [m, rad].
    With g and M the gradient and the second derivative by these motions, the states eliminated, and
    P the covariance, the motions that fit best lower the cost by g (1 + P M)^-1 P g / 2, and their
    volume costs log |1 + P M| / 2.
    """
    equations = fit.equations
    _, change = covariance(fit)
    count = len(equations.diagonal)
    information = _coupling(equations).T @ change
    for row in range(count):
        own = slice(6 * row, 6 * row + 6)
        information[own, own] += equations.of_camera[row]
    gradient = equations.gradient_camera.ravel()
    both = np.eye(6 * count) + path @ information
    gain = gradient @ np.linalg.solve(both, path @ gradient)
    return 0.5 * float(gain) - 0.5 * float(np.linalg.slogdet(both)[1])


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
    count = len(equations.diagonal)
    coupling = np.zeros((SIZE * count + 3, 6 * count))
    for row in range(count):
        columns = slice(6 * row, 6 * row + 6)
        coupling[SIZE * row : SIZE * row + SIZE, columns] = equations.by_camera[row, :SIZE]
        coupling[-3:, columns] = equations.by_camera[row, SIZE:]
    return coupling
