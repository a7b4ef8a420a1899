"""``dqslam detect``: boxes from images, by a detector in an ONNX file."""

import time
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from dqslam._files import refuse_inputs
from dqslam.cli.options import FrameRate, FrameTimesFile, given_frame_times
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import ConfigFile

_MOST_CLASSES = 8  # that are named in the last line


def detect(
    images: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER|FILM",
            help="Images of one camera, or a film. Times come from --frame-times, --frame-rate, "
            "the names of the images, or the film.",
        ),
    ],
    model: Annotated[Path, typer.Option(metavar="FILE", help="Detector, an ONNX file.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="CSV of boxes to write.")
    ],
    layout: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Layout of the model's outputs: rtdetr, detr, rfdetr, yolov5, yolox, "
            "yolox-decoded, yolov8, end-to-end, rtdetr-ultralytics. Default: recognized.",
        ),
    ] = None,
    classes: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Names of classes: COCO JSON, data.yaml, or text with one name per line; or the "
            "word coco or coco91. Default: those in the model.",
        ),
    ] = None,
    min_score: Annotated[
        float, typer.Option(help="Leave out boxes with a lower score, 0 to 1.")
    ] = 0.1,
    class_nms: Annotated[
        float,
        typer.Option(
            metavar="IOU",
            help="Leave out boxes that overlap a better one of their class by more than this, 0 to "
            "1, unless the model leaves out such boxes itself.",
        ),
    ] = 0.65,
    every: Annotated[
        int, typer.Option(min=1, metavar="N", help="Look at one of so many images only.")
    ] = 1,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    model_size: Annotated[
        str | None,
        typer.Option(
            metavar="WxH", help="Size of the model's input in px, if the model leaves it open."
        ),
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(min=1, help="Number of threads. Default: one per core."),
    ] = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Run a detector over images and write its boxes for `dqslam run --detections`.

    It needs the extra "detect". docs/detect.md says where to get models, and their licenses.
    """
    if find_spec("onnxruntime") is None or find_spec("cv2") is None:
        raise ValueError("detection needs ONNX Runtime, OpenCV: pip install 'dqslam[detect]'")
    from dqslam import detection

    options = detection.DetectOptions(
        layout=layout,
        model_size=_given_size(model_size),
        min_score=min_score,
        class_nms=class_nms,
        names=None if classes is None else detection.class_names(classes),
        frames=given_frame_times(frame_times, frame_rate),
        every=every,
        threads=threads,
    )
    refuse_inputs(out, [images, model, frame_times, classes, *_files_of(images)])
    output = Output(quiet=quiet, as_json=json)
    start = time.monotonic()
    with output.share("detecting") as progress:
        found = detection.detect(images, model, options, progress=progress)
    seconds = time.monotonic() - start
    detection.write_found(out, found)
    if not found.names:
        output.warn(f"{model}: has no names of classes, which are numbers now; see --classes")
    counts = found.counts()
    named = [f"{number} {name}" for name, number in list(counts.items())[:_MOST_CLASSES]]
    more = f" and {len(counts) - len(named)} other classes" if len(counts) > len(named) else ""
    output.line(f"outputs of the model: {found.layout}")
    output.line(f"{len(found)} boxes in {len(found.frame)} images: {', '.join(named)}{more}")
    if not found.time:
        output.line("nothing tells the times of the images: `run` needs --frame-rate or the like")
    output.line(f"wrote {out}")
    output.document(
        {
            "written": str(out),
            "layout": found.layout,
            "image_size": list(found.size),
            "images": len(found.frame),
            "boxes": len(found),
            "classes": counts,
            "has_times": bool(found.time),
            "seconds": round(seconds, 3),
        }
    )


def _given_size(text: str | None) -> tuple[int, int] | None:
    """Return width and height from text like 640x480."""
    if text is None:
        return None
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ValueError(f"--model-size: {text!r} is not like 640x480")
    return int(width), int(height)


def _files_of(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []
