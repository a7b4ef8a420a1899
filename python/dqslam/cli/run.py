"""``dqslam run``: a map and a trajectory from the files of a recording."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from dqslam.cli.options import (
    CameraFile,
    DetectionFile,
    Formats,
    FrameRate,
    FrameTimesFile,
    MaxTimeDifference,
    OdometryFile,
)
from dqslam.cli.progress import show_share

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.io import OdometryNoise

NOISE = "translation=0.02,rotation=0.01"
# Of tracklets that are linked in the image: 1 in 10 goes over to another object.
UNSURE = 0.9


def run(
    camera: CameraFile,
    odometry: OdometryFile,
    detections: DetectionFile,
    out: Annotated[Path, typer.Option(help="Directory of the results.")],
    min_score: Annotated[float, typer.Option(help="Leave out boxes with a lower score.")] = 0.5,
    formats: Formats = None,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    ids: Annotated[
        Literal["none", "track_id", "class_id"],
        typer.Option(
            help="What tells objects apart: nothing yet, the column of a tracker, or the class, "
            "where each occurs once."
        ),
    ] = "track_id",
    trust_ids: Annotated[
        float,
        typer.Option(
            min=0.5,
            max=1.0,
            help="Probability that an id stays with its object; 1: ids are final, below: boxes "
            "without ids take part, ids are cut and joined.",
        ),
    ] = 1.0,
    mode: Annotated[
        Literal["slam", "mapping"], typer.Option(help="mapping: the odometry is the truth.")
    ] = "slam",
    perturb_odometry: Annotated[
        str | None,
        typer.Option(metavar="NOISE", help=f'Add noise to every step (m, rad): "{NOISE}".'),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of that noise, and of the boxes held out.")] = 0,
    odometry_noise: Annotated[
        str | None,
        typer.Option(
            metavar="NOISE",
            help="What to believe of every step, likewise. Default: the noise that was added, "
            "else its level is estimated from the boxes.",
        ),
    ] = None,
    groundtruth: Annotated[
        Path | None, typer.Option(help="TUM trajectory to compare with, in any world frame.")
    ] = None,
    size_priors: Annotated[
        Path | None,
        typer.Option(
            help="TOML table of sizes by class. Default: one size for all, from the recording."
        ),
    ] = None,
    hold_out: Annotated[
        float,
        typer.Option(min=0.0, max=0.99, help="Share of boxes that the map is tested on instead."),
    ] = 0.0,
    max_time_difference: MaxTimeDifference = None,
) -> None:
    """Estimate the trajectory and the objects of a recording.

    Writes trajectory.txt, odometry.txt (what it started from), map.json, boxes.csv, camera.json
    and report.json.
    """
    from dqslam import _core, io, run_recording
    from dqslam.size_prior import load_size_priors

    sizes = None if size_priors is None else load_size_priors(size_priors)
    added = parse_noise("--perturb-odometry", perturb_odometry)
    believed = parse_noise("--odometry-noise", odometry_noise) or added
    final = trust_ids == 1.0 and ids != "none"
    names = io.split_formats(formats or [])
    frames = io.choose_frame_times(odometry, detections, names, times=frame_times, rate=frame_rate)
    reference, reference_name = None, None
    if groundtruth is not None:
        reference, reference_name = io.read_trajectory(groundtruth, repeated_times=True), "file"
    elif added is not None:
        reference = io.read_trajectory(odometry, names.trajectory, frames=frames)
        reference_name = "odometry before the added noise"
    recording, dropped = io.load_recording(
        camera,
        odometry,
        detections,
        min_score=min_score,
        ids=ids,
        final_ids=final,
        max_time_difference=max_time_difference,
        odometry_noise=believed,
        formats=names,
        frames=frames,
    )
    if added is not None:
        recording = run_recording.perturb_odometry(recording, added, seed=seed, believed=believed)
    out.mkdir(parents=True, exist_ok=True)
    with show_share("estimating") as progress:
        result = run_recording.run(
            recording,
            trust_ids=1.0 if final else min(trust_ids, UNSURE),
            mode=_core.Mode[mode.upper()],
            reference=reference,
            size_prior=sizes,
            estimates_noise=believed is None,
            hold_out=hold_out,
            seed=seed,
            progress=progress,
        )
    report = {
        "camera": str(camera),
        "odometry": str(odometry),
        "detections": str(detections),
        "groundtruth": None if groundtruth is None else str(groundtruth),
        "min_score": min_score,
        "ids": ids,
        "trust_ids": None if ids == "none" else trust_ids,
        "odometry_noise_added": None if added is None else asdict(added) | {"seed": seed},
        "odometry_noise_believed": None if believed is None else asdict(believed),
        "dropped_boxes": asdict(dropped),
        "reference": reference_name,
        **result.report,
    }
    io.save_estimate(
        result.estimate,
        out,
        detections=result.detections,
        held_out=result.held_out,
        marginals=result.marginals,
    )
    io.write_json(out / "report.json", report)
    _show(report, out)


def parse_noise(option: str, text: str | None) -> "OdometryNoise | None":
    """Read "translation=0.02,rotation=0.01", both needed, None of None."""
    from dqslam.io import OdometryNoise

    if text is None:
        return None
    try:
        pairs = [part.split("=") for part in text.split(",")]
        values = {name.strip(): float(value) for name, value in pairs}
    except ValueError:
        values = {}
    if len(values) != 2 or set(values) != {"translation", "rotation"}:
        raise ValueError(f'{option}: {text!r} is not like "{NOISE}"')
    try:
        return OdometryNoise(values["translation"], values["rotation"])
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from None


def _show(report: dict[str, Any], out: Path) -> None:
    from rich.console import Console

    console = Console()
    console.print(_overview(report))
    if report["objects"]:
        console.print(_objects(report["objects"]))
    lines = [f"object {name} is not in the map: {why}" for name, why in _dropped(report)]
    lines += [f"under-constrained: {sentence}" for sentence in report["under_constrained"]]
    if report["solver"] is None:
        lines.append("no object fits a world at rest: the trajectory is the odometry")
    else:
        lines.append(_solver(report["solver"]))
    for line in [*lines, f"wrote {out}"]:
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def _dropped(report: dict[str, Any]) -> list[tuple[str, str]]:
    return sorted(report["dropped_objects"].items(), key=lambda item: int(item[0]))


def _solver(solver: dict[str, Any]) -> str:
    return (
        f"solver: {solver['message']} ({solver['iterations']} iterations, "
        f"{solver['rejected_steps']} rejected, {solver['seconds']:.2f} s)"
    )


def _overview(report: dict[str, Any]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    boxes = report["boxes"]
    table = Table(box=SIMPLE_HEAD, show_header=False)
    table.add_row("poses", f"{report['poses']}, {report['keyframes']} of them keyframes")
    table.add_row(
        "boxes",
        f"{boxes['count']} of {len(report['objects'])} objects, {boxes['of_dropped_objects']} of "
        f"objects not in the map, {boxes['unassigned']} of none",
    )
    table.add_row("left out", _left_out(report["dropped_boxes"], report["ids"]))
    if boxes["count"]:
        table.add_row(
            "chi-square of a box",
            f"median {boxes['chi2_median']:.2f} (3.36 expected); {boxes['outlier_share']:.1%} do "
            f"not fit (above 13.28), {boxes['not_in_front']} of them not even in front",
        )
    table.add_row("re-projection", _reprojection(report["reprojection"]))
    table.add_row("odometry noise", _noise(report["odometry_noise"]))
    error = report["trajectory_error"]
    if error is None:
        table.add_row("trajectory error", "unknown: there is nothing to compare with")
        return table
    for name, title in (("ate_rmse_m", "rmse after alignment"), ("mean_m", "mean, same start")):
        before, after = error["before"][name], error["after"][name]
        word = "better" if after < before else "worse" if after > before else "unchanged"
        table.add_row(title, f"odometry {before:.4f} m, estimate {after:.4f} m: {word}")
    return table


def _reprojection(overlap: dict[str, Any]) -> str:
    if overlap["iou_median"] is None:
        return "no box shows an object of the map"
    which = "held out" if overlap["held_out"] else "used"
    return (
        f"median IoU {overlap['iou_median']:.2f} of the boxes {which}; "
        f"{overlap['explained_share']:.0%} of those of mapped classes reach 0.5"
    )


def _noise(noise: dict[str, Any]) -> str:
    if noise["from"] == "given":
        return "given"
    return (
        f"estimated: {1e3 * noise['translation_m']:.2f} mm, "
        f"{1e3 * noise['rotation_rad']:.2f} mrad a step"
    )


def _left_out(dropped: dict[str, Any], ids: str) -> str:
    few = dropped["few_boxes"]
    reasons = {
        "below the least score": dropped["below_min_score"],
        f"without {ids}": dropped["without_id"],
        "without a pose of their time": dropped["without_pose"],
        "beside a better box of the same object": dropped["repeated"],
        f"of objects with fewer than 3: {', '.join(map(str, few))}": sum(few.values()),
    }
    return "\n".join(f"{count} {why}" for why, count in reasons.items() if count) or "none"


def _objects(objects: list[dict[str, Any]]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD)
    for heading in ("id", "class", "boxes", "chi-square, median", "do not fit", "not in front"):
        table.add_column(heading, justify="left" if heading == "class" else "right")
    for entry in objects:
        table.add_row(
            str(entry["id"]),
            escape(entry["class_name"]),
            str(entry["observations"]),
            f"{entry['chi2_median']:.2f}",
            f"{entry['outlier_share']:.0%}",
            str(entry["not_in_front"]),
        )
    return table
