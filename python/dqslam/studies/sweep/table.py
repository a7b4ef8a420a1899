"""Every trial of a sweep as one row: results.csv, and results.parquet if pyarrow is installed."""

import csv
import io
import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from dqslam._files import whole_file, write_text
from dqslam.studies.sweep.file import Sweep
from dqslam.studies.sweep.trial import METRICS, TrialResult


def write_results(
    folder: Path, sweep: Sweep, keys: Sequence[str], results: Sequence[Sequence[TrialResult]]
) -> list[Path]:
    """Write the results of each cell, cells by their keys, and return the files.

    The columns are: cell, the varied settings by their dotted names, seed, the metrics that any
    trial has, failure. They do not depend on where a trial ran or how long it took.
    """
    columns = _columns(sweep, keys, results)
    path = folder / "results.csv"
    write_text(path, _csv(columns))
    if find_spec("pyarrow") is None:
        return [path]
    return [path, _write_parquet(folder / "results.parquet", columns)]


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


def _csv(columns: dict[str, list[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()


def _write_parquet(path: Path, columns: dict[str, list[Any]]) -> Path:
    import pyarrow
    from pyarrow import parquet

    with whole_file(path) as temporary:
        parquet.write_table(pyarrow.table(columns), temporary)
    return path
