"""``dqslam run``: a map and a trajectory from the files of a recording."""

from collections.abc import Callable
from contextlib import AbstractContextManager
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
    ResultDirectory,
)
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.results import results_directory, uninterrupted
from dqslam.cli.run_tables import show_report
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from dqslam.assumptions import OdometryNoise
    from dqslam.pipeline import RunResult

NOISE = "translation=0.02,rotation=0.01"


def run(
    context: typer.Context,
    camera: CameraFile,
    odometry: OdometryFile,
    detections: DetectionFile,
    out: ResultDirectory,
    min_score: Annotated[
        float, typer.Option(help="Leave out boxes with a lower score, 0 to 1.")
    ] = 0.5,
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
        typer.Option(
            metavar="NOISE", help=f'Add noise of that sigma to every step, m and rad: "{NOISE}".'
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of that noise, and of the boxes held out.")
    ] = 0,
    odometry_noise: Annotated[
        str | None,
        typer.Option(
            metavar="NOISE",
            help="What to believe of every step, likewise. Default: the noise that was added, "
            "else its level is estimated from the boxes.",
        ),
    ] = None,
    odometry_covariance: Annotated[
        Path | None,
        typer.Option(help="In its place: CSV of the covariance of each step, m and rad squared."),
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
    online: Annotated[
        bool,
        typer.Option(
            "--online", help="Replay it step by step, as it would arrive, and polish at the end."
        ),
    ] = False,
    max_time_difference: MaxTimeDifference = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate the trajectory and the objects of a recording.

    Writes trajectory.txt, odometry.txt (what it started from), map.json, boxes.csv, camera.json,
    report.json and config.toml.
    """
    from dqslam import _core, io, pipeline
    from dqslam.association import FINAL, UNSURE
    from dqslam.assumptions import load_size_priors

    sizes = None if size_priors is None else load_size_priors(size_priors)
    added = parse_noise("--perturb-odometry", perturb_odometry)
    believed = parse_noise("--odometry-noise", odometry_noise) or added
    if odometry_covariance is not None and believed is not None:
        raise ValueError("--odometry-covariance: the noise is given already, by another option")
    if online and mode == "mapping":
        raise ValueError("--online: does not go with --mode mapping")
    final = trust_ids == FINAL and ids != "none"
    names = io.split_formats(formats or [])
    frames = io.choose_frame_times(odometry, detections, names, times=frame_times, rate=frame_rate)
    reference, reference_name = None, None
    if groundtruth is not None:
        reference, reference_name = io.read_trajectory(groundtruth, repeated_times=True), "file"
    elif added is not None:
        reference = io.read_trajectory(odometry, names.trajectory, frames=frames)
        reference_name = "odometry before the added noise"
    how: dict[str, Any] = {
        "trust_ids": FINAL if final else min(trust_ids, UNSURE),
        "reference": reference,
        "size_prior": sizes,
        "estimates_noise": believed is None and odometry_covariance is None,
        "hold_out": hold_out,
        "seed": seed,
    }
    output = Output(quiet=quiet, as_json=json)
    with results_directory(out), _progress(output, online=online) as progress:
        recording, dropped = io.load_recording(
            camera,
            odometry,
            detections,
            min_score=min_score,
            ids=ids,
            final_ids=final,
            max_time_difference=max_time_difference,
            odometry_noise=believed,
            odometry_covariance=odometry_covariance,
            formats=names,
            frames=frames,
        )
        if added is not None:
            recording = pipeline.perturb_odometry(recording, added, seed=seed, believed=believed)
        if online:
            from dqslam.pipeline.online import describe_step, run_online

            result = run_online(
                recording,
                show=lambda slam, frame: progress(describe_step(slam, frame)),
                **how,
            )
        else:
            result = pipeline.run(
                recording, mode=_core.Mode[mode.upper()], progress=progress, **how
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
        "odometry_covariance": None if odometry_covariance is None else str(odometry_covariance),
        "dropped_boxes": asdict(dropped),
        "reference": reference_name,
        **result.report,
    }
    _write(context, out, result, report)
    output.document(report)
    show_report(output, report)
    output.line(f"wrote {out}")


def _write(context: typer.Context, out: Path, result: "RunResult", report: dict[str, Any]) -> None:
    from dqslam import io

    with uninterrupted():
        io.save_estimate(
            result.estimate,
            out,
            detections=result.detections,
            held_out=result.held_out,
            marginals=result.marginals,
        )
        io.write_json(out / "report.json", report)
        save_settings(context, out / CONFIG)


def _progress(output: Output, *, online: bool) -> AbstractContextManager[Callable[[Any], None]]:
    """Show a line that is told what happens, or a bar that is told the share that is done."""
    return output.live("loading") if online else output.share("estimating")


def parse_noise(option: str, text: str | None) -> "OdometryNoise | None":
    """Read "translation=0.02,rotation=0.01", both needed, None of None."""
    from dqslam.assumptions import OdometryNoise

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
