"""Scores in addition to errors: against the posterior bound, and for wrong associations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dqslam._checks import Bools
from dqslam._core import Loss, SolveOptions, Summary
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.metrics import mean_distance, position_error, true_rows
from dqslam.recording import Recording, Truth
from dqslam.studies.paper.methods import Assumptions
from dqslam.uncertainty import (
    chi_square_interval,
    marginal_covariances,
    normalized_squares,
    posterior_bound,
    tangent_errors,
    true_state,
)

# Estimates whose costs differ by less than half a chi-square of 0.1 are the same.
SAME_COST = 0.05


@dataclass(frozen=True)
class BoundScore:
    """An estimate compared with the posterior bound and the optimum."""

    bound: float
    """Expected mean position error at the posterior bound, meters."""
    last_pose_nees: float
    """Squared error of the last pose in sigmas of its covariance, per degree of freedom."""
    pose_nees: float
    """Mean of the same quantity over all poses but the first, which is fixed."""
    pose_dof: int
    center_nees: float
    """Mean of the same quantity over the centers of the mapped objects (3 degrees of freedom)."""
    is_optimum: bool
    """Whether a start at the truth does not reach a lower cost."""
    excess_cost: float = float("nan")
    """Final cost less that of the same solve that starts at the truth."""


@dataclass(frozen=True)
class RobustScore:
    """How well wrong ids were recognized, and the errors of an oracle without the wrong boxes."""

    precision: float
    """Share of the inliers whose id is right."""
    recall: float
    """Share of the boxes with the right id that are inliers."""
    oracle_rmse_pos: float
    """Mean position error of the oracle, meters."""
    oracle_rmse_landmark: float
    """Mean error of the oracle's centers, over the objects that the estimate also has, meters."""
    dropped: int
    """Number of objects that the estimate leaves out because too few boxes fit them."""


def score_bound(
    graph: Graph,
    right_graph: Graph,
    truth: Truth,
    solved: tuple[Estimate, Summary],
    options: SolveOptions,
) -> BoundScore:
    """Compare an estimate with the bound, its own covariance, and the optimum.

    `right_graph` is the problem without the boxes whose id is wrong.
    """
    estimate, _ = solved
    covariance = marginal_covariances(graph, estimate, options)
    pose_error = tangent_errors(truth.pose_model, truth.poses, estimate.poses)[1:]
    pose_nees = normalized_squares(pose_error, covariance.poses[1:])
    exists = np.isin(estimate.object_ids, truth.object_ids)
    rows = true_rows(estimate.object_ids[exists], truth)
    center_error = truth.centers[rows] - estimate.centers[exists]
    center_nees = normalized_squares(center_error, covariance.centers[exists])
    cost = truncated_cost(solved, options)
    from_truth = solve(graph, options, start=true_state(graph, truth, options))
    best_cost = truncated_cost(from_truth, options)
    return BoundScore(
        bound=posterior_bound(right_graph, truth).position_error,
        last_pose_nees=float(pose_nees[-1]),
        pose_nees=float(pose_nees.mean()),
        pose_dof=pose_error.shape[1],
        center_nees=float(np.nanmean(center_nees)),  # NaN for an object that is undetermined
        is_optimum=cost <= best_cost + SAME_COST,
        excess_cost=cost - best_cost,
    )


def truncated_cost(solved: tuple[Estimate, Summary], options: SolveOptions) -> float:
    """Return the cost; each box without a weight counts as much as one at the threshold does."""
    estimate, summary = solved
    if options.loss not in (Loss.GNC_TLS, Loss.GNC_GM):
        return summary.final_cost
    return summary.final_cost + 0.5 * options.outlier_chi_square * float(np.sum(~estimate.inliers))


def score_robust(
    right_graph: Graph, right: Bools, truth: Truth, estimate: Estimate, options: SolveOptions
) -> RobustScore:
    """Compare the inliers with the boxes that have the right id, flags (b,), and run the oracle.

    ``options`` are those of the oracle, which solves ``right_graph``.
    """
    found = estimate.inliers & right
    oracle, _ = solve(right_graph, options)
    shared = oracle.object_ids[np.isin(oracle.object_ids, estimate.object_ids)]
    oracle_centers = oracle.centers[np.isin(oracle.object_ids, shared)]
    return RobustScore(
        precision=float(found.sum() / max(estimate.inliers.sum(), 1)),
        recall=float(found.sum() / max(right.sum(), 1)),
        oracle_rmse_pos=position_error(truth.pose_model, oracle.poses, truth.poses),
        oracle_rmse_landmark=mean_distance(oracle_centers, truth.centers[true_rows(shared, truth)]),
        dropped=len(estimate.dropped),
    )


def right_graph_of(recording: Recording, right: Bools, assumptions: Assumptions) -> Graph:
    """Return the problem of the boxes that have the right id (b,)."""
    detections = recording.detections.select(right)
    positions = recording.positions
    if positions is not None:
        positions = positions.select(np.isin(positions.object_id, detections.object_id))
    return assumptions.graph(replace(recording, detections=detections, positions=positions))


def summarize_bound(scores: Sequence[BoundScore], rmse_pos: Sequence[float]) -> dict[str, Any]:
    """Average over trials; a consistent NEES has mean 1, and is in its interval in 95 % of cases.

    The interval is for one pose, or one object, in each trial. A mean over all of them scatters
    less; how much less depends on their correlation.
    """
    if not scores:
        return {}
    return {
        "efficiency": float(np.mean(rmse_pos) / np.mean([score.bound for score in scores])),
        "anees": float(np.mean([score.last_pose_nees for score in scores])),
        "anees_poses": float(np.mean([score.pose_nees for score in scores])),
        "anees_interval": chi_square_interval(sum(score.pose_dof for score in scores)),
        "anees_objects": float(np.mean([score.center_nees for score in scores])),
        "anees_objects_interval": chi_square_interval(3 * len(scores)),
        "optimum_rate": float(np.mean([score.is_optimum for score in scores])),
    }
