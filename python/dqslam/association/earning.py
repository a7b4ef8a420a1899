"""Whether the boxes earn it: how well a path predicts boxes that took no part in it.

A path that was bent to boxes explains these boxes, right or wrong. So objects are held out in turn,
the path is estimated by the others, and the boxes of those held out are fitted to it, and to the
odometry. If the odometry explains them better, it is the better path.
"""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.association.correlated import CorrelatedProblem, Linearization, minimize
from dqslam.association.repetition import RepeatedNoise

# Objects are held out in so many groups at most.
FOLDS = 5
ITERATIONS, FIT_ITERATIONS = 4, 12
# The estimate is used if it predicts them better by odds of 20 to 1.
LEAST_GAIN = 3.0


def gain_over_odometry(
    problem: CorrelatedProblem, found: Linearization, noise: RepeatedNoise
) -> Floats:
    """Hold objects out in turn; return how much better the estimate explains them, (o,).

    The logarithm of the ratio of likelihoods of an object's boxes, given the path by the others and
    given the odometry; NaN where a fit fails, and of a single object.
    """
    count = problem.graph.num_objects
    gain = np.full(count, np.nan)
    if count < 2:
        return gain
    group = np.arange(count) % min(FOLDS, count)
    odometry = problem.graph.initial_poses
    for number in range(int(group.max()) + 1):
        tested, others = problem.part(group == number), problem.part(group != number)
        objects = found.state.landmarks[group == number]
        state = _core.State(found.state.poses, found.state.landmarks[group != number])
        without = minimize(others, state, noise, max_iterations=ITERATIONS)
        if without is None:
            continue
        by_odometry = _fit(tested, _core.State(odometry, objects), noise)
        by_others = _fit(tested, _core.State(without.state.poses, objects), noise)
        if by_odometry is not None and by_others is not None:
            costs = tested.box_costs(by_odometry), tested.box_costs(by_others)
            gain[group == number] = costs[0] - costs[1]
    return gain


def earns_it(gain: Floats) -> bool:
    """Return whether the estimate is to be used; also if nothing could be held out."""
    return bool(np.isnan(gain).all() or np.nansum(gain) > LEAST_GAIN)


def map_along_odometry(
    problem: CorrelatedProblem, found: Linearization, noise: RepeatedNoise
) -> _core.State | None:
    """Return the odometry and the objects that fit it; None where one reaches a camera."""
    state = _core.State(problem.graph.initial_poses, found.state.landmarks)
    fitted = _fit(problem, state, noise)
    return None if fitted is None else fitted.state


def _fit(
    problem: CorrelatedProblem, state: _core.State, noise: RepeatedNoise
) -> Linearization | None:
    """Fit objects at the poses of a state."""
    return minimize(problem, state, noise, max_iterations=FIT_ITERATIONS, keeps_poses=True)
