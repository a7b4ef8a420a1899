"""The paper's table 1: errors of many trials, as numbers and as JSON."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from dqslam.io.files import write_json
from dqslam.simulation.scenario import Scenario
from dqslam.studies.paper.methods import ROWS, Method, RowName, Settings, candidate_sigmas
from dqslam.studies.paper.scores import summarize_bound
from dqslam.studies.paper.trial import PaperTrial, ScoredSolve

METRICS = ("rmse_pos", "rmse_landmark", "rmse_volume")

# [S&M17] table 1: (avg, med) of each metric.
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


@dataclass(frozen=True)
class Statistics:
    """Statistics of one metric over the trials that succeeded; NaN if none did."""

    avg: float
    med: float
    max: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Self:
        """Summarize values."""
        if not len(values):
            return cls(np.nan, np.nan, np.nan)
        return cls(float(np.mean(values)), float(np.median(values)), float(np.max(values)))


@dataclass(frozen=True)
class TableRow:
    """One row of the table: all trials of one kind, with one candidate sigma."""

    algebraic_sigma: float | None
    metrics: dict[str, Statistics]
    """Statistics by the names in METRICS, in meters, meters and cubic meters."""
    volume_relative_error: Statistics
    """Statistics of our own estimate of volume, over the objects of all trials."""
    seconds_med: float
    failures: dict[int, str]
    """The reason why a trial failed, by its seed."""
    worse_than_odometry: tuple[int, ...] = ()
    """Seeds of the trials whose positions have a larger error than odometry alone."""
    scores: dict[str, Any] = field(default_factory=dict)
    """Scores for the bound and for wrong ids, by name, over the trials that succeeded."""

    def as_dict(self) -> dict[str, Any]:
        """Return the row as plain data."""
        volume = self.volume_relative_error
        return {
            **{metric: asdict(self.metrics[metric]) for metric in METRICS},
            "volume_relative_error": {"avg": volume.avg, "med": volume.med},
            **self.scores,
            "failures": len(self.failures),
            "worse_than_odometry": list(self.worse_than_odometry),
            "seconds_per_trial": {"med": self.seconds_med},
        }


@dataclass(frozen=True)
class PaperTable:
    """The paper's table 1 for one method, and the scan from which its rows were chosen."""

    seeds: tuple[int, ...]
    scenario: Scenario
    settings: Settings
    odometry: Statistics
    """RMSE_pos of odometry alone, meters."""
    scan: dict[RowName, tuple[TableRow, ...]]
    """One table row per candidate sigma."""

    @property
    def method(self) -> Method:
        """Return the name of the estimator."""
        return self.settings.method

    def best(self, row: RowName) -> TableRow:
        """Return the row with the fewest failures, and among these with the least mean RMSE_pos."""
        return min(
            self.scan[row],
            key=lambda one: (
                len(one.failures),
                np.nan_to_num(one.metrics["rmse_pos"].avg, nan=np.inf),
            ),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the table as plain data for JSON; it has the scan if there is a choice."""
        table: dict[str, Any] = {
            "trials": len(self.seeds),
            "seed": self.seeds[0],
            "scenario": self.scenario.name,
            "objects": self.scenario.objects,
            "method": self.method,
            "loss": self.settings.loss,
            "odometry": {"rmse_pos": asdict(self.odometry)},
        }
        if self.settings.shape != "ellipsoid":
            table["shape"] = self.settings.shape
        detector = self.scenario.detector
        if detector.wrong_associations > 0.0:
            table["wrong_associations"] = detector.wrong_associations
            table["wrong_association_kind"] = detector.wrong_association_kind
        for name in ROWS:
            table[name] = self.best(name).as_dict()
        if self.method == "paper":
            table["scan"] = {name: [_scan_entry(row) for row in self.scan[name]] for name in ROWS}
        return table

    def save(self, path: str | Path) -> None:
        """Write the table as JSON; the file is complete or absent."""
        write_json(path, self.as_dict())


def _scan_entry(row: TableRow) -> dict[str, Any]:
    return {
        "algebraic_sigma": row.algebraic_sigma,
        "rmse_pos": asdict(row.metrics["rmse_pos"]),
        "failures": len(row.failures),
    }


def tabulate(trials: Sequence[PaperTrial], scenario: Scenario, settings: Settings) -> PaperTable:
    """Put trials into a table."""
    sigmas = candidate_sigmas(settings.method)
    return PaperTable(
        seeds=tuple(trial.seed for trial in trials),
        scenario=scenario,
        settings=settings,
        odometry=Statistics.of([trial.odometry_rmse_pos for trial in trials]),
        scan={
            row: tuple(
                _table_row(sigma, {trial.seed: trial.solves[row][column] for trial in trials})
                for column, sigma in enumerate(sigmas)
            )
            for row in ROWS
        },
    )


def _table_row(sigma: float | None, solves: dict[int, ScoredSolve]) -> TableRow:
    reports = [one.report for one in solves.values() if one.report is not None]
    return TableRow(
        algebraic_sigma=sigma,
        metrics={
            metric: Statistics.of([getattr(report, metric) for report in reports])
            for metric in METRICS
        },
        volume_relative_error=Statistics.of(
            [error for report in reports for error in report.volume_relative_errors]
        ),
        seconds_med=float(np.median([one.seconds for one in solves.values()])),
        failures={seed: one.failure for seed, one in solves.items() if one.report is None},
        worse_than_odometry=tuple(
            seed
            for seed, one in solves.items()
            if one.report is not None and one.report.rmse_pos > one.report.odometry_rmse_pos
        ),
        scores=_scores(list(solves.values())),
    )


def _scores(solves: Sequence[ScoredSolve]) -> dict[str, Any]:
    """Average the scores of a row; those that no trial has are left out."""
    bounds = [one.bound for one in solves if one.bound is not None]
    errors = [
        one.report.rmse_pos for one in solves if one.bound is not None and one.report is not None
    ]
    scores = summarize_bound(bounds, errors)
    robust = [one.robust for one in solves if one.robust is not None]
    if robust:
        scores["inlier_precision"] = float(np.mean([score.precision for score in robust]))
        scores["inlier_recall"] = float(np.mean([score.recall for score in robust]))
        for name in ("oracle_rmse_pos", "oracle_rmse_landmark"):
            scores[name] = asdict(Statistics.of([getattr(score, name) for score in robust]))
        scores["objects_dropped"] = float(np.mean([score.dropped for score in robust]))
    return scores
