"""``dqslam ablation``: the value of each part of the estimator."""

import os
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._outputs import output_set
from dqslam.cli.options import MOST_TRIALS, FirstSeed, Jobs, ResultDirectory
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.results import save_study, show_written
from dqslam.cli.settings import ConfigFile

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.studies.ablation import AblationTable, Row


def ablation(
    context: typer.Context,
    out: ResultDirectory,
    trials: Annotated[
        int, typer.Option(min=1, max=MOST_TRIALS, help="Drives to solve; each takes 20 seconds.")
    ] = 10,
    seed: FirstSeed = 0,
    jobs: Jobs = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Solve the paper's scenario with one part of the estimator changed at a time.

    Writes ablation.json, ablation.png and config.toml.
    """
    from dqslam.plot.ablation import plot_ablation
    from dqslam.simulation.scenario import load_scenario
    from dqslam.studies.ablation import run_ablation

    output = Output(quiet=quiet, as_json=json)
    with output_set(out, "dqslam ablation") as folder:
        with output.trials(trials) as progress:
            table = run_ablation(
                load_scenario("paper"),
                trials=trials,
                seed=seed,
                jobs=jobs or os.cpu_count() or 1,
                progress=progress,
            )
        output.table(_results(table))
        why_not = save_study(context, output, table, folder / "ablation.json", plot_ablation)
    show_written(output, out / "ablation.json", out / "ablation.png", why_not)


def _results(table: "AblationTable") -> "Table":
    """Return the table: a block for each residual, then one for each kind of wrong ids."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(
        title=f"seeds {table.seed} to {table.seed + table.trials - 1}, ellipsoids, monocular; "
        "errors over the posterior bound",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),  # fits into eighty columns
    )
    shown.add_column("variant", no_wrap=True)
    for heading in ("optimum", "mean", "median", "iterations", "seconds", "failed"):
        shown.add_column(heading, justify="right", no_wrap=True)
    block = ""
    for row in table.rows:
        if _block(row) != block:
            block = _block(row)
            shown.add_row()
            shown.add_row(block, style="bold")
        shown.add_row(f"  {_name(row)}", *_numbers(row))
    return shown


def _block(row: "Row") -> str:
    if row.variant.wrong_ids is not None:
        return f"{row.variant.wrong_ids} wrong ids"
    return _words(row.variant.residual.name)


def _name(row: "Row") -> str:
    variant = row.variant
    if variant.wrong_ids is None:
        return f"{_words(variant.start.name)}, {_words(variant.schedule.name)}"
    return "oracle" if variant.oracle else _words(variant.loss.name)


def _words(name: str) -> str:
    return name.lower().replace("_", " ")


def _numbers(row: "Row") -> list[str]:
    return [
        f"{row.optimum_rate:.0%}",
        f"{row.error_over_bound:.3g}",
        f"{row.median_error_over_bound:.3g}",
        f"{row.iterations_med:.0f}",
        f"{row.seconds_med:.2f}",
        str(len(row.failures)),
    ]
