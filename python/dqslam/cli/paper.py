"""``dqslam paper``: the paper's table and figure."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from dqslam.experiment import PaperTable, RowName, Statistics
    from dqslam.scenario import Scenario

TITLES: "dict[RowName, str]" = {
    "monocular": "monocular",
    "relative_position": "relative position",
}
EXAMPLES = 6  # maps drawn, as in the paper's figure


def paper(
    out: Annotated[Path, typer.Option(help="Directory for table.json and maps.png.")],
    trials: Annotated[int, typer.Option(min=1, help="Seeds to run.")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="The first of them.")] = 0,
    objects: Annotated[
        Literal["cubes", "ellipsoids"],
        typer.Option(help="cubes: as in the paper; ellipsoids: no model error."),
    ] = "cubes",
    method: Annotated[
        Literal["dqslam", "paper"],
        typer.Option(help="dqslam: our best estimator; paper: as published."),
    ] = "dqslam",
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: all cores.")] = None,
) -> None:
    """Run the paper's experiment, and print its table beside the paper's own.

    Writes table.json and maps.png, six of the trials.
    """
    from rich.console import Console

    from dqslam.experiment import run_paper
    from dqslam.scenario import load_scenario

    scenario = load_scenario("paper").model_copy(update={"objects": objects})
    out.mkdir(parents=True, exist_ok=True)
    with _progress(trials) as progress:
        table = run_paper(
            scenario,
            trials=trials,
            seed=seed,
            method=method,
            jobs=jobs or os.cpu_count() or 1,
            progress=progress,
        )
    table.save(out / "table.json")
    # Wide enough for the table whatever the terminal: a wrapped line is easier read than a cut one.
    console = Console(width=max(100, Console().width))
    console.print(_results(table))
    if method == "paper":
        console.print(_scan(table))
    for row, title in TITLES.items():
        for failed, why in table.best(row).failures.items():
            console.print(f"failed: {title}, seed {failed}: {why}", markup=False)
    console.print(f"wrote {out / 'table.json'}", markup=False)
    _draw(scenario, table, out / "maps.png", console)


@contextmanager
def _progress(trials: int) -> Iterator[Callable[[int, int], None]]:
    """Show a bar with the time left on stderr while trials run."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = ("trials", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), "left")
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("trials", total=trials)
        yield lambda done, _: bar.update(task, completed=done)


def _results(table: "PaperTable") -> "Table":
    """Lay out the paper's printed rows beside ours."""
    from rich.table import Table

    from dqslam.experiment import METRICS, PAPER_ODOMETRY, PAPER_ROWS

    seeds = f"{table.seeds[0]}..{table.seeds[-1]}"
    shown = Table(
        title=f"{len(table.seeds)} trials, seeds {seeds}, {table.objects}, method {table.method}",
        caption="avg / med / max over the trials; the paper prints avg / med",
    )
    for heading in ("", "", "position [m]", "objects [m]", "volume [m\u00b3]", "failed", "s/trial"):
        shown.add_column(heading, justify="left" if heading == "" else "right", no_wrap=True)
    shown.add_row("odometry", "paper", _numbers(PAPER_ODOMETRY), style="dim")
    shown.add_row("", "ours", _numbers(table.odometry), end_section=True)
    for name, title in TITLES.items():
        printed, row = PAPER_ROWS[name], table.best(name)
        shown.add_row(
            title, "paper", *[_numbers(printed[metric]) for metric in METRICS], style="dim"
        )
        shown.add_row(
            "",
            "ours",
            *[_numbers(row.metrics[metric]) for metric in METRICS],
            str(len(row.failures)),
            f"{row.seconds_med:.2f}",
            end_section=True,
        )
    return shown


def _scan(table: "PaperTable") -> "Table":
    """Show what each weight of the paper's box residual gives."""
    from rich.table import Table

    shown = Table(
        title="position error [m] by sigma of the algebraic residual, which the paper leaves open",
        caption="avg / med / max (failed); * is used above",
    )
    shown.add_column("sigma", justify="right")
    for title in TITLES.values():
        shown.add_column(title, justify="right", no_wrap=True)
    for rows in zip(*[table.scan[name] for name in TITLES], strict=True):
        cells = []
        for name, row in zip(TITLES, rows, strict=True):
            failed = f" ({len(row.failures)})" if row.failures else ""
            used = " *" if row is table.best(name) else "  "
            cells.append(_numbers(row.metrics["rmse_pos"]) + failed + used)
        shown.add_row(f"{rows[0].algebraic_sigma:.0e}", *cells)
    return shown


def _numbers(values: "Statistics | tuple[float, float]") -> str:
    if not isinstance(values, tuple):
        values = (values.avg, values.med, values.max)
    # Quadrics that are far off have volumes no fixed notation can show.
    return " / ".join(f"{value:.2f}" if value < 1e4 else f"{value:.0e}" for value in values)


def _draw(scenario: "Scenario", table: "PaperTable", path: Path, console: "Console") -> None:
    from dqslam.experiment import example_maps

    if find_spec("matplotlib") is None:
        console.print("no maps.png: matplotlib is missing (pip install 'dqslam[plot]')")
        return
    from dqslam.plot import plot_maps

    maps = example_maps(scenario, table, EXAMPLES)
    if not maps:
        console.print("no maps.png: no monocular trial succeeded")
        return
    plot_maps(maps, path)
    console.print(f"wrote {path}", markup=False)
