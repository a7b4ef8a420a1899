"""Options of commands that read the files of a recording. A new one is a field, and used below."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import typer

from dqslam.cli.options import (
    FrameRate,
    FrameTimesFile,
    FromTime,
    UntilTime,
    given_frame_times,
    given_span,
)

if TYPE_CHECKING:
    from dqslam.io import Readings, ReadOptions

Number = TypeVar("Number", int, float)
# What numbers in the files mean, where it is not what is usual.
MEANING = "What numbers mean"


@dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """How any one file of a recording is read."""

    camera_id: Annotated[
        str | None,
        typer.Option(
            metavar="ID",
            help="Id of the camera, if the file has several: cam0, Camera1, 2, color.",
        ),
    ] = None
    frame_times: FrameTimesFile = None
    frame_rate: FrameRate = None
    first_frame: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            help="Number of the first frame in the file of boxes. Default: 1 for MOT, else 0.",
        ),
    ] = None
    image_size: Annotated[
        str | None,
        typer.Option(
            metavar="WxH",
            help="Size of the image in pixels, for a camera that has none.",
        ),
    ] = None
    topics: Annotated[
        list[str] | None,
        typer.Option(
            "--topic", metavar="NAME", help="Topic, if a bag has several of a kind; repeatable."
        ),
    ] = None
    nms: Annotated[
        float | None,
        typer.Option(
            metavar="IOU",
            help="Leave out boxes that overlap a better one of their image by this, 0 to 1, of any "
            "class. Default: leave out none.",
        ),
    ] = None
    max_bad: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            metavar="SHARE",
            help="Share of bad boxes or poses that are left out; with more, a file is refused.",
        ),
    ] = 0.05
    since: FromTime = None
    until: UntilTime = None
    poses: Annotated[
        list[str] | None,
        typer.Option(
            "--poses",
            metavar="READING",
            help="What poses are: camera_from_world, w_first (quaternions), opengl or body (axes); "
            "repeatable.",
            rich_help_panel=MEANING,
        ),
    ] = None
    camera_in_body: Annotated[
        Path | None,
        typer.Option(
            help="File with body_from_camera, 7, 12 or 16 numbers, if the poses are a body's.",
            rich_help_panel=MEANING,
        ),
    ] = None
    length_scale: Annotated[
        float,
        typer.Option(
            help="Meters in the unit of positions: 0.001 for millimeters.",
            rich_help_panel=MEANING,
        ),
    ] = 1.0
    box_form: Annotated[
        Literal["xyxy", "xywh", "cxcywh", "yxyx"] | None,
        typer.Option(
            metavar="FORM",
            help="What the four numbers of a box are: xyxy, xywh, cxcywh or yxyx. Default: what "
            "the format says.",
            rich_help_panel=MEANING,
        ),
    ] = None
    box_image: Annotated[
        str | None,
        typer.Option(
            metavar="WxH",
            help="Size of the image that boxes are of, if it is scaled; 1x1 for shares of the "
            "image.",
            rich_help_panel=MEANING,
        ),
    ] = None
    letterbox: Annotated[
        bool,
        typer.Option(
            "--letterbox",
            help="The image of --box-image has bars beside or above the camera's.",
            rich_help_panel=MEANING,
        ),
    ] = False
    time_offset: Annotated[
        float,
        typer.Option(
            metavar="SECONDS", help="Added to the times of boxes.", rich_help_panel=MEANING
        ),
    ] = 0.0
    time_scale: Annotated[
        float,
        typer.Option(
            help="Factor of the times of boxes, before that: 0.001 for milliseconds.",
            rich_help_panel=MEANING,
        ),
    ] = 1.0

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The files that these options name."""
        return self.frame_times, self.camera_in_body

    def read_options(self) -> ReadOptions:
        """Return how files are read; reads those that options name."""
        from dqslam import io

        return io.ReadOptions(
            frames=given_frame_times(self.frame_times, self.frame_rate),
            first_frame=self.first_frame,
            max_bad=self.max_bad,
            nms=self.nms,
            topics=tuple(self.topics or ()),
            image_size=_size("--image-size", self.image_size, int),
            camera_id=self.camera_id,
            readings=self._readings(),
            span=given_span(self.since, self.until),
        )

    def _readings(self) -> Readings:
        from dqslam import io

        file = self.camera_in_body
        return io.Readings(
            poses=tuple(self.poses or ()),
            body_from_camera=None if file is None else tuple(io.read_mount(file).tolist()),
            length_scale=self.length_scale,
            boxes=io.BoxReading(
                form=self.box_form,
                image=_size("--box-image", self.box_image, float),
                letterbox=self.letterbox,
            ),
            time_scale=self.time_scale,
            time_offset=self.time_offset,
        )


@dataclass(frozen=True, kw_only=True)
class ImageOptions(ReadingOptions):
    """The camera, the boxes of its images, and how they are read together."""

    camera: Annotated[
        Path,
        typer.Option(help="Camera file: JSON, TOML, ROS, OpenCV, Kalibr, COLMAP, KITTI, bag, ..."),
    ]
    detections: Annotated[
        Path, typer.Option(help="File or folder of boxes: CSV, COCO, YOLO, MOT, KITTI, bag, ...")
    ]
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format", metavar="NAME", help="Format of a file that is not recognized; repeatable."
        ),
    ] = None
    max_time_difference: Annotated[
        float | None,
        typer.Option(
            help="Most seconds from a box to its pose. Default: half the interval of poses.",
            rich_help_panel=MEANING,
        ),
    ] = None

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The files that these options name."""
        return (self.camera, self.detections, *super().files)

    def read_options(self) -> ReadOptions:
        """Return how the files are read; reads those that options name."""
        from dqslam import io

        return replace(
            super().read_options(),
            formats=io.split_formats(self.formats or []),
            max_time_difference=self.max_time_difference,
        )


@dataclass(frozen=True, kw_only=True)
class RecordingOptions(ImageOptions):
    """The three files of a recording, and how they are read together."""

    odometry: Annotated[Path, typer.Option(help="Trajectory: TUM, KITTI, EuRoC, COLMAP, bag, ...")]

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The files that these options name."""
        return (self.odometry, *super().files)


def _size(
    option: str, text: str | None, number: Callable[[str], Number]
) -> tuple[Number, Number] | None:
    """Read a size like 640x480."""
    if text is None:
        return None
    try:
        width, height = (number(side) for side in text.lower().split("x"))
    except ValueError:
        raise ValueError(f"{option}: {text!r} is not like 640x480") from None
    return width, height
