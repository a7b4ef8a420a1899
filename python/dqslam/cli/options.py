"""Options that several commands share: the files of a recording, results, trials."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from dqslam.io import FrameTimes, Readings, ReadOptions

CameraFile = Annotated[
    Path, typer.Option(help="Camera file: JSON, TOML, ROS, OpenCV, Kalibr, COLMAP, KITTI, bag, ...")
]
CameraId = Annotated[
    str | None,
    typer.Option(
        metavar="ID", help="Id of the camera, if the file has several: cam0, Camera1, 2, color."
    ),
]
OdometryFile = Annotated[Path, typer.Option(help="Trajectory: TUM, KITTI, EuRoC, COLMAP, bag, ...")]
DetectionFile = Annotated[
    Path, typer.Option(help="File or folder of boxes: CSV, COCO, YOLO, MOT, KITTI, bag, ...")
]
Formats = Annotated[
    list[str] | None,
    typer.Option(
        "--format", metavar="NAME", help="Format of a file that is not recognized; repeatable."
    ),
]
FrameTimesFile = Annotated[
    Path | None,
    typer.Option(help="File of the times of frames: KITTI times.txt, TUM rgb.txt, CSV."),
]
FrameRate = Annotated[
    float | None,
    typer.Option(
        metavar="HZ",
        help="Frames per second, with frame 0 at 0 s. Default: --frame-times or the files.",
    ),
]
FirstFrame = Annotated[
    int | None,
    typer.Option(
        min=0,
        metavar="N",
        help="Number of the first frame in the file of boxes. Default: 1 for MOT, else 0.",
    ),
]
MaxBad = Annotated[
    float,
    typer.Option(
        min=0.0,
        max=1.0,
        metavar="SHARE",
        help="Share of bad boxes or poses that are left out; with more, a file is refused.",
    ),
]
Nms = Annotated[
    float | None,
    typer.Option(
        metavar="IOU",
        help="Leave out boxes that overlap a better one of their image by this, 0 to 1, of any "
        "class. Default: leave out none.",
    ),
]
Topics = Annotated[
    list[str] | None,
    typer.Option(
        "--topic", metavar="NAME", help="Topic, if a bag has several of a kind; repeatable."
    ),
]
ImageSize = Annotated[
    str | None,
    typer.Option(metavar="WxH", help="Size of the image in pixels, for a camera that has none."),
]
PositionsFile = Annotated[
    Path | None,
    typer.Option(
        help="CSV of measured centers of objects in the camera frame, with final ids.",
        rich_help_panel="More measurements",
    ),
]
AbsoluteFile = Annotated[
    Path | None,
    typer.Option(
        help="CSV of positions of the camera in a frame of their own, like GPS.",
        rich_help_panel="More measurements",
    ),
]
ClosuresFile = Annotated[
    Path | None,
    typer.Option(
        help="CSV of relative poses of the camera: loop closures.",
        rich_help_panel="More measurements",
    ),
]
MaxTimeDifference = Annotated[
    float | None,
    typer.Option(
        help="Most seconds from a box to its pose. Default: half the interval of poses.",
        rich_help_panel="What numbers mean",
    ),
]
# What numbers in the files mean, where it is not what is usual.
PosesAs = Annotated[
    list[str] | None,
    typer.Option(
        "--poses",
        metavar="READING",
        help="What poses are: camera_from_world, w_first (quaternions), opengl or body (axes); "
        "repeatable.",
        rich_help_panel="What numbers mean",
    ),
]
CameraInBody = Annotated[
    Path | None,
    typer.Option(
        help="File with body_from_camera, 7, 12 or 16 numbers, if the poses are a body's.",
        rich_help_panel="What numbers mean",
    ),
]
LengthScale = Annotated[
    float,
    typer.Option(
        help="Meters in the unit of positions: 0.001 for millimeters.",
        rich_help_panel="What numbers mean",
    ),
]
BoxForm = Annotated[
    Literal["xyxy", "xywh", "cxcywh", "yxyx"] | None,
    typer.Option(
        metavar="FORM",
        help="What the four numbers of a box are: xyxy, xywh, cxcywh or yxyx. Default: what the "
        "format says.",
        rich_help_panel="What numbers mean",
    ),
]
BoxImage = Annotated[
    str | None,
    typer.Option(
        metavar="WxH",
        help="Size of the image that boxes are of, if it is scaled; 1x1 for shares of the image.",
        rich_help_panel="What numbers mean",
    ),
]
Letterbox = Annotated[
    bool,
    typer.Option(
        "--letterbox",
        help="The image of --box-image has bars beside or above the camera's.",
        rich_help_panel="What numbers mean",
    ),
]
TimeOffset = Annotated[
    float,
    typer.Option(
        metavar="SECONDS",
        help="Added to the times of boxes.",
        rich_help_panel="What numbers mean",
    ),
]
TimeScale = Annotated[
    float,
    typer.Option(
        help="Factor of the times of boxes, before that: 0.001 for milliseconds.",
        rich_help_panel="What numbers mean",
    ),
]
ResultDirectory = Annotated[
    Path,
    typer.Option("--out", "-o", metavar="DIR", help="Directory of the results, created if needed."),
]
MOST_TRIALS = 1_000_000  # a larger number is a slip
FirstSeed = Annotated[
    int, typer.Option(min=0, help="Seed of the first trial; each next trial adds 1.")
]
Jobs = Annotated[
    int | None, typer.Option(min=1, help="Number of processes. Default: one per core.")
]
BackendName = Annotated[
    Literal["serial", "processes", "loky", "dask", "ray"] | None,
    typer.Option(
        "--backend",
        help="Where trials run: this process, other processes (Python's or joblib's loky), or a "
        "cluster. Default: serial for one job, else loky if joblib is installed, else processes.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Address of a cluster, like tcp://host:8786 for dask. Default: one on this machine.",
    ),
]

# Options of commands that show results, with the truth if there is one.
TruthFile = Annotated[
    Path | None,
    typer.Option(
        help="True trajectory, in any world frame. Default: groundtruth.txt in DIR, or what "
        "`dqslam evaluate` was given, or groundtruth.txt in the parent of DIR."
    ),
]
TrueObjectsFile = Annotated[
    Path | None,
    typer.Option(help="CSV of true objects. Default: found with the true trajectory."),
]
Alignment = Annotated[
    Literal["se3", "sim3", "se2", "none"],
    typer.Option(help="Motion between both worlds: rigid, with scale, on the plane, or none."),
]


def given_frame_times(table: Path | None, rate: float | None) -> "FrameTimes | None":
    """Return the times of frames from these two options, or None without either."""
    from dqslam import io

    if table is not None and rate is not None:
        raise ValueError("--frame-times and --frame-rate both give the times of frames")
    if table is not None:
        return io.read_frame_times(table)
    return None if rate is None else io.frame_rate(rate)


def given_image_size(text: str | None) -> tuple[int, int] | None:
    """Return width and height from text like 640x480."""
    if text is None:
        return None
    width, _, height = text.lower().partition("x")
    if not (width.strip().isdecimal() and height.strip().isdecimal()):
        raise ValueError(f"--image-size: {text!r} is not like 640x480")
    return int(width), int(height)


def given_reading(
    first_frame: int | None,
    max_bad: float,
    nms: float | None,
    topics: list[str] | None,
    image_size: str | None,
    camera_id: str | None = None,
    *,
    readings: "Readings",
) -> "ReadOptions":
    """Return how files are read from these options."""
    from dqslam import io

    return io.ReadOptions(
        first_frame=first_frame,
        max_bad=max_bad,
        nms=nms,
        topics=tuple(topics or ()),
        image_size=given_image_size(image_size),
        camera_id=camera_id,
        readings=readings,
    )


def given_readings(
    *,
    camera_in_body: Path | None,
    poses: list[str] | None = None,
    length_scale: float = 1.0,
    box_form: str | None = None,
    box_image: str | None = None,
    letterbox: bool = False,
    time_offset: float = 0.0,
    time_scale: float = 1.0,
) -> "Readings":
    """Return what these options say that numbers mean."""
    from dqslam import io

    mount = None if camera_in_body is None else tuple(io.read_mount(camera_in_body).tolist())
    return io.Readings(
        poses=tuple(poses or ()),
        body_from_camera=mount,
        length_scale=length_scale,
        boxes=io.BoxReading(form=box_form, image=_size(box_image), letterbox=letterbox),
        time_scale=time_scale,
        time_offset=time_offset,
    )


def _size(text: str | None) -> tuple[float, float] | None:
    """Read a size like 640x480."""
    if text is None:
        return None
    try:
        width, height = (float(side) for side in text.lower().split("x"))
    except ValueError:
        raise ValueError(f"--box-image: {text!r} is not like 640x480") from None
    return width, height
