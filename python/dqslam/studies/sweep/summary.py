"""The summary of a sweep: the metrics of each cell, with confidence intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from dqslam._version import version
from dqslam.io.files import write_json
from dqslam.studies.sweep.file import Sweep
from dqslam.studies.sweep.intervals import (
    CONFIDENCE,
    Interval,
    mean_interval,
    median_interval,
    share_interval,
)
from dqslam.studies.sweep.trial import METRICS, YES_OR_NO, TrialResult


@dataclass(frozen=True)
class Spread:
    """One metric over the trials of a cell that have it."""

    count: int
    mean: float
    mean_interval: Interval | None
    median: float
    median_interval: Interval | None
    max: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Self:
        """Summarize one or more values."""
        return cls(
            count=len(values),
            mean=float(np.mean(values)),
            mean_interval=mean_interval(values),
            median=float(np.median(values)),
            median_interval=median_interval(values),
            max=float(np.max(values)),
        )


@dataclass(frozen=True)
class Share:
    """The share of the trials of a cell for which something is true."""

    count: int
    share: float | None
    interval: Interval | None

    @classmethod
    def of(cls, count: int, total: int) -> Self:
        """Count cases."""
        return cls(count, count / total if total else None, share_interval(count, total))


@dataclass(frozen=True)
class CellSummary:
    """All trials of one cell."""

    key: str
    values: Mapping[str, Any]
    """Values of the varied settings, by their dotted names."""
    trials: int
    failed: Share
    metrics: dict[str, Spread]
    """Metrics of the trials that succeeded, by the names in METRICS."""
    shares: dict[str, Share]
    """Shares of the same trials, by the names in YES_OR_NO."""


@dataclass(frozen=True)
class SweepSummary:
    """A summary per cell, in the order of the sweep."""

    scenario: str
    seeds: tuple[int, ...]
    parameters: tuple[str, ...]
    cells: tuple[CellSummary, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the summary as plain data for JSON."""
        shown = [name for name in METRICS if any(name in cell.metrics for cell in self.cells)]
        return {
            "dqslam_version": version(),
            "scenario": self.scenario,
            "trials": len(self.seeds),
            "seed": self.seeds[0],
            "parameters": list(self.parameters),
            "units": {name: METRICS[name] for name in shown},
            "confidence": CONFIDENCE,
            "cells": [asdict(cell) for cell in self.cells],
        }

    def save(self, path: str | Path) -> None:
        """Write the summary as JSON; the file is complete or absent."""
        write_json(path, self.as_dict())


def summarize(
    sweep: Sweep, keys: Sequence[str], results: Sequence[Sequence[TrialResult]]
) -> SweepSummary:
    """Summarize the results of each cell, cells by their keys, in the order of the sweep."""
    return SweepSummary(
        scenario=sweep.scenario,
        seeds=sweep.seeds,
        parameters=sweep.parameters,
        cells=tuple(
            _cell(key, cell.values, trials)
            for key, cell, trials in zip(keys, sweep.cells, results, strict=True)
        ),
    )


def _cell(key: str, values: Mapping[str, Any], trials: Sequence[TrialResult]) -> CellSummary:
    columns = {name: _present(name, trials) for name in METRICS}
    return CellSummary(
        key=key,
        values=dict(values),
        trials=len(trials),
        failed=Share.of(sum(bool(trial.failure) for trial in trials), len(trials)),
        metrics={
            name: Spread.of(column)
            for name, column in columns.items()
            if column and name not in YES_OR_NO
        },
        shares={
            name: Share.of(int(sum(columns[name])), len(columns[name]))
            for name in YES_OR_NO
            if columns[name]
        },
    )


def _present(name: str, trials: Sequence[TrialResult]) -> list[float]:
    values = [trial.metrics.get(name) for trial in trials]
    return [value for value in values if value is not None]
