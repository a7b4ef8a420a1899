"""``dqslam locate``: where a camera is in a map."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._input import refuse_shared_input
from dqslam.cli.options import (
    BoxForm,
    BoxImage,
    CameraFile,
    CameraId,
    DetectionFile,
    FirstFrame,
    Formats,
    FrameRate,
    FrameTimesFile,
    ImageSize,
    Letterbox,
    MaxBad,
    Nms,
    given_frame_times,
    given_reading,
    given_readings,
)
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import ConfigFile

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.places.locate_files import ImageLocation

MOST_LISTED = 40


def locate(
    known: Annotated[Path, typer.Argument(metavar="MAP", help="Directory that `run` wrote.")],
    camera: CameraFile,
    detections: DetectionFile,
    odometry: Annotated[
        Path | None,
        typer.Option(
            help="Trajectory between the images, which then vote for one answer. Default: each "
            "image is located alone."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Directory for locations.csv and locations.json."),
    ] = None,
    min_score: Annotated[
        float, typer.Option(help="Leave out boxes with a lower score, 0 to 1.")
    ] = 0.3,
    min_confidence: Annotated[
        float, typer.Option(help="The least probability of an answer.")
    ] = 0.9,
    camera_id: CameraId = None,
    formats: Formats = None,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    first_frame: FirstFrame = None,
    image_size: ImageSize = None,
    nms: Nms = None,
    max_bad: MaxBad = 0.05,
    box_form: BoxForm = None,
    box_image: BoxImage = None,
    letterbox: Letterbox = False,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Find where a camera is in MAP, from boxes and their classes, or say why it is not sure.

    Boxes need no ids. Objects may be missing, new, or of wrong classes. docs/locate.md describes
    the answer and its confidence.
    """
    from dqslam import io
    from dqslam._outputs import output_set
    from dqslam.places.locate_files import described, locate_files, write_locations

    refuse_shared_input(camera, detections, odometry, frame_times)
    output = Output(quiet=quiet, as_json=json)
    names = io.split_formats(formats or [])
    frames = given_frame_times(frame_times, frame_rate)
    readings = given_readings(
        camera_in_body=None, box_form=box_form, box_image=box_image, letterbox=letterbox
    )
    notes = io.Notes(max_bad=max_bad)
    with output.share("locating") as progress:
        answers = locate_files(
            known,
            camera,
            detections,
            odometry,
            min_score=min_score,
            min_confidence=min_confidence,
            formats=names,
            frames=frames,
            reading=given_reading(
                first_frame, max_bad, nms, None, image_size, camera_id, readings=readings
            ),
            notes=notes,
            progress=progress,
        )
    if out is not None:
        inputs = (known, camera, detections, odometry)
        with output_set(out, "dqslam locate", inputs=inputs) as folder:
            write_locations(folder, answers)
    output.table(_table(answers))
    found = sum(one.location.is_found for one in answers)
    output.line(f"{found} of {len(answers)} located")
    for sentence in notes.sentences():
        output.warn(sentence)
    if out is not None:
        output.line(f"wrote {out}")
    output.document({"images": [described(one) for one in answers]})


def _table(answers: "list[ImageLocation]") -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD)
    for name in ("time [s]", "boxes", "position [m]", "± [m]", "confidence", "no answer because"):
        table.add_column(name, justify="left" if name == "no answer because" else "right")
    for one in answers[:MOST_LISTED]:
        found = one.location
        where, sigma = "", ""
        if found.is_found:
            where = " ".join(f"{x:.2f}" for x in found.pose[:3])
            sigma = f"{float(found.covariance[:3, :3].trace()) ** 0.5:.2g}"
        table.add_row(
            f"{one.timestamp:.3f}",
            str(one.boxes),
            where,
            sigma,
            f"{found.confidence:.4f}",
            escape(found.reason),
        )
    if len(answers) > MOST_LISTED:
        table.add_row("", "", "", "", "", f"and {len(answers) - MOST_LISTED} more")
    return table
