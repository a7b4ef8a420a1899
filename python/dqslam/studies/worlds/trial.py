"""One trial: one world, one seed, and what each row makes of it."""

import time
from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.calibration import calibrated_covariances, solve_with_calibration
from dqslam.estimate import Estimate
from dqslam.graph import ENOUGH_INLIERS, Graph, solve
from dqslam.metrics import position_error, true_rows
from dqslam.pipeline import run
from dqslam.recording import Recording, Truth
from dqslam.simulation.scenario import Scenario
from dqslam.simulation.simulator import simulate
from dqslam.studies.paper.scores import right_graph_of, score_bound
from dqslam.studies.worlds.rows import (
    RowName,
    row_assumptions,
    row_options,
    wrong_parameters,
)
from dqslam.uncertainty import Marginals, normalized_squares, tangent_errors

LOST_COST = 10.0
"""A solve that ends this far above a solve that starts at the truth is lost."""
NAN = float("nan")


@dataclass(frozen=True)
class WorldSolve:
    """What a row made of a trial; NaN where there is no such number."""

    position_error: float = NAN
    """Mean distance of the poses from their true places, unaligned, meters."""
    center_error: float = NAN
    """Mean distance of the centers of the mapped objects, meters."""
    mapped: int = 0
    """Objects of the world in the map."""
    bound: float = NAN
    """Expected position error of the best possible estimator, meters."""
    pose_nees: float = NAN
    """Mean squared error of the poses in sigmas, per degree of freedom."""
    center_nees: float = NAN
    """Mean squared error of the centers in sigmas, per degree of freedom."""
    excess_cost: float = NAN
    """Final cost less that of the same solve started at the truth."""
    is_optimum: bool | None = None
    """Whether it is not above that cost by more than 0.05; None if that is not known."""
    converged: bool | None = None
    """Whether the solver says that it has converged, and no object with six boxes or more is left
    out because they do not fit; None if there was nothing to solve."""
    failure: str = ""
    """Why there is no estimate."""
    score_failure: str = ""
    """Why an estimate could not be compared with the bound and the optimum."""
    cpu_seconds: float = NAN
    """Processor time of the row, not of its comparisons."""

    @property
    def is_lost(self) -> bool:
        """Return whether it ended far above a solve that starts at the truth."""
        return self.excess_cost > LOST_COST


@dataclass(frozen=True)
class WorldTrial:
    """A world, a seed, and its rows."""

    world: str
    seed: int
    odometry_error: float
    """Mean distance of the poses of odometry alone from their true places, meters."""
    rows: dict[RowName, WorldSolve]


def run_trial(scenario: Scenario, seed: int, rows: tuple[RowName, ...]) -> WorldTrial:
    """Simulate one seed and run each row; a row may fail, and is kept."""
    recording, truth = simulate(scenario, seed=seed)
    odometry = recording.odometry
    poses = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    recording = replace(recording, positions=None)
    return WorldTrial(
        world=scenario.name,
        seed=seed,
        odometry_error=position_error(truth.pose_model, poses, truth.poses),
        rows={row: _row(row, scenario, recording, truth) for row in rows},
    )


def _row(row: RowName, scenario: Scenario, recording: Recording, truth: Truth) -> WorldSolve:
    if row == "run":
        return _run(recording, truth)
    if row == "calibrated":
        return _calibrate(scenario, recording, truth)
    return _solve(row, scenario, recording, truth)


def _calibrate(scenario: Scenario, recording: Recording, truth: Truth) -> WorldSolve:
    """Estimate what is wrong with the calibration; the optimum and the bound are not known then."""
    believed, options = row_assumptions("calibrated", scenario), row_options("calibrated")
    start = time.process_time()
    try:
        graph, estimate, summary, findings = solve_with_calibration(
            believed.graph(recording), wrong_parameters(scenario), options
        )
        marginals = calibrated_covariances(graph, estimate, findings, options)
    except Exception as error:  # any error is counted and shown
        seconds = time.process_time() - start
        return WorldSolve(failure=f"{type(error).__name__}: {error}", cpu_seconds=seconds)
    pose_nees, center_nees = _nees(estimate, marginals, truth)
    return replace(
        _errors(estimate, truth),
        pose_nees=pose_nees,
        center_nees=center_nees,
        converged=summary.converged and not _gives_up(graph, estimate),
        cpu_seconds=time.process_time() - start,
    )


def _solve(row: RowName, scenario: Scenario, recording: Recording, truth: Truth) -> WorldSolve:
    believed, options = row_assumptions(row, scenario), row_options(row)
    start = time.process_time()
    try:
        graph = believed.graph(recording)
        estimate, summary = solve(graph, options)
    except Exception as error:  # any error is counted and shown
        seconds = time.process_time() - start
        return WorldSolve(failure=f"{type(error).__name__}: {error}", cpu_seconds=seconds)
    solved = replace(
        _errors(estimate, truth),
        converged=summary.converged and not _gives_up(graph, estimate),
        cpu_seconds=time.process_time() - start,
    )
    try:
        right = recording.detections.object_id == truth.box_object_id
        right_graph = graph if right.all() else right_graph_of(recording, right, believed)
        score = score_bound(graph, right_graph, truth, (estimate, summary), options)
    except Exception as error:  # the estimate itself remains
        return replace(solved, score_failure=f"{type(error).__name__}: {error}")
    return replace(
        solved,
        bound=score.bound,
        pose_nees=score.pose_nees,
        center_nees=score.center_nees,
        excess_cost=score.excess_cost,
        is_optimum=score.is_optimum,
    )


def _run(recording: Recording, truth: Truth) -> WorldSolve:
    start = time.process_time()
    try:
        result = run(recording)
    except Exception as error:  # any error is counted and shown
        seconds = time.process_time() - start
        return WorldSolve(failure=f"{type(error).__name__}: {error}", cpu_seconds=seconds)
    seconds = time.process_time() - start
    pose_nees, center_nees = _nees(result.estimate, result.marginals, truth)
    return replace(
        _errors(result.estimate, truth),
        pose_nees=pose_nees,
        center_nees=center_nees,
        converged=None if result.summary is None else result.summary.converged,
        cpu_seconds=seconds,
    )


def _gives_up(graph: Graph, estimate: Estimate) -> bool:
    """Return whether an object is left out that has enough boxes, because they do not fit."""
    dropped = np.isin(graph.object_ids, list(estimate.dropped))
    return bool((graph.observations[dropped] >= ENOUGH_INLIERS).any())


def _errors(estimate: Estimate, truth: Truth) -> WorldSolve:
    exists = np.isin(estimate.object_ids, truth.object_ids)
    rows = true_rows(estimate.object_ids[exists], truth)
    return WorldSolve(
        position_error=position_error(truth.pose_model, estimate.poses, truth.poses),
        center_error=_mean(np.linalg.norm(estimate.centers[exists] - truth.centers[rows], axis=1)),
        mapped=len(rows),
    )


def _nees(estimate: Estimate, marginals: Marginals | None, truth: Truth) -> tuple[float, float]:
    """Return the NEES of the poses and centers whose covariance the pipeline gives."""
    if marginals is None:
        return NAN, NAN
    known = np.flatnonzero(np.isfinite(marginals.poses).all(axis=(1, 2)))
    known = known[known > 0]  # the first pose is fixed
    error = tangent_errors(truth.pose_model, truth.poses[known], estimate.poses[known])
    exists = np.isin(estimate.object_ids, truth.object_ids)
    exists &= np.isfinite(marginals.centers).all(axis=(1, 2))
    rows = true_rows(estimate.object_ids[exists], truth)
    center_error = truth.centers[rows] - estimate.centers[exists]
    return (
        _mean(normalized_squares(error, marginals.poses[known])),
        _mean(normalized_squares(center_error, marginals.centers[exists])),
    )


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else NAN
