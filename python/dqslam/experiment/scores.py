"""Scores beside plain errors: against the posterior bound, and of wrong associations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import SolveOptions, Summary
from dqslam.estimate import Estimate
from dqslam.evaluate import position_error, true_rows
from dqslam.problem import BoxNoise, Graph, build_graph, solve
from dqslam.recording import Recording, Truth
from dqslam.uncertainty import marginal_covariances, posterior_bound, true_state

# Half a chi-square of 0.1: estimates that differ by less are the same.
SAME_COST = 0.05


@dataclass(frozen=True)
class BoundScore:
    """An estimate beside what the data could give at best."""

    bound: float
    """Expected mean position error, metres."""
    pose_nees: float
    """Squared error of the last pose, in sigmas of its own covariance."""
    pose_dof: int
    center_nees: float
    """The same for the centre of the first object; 3 degrees of freedom."""
    is_optimum: bool
    """Whether a start at the truth ends no lower."""


@dataclass(frozen=True)
class RobustScore:
    """How wrong ids were told from right ones, and what it would be worth to know them."""

    precision: float
    """Share of the boxes called inliers whose id is right."""
    recall: float
    """Share of the boxes with the right id that are called inliers."""
    oracle_rmse_pos: float
    """Mean position error of the run that is told the right ones, metres."""


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
    estimate, summary = solved
    covariance = marginal_covariances(graph, estimate, options)
    last = [truth.poses[-1:], estimate.poses[-1:]]
    pose_error = _core.minus(truth.pose_model, *last)[0]
    first_row = true_rows(estimate.object_ids[:1], truth)
    center_error = (truth.center[first_row] - estimate.centers[:1])[0]
    _, from_truth = solve(graph, options, start=true_state(graph, truth, options))
    return BoundScore(
        bound=posterior_bound(right_graph, truth).position_error,
        pose_nees=_squared_sigmas(pose_error, covariance.poses[-1]),
        pose_dof=len(pose_error),
        center_nees=_squared_sigmas(center_error, covariance.centers[0]),
        is_optimum=bool(summary.final_cost <= from_truth.final_cost + SAME_COST),
    )


def score_robust(
    right_graph: Graph, right: Bools, truth: Truth, estimate: Estimate, options: SolveOptions
) -> RobustScore:
    """Score which boxes fit, against which have the right id (b,); options: of the told run."""
    found = estimate.inliers & right
    told, _ = solve(right_graph, options)
    return RobustScore(
        precision=float(found.sum() / max(estimate.inliers.sum(), 1)),
        recall=float(found.sum() / max(right.sum(), 1)),
        oracle_rmse_pos=position_error(truth.pose_model, told.poses, truth.poses),
    )


def right_graph_of(recording: Recording, right: Bools, noise: BoxNoise) -> Graph:
    """Return the problem of the boxes that have the right id (b,)."""
    detections = recording.detections.select(right)
    positions = recording.positions
    if positions is not None:
        positions = positions.select(np.isin(positions.object_id, detections.object_id))
    part = replace(recording, detections=detections, positions=positions)
    return build_graph(part, box_noise=noise)


def summarise_bound(scores: Sequence[BoundScore], rmse_pos: Sequence[float]) -> dict[str, Any]:
    """Average over trials; NEES is divided by its degrees of freedom, so that 1 is expected."""
    if not scores:
        return {}
    freedom = sum(score.pose_dof for score in scores)
    return {
        "efficiency": float(np.mean(rmse_pos) / np.mean([score.bound for score in scores])),
        "anees": sum(score.pose_nees for score in scores) / freedom,
        "anees_interval": chi_square_interval(freedom),
        "anees_objects": float(np.mean([score.center_nees for score in scores]) / 3.0),
        "optimum_rate": float(np.mean([score.is_optimum for score in scores])),
    }


def chi_square_interval(freedom: int) -> list[float]:
    """Return where 95 % of chi-squares of these degrees of freedom lie, divided by them."""
    from scipy.stats import chi2

    return [float(chi2.ppf(share, freedom) / freedom) for share in (0.025, 0.975)]


def _squared_sigmas(error: Floats, covariance: Floats) -> float:
    return float(error @ np.linalg.solve(covariance, error))
