"""Tiny problems of the benchmarks, and results made up."""

from dataclasses import replace

import numpy as np
from benchmarks.problems import Problem, chain
from benchmarks.results import Measured, Results, Run, Score, Stage

from dqslam import _core

TRUE_ANSWER = Score(0.1, 0.02, 0.05, 1.0, 0)


def cut(problem, poses):
    """Keep the first poses of a problem."""
    recording, odometry = problem.recording, problem.recording.odometry
    kept = recording.detections.pose < poses
    detections = recording.detections.select(kept)
    seen = np.unique(recording.detections.object_id)
    return Problem(
        replace(
            recording,
            timestamps=recording.timestamps[:poses],
            odometry=replace(
                odometry,
                relative=odometry.relative[: poses - 1],
                covariance=odometry.covariance[: poses - 1],
            ),
            detections=detections,
        ),
        replace(problem.truth, poses=problem.truth.poses[:poses], box_object_id=None),
        problem.peer_centers[np.isin(seen, detections.object_id)],
    )


def tiny(seed=0, noise=0.1):
    return cut(chain(1, 3, seed, noise), 60)


def true_quadrics(problem):
    seen = np.unique(problem.recording.detections.object_id)
    return np.array(
        [_core.dual_quadric_from_ellipsoid(problem.truth.ellipsoids[row]) for row in seen]
    )


def measured(case, program, cpu, boxes=100, score=TRUE_ANSWER, peak=50.0):
    """Runs of the given CPU times, a fifth of it building, the wall clock twice as long."""
    runs = tuple(
        Run(
            {"build": Stage(0.4 * s, 0.2 * s), "solve": Stage(1.6 * s, 0.8 * s)},
            peak_mb=peak,
            iterations=10,
            cost=7.0,
            score=score,
        )
        for s in cpu
    )
    return Measured(case, program, {"poses": 9, "objects": 2, "boxes": boxes}, runs)


def results(*measured):
    return Results({"cores": "2"}, "0.1.0", 0, measured)


def cells(table, heading):
    return next(list(column.cells) for column in table.columns if column.header == heading)
