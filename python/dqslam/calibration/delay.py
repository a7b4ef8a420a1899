"""The score of a time offset, by what it does to the optimum.

The core differentiates by a delay with the mean motion before and after a pose. A delay is
determined where the motion changes, and there the mean is half of the truth. The score of this
parameter is therefore taken from optima on both sides of the value in use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam.calibration.optimum import fitting, settle
from dqslam.calibration.parameters import calibration_parameters
from dqslam.calibration.recalibrate import recalibrate
from dqslam.calibration.scores import Scores
from dqslam.graph import Graph

# The offset moves by its sigma either way, as the core has it.
LEAST_STEP, LARGEST_STEP = 1e-5, 0.1  # seconds


def scores_at(
    graph: Graph,
    state: _core.State,
    options: _core.SolveOptions,
    rows: Sequence[int],
    *,
    is_late: bool = True,
) -> Scores:
    """Return the scores at a state; that of the time offset is exact if it is among some rows.

    ``is_late`` tells whether the images were taken after their poses, or before them.
    """
    scores = Scores.at(graph, state, options)
    row = scores.names.index("time_offset")
    known = float(scores.information[row, row])
    if row not in rows or not known > 0.0:
        return scores
    step = float(np.clip(1.0 / np.sqrt(known), LEAST_STEP, LARGEST_STEP))
    core = fitting(graph.core, state, options)
    settled, cost = settle(core, state, options)
    plain = _core.SolveOptions(
        residual=options.residual,
        algebraic_sigma=options.algebraic_sigma,
        mode=options.mode,
        loss=_core.Loss.NONE,
    )
    costs, others = [], []
    for sign in (1.0, -1.0):
        deviations = np.zeros(len(scores.names))
        deviations[row] = sign * step
        moved = recalibrate(core, settled, graph.timestamps, deviations, is_late=is_late)
        end, cost_there = settle(moved, settled, options)
        costs.append(cost_there)
        others.append(_core.score_calibration(moved, plain, end, graph.timestamps).score)
    score, information = scores.score.copy(), scores.information.copy()
    across = -(others[0] - others[1]) / (2.0 * step)
    across[row] = (costs[0] + costs[1] - 2.0 * cost) / step**2
    score[row] = -(costs[0] - costs[1]) / (2.0 * step)
    information[row], information[:, row] = across, across
    level = scores.covariance[row, row] / known
    covariance = scores.covariance.copy()
    covariance[row], covariance[:, row] = level * across, level * across
    return replace(scores, score=score, information=information, covariance=covariance)


def one_sided(
    graph: Graph, state: _core.State, options: _core.SolveOptions
) -> tuple[float, float, float]:
    """Return the offset by the motion after each pose, by that before it, and their sigma [s].

    Errors of boxes move poses, and with them the motion that a delay goes along. What that does to
    an estimate has the opposite sign on both sides: where these contradict each other, the estimate
    is no better than half of their difference.

    Raises
    ------
    ValueError
        If boxes do not determine it.
    """
    row = calibration_parameters().index("time_offset")
    values, sigmas = [], []
    for is_late in (True, False):
        scores = scores_at(graph, state, options, [row], is_late=is_late)
        information = float(scores.information[row, row])
        if not information > 0.0:
            raise ValueError("calibration: the data do not determine time_offset")
        values.append(float(scores.score[row]) / information)
        sigmas.append(float(np.sqrt(scores.covariance[row, row])) / information)
    return values[0], values[1], max(sigmas)


def are_late(
    graph: Graph, state: _core.State, options: _core.SolveOptions, rows: Sequence[int]
) -> bool:
    """Return whether images were rather taken after their poses than before, by their boxes."""
    row = calibration_parameters().index("time_offset")
    if row not in rows:
        return True
    gains = []
    for is_late in (True, False):
        scores = scores_at(graph, state, options, rows, is_late=is_late)
        score, information = float(scores.score[row]), float(scores.information[row, row])
        is_consistent = information > 0.0 and (score > 0.0) == is_late
        gains.append(score**2 / information if is_consistent else 0.0)
    return gains[0] >= gains[1]
