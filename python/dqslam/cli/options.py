"""Options that several commands share: the files of a recording, results, trials."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from dqslam.io import FrameTimes, ReadOptions

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
CameraInBody = Annotated[
    Path | None,
    typer.Option(
        help="File with body_from_camera, 7, 12 or 16 numbers, if the poses are a body's."
    ),
]
ImageSize = Annotated[
    str | None,
    typer.Option(
        metavar="WIDTHxHEIGHT", help="Size of the image in pixels, for a camera that has none."
    ),
]
PositionsFile = Annotated[
    Path | None,
    typer.Option(help="CSV of measured centers of objects in the camera frame, with final ids."),
]
AbsoluteFile = Annotated[
    Path | None,
    typer.Option(help="CSV of positions of the camera in a frame of their own, like GPS."),
]
ClosuresFile = Annotated[
    Path | None, typer.Option(help="CSV of relative poses of the camera: loop closures.")
]
MaxTimeDifference = Annotated[
    float | None,
    typer.Option(help="Most seconds from a box to its pose. Default: half the interval of poses."),
]
ResultDirectory = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Directory of the results, created if needed.")
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
        help="True trajectory, in any world frame. Default: groundtruth.txt in DIR or its parent."
    ),
]
TrueObjectsFile = Annotated[
    Path | None,
    typer.Option(
        help="CSV of true objects. Default: objects.csv beside groundtruth.txt, if that is used."
    ),
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
    camera_in_body: Path | None,
    image_size: str | None,
    camera_id: str | None = None,
) -> "ReadOptions":
    """Return how files are read from these options."""
    from dqslam import io

    mount = None if camera_in_body is None else io.read_mount(camera_in_body)
    return io.ReadOptions(
        first_frame=first_frame,
        max_bad=max_bad,
        nms=nms,
        topics=tuple(topics or ()),
        body_from_camera=None if mount is None else tuple(mount.tolist()),
        image_size=given_image_size(image_size),
        camera_id=camera_id,
    )
