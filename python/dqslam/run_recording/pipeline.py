"""Estimate a real recording."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dqslam import _core
from dqslam.estimate import Estimate
from dqslam.io import OdometryNoise, Trajectory
from dqslam.problem import BoxNoise, Graph, build_graph, solve
from dqslam.recording import Recording
from dqslam.run_recording.assumptions import scene_size_prior, with_cut_edges
from dqslam.run_recording.report import (
    box_chi2,
    describe_boxes,
    describe_objects,
    describe_size_prior,
    describe_solver,
    trajectory_error,
)
from dqslam.size_prior import SizePrior, SizePriors

GROW_STEPS = 60


@dataclass(frozen=True)
class RunResult:
    """An estimate, how the solver got there, and its report, ready for JSON."""

    estimate: Estimate
    summary: _core.Summary
    report: dict[str, Any]


def default_options(
    mode: _core.Mode = _core.Mode.SLAM,
    schedule: _core.Schedule = _core.Schedule.GROW,
    poses: int = 0,
) -> _core.SolveOptions:
    """Choose the estimator for real detectors: outliers are many, so the loss is Cauchy's.

    A path of many ``poses`` grows by more of them at a time: at most GROW_STEPS additions.
    """
    options = _core.SolveOptions()
    options.mode = mode
    options.schedule = schedule
    options.loss = _core.Loss.CAUCHY
    options.loss_scale = 2.0
    options.grow_poses = max(options.grow_poses, -(-poses // GROW_STEPS))
    return options


def perturb_odometry(
    recording: Recording,
    noise: OdometryNoise,
    *,
    seed: int,
    believed: OdometryNoise | None = None,
) -> Recording:
    """Add Gaussian noise to every step, for a trajectory that is better than odometry would be.

    The estimator is told the ``noise``, or what is ``believed`` of it instead.
    """
    odometry = recording.odometry
    steps = len(odometry.relative)
    sigma = np.repeat([noise.translation_m, noise.rotation_rad], 3)
    tangent = np.random.default_rng(seed).normal(0.0, sigma, (steps, 6))
    relative = _core.plus(odometry.pose_model, odometry.relative, tangent)
    covariance = (believed or noise).covariance(steps)
    return replace(recording, odometry=replace(odometry, relative=relative, covariance=covariance))


def run(
    recording: Recording,
    *,
    mode: _core.Mode = _core.Mode.SLAM,
    reference: Trajectory | None = None,
    box_noise: BoxNoise | None = None,
    size_prior: SizePrior | SizePriors | None = None,
    options: _core.SolveOptions | None = None,
) -> RunResult:
    """Estimate poses and objects of a recording, and report.

    Edges of boxes on the border of the image only bound the object from one side.

    Parameters
    ----------
    mode
        Whether the odometry is improved (SLAM) or taken as the truth (MAPPING).
    reference
        The trajectory to compare with, before and after; it may be in another world frame.
    box_noise, size_prior, options
        What to assume; by default ``BoxNoise``, ``scene_size_prior``, ``default_options``.
    """
    noise = box_noise or BoxNoise()
    recording = with_cut_edges(recording)
    prior = size_prior or scene_size_prior(recording)
    graph = build_graph(recording, box_noise=noise, size_prior=prior)
    if options is None:
        estimate, summary, costs = _solve_both_ways(graph, mode)
    else:
        estimate, summary = solve(graph, options)
        costs = {options.schedule.name.lower(): summary.final_cost}
    chi2 = box_chi2(estimate, recording.detections, noise)
    report = {
        "mode": mode.name.lower(),
        "poses": len(estimate.timestamps),
        "boxes": describe_boxes(chi2),
        "objects": describe_objects(estimate, recording.detections, chi2),
        "box_noise": {"pixels": noise.pixels, "relative": noise.relative},
        "dropped_objects": {str(name): why for name, why in estimate.dropped.items()},
        "size_prior": describe_size_prior(prior),
        "trajectory_error": None if reference is None else trajectory_error(estimate, reference),
        "solver": describe_solver(summary) | {"final_costs": costs},
    }
    return RunResult(estimate, summary, report)


def _solve_both_ways(
    graph: Graph, mode: _core.Mode
) -> tuple[Estimate, _core.Summary, dict[str, float]]:
    """Solve all at once and by growing, and keep the estimate of lower cost.

    Growing survives long drift; all at once survives video, where the first few views of an
    object have too little parallax to tell in front of from behind.
    """
    schedules = [_core.Schedule.BATCH]
    if mode == _core.Mode.SLAM:
        schedules.append(_core.Schedule.GROW)
    poses = len(graph.timestamps)
    results = [solve(graph, default_options(mode, schedule, poses)) for schedule in schedules]
    costs = {
        schedule.name.lower(): summary.final_cost
        for schedule, (_, summary) in zip(schedules, results, strict=True)
    }
    estimate, summary = min(results, key=lambda result: result[1].final_cost)
    return estimate, summary, costs
