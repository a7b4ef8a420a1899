"""``dqslam paper``: the paper's table and figure."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dqslam._outputs import output_set
from dqslam.cli.options import MOST_TRIALS, BackendName, FirstSeed, Jobs, ResultDirectory, Scheduler
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.results import draw_figure, show_written
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.studies.paper import PaperTable, RowName, Statistics

ROWS: "dict[RowName, str]" = {
    "monocular": "monocular",
    "relative_position": "relative position",
}
METRICS = {
    "rmse_pos": "positions, m",
    "rmse_landmark": "objects' centers, m",
    "rmse_volume": "objects' volumes, m\u00b3",
}
SCORES = {
    "efficiency": "error / bound",
    "anees": "NEES of last pose",
    "anees_poses": "NEES of all poses",
    "anees_interval": "  95 % interval",
    "anees_objects": "NEES of centers",
    "anees_objects_interval": "  95 % interval",
    "optimum_rate": "share at optimum",
    "inlier_precision": "inliers, precision",
    "inlier_recall": "inliers, recall",
    "oracle_rmse_pos": "oracle: positions",
    "oracle_rmse_landmark": "oracle: centers",
    "objects_dropped": "objects left out",
}
EXAMPLES = 6  # maps drawn, as in the paper's figure


def paper(
    context: typer.Context,
    out: ResultDirectory,
    trials: Annotated[
        int, typer.Option(min=1, max=MOST_TRIALS, help="Drives to simulate and solve.")
    ] = 50,
    seed: FirstSeed = 0,
    scenario: Annotated[
        str,
        typer.Option(
            metavar="NAME|FILE",
            help="paper; orbit: hand-held, in SE(3); honest and honest_orbit: the same, drawn from "
            "the assumptions of the estimator; or a TOML file like theirs.",
        ),
    ] = "paper",
    object_kind: Annotated[
        Literal["cubes", "ellipsoids"] | None,
        typer.Option(
            help="cubes, as in the paper; ellipsoids, without model error. Default: those of the "
            "scenario.",
        ),
    ] = None,
    objects: Annotated[
        Literal["cubes", "ellipsoids"] | None,
        typer.Option(hidden=True, help="The earlier name of --object-kind."),
    ] = None,
    method: Annotated[
        Literal["dqslam", "paper"],
        typer.Option(help="dqslam: the default estimator; paper: the published method."),
    ] = "dqslam",
    bound: Annotated[
        bool,
        typer.Option(
            "--bound",
            help="Compare with the posterior bound and the optimum. For objects in their own "
            "shape, the estimator then uses the true noise of the boxes and the true spread of the "
            "sizes.",
        ),
    ] = False,
    shape: Annotated[
        Literal["ellipsoid", "cuboid", "cylinder", "auto"],
        typer.Option(
            help="The shape of the objects in the estimate; auto: the one that explains the boxes "
            "of an object best."
        ),
    ] = "ellipsoid",
    wrong_associations: Annotated[
        float,
        typer.Option(min=0.0, max=0.4, help="Share of boxes with a wrong object id, 0 to 0.4."),
    ] = 0.0,
    wrong_kind: Annotated[
        Literal["random", "structured"],
        typer.Option(help="Wrong ids are those of any other object, or of the nearest one."),
    ] = "random",
    wrong_association_kind: Annotated[
        Literal["random", "structured"] | None,
        typer.Option(hidden=True, help="The earlier name of --wrong-kind."),
    ] = None,
    loss: Annotated[
        Literal["none", "huber", "cauchy", "dcs", "switchable", "gnc_tls", "gnc_gm"] | None,
        typer.Option(help="Robust loss on boxes. Default: none, or gnc_gm with wrong ids."),
    ] = None,
    jobs: Jobs = None,
    backend: BackendName = None,
    scheduler: Scheduler = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Run the paper's experiment, or another scenario's, and print its table.

    Writes table.json, maps.png with six of the trials, and config.toml.
    """
    from dqslam.simulation.scenario import load_scenario
    from dqslam.studies.paper import run_paper

    chosen = load_scenario(scenario)
    wrong = {
        "wrong_associations": wrong_associations,
        "wrong_association_kind": wrong_association_kind or wrong_kind,
    }
    changes = {
        "objects": object_kind or objects or chosen.objects,
        "detector": chosen.detector.model_copy(update=wrong),
    }
    output = Output(quiet=quiet, as_json=json)
    with output_set(out, "dqslam paper", inputs=[scenario]) as folder:
        with output.trials(trials) as progress:
            table = run_paper(
                chosen.model_copy(update=changes),
                trials=trials,
                seed=seed,
                method=method,
                loss=loss,
                bound=bound,
                shape=shape,
                jobs=jobs,
                backend=backend,
                scheduler=scheduler,
                progress=progress,
            )
        output.table(_results(table))
        if method == "paper":
            output.table(_scan(table))
        for row, title in ROWS.items():
            for failed, why in table.best(row).failures.items():
                output.line(f"failed: {title}, seed {failed}: {why}")
        table.save(folder / "table.json")
        save_settings(context, folder / CONFIG)
        why_not = _draw(table, folder / "maps.png", output)
    show_written(output, out / "table.json", out / "maps.png", why_not)


def _results(table: "PaperTable") -> "Table":
    """Return the table of our numbers, with those of the paper if it has the same scenario."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from dqslam.studies.paper import PAPER_ODOMETRY, PAPER_ROWS

    shown = Table(
        title=f"{table.scenario.name}, seeds {table.seeds[0]} to {table.seeds[-1]}, "
        f"{table.scenario.objects}, method {table.method}"
        + ("" if table.settings.shape == "ellipsoid" else f", shape {table.settings.shape}"),
        box=SIMPLE_HEAD,
    )
    shown.add_column("mean error of", no_wrap=True)
    for heading in ("paper avg", "med", "ours avg", "med", "max"):
        shown.add_column(heading, justify="right", no_wrap=True)

    def printed(values: "tuple[float, float]") -> list[str]:
        return _cells(values) if table.scenario.name == "paper" else ["", ""]

    shown.add_row("odometry alone", style="bold")
    shown.add_row("  positions, m", *printed(PAPER_ODOMETRY), *_cells(table.odometry))
    for name, title in ROWS.items():
        row = table.best(name)
        shown.add_row()
        shown.add_row(title, style="bold")
        for metric, label in METRICS.items():
            shown.add_row(
                f"  {label}", *printed(PAPER_ROWS[name][metric]), *_cells(row.metrics[metric])
            )
        volume = row.volume_relative_error
        shown.add_row("  our volumes, rel.", "", "", *_cells((volume.avg, volume.med)))
        for key, label in SCORES.items():
            if key in row.scores:
                shown.add_row(f"  {label}", "", "", *_score_cells(row.scores[key]))
        shown.add_row("  trials failed", "", "", str(len(row.failures)))
        shown.add_row("  worse than odometry", "", "", str(len(row.worse_than_odometry)))
        shown.add_row("  seconds a trial", "", "", "", f"{row.seconds_med:.2f}")
    return shown


def _scan(table: "PaperTable") -> "Table":
    """Show the result of each weight of the paper's box residual."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(
        title="positions, m, by sigma of the box residual\n"
        "(the paper does not state it; the best of each, *, stands above)",
        box=SIMPLE_HEAD,
    )
    shown.add_column("\nsigma", justify="right", no_wrap=True)
    for title in ROWS.values():
        for heading in (f"{title}\navg", "\nmed", "\nmax"):
            shown.add_column(heading, justify="right", no_wrap=True)
    shown.add_column("\nfailed", justify="right", no_wrap=True)
    for rows in zip(*[table.scan[name] for name in ROWS], strict=True):
        cells = []
        for name, row in zip(ROWS, rows, strict=True):
            avg, *others = _cells(row.metrics["rmse_pos"])
            cells += ["* " + avg if row is table.best(name) else avg, *others]
        failed = sum(len(row.failures) for row in rows)
        shown.add_row(f"{rows[0].algebraic_sigma:.0e}", *cells, str(failed))
    return shown


def _cells(values: "Statistics | tuple[float, float]") -> list[str]:
    numbers = values if isinstance(values, tuple) else (values.avg, values.med, values.max)
    # Quadrics that are far off have volumes too large for fixed notation.
    return [f"{number:.2f}" if not number >= 1e4 else f"{number:.0e}" for number in numbers]


def _score_cells(score: "float | list[float] | dict[str, float]") -> list[str]:
    values = score if isinstance(score, list) else [score]
    numbers = list(score.values()) if isinstance(score, dict) else values
    return [f"{number:.2f}" for number in numbers]


def _draw(table: "PaperTable", path: Path, output: Output) -> str:
    """Draw some of the trials; return why there is no figure, or nothing."""
    from dqslam.plot import plot_maps
    from dqslam.studies.paper import example_maps

    maps = example_maps(table, EXAMPLES)
    if not maps:
        return f"no {path.name}: no monocular trial succeeded"
    return draw_figure(output, path, lambda path: plot_maps(maps, path))
