"""``dqslam convert``: cameras, trajectories and detections from one format to another."""

from pathlib import Path
from typing import Annotated

import typer

from dqslam.cli.options import FrameRate, FrameTimesFile, given_frame_times
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import ConfigFile


def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="File, YOLO folder, or bag to read.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="File or folder to write.")],
    format_: Annotated[
        str | None,
        typer.Option("--format", metavar="NAME", help="Format of IN. Default: recognized."),
    ] = None,
    to: Annotated[
        str | None, typer.Option(metavar="NAME", help="Format of OUT. Default: by its ending.")
    ] = None,
    camera: Annotated[
        Path | None, typer.Option(help="Camera file with the image size, which YOLO boxes need.")
    ] = None,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    classes: Annotated[
        Path | None,
        typer.Option(
            help="Names of classes: COCO JSON, data.yaml, or text with one name per line."
        ),
    ] = None,
    camera_in_body: Annotated[
        Path | None,
        typer.Option(
            help="File with body_from_camera, 7, 12 or 16 numbers, if the poses are a body's."
        ),
    ] = None,
    topic: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Topic, if a bag has several of a kind; repeatable."),
    ] = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Convert a camera, a trajectory or detections to another format, or a bag to a folder.

    Formats: json toml ros colmap kitti-calib | tum kitti euroc | csv coco yolo mot | rosbag (read).
    If the format of OUT has no times, they go into a file beside it.
    """
    from dqslam import io

    output = Output(quiet=quiet, as_json=json)
    size = None
    if camera is not None:
        lens = io.read_camera(camera)
        size = (lens.width, lens.height)
    context = io.ConvertContext(
        size=size,
        frames=given_frame_times(frame_times, frame_rate),
        classes=None if classes is None else io.read_class_names(classes),
        body_from_camera=None if camera_in_body is None else io.read_mount(camera_in_body),
        files=tuple(
            one for one in (camera, frame_times, classes, camera_in_body) if one is not None
        ),
    )
    with output.share("converting") as progress:
        written = io.convert(
            source,
            out,
            format=format_,
            to=to,
            topics=topic or (),
            context=context,
            progress=progress,
        )
    for file in written:
        loses = f"; no place for {' and '.join(file.loses)}" if file.loses else ""
        output.line(f"wrote {file.path}: {file.what}{loses}")
    described = [
        {"path": str(file.path), "what": file.what, "loses": file.loses} for file in written
    ]
    output.document({"written": described})
