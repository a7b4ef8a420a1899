"""``dqslam inspect``: the content of a recording, and the usual mistakes in it."""

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from dqslam._input import refuse_shared_input
from dqslam.cli.options import (
    CameraFile,
    CameraId,
    CameraInBody,
    DetectionFile,
    FirstFrame,
    Formats,
    FrameRate,
    FrameTimesFile,
    ImageSize,
    MaxBad,
    MaxTimeDifference,
    Nms,
    OdometryFile,
    Topics,
    given_frame_times,
    given_reading,
)
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import ConfigFile

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.inspection import Inspection
    from dqslam.io import Notes

MOST_LISTED = 8
FOUND = 3  # exit code of --strict


def inspect(
    camera: CameraFile,
    odometry: OdometryFile,
    detections: DetectionFile,
    camera_id: CameraId = None,
    formats: Formats = None,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    first_frame: FirstFrame = None,
    camera_in_body: CameraInBody = None,
    image_size: ImageSize = None,
    topics: Topics = None,
    nms: Nms = None,
    max_bad: MaxBad = 0.05,
    ids: Annotated[
        Literal["track_id", "class_id"] | None,
        typer.Option(help="Column with the ids of objects. Default: boxes are linked by overlap."),
    ] = None,
    max_time_difference: MaxTimeDifference = None,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help=f"Exit with {FOUND} if there are warnings, or bad boxes or poses."
        ),
    ] = False,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Show the content of a recording, and warn of the usual mistakes.

    These are inverted poses, x y width height instead of corners, another image size, missing lens
    distortion, and clocks that do not match. Each check compares two interpretations of the files.
    """
    from dqslam import io
    from dqslam.inspection import inspect_recording

    refuse_shared_input(camera, odometry, detections, frame_times, camera_in_body)
    output = Output(quiet=quiet, as_json=json)
    names = io.split_formats(formats or [])
    with output.steps("inspecting", 3) as done:
        frames = given_frame_times(frame_times, frame_rate)
        frames = frames or io.choose_frame_times(odometry, detections, names)
        reading = given_reading(
            first_frame, max_bad, nms, topics, camera_in_body, image_size, camera_id
        )
        io.check_topics(camera, odometry, detections, reading)
        notes = io.Notes(max_bad=max_bad)
        lens = io.read_camera_file(camera, names, reading)
        path = io.read_path_file(odometry, names, frames, reading, notes)
        done()
        table = io.read_boxes_file(
            detections, lens, path, names, frames, reading, notes, check=False
        )
        done()
        inspection = inspect_recording(
            lens, path, table, ids=ids, max_time_difference=max_time_difference
        )
    _show(output, inspection, notes)
    if strict and (inspection.findings or notes.has_bad):
        raise typer.Exit(FOUND)


def _show(output: Output, inspection: "Inspection", notes: "Notes") -> None:
    output.table(_overview(inspection.summary))
    for sentence in notes.sentences():
        output.warn(sentence)
    for finding in inspection.findings:
        output.line(f"warning: {finding.check}: {finding.message}", style="bold red")
    for check, why in inspection.unchecked.items():
        output.line(f"not checked: {check}: {why}")
    if not inspection.findings:
        output.line("no mistake found")
    warnings = [vars(finding) for finding in inspection.findings]
    output.document(
        {
            **inspection.summary,
            "warnings": warnings,
            "unchecked": inspection.unchecked,
            "input_notes": notes.described(),
        }
    )


def _overview(summary: dict[str, Any]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    camera, path, boxes = summary["camera"], summary["trajectory"], summary["detections"]
    overlap, border = summary["overlap"], boxes["at_border"]
    across, down = camera["field_of_view_deg"]
    lens = "with" if camera["distortion"] is not None else "without"
    table = Table(box=SIMPLE_HEAD, show_header=False)
    rows = {
        "camera": f"{camera['width']} x {camera['height']} px, {across:.0f} x {down:.0f} degrees, "
        f"{lens} distortion",
        "poses": f"{path['poses']}, {_clock(path)}",
        "path": f"{path['length_m']:.2f} m, extent "
        f"{' x '.join(f'{side:.2f}' for side in path['extent_m'])} m, "
        f"largest step {path['largest_step_m']:.3f} m",
        "boxes": f"{boxes['boxes']} in {boxes['frames']} frames, {_clock(boxes)}",
        "boxes a frame": _spread(boxes["boxes_a_frame"]),
        "time together": f"{overlap['seconds']:.3f} s; {overlap['boxes_with_pose']} boxes have a "
        f"pose within {overlap['tolerance_s']:.4g} s, {overlap['boxes_without_pose']} have none",
        "objects": "no ids"
        if boxes["objects"] is None
        else f"{boxes['objects']}; {boxes['boxes_without_object']} boxes without one",
        "classes": escape(_listed([f"{k} {n}" for k, n in boxes["classes"].items()])),
        "score": _spread(boxes["score"]),
        "width, px": _spread(boxes["width_px"]),
        "height, px": _spread(boxes["height_px"]),
        "at the border": f"{border['any']} boxes: left {border['left']}, top {border['top']}, "
        f"right {border['right']}, bottom {border['bottom']}",
    }
    for name, text in rows.items():
        table.add_row(name, text)
    return table


def _clock(entry: dict[str, Any]) -> str:
    rate = "no rate" if entry["rate_hz"] is None else f"{entry['rate_hz']:.4g} Hz"
    text = f"{entry['start_s']:.3f} to {entry['end_s']:.3f} s at {rate}"
    gaps = [f"{gap['seconds']:.3g} s after {gap['after_s']:.3f}" for gap in entry["gaps"]]
    return text + (f", {len(gaps)} gaps: {_listed(gaps)}" if gaps else ", no gap")


def _listed(texts: list[str]) -> str:
    more = f", and {len(texts) - MOST_LISTED} more" if len(texts) > MOST_LISTED else ""
    return ", ".join(texts[:MOST_LISTED]) + more


def _spread(values: list[float]) -> str:
    least, lower, median, upper, largest = (f"{value:.4g}" for value in values)
    return f"{least} to {largest}, median {median}, half in {lower} to {upper}"
