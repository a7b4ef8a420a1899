"""Estimation of some parameters of the calibration together with all poses and objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, require
from dqslam._core import SolveOptions
from dqslam.calibration.delay import are_late, scores_at
from dqslam.calibration.parameters import CalibrationFinding, calibration_parameters, parameter_rows
from dqslam.calibration.recalibrate import recalibrate
from dqslam.calibration.scores import mapped_graph
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve

# A calibration has converged when no parameter moves by more than this share of its sigma.
SMALL_CHANGE = 0.05
MAX_ROUNDS = 20
# A step that takes back more than this share of the one before is too long, as are all after it.
TURNS_BACK = 0.5


def solve_with_calibration(
    graph: Graph,
    parameters: Sequence[str],
    options: SolveOptions | None = None,
    *,
    start: _core.State | None = None,
) -> tuple[Graph, Estimate, _core.Summary, tuple[CalibrationFinding, ...]]:
    """Estimate some parameters of the calibration with all poses and objects.

    The solve alternates with Gauss-Newton steps of the parameters, which are the score tests of
    `check_calibration`. `calibrated_covariances` has the covariances of the result.

    Parameters
    ----------
    parameters
        Names from `calibration_parameters`, or groups of them: ``mount`` stands for the three
        rotations of the mount, ``mount_position`` for its place, ``principal_point`` for both of
        its coordinates, ``focal`` and ``k1`` for ``focal_length`` and ``distortion``.
    start
        Initial poses and objects of every solve, as for ``solve``; by default each solve starts at
        the odometry.

    Returns
    -------
    graph
        The problem with the calibration as estimated, and with the objects of the estimate.
    estimate, summary
        Of the last solve, as `solve` returns them.
    findings
        Value and standard deviation of each parameter, in their order, whether significant or not.

    Raises
    ------
    ValueError
        For an unknown name, for a parameter that the data do not determine, or if the calibration
        does not converge.

    Examples
    --------
    A camera that is turned by two degrees, which nobody has told the estimator:

    >>> import dqslam as dq
    >>> import numpy as np
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> calibrated, estimate, summary, (yaw,) = dq.solve_with_calibration(graph, ["mount_yaw"])
    >>> bool(abs(np.degrees(yaw.value)) < 0.5)
    True
    """
    require(graph, Graph, "solve_with_calibration", "call build_graph(recording) first")
    options = options or SolveOptions()
    rows = parameter_rows(parameters)
    if start is None:
        graph = mapped_graph(graph, solve(graph, options)[0])
    return solve_jointly(graph, rows, options, start)


def combined(values: Floats, change: Floats, rows: Sequence[int]) -> Floats:
    """Return values of parameters, (p,), after a further change.

    Scales are multiplied, by the exponential: the priors are of logarithms of sizes.
    """
    return np.where(are_scales(rows), (1.0 + values) * np.exp(change) - 1.0, values + change)


def are_scales(rows: Sequence[int]) -> Bools:
    """Return which parameters are factors, less 1, shape (p,)."""
    return np.isin(rows, parameter_rows(["odometry_scale", "focal_length"]))


def solve_jointly(
    graph: Graph,
    rows: Sequence[int],
    options: SolveOptions,
    start: _core.State | None,
    is_late: bool | None = None,
) -> tuple[Graph, Estimate, _core.Summary, tuple[CalibrationFinding, ...]]:
    """Do what `solve_with_calibration` does, for rows of `calibration_parameters`.

    ``is_late`` tells whether images are taken after their poses; None finds that out.
    """
    names = calibration_parameters()
    total = np.zeros(len(names))
    calibrated, last, damping = graph, None, 1.0
    for _ in range(MAX_ROUNDS):
        estimate, summary = solve(calibrated, options, start=start)
        calibrated, graph = mapped_graph(calibrated, estimate), mapped_graph(graph, estimate)
        state = _core.State(estimate.poses, estimate.ellipsoids, shared=estimate.shared)
        if is_late is None:
            is_late = are_late(calibrated, state, options, rows)
        scores = scores_at(calibrated, state, options, rows, is_late=is_late)
        open_rows = [row for row in rows if not scores.is_determined(row, rows)]
        if open_rows:
            raise ValueError(f"calibration: the data do not determine {names[open_rows[0]]}")
        change, covariance = scores.estimate(rows)
        sigma = np.sqrt(np.diag(covariance))
        step = change / sigma
        if last is not None and last @ step < -TURNS_BACK * (last @ last):
            damping *= 0.5
        last = step
        total[rows] = combined(total[rows], damping * change, rows)
        core = recalibrate(graph.core, state, graph.timestamps, total, is_late=is_late)
        calibrated = replace(graph, core=core)
        if start is not None:
            start = state
        if (np.abs(change) <= SMALL_CHANGE * sigma).all():
            sigma = np.where(are_scales(rows), 1.0 + total[rows], 1.0) * sigma
            findings = tuple(
                CalibrationFinding(names[row], float(total[row]), float(one), scores.units[row])
                for row, one in zip(rows, sigma, strict=True)
            )
            return calibrated, estimate, summary, findings
    raise ValueError(f"calibration: not converged after {MAX_ROUNDS} rounds")
