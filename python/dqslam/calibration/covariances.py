"""Covariances of poses and objects where the calibration is estimated with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints, require
from dqslam._core import SolveOptions
from dqslam.calibration.delay import scores_at
from dqslam.calibration.optimum import fitting, settle
from dqslam.calibration.parameters import (
    CalibrationFinding,
    calibration_parameters,
    parameter_rows,
)
from dqslam.calibration.recalibrate import recalibrate
from dqslam.calibration.scores import mapped_graph
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.uncertainty import Marginals, marginal_covariances

# Parameters move by this share of their sigma either way, to see how the optimum follows.
SHARE_OF_SIGMA = 0.2


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How the optimum follows p parameters of the calibration, and how well these are known."""

    rows: tuple[int, ...]
    """The parameters, as rows of `calibration_parameters`."""
    covariance: Floats
    """Of the parameters, estimated with all poses and objects, shape (p, p)."""
    poses: Floats
    """Derivatives of the poses, in the tangent of each; shape (n, k, p)."""
    objects: Floats
    """Derivatives of centers and log-Cholesky shapes, shape (o, 9, p)."""
    object_ids: Ints
    """Shape (o,)."""

    def inflated(self, marginals: Marginals, object_ids: Ints) -> Marginals:
        """Return marginals given the calibration as those with an estimated one.

        The joint information of states x and parameters c has the Schur complement P^-1 of c, and
        the marginal covariance of x is cov + J P J^T with J = dx / dc at the optimum.

        Parameters
        ----------
        marginals, object_ids
            Covariances for a known calibration, NaN where there are none, and their objects' ids,
            (o,). An object that took no part has none, either.
        """
        row = np.searchsorted(self.object_ids, object_ids).clip(max=len(self.object_ids) - 1)
        took_part = self.object_ids[row] == object_ids
        objects = np.where(took_part[:, None, None], self.objects[row], np.nan)
        return replace(
            marginals,
            poses=marginals.poses + self._spread(self.poses),
            objects=marginals.objects + self._spread(objects),
        )

    def _spread(self, derivatives: Floats) -> Floats:
        return np.asarray(derivatives @ self.covariance @ derivatives.transpose(0, 2, 1))


def calibrated_covariances(
    graph: Graph,
    estimate: Estimate,
    findings: Sequence[CalibrationFinding],
    options: SolveOptions | None = None,
) -> Marginals:
    """Return covariances of poses and objects that allow for an estimated calibration.

    ``marginal_covariances`` takes the calibration for known. Here the uncertainty of its parameters
    is added. It takes two further solves from the estimate for each parameter.

    Parameters
    ----------
    graph, estimate, findings, options
        The problem with the calibration as estimated, its estimate, the parameters, and the
        options of the solve, as `solve_with_calibration` takes and returns them.

    Raises
    ------
    ValueError
        For free quadrics.
    RuntimeError
        When the box of an object is undefined at the estimate, or next to it.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> graph, estimate, _, findings = dq.solve_with_calibration(graph, ["mount_yaw"])
    >>> known = dq.marginal_covariances(graph, estimate)
    >>> estimated = dq.calibrated_covariances(graph, estimate, findings)
    >>> bool(estimated.poses[100, 0, 0] > known.poses[100, 0, 0])
    True
    """
    require(graph, Graph, "calibrated_covariances", "call build_graph(recording) first")
    require(estimate, Estimate, "calibrated_covariances", "estimate, summary = solve(graph)")
    options = options or SolveOptions()
    graph = mapped_graph(graph, estimate)
    state = _core.State(estimate.poses, estimate.ellipsoids, shared=estimate.shared)
    values = np.zeros(len(calibration_parameters()))
    rows = parameter_rows([one.name for one in findings])
    values[rows] = [one.value for one in findings]
    found = sensitivity(graph, state, rows, values, options)
    known = marginal_covariances(graph, estimate, options)
    return found.inflated(known, estimate.object_ids)


def sensitivity(
    graph: Graph,
    state: _core.State,
    rows: Sequence[int],
    values: Floats,
    options: SolveOptions,
) -> Sensitivity:
    """Find how the optimum of a problem, near a state, follows some parameters.

    Boxes that do not fit at the state are left out where the loss is robust. ``values``, (p,), are
    those that the problem has been corrected for.
    """
    is_late = float(values[calibration_parameters().index("time_offset")]) >= 0.0
    scores = scores_at(graph, state, options, rows, is_late=is_late)
    _, covariance = scores.estimate(rows)
    core = fitting(graph.core, state, options)
    settled, _ = settle(core, state, options)
    count, k = core.num_poses, 3 if core.pose_model == _core.PoseModel.SE2 else 6
    poses = np.zeros((count, k, len(rows)))
    objects = np.zeros((core.num_objects, 9, len(rows)))
    for column, row in enumerate(rows):
        step = SHARE_OF_SIGMA * float(np.sqrt(covariance[column, column]))
        ends = []
        for sign in (1.0, -1.0):
            deviations = np.zeros(len(values))
            deviations[row] = sign * step
            moved = recalibrate(core, settled, graph.timestamps, deviations, is_late=is_late)
            ends.append(settle(moved, settled, options)[0])
        above, below = ends
        poses[:, :, column] = _core.minus(core.pose_model, above.poses, below.poses) / (2.0 * step)
        objects[:, :, column] = (above.landmarks - below.landmarks) / (2.0 * step)
    return Sensitivity(tuple(rows), covariance, poses, objects, graph.object_ids)
