"""``dqslam ablation``: what each part of the estimator is worth."""

import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam.cli.progress import show_progress

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.ablation import AblationTable, Row


def ablation(
    out: Annotated[Path, typer.Option(help="Directory for ablation.json and ablation.png.")],
    trials: Annotated[int, typer.Option(min=1, help="Seeds to run; each takes a minute.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="The first of them.")] = 0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: all cores.")] = None,
) -> None:
    """Solve the paper's scenario with one part of the estimator changed at a time.

    Writes ablation.json and ablation.png.
    """
    from rich.console import Console

    from dqslam.ablation import run_ablation
    from dqslam.scenario import load_scenario

    out.mkdir(parents=True, exist_ok=True)
    with show_progress(trials) as progress:
        table = run_ablation(
            load_scenario("paper"),
            trials=trials,
            seed=seed,
            jobs=jobs or os.cpu_count() or 1,
            progress=progress,
        )
    table.save(out / "ablation.json")
    console = Console()
    console.print(_results(table))
    console.print(f"wrote {out / 'ablation.json'}", markup=False)
    if find_spec("matplotlib") is None:
        console.print("no ablation.png: matplotlib is missing (pip install 'dqslam[plot]')")
        return
    from dqslam.plot.ablation import plot_ablation

    plot_ablation(table, out / "ablation.png")
    console.print(f"wrote {out / 'ablation.png'}", markup=False)


def _results(table: "AblationTable") -> "Table":
    """Lay out a block for each residual, then one for each kind of wrong ids."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(
        title=f"seeds {table.seed} to {table.seed + table.trials - 1}, ellipsoids, monocular; "
        "errors over the posterior bound",
        box=SIMPLE_HEAD,
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
    return "told the right ids" if variant.told else _words(variant.loss.name)


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
