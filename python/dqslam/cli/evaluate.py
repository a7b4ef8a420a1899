"""``dqslam evaluate``: a directory of results against the truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from dqslam._outputs import added_files, check_added
from dqslam.cli.options import FromTime, UntilTime, given_span
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

_WRITTEN = ("evaluation.json", "evaluation.toml")


def evaluate(
    context: typer.Context,
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="Directory that `dqslam run` wrote.")
    ],
    groundtruth: Annotated[
        Path, typer.Option(help="True trajectory, world_from_camera, in any world frame.")
    ],
    align: Annotated[
        Literal["se3", "sim3", "se2", "none"],
        typer.Option(
            help="Motion between both worlds to remove: rigid, with scale, on the plane, or none."
        ),
    ] = "se3",
    rpe_delta: Annotated[
        float, typer.Option(help="Distance for the relative pose error, in frames or meters.")
    ] = 1.0,
    rpe_unit: Annotated[
        Literal["frames", "meters"], typer.Option(help="Unit of --rpe-delta.")
    ] = "frames",
    objects: Annotated[
        Path | None, typer.Option(help="CSV of true objects: x, y, z, class_name, sx, sy, sz, ...")
    ] = None,
    match: Annotated[
        Literal["nearest", "id"],
        typer.Option(help="Match objects with the nearest true one, or by id."),
    ] = "nearest",
    gate: Annotated[
        float | None,
        typer.Option(
            help="Largest distance of a match by nearest, in meters. Default: the longest side of "
            "the true object, or 1 m if sizes are unknown; 5 m for tracks."
        ),
    ] = None,
    boxes: Annotated[
        Path | None,
        typer.Option(help="CSV of boxes with true object ids, to evaluate the association."),
    ] = None,
    box_ids: Annotated[str, typer.Option(help="Column of --boxes with the ids.")] = "track_id",
    tracks: Annotated[
        Path | None,
        typer.Option(help="CSV of true tracks of what moves: track_id, timestamp, x, y, z, speed."),
    ] = None,
    max_time_difference: Annotated[
        float | None,
        typer.Option(
            help="Most seconds between compared poses. Default: half the interval of poses."
        ),
    ] = None,
    since: FromTime = None,
    until: UntilTime = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Compare the trajectory, the objects and the boxes of DIR with the truth.

    With --from and --until, only poses of that time are compared, and the boxes of the whole.

    Writes evaluation.json, and the options as evaluation.toml, into DIR. docs/evaluation.md
    describes each number.
    """
    from dqslam import io
    from dqslam.evaluation import evaluate_results

    if gate is not None and not gate > 0.0:
        raise ValueError(f"--gate: {gate:g} is not positive")
    if max_time_difference is not None and not max_time_difference >= 0.0:
        raise ValueError(f"--max-time-difference: {max_time_difference:g} is negative")
    output = Output(quiet=quiet, as_json=json)
    inputs = (groundtruth, objects, boxes, tracks)
    span = given_span(since, until)
    if directory.is_dir():
        check_added(directory, _WRITTEN, "dqslam evaluate", inputs=inputs)
    with output.steps("evaluating", 3) as done:
        results = io.load_results(directory)
        done()
        truth = span.of_path(io.read_trajectory(groundtruth, repeated_times=True), groundtruth)
        done()
        evaluation = evaluate_results(
            results,
            truth,
            align=align,
            rpe_delta=rpe_delta,
            rpe_unit=rpe_unit,
            objects=None if objects is None else io.read_true_objects(objects),
            match=match,
            gate=gate,
            boxes=None if boxes is None else io.read_true_boxes(boxes, results.camera, box_ids),
            tracks=None if tracks is None else io.read_true_tracks(tracks),
            max_time_difference=max_time_difference,
        )
    output.table(_trajectory(evaluation))
    output.table(_boxes_and_objects(evaluation))
    if evaluation["objects"] is not None:
        output.table(_pairs(evaluation["objects"]["pairs"]))
    if evaluation["tracks"] is not None:
        output.table(_tracks(evaluation["tracks"]))
    with added_files(directory, _WRITTEN, "dqslam evaluate", inputs=inputs) as folder:
        io.write_json(folder / "evaluation.json", evaluation)
        save_settings(context, folder / "evaluation.toml")
    output.file(directory / "evaluation.json")


def _trajectory(evaluation: dict[str, Any]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    rpe = evaluation["rpe"]
    over = f"{rpe['delta']:g} {rpe['unit']}"
    table = Table(title=f"{evaluation['poses']} poses, {evaluation['align']}", box=SIMPLE_HEAD)
    for heading in ("", "rmse", "mean", "median", "max"):
        table.add_column(heading, justify="right" if heading else "left")
    for title, key in (("odometry", "odometry_"), ("estimate", "")):
        absolute, relative = evaluation[f"{key}ate"], evaluation[f"{key}rpe"]
        rows = (
            ("position, m", absolute),
            (f"motion over {over}, m", relative["translation"]),
            (f"turn over {over}, deg", relative["rotation_deg"]),
        )
        for what, errors in rows:
            shown = (f"{errors[name]:.4f}" for name in ("rmse", "mean", "median", "max"))
            table.add_row(f"{title}: {what}", *shown)
    return table


def _boxes_and_objects(evaluation: dict[str, Any]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, show_header=False)
    overlap = evaluation["reprojection_iou"]
    if overlap is None:
        table.add_row("boxes", "unknown: there is no boxes.csv")
    else:
        parts = (
            ("all", overlap),
            ("fitting", overlap["inliers"]),
            ("held out", overlap["held_out"]),
        )
        shown = (f"{name} {_number(p['median'])} ({p['boxes']})" for name, p in parts)
        table.add_row("IoU with the boxes, median", ", ".join(shown))
    association = evaluation["association"]
    if association is not None:
        names = ("precision", "recall", "purity")
        shares = ", ".join(f"{name} {_number(association[name])}" for name in names)
        table.add_row("association", f"{shares}, {association['id_switches']} id switches")
        counted = ("found", "missed", "split", "invented")
        table.add_row("its objects", ", ".join(f"{association[name]} {name}" for name in counted))
    objects = evaluation["objects"]
    if objects is None:
        return table
    counts = ", ".join(f"{objects[name]} {name}" for name in ("matched", "missed", "invented"))
    how = "id" if objects["match"] == "id" else "distance"
    how += " and class" if objects["by_class"] else ""
    table.add_row("objects", f"{counts}, by {how}; {objects['moving_in_map']} in the map move")
    rows = (
        ("centers, m", "center", ("median", "mean", "max")),
        ("sizes, relative", "size_relative", ("median", "mean", "max")),
        ("volume, ratio", "volume_ratio", ("median",)),
        ("orientation, deg", "orientation_deg", ("median", "mean", "max")),
        ("IoU in space", "iou_3d", ("median", "mean")),
    )
    for title, name, wanted in rows:
        found = {which: objects[f"{name}_{which}"] for which in wanted}
        known = [f"{which} {_number(value)}" for which, value in found.items() if value is not None]
        table.add_row(title, ", ".join(known) or "unknown")
    return table


def _pairs(pairs: list[dict[str, Any]]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    names = ("center", "size_relative", "volume_ratio", "orientation_deg", "iou_3d")
    table = Table(box=SIMPLE_HEAD)
    for heading in ("id", "true id", "class", "center, m", "size", "volume", "turn, deg", "IoU"):
        table.add_column(heading, justify="left" if heading == "class" else "right")
    for pair in pairs:
        true_id = "" if pair["true_id"] is None else str(pair["true_id"])
        values = (_number(pair[name]) for name in names)
        table.add_row(str(pair["id"]), true_id, escape(pair["class_name"]), *values)
    return table


def _tracks(found: dict[str, Any]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    counts = ", ".join(f"{found[name]} {name}" for name in ("found", "missed", "split", "invented"))
    names = ("position", "motion", "speed", "nees", "speed_nees")
    table = Table(title=f"tracks: {counts}", box=SIMPLE_HEAD)
    for heading in ("id", "true id", "class", "images", "position, m", "motion, m", "speed, m/s"):
        table.add_column(heading, justify="left" if heading == "class" else "right")
    for heading in ("NEES", "of speed"):
        table.add_column(heading, justify="right")
    for pair in found["pairs"]:
        what = (str(pair["id"]), str(pair["true_id"]), escape(pair["class_name"]))
        values = (_number(pair[name]) for name in names)
        table.add_row(*what, str(pair["images"]), *values)
    together = ("position_median", "motion_median", "speed_median", "nees_mean", "speed_nees_mean")
    table.add_row("all", "", "", "", *(_number(found[name]) for name in together))
    return table


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
