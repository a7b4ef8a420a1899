"""One trial: simulate a seed, estimate, and score."""

import time
from dataclasses import dataclass

from dqslam import _core
from dqslam._core import SolveOptions
from dqslam.graph import solve
from dqslam.metrics import Report, evaluate, position_error
from dqslam.recording import Recording, Truth
from dqslam.simulation.scenario import Scenario
from dqslam.simulation.simulator import simulate
from dqslam.studies.paper.methods import (
    ROWS,
    Assumptions,
    RowName,
    Settings,
    assumptions_of,
    candidate_sigmas,
    method_options,
    seen_by,
)
from dqslam.studies.paper.scores import (
    BoundScore,
    RobustScore,
    right_graph_of,
    score_bound,
    score_robust,
)


@dataclass(frozen=True)
class ScoredSolve:
    """One solve of one trial: a report, or the reason why there is none."""

    report: Report | None
    seconds: float
    """Wall-clock time to build and solve the problem."""
    failure: str = ""
    bound: BoundScore | None = None
    robust: RobustScore | None = None
    """The score of the robust loss if some ids are wrong."""
    iterations: int = 0
    """Iterations of all stages of the solver."""
    converged: bool = False


@dataclass(frozen=True)
class PaperTrial:
    """One seed: the error of odometry, and one solve per row and candidate sigma."""

    seed: int
    odometry_rmse_pos: float
    """Meters."""
    solves: dict[RowName, tuple[ScoredSolve, ...]]


def run_trial(scenario: Scenario, seed: int, settings: Settings) -> PaperTrial:
    """Simulate one seed, and solve each row with each sigma; failed solves are kept."""
    recording, truth = simulate(scenario, seed=seed)
    odometry = recording.odometry
    poses = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    assumptions = assumptions_of(scenario, settings)
    return PaperTrial(
        seed=seed,
        odometry_rmse_pos=position_error(truth.pose_model, poses, truth.poses),
        solves={
            row: tuple(
                solve_and_score(
                    seen_by(row, recording),
                    truth,
                    assumptions,
                    method_options(settings, sigma),
                    oracle_options=method_options(Settings(settings.method), sigma),
                    bound=settings.bound,
                )
                for sigma in candidate_sigmas(settings.method)
            )
            for row in ROWS
        },
    )


def solve_and_score(
    recording: Recording,
    truth: Truth,
    assumptions: Assumptions,
    options: SolveOptions,
    *,
    oracle_options: SolveOptions,
    bound: bool,
) -> ScoredSolve:
    """Solve a recording and compare the estimate with the truth.

    Parameters
    ----------
    oracle_options
        Options of the oracle, which has no loss and runs if some ids are wrong.
    bound
        Whether to compare with the posterior bound and the optimum as well.
    """
    start = time.perf_counter()
    seconds = None
    try:
        graph = assumptions.graph(recording)
        solved = solve(graph, options)
        seconds = time.perf_counter() - start
        report = evaluate(solved[0], truth)
        right = recording.detections.object_id == truth.box_object_id
        right_graph = graph if right.all() else right_graph_of(recording, right, assumptions)
        score = robust = None
        if bound:
            score = score_bound(graph, right_graph, truth, solved, options)
        if not right.all():
            robust = score_robust(right_graph, right, truth, solved[0], oracle_options)
        summary = solved[1]
        return ScoredSolve(
            report,
            seconds,
            bound=score,
            robust=robust,
            iterations=summary.iterations,
            converged=summary.converged,
        )
    except Exception as error:  # any error is counted and shown
        seconds = time.perf_counter() - start if seconds is None else seconds
        return ScoredSolve(None, seconds, f"{type(error).__name__}: {error}")
