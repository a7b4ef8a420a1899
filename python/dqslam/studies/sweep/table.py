"""Every trial of a sweep as one row: results.csv, and results.parquet if pyarrow is installed."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dqslam.studies.sweep.file import Sweep
from dqslam.studies.sweep.trial import METRICS, TrialResult
from dqslam.studies.tables import write_table


def write_results(
    folder: Path, sweep: Sweep, keys: Sequence[str], results: Sequence[Sequence[TrialResult]]
) -> list[Path]:
    """Write the results of each cell, cells by their keys, and return the files.

    The columns are: cell, the varied settings by their dotted names, seed, the metrics that any
    trial has, failure. They do not depend on where a trial ran or how long it took.
    """
    return write_table(folder / "results", _columns(sweep, keys, results))


def _columns(
    sweep: Sweep, keys: Sequence[str], results: Sequence[Sequence[TrialResult]]
) -> dict[str, list[Any]]:
    rows = [
        (key, cell.values, trial)
        for key, cell, trials in zip(keys, sweep.cells, results, strict=True)
        for trial in trials
    ]
    measured = [name for name in METRICS if any(name in trial.metrics for _, _, trial in rows)]
    return {
        "cell": [key for key, _, _ in rows],
        **{name: [_plain(values[name]) for _, values, _ in rows] for name in sweep.parameters},
        "seed": [trial.seed for _, _, trial in rows],
        **{name: [trial.metrics.get(name) for _, _, trial in rows] for name in measured},
        "failure": [trial.failure for _, _, trial in rows],
    }


def _plain(value: Any) -> Any:
    """Return a value that a cell of a table can hold; lists become JSON."""
    return json.dumps(value) if isinstance(value, list | dict) else value
