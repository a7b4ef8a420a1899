"""``dqslam batch``: many recordings, resumable, on one machine or a cluster."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._files import write_text
from dqslam._input import read_text
from dqslam._outputs import added_files, check_added, claim_folder
from dqslam.cli.options import BackendName, Jobs, ResultDirectory, Scheduler
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.studies.batch import BatchRun, Row

COPY = "batch.toml"
DOUBTFUL, FAILED = 3, 4  # exit codes


def batch(
    context: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="TOML file with recordings and the options of their runs."
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
    """Run many recordings, each as `dqslam run` does, and write one table of all.

    If it is stopped or killed, the same command continues. Writes the results of each recording to
    recordings/NAME, results.csv with a row for each, results.parquet if pyarrow is installed, a
    copy of the file and config.toml. The file may also have the maps aligned or merged. Exits with
    4 if a recording failed, which does not stop the others, else with 3 if a result is doubtful or
    maps could not be aligned.
    """
    from dataclasses import asdict

    from dqslam.cli.batch_file import load_batch
    from dqslam.studies.batch import run_batch
    from dqslam.studies.batch.run import WRITTEN_BY

    asked = load_batch(file)
    is_copy = (out / COPY).exists() and (out / COPY).samefile(file)
    names = [CONFIG] if is_copy else [COPY, CONFIG]
    if out.is_dir():
        claim_folder(out, WRITTEN_BY)
        check_added(out, names, WRITTEN_BY)
    output = Output(quiet=quiet, as_json=json)
    with output.trials(len(asked.tasks), "recordings") as progress:
        done = run_batch(
            asked.tasks,
            out,
            jobs=jobs,
            backend=backend,
            scheduler=scheduler,
            align=asked.align,
            merge=asked.merge,
            progress=progress,
        )
    with added_files(out, names, WRITTEN_BY) as folder:
        if not is_copy:
            write_text(folder / COPY, read_text(file))
        save_settings(context, folder / CONFIG)
    rows, combined = [asdict(row) for row in done.rows], asdict(done.combined)
    merged = done.combined.merged and str(done.combined.merged)
    output.document({"recordings": rows, **combined, "merged": merged})
    _show(output, done)
    if done.with_status("failed"):
        raise typer.Exit(FAILED)
    if done.with_status("doubtful") or not done.combined.is_complete:
        raise typer.Exit(DOUBTFUL)


def _show(output: Output, done: "BatchRun") -> None:
    output.table(_table(done.rows))
    if done.found:
        output.line(f"{done.done} recordings run, {done.found} were finished before")
    for row in done.with_status("doubtful"):
        output.warn(f"{row.name}: {row.doubts}")
    for row in done.with_status("failed"):
        output.warn(f"{row.name} failed: {row.error}")
    for one in done.combined.alignments:
        if "not_aligned" in one:
            output.warn(f"{one['name']} is not aligned: {one['not_aligned']}")
    if done.combined.not_merged is not None:
        output.warn(f"not merged: {done.combined.not_merged}")
    for path in done.files:
        output.line(f"wrote {path}")


def _table(rows: "tuple[Row, ...]") -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(box=SIMPLE_HEAD, padding=0)
    shown.add_column("recording", overflow="fold")
    shown.add_column("status", no_wrap=True)
    has_truth = any(row.ate_m is not None for row in rows)
    headings = ["poses", "objects", "warned", "IoU\nmedian"]
    headings += ["ATE, m\nbefore", "\nafter"] if has_truth else []
    for heading in (*headings, "time\ns"):
        shown.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        errors = [_number(row.odometry_ate_m), _number(row.ate_m)] if has_truth else []
        counts = [row.poses, row.objects, row.warnings]
        shown.add_row(
            row.name,
            row.status,
            *("" if count is None else str(count) for count in counts),
            _number(row.iou_median),
            *errors,
            _number(row.seconds),
        )
    return shown


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
