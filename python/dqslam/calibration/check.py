"""Whether the boxes contradict what an estimate takes for known: camera, mount and odometry."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import require
from dqslam._core import SolveOptions
from dqslam.calibration.parameters import CalibrationFinding
from dqslam.calibration.scores import Scores, mapped_graph
from dqslam.estimate import Estimate
from dqslam.graph import Graph

# Fourteen parameters are tested at once: a false alarm has a probability of 1e-3.
SURE_SIGMAS = 4.0
# Parameters that explain the residuals nearly as well as the best one, as a share of its sigmas.
RIVAL_SHARE = 0.9


def check_calibration(
    graph: Graph,
    estimate: Estimate,
    options: SolveOptions | None = None,
    *,
    sizes_known: bool = False,
) -> tuple[CalibrationFinding, ...]:
    """Test whether the boxes contradict camera, mount or odometry, by score tests.

    The most significant deviation comes first. Each later one is what the residuals show once the
    earlier ones are allowed for. The noise of odometry and of boxes is scaled to their residuals,
    so that a wrong level of noise is no finding. No poses or objects are estimated again.

    The errors of boxes are taken to be independent. Detectors repeat theirs from image to image,
    and objects are no ellipsoids: on recordings, take a finding of less than ten sigmas for a hint.

    Parameters
    ----------
    graph, estimate, options
        The problem, its estimate, and the options of the solve. Objects that are not in the
        estimate take no part.
    sizes_known
        Whether the prior sizes of objects are right on average. If not, a factor common to all of
        them is left open, and the scale of the odometry cannot be told from it.

    Raises
    ------
    ValueError
        When the landmarks are free quadrics, or a box next to the estimate's is no box.
    RuntimeError
        When the box of an object is undefined at the estimate, or next to it.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> estimate, summary = dq.solve(graph)
    >>> dq.check_calibration(graph, estimate)
    ()
    """
    require(graph, Graph, "check_calibration", "call build_graph(recording) first")
    require(estimate, Estimate, "check_calibration", "estimate, summary = solve(graph)")
    state = _core.State(estimate.poses, estimate.ellipsoids, shared=estimate.shared)
    scores = Scores.at(mapped_graph(graph, estimate), state, options or SolveOptions())
    allowed = [] if sizes_known else [scores.names.index("object_size")]
    nuisance = len(allowed)
    rivals: list[tuple[str, ...]] = []
    while len(allowed) < len(scores.names):
        sigmas = scores.sigmas_beside(allowed)
        best = int(np.argmax(sigmas))
        if not sigmas[best] > SURE_SIGMAS:
            break
        near = np.flatnonzero(sigmas >= RIVAL_SHARE * sigmas[best])
        rivals.append(tuple(scores.names[row] for row in near if row != best))
        allowed.append(best)
    if len(allowed) == nuisance:
        return ()
    values, covariance = scores.estimate(allowed)
    return tuple(
        CalibrationFinding(
            scores.names[row],
            float(values[i]),
            float(np.sqrt(covariance[i, i])),
            scores.units[row],
            rivals[i - nuisance],
        )
        for i, row in enumerate(allowed)
        if i >= nuisance
    )
