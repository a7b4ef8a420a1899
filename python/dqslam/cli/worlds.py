"""``dqslam worlds``: how the estimator does in worlds unlike the paper's."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._outputs import output_set
from dqslam.cli.options import BackendName, FirstSeed, Jobs, ResultDirectory, Scheduler
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.studies.worlds import RowName, WorldsSummary


def worlds(
    context: typer.Context,
    out: ResultDirectory,
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME|FILE", help="Worlds, or TOML files like theirs. Default: all."
        ),
    ] = None,
    trials: Annotated[int, typer.Option(min=1, help="Seeds of each world.")] = 20,
    seed: FirstSeed = 0,
    row: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROW",
            help="told, calibrated, default, plain or run; can be repeated. Default: told where "
            "there are right sigmas, calibrated where a calibration is wrong, and default.",
        ),
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option(help="Markdown page whose table of the worlds is to be replaced."),
    ] = None,
    jobs: Jobs = None,
    backend: BackendName = None,
    scheduler: Scheduler = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Solve worlds of many kinds and print how many solves reach the optimum, and their errors.

    Writes worlds.json, worlds.md (the table), trials.csv with a row for each solve, and
    config.toml.
    """
    from dqslam.simulation.scenario import load_scenario
    from dqslam.studies.worlds import (
        all_worlds,
        around_table,
        replace_table,
        run_worlds,
        save_results,
    )

    scenarios = [load_scenario(name) for name in names or all_worlds()]
    rows = _rows(row)
    if page is not None:  # before the work: does it have a place for the table?
        around_table(page)
    output = Output(quiet=quiet, as_json=json)
    with output_set(out, "dqslam worlds", inputs=[*(names or ()), page]) as folder:
        with output.trials(len(scenarios) * trials) as progress:
            summary = run_worlds(
                scenarios,
                trials=trials,
                seed=seed,
                rows=rows,
                jobs=jobs,
                backend=backend,
                scheduler=scheduler,
                progress=progress,
            )
        output.table(_table(summary))
        for line in _failures(summary):
            output.line(line)
        written = [out / path.name for path in save_results(summary, folder)]
        save_settings(context, folder / CONFIG)
    for path in written[:-1]:
        output.line(f"wrote {path}")
    output.file(written[-1])
    if page is not None:
        replace_table(page, summary)
        output.line(f"wrote {page}")


def _rows(given: list[str] | None) -> "tuple[RowName, ...] | None":
    from dqslam.studies.worlds import ROWS

    if not given:
        return None
    unknown = [name for name in given if name not in ROWS]
    if unknown:
        raise ValueError(f"--row: {unknown[0]!r} is none of {', '.join(ROWS)}")
    return tuple(name for name in ROWS if name in given)


def _table(summary: "WorldsSummary") -> "Table":
    """Return a table that 80 columns hold; the one in worlds.md has more."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from dqslam.studies.worlds import number

    seeds = summary.seeds
    shown = Table(
        title=f"seeds {seeds[0]} to {seeds[-1]}; lost, in brackets those "
        "that say converged; medians of NEES",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    shown.add_column("world\n  row", no_wrap=True)
    headings = ("\noptimum", "\nlost", "m\nmean", "\nmax", "\nworse")
    for heading in (*headings, "error /\nbound", "NEES of\nposes", "NEES of\ncenters"):
        shown.add_column(heading, justify="right", no_wrap=True)
    for world in summary.worlds:
        odometry = (number(world.odometry.avg), number(world.odometry.max))
        shown.add_row(world.scenario.name, "", "", *odometry, style="bold")
        for name, row in world.rows.items():
            compared = row.compared > 0
            shown.add_row(
                f"  {name}",
                f"{row.at_optimum} of {row.compared}" if compared else "",
                f"{len(row.lost)} ({len(row.lost_converged)})" if compared else "",
                number(row.positions.avg),
                number(row.positions.max),
                str(len(row.worse_than_odometry)),
                number(row.error_over_bound),
                number(row.pose_nees.med),
                number(row.center_nees.med),
            )
    return shown


def _failures(summary: "WorldsSummary") -> list[str]:
    """Say why trials failed: of each row the first reason, and how many there are."""
    lines = []
    for world in summary.worlds:
        for name, row in world.rows.items():
            for what, failures in (("failed", row.failures), ("unscored", row.score_failures)):
                if failures:
                    seed, why = next(iter(failures.items()))
                    more = f" (and {len(failures) - 1} more)" if len(failures) > 1 else ""
                    lines.append(f"{what}: {world.scenario.name}, {name}, seed {seed}: {why}{more}")
    return lines
