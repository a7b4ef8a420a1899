"""``dqslam demo``: a few simulated drives, solved, as a first look for newcomers."""

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from dqslam._outputs import output_set
from dqslam.cli.options import FirstSeed, ResultDirectory
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.results import draw_figure, show_written
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.estimate import Estimate
    from dqslam.metrics import Report
    from dqslam.recording import Detections, Truth
    from dqslam.simulation.scenario import Scenario


class _Drive(NamedTuple):
    seed: int
    estimate: "Estimate"
    truth: "Truth"
    boxes: "Detections"
    report: "Report"
    seconds: float  # of building and solving the problem


def demo(
    context: typer.Context,
    out: ResultDirectory = Path("results/demo"),
    drives: Annotated[int, typer.Option(min=1, help="Drives to simulate and solve.")] = 3,
    seed: FirstSeed = 0,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Simulate a few drives past objects, solve each from odometry and boxes, and draw them.

    It takes seconds. It writes a directory for each drive (trajectory.txt, map.json and so on),
    demo.json, maps.png and config.toml.
    """
    from dqslam import io
    from dqslam.plot import plot_maps
    from dqslam.simulation.scenario import load_scenario

    output = Output(quiet=quiet, as_json=json)
    scenario = load_scenario("paper")
    with output_set(out, "dqslam demo") as folder:
        with output.trials(drives) as progress:
            solved = []
            for one in range(seed, seed + drives):
                solved.append(_drive(scenario, one))
                progress(len(solved), drives)
        output.table(_table(solved))
        for drive in solved:
            directory = folder / f"seed{drive.seed}"
            io.save_estimate(drive.estimate, directory, detections=drive.boxes)
        io.write_json(folder / "demo.json", {"drives": [_row(drive) for drive in solved]})
        save_settings(context, folder / CONFIG)
        maps = [(f"seed {drive.seed}", drive.estimate, drive.truth) for drive in solved]
        why_not = draw_figure(output, folder / "maps.png", lambda path: plot_maps(maps, path))
    show_written(output, out / "demo.json", out / "maps.png", why_not)


def _drive(scenario: "Scenario", seed: int) -> _Drive:
    from dqslam.graph import build_graph, solve
    from dqslam.metrics import evaluate
    from dqslam.simulation.simulator import simulate

    recording, truth = simulate(scenario, seed=seed)
    start = time.perf_counter()
    estimate, _ = solve(build_graph(replace(recording, positions=None)))
    seconds = time.perf_counter() - start
    boxes = recording.detections
    return _Drive(seed, estimate, truth, boxes, evaluate(estimate, truth), seconds)


def _row(drive: _Drive) -> dict[str, Any]:
    return {
        "seed": drive.seed,
        "poses": len(drive.estimate.poses),
        "boxes": len(drive.boxes),
        "objects": len(drive.estimate.object_ids),
        "odometry_rmse_pos": drive.report.odometry_rmse_pos,
        "rmse_pos": drive.report.rmse_pos,
        "rmse_landmark": drive.report.rmse_landmark,
        "seconds": drive.seconds,
    }


def _table(drives: list[_Drive]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(title="mean errors in meters, the same start", box=SIMPLE_HEAD)
    for heading in ("seed", "poses", "boxes", "objects", "odometry", "estimate", "centers", "s"):
        shown.add_column(heading, justify="right")
    for drive in drives:
        row = _row(drive)
        errors = (row["odometry_rmse_pos"], row["rmse_pos"], row["rmse_landmark"], row["seconds"])
        counts = (row["seed"], row["poses"], row["boxes"], row["objects"])
        shown.add_row(*map(str, counts), *(f"{error:.2f}" for error in errors))
    return shown
