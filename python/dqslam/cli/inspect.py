"""``dqslam inspect``: the content of a recording, and the usual mistakes in it."""

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from dqslam._input import refuse_shared_input
from dqslam.cli.groups import with_groups
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.reading import RecordingOptions
from dqslam.cli.settings import ConfigFile

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.inspection import Inspection
    from dqslam.io import Notes

MOST_LISTED = 8
FOUND = 3  # exit code of --strict


@with_groups
def inspect(
    files: RecordingOptions,
    ids: Annotated[
        Literal["none", "track_id", "class_id"],
        typer.Option(
            metavar="SOURCE",
            help="Where the ids of objects come from, as for run; with none, boxes are linked by "
            "their overlap.",
        ),
    ] = "none",
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help=f"Exit with {FOUND} if there is a warning or any bad box or pose, which run "
            "--strict refuses.",
        ),
    ] = False,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Show the content of a recording, and warn of the usual mistakes.

    Other readings of poses, boxes and times are tried, and one that fits far better is named with
    its option. If none explains where the boxes are, that is said, too.
    """
    from dqslam import io
    from dqslam.inspection import inspect_recording

    refuse_shared_input(*files.files)
    output = Output(quiet=quiet, as_json=json)
    camera, odometry, detections = files.camera, files.odometry, files.detections
    with output.steps("inspecting", 3) as done:
        reading = files.read_options().with_frame_times(odometry, detections)
        io.check_topics(camera, odometry, detections, reading)
        notes = io.Notes(max_bad=reading.max_bad)
        lens = io.read_camera_file(camera, reading)
        path = io.read_path_file(odometry, reading, notes)
        done()
        size = (lens.width, lens.height)
        table = io.read_boxes_file(detections, size, reading, notes, trajectory=path, check=False)
        path, table = reading.span.of_path(path, odometry), reading.span.of_boxes(table)
        done()
        latest = reading.max_time_difference
        linked = None if ids == "none" else ids
        inspection = inspect_recording(lens, path, table, ids=linked, max_time_difference=latest)
    _show(output, inspection, notes)
    if strict and (inspection.findings or notes.has_bad):
        raise typer.Exit(FOUND)


def _show(output: Output, inspection: "Inspection", notes: "Notes") -> None:
    output.table(_overview(inspection.summary))
    for line in _fit(inspection):
        output.line(line)
    for sentence in notes.sentences():
        output.warn(sentence)
    for finding in inspection.findings:
        output.line(f"warning: {finding}", style="bold red")
    for note in inspection.notes:
        output.line(f"note: {note}")
    for check, why in inspection.unchecked.items():
        output.line(f"not checked: {check}: {why}")
    if not inspection.findings:
        output.line(_conclusion(inspection))
    warnings = [vars(finding) for finding in inspection.findings]
    verdict, clock = inspection.verdict, inspection.clock
    fit = None if verdict is None else vars(verdict) | {"explained": verdict.explained}
    offset = None if clock is None else vars(clock) | {"sure": clock.sure}
    output.document(
        {
            **inspection.summary,
            "fit": fit,
            "clock": offset,
            "warnings": warnings,
            "notes": inspection.notes,
            "unchecked": inspection.unchecked,
            "input_notes": notes.described(),
        }
    )


def _fit(inspection: "Inspection") -> list[str]:
    """Say how well poses explain the boxes, beside what right files give."""
    from dqslam.inspection import pixels

    verdict, clock = inspection.verdict, inspection.clock
    if verdict is None:
        return ["rays: unknown, as no object is seen often enough from different poses"]
    lines = [
        f"rays to an object miss each other by {pixels(verdict.track_px)} over whole tracks, by "
        f"{verdict.short_px:.1f} px in short windows, in which boxes move by "
        f"{verdict.short_motion_px:.0f} px (right files: a few px, or what odometry drifts by)",
        f"the poses leave {verdict.unexplained:.0%} of the boxes' motion unexplained (right files: "
        f"2 to 15%, with noisy odometry to 35%)",
    ]
    if clock is not None:
        when = "later" if clock.seconds > 0 else "earlier"
        lines.append(
            f"clock: boxes fit best {abs(clock.seconds):.3g} ± {clock.sigma:.2g} s {when} than "
            f"their times say{'' if clock.sure else ', which may be chance'}"
        )
    return lines


def _conclusion(inspection: "Inspection") -> str:
    """Say what was not found, and what was not looked at."""
    verdict = inspection.verdict
    explained = "unsure" if verdict is None else verdict.explained
    if explained == "yes":
        return "no mistake found"
    if explained == "partly":
        return (
            "no mistake found, but much of the boxes' motion is unexplained: the odometry is "
            "noisy, or there is a mistake that is none of those that were tried"
        )
    return "no mistake found, but whether poses and boxes fit together cannot be told"


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
