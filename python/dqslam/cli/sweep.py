"""``dqslam sweep``: many trials of many settings."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dqslam._files import write_text
from dqslam._input import read_text
from dqslam._outputs import added_files, check_added, claim_folder
from dqslam.cli.options import BackendName, Jobs, ResultDirectory, Scheduler
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.studies.sweep import CellSummary, SweepSummary

COPY = "sweep.toml"
NAMED = 5  # number of failures of one kind that are named


def sweep(
    context: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="TOML file with a scenario, seeds, and the settings to vary."
        ),
    ],
    out: ResultDirectory,
    jobs: Jobs = None,
    backend: BackendName = None,
    scheduler: Scheduler = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Vary settings of a scenario or the estimator, over a grid or at random, with many seeds.

    If it is stopped or killed, the same command continues. Writes results.csv with a row for each
    trial, results.parquet if pyarrow is installed, summary.json, sweep.toml (a copy of the file)
    and config.toml.
    """
    from dqslam.studies.sweep import load_sweep, run_sweep
    from dqslam.studies.sweep.run import WRITTEN_BY

    asked = load_sweep(file)
    is_copy = (out / COPY).exists() and file.exists() and (out / COPY).samefile(file)
    names = [CONFIG] if is_copy else [COPY, CONFIG]
    if out.is_dir():
        claim_folder(out, WRITTEN_BY)
        check_added(out, names, WRITTEN_BY)
    output = Output(quiet=quiet, as_json=json)
    with output.trials(len(asked.cells) * len(asked.seeds)) as progress:
        done = run_sweep(
            asked, out, jobs=jobs, backend=backend, scheduler=scheduler, progress=progress
        )
    with added_files(out, names, WRITTEN_BY) as folder:
        if not is_copy:
            write_text(folder / COPY, read_text(file))
        save_settings(context, folder / CONFIG)
    output.table(_table(done.summary))
    if done.found:
        output.line(f"{done.done} trials run, {done.found} were finished before")
    for line in _failures(done.failures):
        output.line(line)
    for path in done.files[:-1]:
        output.line(f"wrote {path}")
    output.file(done.files[-1])


def _table(summary: "SweepSummary") -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    seeds = summary.seeds
    shown = Table(
        title=f"{summary.scenario}, seeds {seeds[0]} to {seeds[-1]}; in brackets 95 % intervals",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for name in _short(summary.parameters).values():
        shown.add_column(name.replace("_", "\n"), justify="right", no_wrap=True)
    has_bound = any("error_over_bound" in cell.metrics for cell in summary.cells)
    for heading in ("positions, m\nmean", "\nmedian"):
        shown.add_column(heading, justify="right", min_width=13)
    bound_heading = ["error/bound\nmean"] if has_bound else []
    for heading in ("centers, m\nmean", *bound_heading, "\nfailed"):
        shown.add_column(heading, justify="right")
    for cell in summary.cells:
        positions = cell.metrics.get("rmse_pos")
        bound = [_mean(cell, "error_over_bound")] if has_bound else []
        shown.add_row(
            *map(_text, cell.values.values()),
            "" if positions is None else _number(positions.mean, positions.mean_interval),
            "" if positions is None else _number(positions.median, positions.median_interval),
            _mean(cell, "rmse_landmark"),
            *bound,
            str(cell.failed.count),
        )
    return shown


def _short(names: tuple[str, ...]) -> dict[str, str]:
    """Shorten dotted names as far as they remain different."""
    last = [name.rsplit(".", 1)[-1] for name in names]
    return {
        name: end if last.count(end) == 1 else name for name, end in zip(names, last, strict=True)
    }


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _mean(cell: "CellSummary", metric: str) -> str:
    return _number(cell.metrics[metric].mean) if metric in cell.metrics else ""


def _number(number: float, interval: tuple[float, float] | None = None) -> str:
    if interval is None:
        return f"{number:.3g}"
    # A bare [ would be rich's markup. The interval has no space, so it is never wrapped.
    return f"{number:.3g} \\[{interval[0]:.2g},{interval[1]:.2g}]"


def _failures(failures: Mapping[str, str]) -> list[str]:
    """Return a line for each error, with the trials that it ended."""
    trials: dict[str, list[str]] = {}
    for trial, error in failures.items():
        trials.setdefault(error, []).append(trial)
    return [
        f"failed: {error}: {', '.join(named[:NAMED])}"
        + (f" and {len(named) - NAMED} more" if len(named) > NAMED else "")
        for error, named in trials.items()
    ]
