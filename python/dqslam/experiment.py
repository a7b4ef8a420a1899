"""The paper's experiment: many trials of one scenario, and the table of their errors."""

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

from dqslam import _core
from dqslam._core import SolveOptions
from dqslam.estimate import Estimate
from dqslam.evaluate import Report, evaluate, position_error
from dqslam.io.files import write_json
from dqslam.problem import build_graph, solve
from dqslam.recording import Recording, Truth
from dqslam.scenario import Scenario
from dqslam.simulate import simulate

Method = Literal["dqslam", "paper"]
RowName = Literal["monocular", "relative_position"]
Progress = Callable[[int, int], None]

ROWS: tuple[RowName, ...] = ("monocular", "relative_position")
METRICS = ("rmse_pos", "rmse_landmark", "rmse_volume")

# The paper does not state the weight Lambda of its box residual. Every decade of its sigma, in
# px^4 m^2, is tried from where boxes overrule odometry (worse than it) to where they do not count.
ALGEBRAIC_SIGMAS = tuple(float(10.0**power) for power in range(7, 15))

# [S&M17] table 1, (avg, med) of each metric.
PAPER_ODOMETRY = (5.31, 4.03)
PAPER_ROWS: dict[RowName, dict[str, tuple[float, float]]] = {
    "monocular": {
        "rmse_pos": (4.12, 3.33),
        "rmse_landmark": (4.27, 2.86),
        "rmse_volume": (0.36, 0.12),
    },
    "relative_position": {
        "rmse_pos": (1.75, 0.63),
        "rmse_landmark": (2.39, 0.89),
        "rmse_volume": (7.28, 0.13),
    },
}


def candidate_sigmas(method: Method) -> tuple[float | None, ...]:
    """Return the algebraic sigmas that a method is run with; None: it has no such weight."""
    return ALGEBRAIC_SIGMAS if method == "paper" else (None,)


def method_options(method: Method, algebraic_sigma: float | None) -> SolveOptions:
    """Return the options of the solver: its defaults, or the paper's method as published."""
    if method == "dqslam":
        return SolveOptions()
    return SolveOptions(
        residual=_core.Residual.ALGEBRAIC,
        landmark_model=_core.LandmarkModel.DUAL_QUADRIC,
        start=_core.Start.IDENTITY,
        schedule=_core.Schedule.BATCH,
        loss=_core.Loss.NONE,
        minimizer=_core.Minimizer.DOGLEG,  # never worse than Levenberg-Marquardt here, and faster
        algebraic_sigma=algebraic_sigma,
    )


@dataclass(frozen=True)
class Outcome:
    """One solve of one trial: a report, or why there is none."""

    report: Report | None
    seconds: float
    """Wall clock of building and solving the problem."""
    failure: str = ""


@dataclass(frozen=True)
class Trial:
    """One seed: the error of odometry, and one outcome per row and candidate sigma."""

    seed: int
    odometry_rmse_pos: float
    """Metres."""
    outcomes: dict[RowName, tuple[Outcome, ...]]


@dataclass(frozen=True)
class Statistics:
    """Of one metric over the trials that succeeded; NaN when none did."""

    avg: float
    med: float
    max: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Self:
        """Summarise values."""
        if not values:
            return cls(np.nan, np.nan, np.nan)
        return cls(float(np.mean(values)), float(np.median(values)), float(np.max(values)))


@dataclass(frozen=True)
class TableRow:
    """One row of the table: all trials of one kind, with one candidate sigma."""

    algebraic_sigma: float | None
    metrics: dict[str, Statistics]
    """By the names in METRICS; metres, metres, cubic metres."""
    seconds_med: float
    failures: dict[int, str]
    """Why a trial failed, by its seed."""


@dataclass(frozen=True)
class PaperTable:
    """The paper's table 1 for one method, and the scan it was chosen from."""

    seeds: tuple[int, ...]
    objects: str
    method: Method
    odometry: Statistics
    """RMSE_pos of odometry alone, metres."""
    scan: dict[RowName, tuple[TableRow, ...]]
    """One table row per candidate sigma."""

    def best(self, row: RowName) -> TableRow:
        """Return the row with the fewest failures, among these the least mean RMSE_pos."""
        return min(
            self.scan[row],
            key=lambda one: (
                len(one.failures),
                np.nan_to_num(one.metrics["rmse_pos"].avg, nan=np.inf),
            ),
        )

    def as_dict(self) -> dict[str, Any]:
        """Lay out the table as plain data, for JSON; the scan is there when there is a choice."""
        table: dict[str, Any] = {
            "trials": len(self.seeds),
            "seed": self.seeds[0],
            "objects": self.objects,
            "method": self.method,
            "odometry": {"rmse_pos": asdict(self.odometry)},
        }
        for name in ROWS:
            row = self.best(name)
            table[name] = {
                **{metric: asdict(row.metrics[metric]) for metric in METRICS},
                "failures": len(row.failures),
                "seconds_per_trial": {"med": row.seconds_med},
            }
        if self.method == "paper":
            table["scan"] = {name: [_scan_entry(row) for row in self.scan[name]] for name in ROWS}
        return table

    def save(self, path: str | Path) -> None:
        """Write the table as JSON, whole or not at all."""
        write_json(path, self.as_dict())


def _scan_entry(row: TableRow) -> dict[str, Any]:
    return {
        "algebraic_sigma": row.algebraic_sigma,
        "rmse_pos": asdict(row.metrics["rmse_pos"]),
        "failures": len(row.failures),
    }


def run_paper(
    scenario: Scenario,
    *,
    trials: int,
    seed: int,
    method: Method,
    jobs: int = 1,
    progress: Progress | None = None,
) -> PaperTable:
    """Run trials with seeds seed, seed + 1, ... and tabulate their errors.

    Parameters
    ----------
    jobs
        Processes; with 1 everything runs in this one. The numbers do not depend on it, times do.
    progress
        Called with (trials done, trials) after each.
    """
    for name, value, least in (("trials", trials, 1), ("seed", seed, 0), ("jobs", jobs, 1)):
        if value < least:
            raise ValueError(f"{name}: expected {least} or more, got {value}")
    seeds = range(seed, seed + trials)
    run = _run_here if jobs == 1 else partial(_run_in_processes, jobs=jobs)
    done: list[Trial] = []
    for trial in run(scenario, seeds, method):
        done.append(trial)
        if progress is not None:
            progress(len(done), trials)
    return tabulate(sorted(done, key=lambda trial: trial.seed), scenario, method)


def run_trial(scenario: Scenario, seed: int, method: Method) -> Trial:
    """Simulate one seed and solve each row with each sigma; a solve may fail, and is kept."""
    recording, truth = simulate(scenario, seed=seed)
    odometry = recording.odometry
    poses = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    return Trial(
        seed=seed,
        odometry_rmse_pos=position_error(truth.pose_model, poses, truth.poses),
        outcomes={
            row: tuple(
                _outcome(seen_by(row, recording), truth, method_options(method, sigma))
                for sigma in candidate_sigmas(method)
            )
            for row in ROWS
        },
    )


def seen_by(row: RowName, recording: Recording) -> Recording:
    """Return what the estimator of a row is given."""
    return recording if row == "relative_position" else replace(recording, positions=None)


def _outcome(recording: Recording, truth: Truth, options: SolveOptions) -> Outcome:
    start = time.perf_counter()
    try:
        estimate, _ = solve(build_graph(recording), options)
        seconds = time.perf_counter() - start
        return Outcome(evaluate(estimate, truth), seconds)
    except Exception as error:  # whatever it was: counted, shown and never dropped
        seconds = time.perf_counter() - start
        return Outcome(None, seconds, f"{type(error).__name__}: {error}")


def tabulate(trials: Sequence[Trial], scenario: Scenario, method: Method) -> PaperTable:
    """Put the outcomes of trials into a table."""
    sigmas = candidate_sigmas(method)
    return PaperTable(
        seeds=tuple(trial.seed for trial in trials),
        objects=scenario.objects,
        method=method,
        odometry=Statistics.of([trial.odometry_rmse_pos for trial in trials]),
        scan={
            row: tuple(
                _table_row(sigma, {trial.seed: trial.outcomes[row][column] for trial in trials})
                for column, sigma in enumerate(sigmas)
            )
            for row in ROWS
        },
    )


def _table_row(sigma: float | None, outcomes: dict[int, Outcome]) -> TableRow:
    reports = [outcome.report for outcome in outcomes.values() if outcome.report is not None]
    return TableRow(
        algebraic_sigma=sigma,
        metrics={
            metric: Statistics.of([getattr(report, metric) for report in reports])
            for metric in METRICS
        },
        seconds_med=float(np.median([outcome.seconds for outcome in outcomes.values()])),
        failures={
            seed: outcome.failure for seed, outcome in outcomes.items() if outcome.report is None
        },
    )


def example_maps(
    scenario: Scenario, table: PaperTable, count: int
) -> list[tuple[str, Estimate, Truth]]:
    """Solve the first monocular trials that succeeded again: title, estimate, truth of each."""
    row = table.best("monocular")
    options = method_options(table.method, row.algebraic_sigma)
    maps = []
    for seed in [seed for seed in table.seeds if seed not in row.failures][:count]:
        recording, truth = simulate(scenario, seed=seed)
        estimate, _ = solve(build_graph(seen_by("monocular", recording)), options)
        report = evaluate(estimate, truth)
        errors = f"odometry {report.odometry_rmse_pos:.2f} m, estimate {report.rmse_pos:.2f} m"
        maps.append((f"seed {seed}: {errors}", estimate, truth))
    return maps


def _run_here(scenario: Scenario, seeds: Sequence[int], method: Method) -> Iterator[Trial]:
    for seed in seeds:
        yield run_trial(scenario, seed, method)


def _run_in_processes(
    scenario: Scenario, seeds: Sequence[int], method: Method, jobs: int
) -> Iterator[Trial]:
    """Yield trials as they finish. Ctrl-C in a terminal reaches the workers too, and ends them."""
    # Spawned, not forked: the parent may hold locks of threads that a fork would not copy.
    executor = ProcessPoolExecutor(
        min(jobs, len(seeds)), multiprocessing.get_context("spawn"), _end_on_interrupt
    )
    try:
        with _interrupts_held():  # workers inherit this: while they start they would say much
            futures = [executor.submit(run_trial, scenario, seed, method) for seed in seeds]
        for future in as_completed(futures):
            yield future.result()
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Put off Ctrl-C in this thread."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_on_interrupt() -> None:
    """Let Ctrl-C end this process at once and in silence."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
