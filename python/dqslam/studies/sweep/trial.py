"""One trial of a sweep: one cell, one seed."""

import hashlib
import json
import time
from dataclasses import dataclass

import numpy as np

from dqslam._version import version
from dqslam.simulation.simulator import simulate
from dqslam.studies.paper import ScoredSolve, seen_by, solve_and_score
from dqslam.studies.sweep.settings import TrialSettings

# The metrics of a trial with their units. "" is for a share, a count, or 1 and 0 for yes and no.
METRICS = {
    "odometry_rmse_pos": "m",
    "rmse_pos": "m",
    "rmse_landmark": "m",
    "rmse_volume": "m^3",
    "volume_relative_error": "",
    "mapped": "",
    "iterations": "",
    "converged": "",
    "worse_than_odometry": "",
    # Only with `bound`.
    "bound": "m",
    "error_over_bound": "",
    "last_pose_nees": "",
    "pose_nees": "",
    "center_nees": "",
    "is_optimum": "",
    # Only if ids are wrong.
    "inlier_precision": "",
    "inlier_recall": "",
    "oracle_rmse_pos": "m",
    "oracle_rmse_landmark": "m",
    "dropped": "",
}
# The metrics that are 1 or 0 in each trial.
YES_OR_NO = ("converged", "worse_than_odometry", "is_optimum")


@dataclass(frozen=True)
class Task:
    """A trial that is to be run."""

    key: str
    settings: TrialSettings
    seed: int


@dataclass(frozen=True)
class TrialResult:
    """The result of a trial. Only the time depends on where it runs."""

    key: str
    seed: int
    version: str | None
    """Version of dqslam with which the trial ran."""
    seconds: float
    """Wall-clock time."""
    metrics: dict[str, float | None]
    """The measured metrics, by the names in METRICS; None if a value is not finite."""
    failure: str = ""
    """The error if the trial failed; it has no metrics then."""


def cell_key(settings: TrialSettings) -> str:
    """Return a name that two cells share only if all their settings are the same."""
    text = json.dumps(settings.in_full(), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def trial_key(cell: str, seed: int) -> str:
    """Name the trial of a cell with a seed."""
    return f"{cell}_{seed}"


def run_task(task: Task) -> TrialResult:
    """Run a trial; an error becomes its failure."""
    start = time.perf_counter()
    metrics: dict[str, float | None] = {}
    try:
        recording, truth = simulate(task.settings.scenario, seed=task.seed)
        solved = solve_and_score(
            seen_by(task.settings.input, recording),
            truth,
            task.settings.assumptions(),
            task.settings.options(),
            oracle_options=task.settings.options(loss="none"),
            bound=task.settings.bound,
        )
        failure = solved.failure
        if not failure:
            metrics = _metrics(solved)
    except (
        Exception
    ) as error:  # also of the simulation, for example in a world without a single box
        failure = f"{type(error).__name__}: {error}"
    seconds = time.perf_counter() - start
    return TrialResult(task.key, task.seed, version(), seconds, metrics, failure)


def _metrics(solved: ScoredSolve) -> dict[str, float | None]:
    report, bound, robust = solved.report, solved.bound, solved.robust
    assert report is not None  # a solve without a failure has one
    volumes = report.volume_relative_errors
    found: dict[str, float] = {
        "odometry_rmse_pos": report.odometry_rmse_pos,
        "rmse_pos": report.rmse_pos,
        "rmse_landmark": report.rmse_landmark,
        "rmse_volume": report.rmse_volume,
        "volume_relative_error": float(np.median(volumes)) if volumes else np.nan,
        "mapped": report.mapped,
        "iterations": solved.iterations,
        "converged": solved.converged,
        "worse_than_odometry": report.rmse_pos > report.odometry_rmse_pos,
    }
    if bound is not None:
        found |= {
            "bound": bound.bound,
            "error_over_bound": report.rmse_pos / bound.bound,
            "last_pose_nees": bound.last_pose_nees,
            "pose_nees": bound.pose_nees,
            "center_nees": bound.center_nees,
            "is_optimum": bound.is_optimum,
        }
    if robust is not None:
        found |= {
            "inlier_precision": robust.precision,
            "inlier_recall": robust.recall,
            "oracle_rmse_pos": robust.oracle_rmse_pos,
            "oracle_rmse_landmark": robust.oracle_rmse_landmark,
            "dropped": robust.dropped,
        }
    return {name: float(value) if np.isfinite(value) else None for name, value in found.items()}
