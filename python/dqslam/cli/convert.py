"""``dqslam convert``: cameras, trajectories and detections from one format to another."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from dqslam._input import is_stdin, refuse_shared_input
from dqslam.cli.groups import with_groups
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.reading import ReadingOptions
from dqslam.cli.settings import ConfigFile


@with_groups
def convert(
    *,
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="File, YOLO folder, bag, or directory of results.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="File or folder, - for stdout.")],
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
    classes: Annotated[
        Path | None,
        typer.Option(
            help="Names of classes: COCO JSON, data.yaml, or text with one name per line."
        ),
    ] = None,
    how: ReadingOptions,
    odometry_covariance: Annotated[
        Path | None,
        typer.Option(help="CSV of the covariance of each step, for pose graphs of results."),
    ] = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Convert a camera, a trajectory or detections to another format, or a bag to a folder.

    Directories of results are written as pose graphs, --to g2o or gtsam, or --to colmap-model.

    Formats: see docs/formats.md. All are read; written are json toml ros colmap kitti-calib, tum
    kitti euroc, csv coco yolo mot. Files may be packed (.gz), or - for standard input and output.
    If the format of OUT has no times, they go into a file beside it.
    """
    from dqslam import io

    to_standard_output = is_stdin(out)
    if json and to_standard_output:
        raise ValueError("-: standard output has what is converted, so that --json has no place")
    output = Output(quiet=quiet or to_standard_output, as_json=json)
    inputs = (source, camera, classes, *how.files)
    refuse_shared_input(*inputs, odometry_covariance)
    reading = how.read_options()
    if camera is not None:
        lens = io.read_camera_file(camera, reading)
        reading = replace(reading, camera_id=None, image_size=(lens.width, lens.height))
    notes = io.Notes(max_bad=reading.max_bad)
    context = io.ConvertContext(
        reading=reading,
        odometry_covariance=odometry_covariance,
        classes=None if classes is None else io.read_class_names(classes),
        notes=notes,
        files=tuple(one for one in inputs[1:] if one is not None),
    )
    with output.share("converting") as progress:
        written = io.convert(
            source,
            out,
            format=format_,
            to=to,
            context=context,
            progress=progress,
        )
    for sentence in notes.sentences():
        output.warn(sentence)
    for file in written:
        loses = f"; no place for {' and '.join(file.loses)}" if file.loses else ""
        output.line(f"wrote {file.path}: {file.what}{loses}")
    described = [
        {"path": str(file.path), "what": file.what, "loses": file.loses} for file in written
    ]
    output.document({"written": described, "input_notes": notes.described()})
