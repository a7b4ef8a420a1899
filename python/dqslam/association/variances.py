"""Levels of the noise of boxes and odometry where the errors of boxes repeat.

Restricted maximum likelihood, as in ``noise``: each part of a covariance is corrected by the ratio
of its squared residuals to what they are expected to be, given what the estimate took from them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam.association.correlated import CorrelatedProblem, Linearization, minimize
from dqslam.association.noise import StepNoise, corrected
from dqslam.association.repetition import MAX_RATIO, RepeatedNoise, corrected_variances

# Corrections of the levels, and iterations of the estimate before each.
MAX_CORRECTIONS = 8
ITERATIONS, LAST_ITERATIONS = 4, 20
# Levels are settled when none of their logarithms moves by more.
SETTLED = 0.05
# What an estimate takes from its residuals is a mean over so many draws from its covariance: sums
# over hundreds of edges are known to a few percent, at a hundredth of the cost of an inverse.
DRAWS = 100
# Objects are as hard to draw as the others, unless so many edges show it.
PRIOR_EDGES_OF_OBJECT = 10.0


@dataclass(frozen=True)
class OdometryFit:
    """Residuals of the odometry as ``noise.corrected`` needs them."""

    odometry_residuals: Floats
    """In sigmas, shape (s, k)."""
    odometry_leverage: Floats
    """Shape (s, k)."""


@dataclass
class Levels:
    """The noise that is believed of boxes and of odometry, and what of it may be corrected."""

    boxes: RepeatedNoise
    steps: StepNoise | None
    """None if the odometry's covariance is given."""
    of_steps: Floats
    """Levels of the components of ``steps``, shape (c,)."""
    inflation: Floats
    """Factors of the covariances of jumps, shape (s,)."""
    lowest: Floats
    """Of the levels, shape (c,)."""


def estimate_with_levels(
    problem: CorrelatedProblem, state: _core.State, levels: Levels
) -> Linearization | None:
    """Estimate poses and objects, and correct the levels, until both agree.

    None where an object is not in front of a camera that saw it.
    """
    for _ in range(MAX_CORRECTIONS):
        here = minimize(problem, state, levels.boxes, max_iterations=ITERATIONS)
        if here is None:
            return None
        state = here.state
        if correct(problem, here, levels) < SETTLED:
            break
    return minimize(problem, state, levels.boxes, max_iterations=LAST_ITERATIONS)


def correct(problem: CorrelatedProblem, here: Linearization, levels: Levels) -> float:
    """Correct the levels of the noise; return the largest change, as a logarithm."""
    draws = _draws(here.hessian, problem.k)
    before = levels.boxes.variances
    found, expected = _box_components(problem, here, draws)
    factors = np.repeat(problem.factors, 2, axis=1)
    sums = np.sum(factors * found, axis=0), np.sum(factors * expected, axis=0)
    levels.boxes = levels.boxes.with_variances(corrected_variances(before, *sums))
    problem.factors = corrected_factors(problem.factors, before * found, before * expected)
    change = 0.5 * np.abs(np.log(levels.boxes.variances / before))
    # A part that is next to nothing does not matter, however it changes.
    largest = float(np.max(change[_matters(problem, before)], initial=0.0))
    if levels.steps is not None:
        fit = odometry_fit(problem, here, draws)
        better = corrected(
            levels.steps, levels.of_steps, levels.inflation, fit, lowest=levels.lowest
        )
        levels.of_steps, levels.inflation = better.levels, better.inflation
        covariance = levels.steps.covariance(levels.of_steps, levels.inflation)
        problem.odometry_precision = np.linalg.inv(covariance)
        largest = max(largest, better.change)
    return largest


def corrected_factors(factors: Floats, found: Floats, expected: Floats) -> Floats:
    """Return better factors of the variances of objects, (o, 2): new, and repeated.

    ``found`` and ``expected`` are the squares of the four parts in units of the variances that were
    believed of all objects, (o, 4). The factors of all objects have a geometric mean of 1.
    """
    count = factors * found.reshape(-1, 2, 2).sum(axis=2) + PRIOR_EDGES_OF_OBJECT
    usual = factors * expected.reshape(-1, 2, 2).sum(axis=2) + PRIOR_EDGES_OF_OBJECT * factors
    better = factors * np.clip(count / usual, 1.0 / MAX_RATIO, MAX_RATIO)
    return np.asarray(better / np.exp(np.mean(np.log(better), axis=0)))


def _matters(problem: CorrelatedProblem, variances: Floats) -> Bools:
    """Return which parts are at least a twentieth of the variance of a usual edge, (4,)."""
    side2 = float(np.median(np.concatenate([boxes.side.ravel() for boxes in problem.objects])) ** 2)
    parts = variances * [1.0, side2, 1.0, side2]
    return np.asarray(parts >= 0.05 * parts.sum())


def _draws(hessian: Floats, k: int) -> Floats:
    """Draw errors of the estimate from its covariance: (k + u, s), the first pose exact."""
    from scipy.linalg import solve_triangular

    normal = np.random.default_rng(0).standard_normal((len(hessian), DRAWS))
    lower = np.linalg.cholesky(hessian)
    drawn = solve_triangular(lower, normal, trans="T", lower=True)
    return np.concatenate([np.zeros((k, DRAWS)), drawn])


def _box_components(
    problem: CorrelatedProblem, here: Linearization, draws: Floats
) -> tuple[Floats, Floats]:
    """Return squares found and expected of the four parts of each object's variances, (o, 4)."""
    n, k = problem.graph.num_poses, problem.k
    by_pose, by_object = draws[: k * n].reshape(n, k, -1), draws[k * n :].reshape(-1, 9, DRAWS)
    found, expected = np.zeros((2, len(problem.objects), 4))
    for number, (boxes, whitener, correlation) in enumerate(
        zip(problem.objects, here.whiteners, here.correlations, strict=True)
    ):
        j = here.jacobian[boxes.rows].transpose(1, 0, 2)
        moved = np.einsum("eia,ias->eis", j[:, :, :k], by_pose[boxes.poses])
        moved += j[:, :, k:] @ by_object[number]
        taken = whitener.precision @ moved
        left = np.einsum("eij,ej->ei", whitener.precision, here.error[boxes.rows].T)
        parts = whitener.components(correlation, boxes.side, here.weight[boxes.rows])
        for part, shape in enumerate(parts):
            found[number, part] = np.einsum("ei,eij,ej", left, shape, left, optimize=True)
            expected[number, part] = np.sum(whitener.precision * shape)
            expected[number, part] -= np.sum(taken * (shape @ taken)) / DRAWS
    return found, np.maximum(expected, 0.0)


def odometry_fit(problem: CorrelatedProblem, here: Linearization, draws: Floats) -> OdometryFit:
    """Return the residuals of the odometry in sigmas, and their leverages by draws, (s, k)."""
    n, k = problem.graph.num_poses, problem.k
    off, at_start = problem.odometry_errors(here.state.poses)
    by_pose = draws[: k * n].reshape(n, k, -1)
    table = problem.graph.odometry
    moved = at_start @ by_pose[table.from_pose] + by_pose[table.to_pose]
    # Rows of the whitener are those that ``corrected`` takes: of the covariance's Cholesky factor.
    whitener = np.linalg.inv(np.linalg.cholesky(np.linalg.inv(problem.odometry_precision)))
    leverage = np.mean((whitener @ moved) ** 2, axis=2)
    return OdometryFit((whitener @ off[:, :, None])[:, :, 0], np.clip(leverage, 0.0, 1.0))
