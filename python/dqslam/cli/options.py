"""Options that several commands share: the files of a recording, results, trials."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from dqslam.io import FrameTimes

CameraFile = Annotated[Path, typer.Option(help="Camera: JSON, TOML, ROS, COLMAP, KITTI, bag.")]
OdometryFile = Annotated[Path, typer.Option(help="Trajectory: TUM, KITTI, EuRoC, bag.")]
DetectionFile = Annotated[Path, typer.Option(help="Boxes: CSV, COCO, YOLO, MOT, bag.")]
Formats = Annotated[
    list[str] | None,
    typer.Option("--format", metavar="NAME", help="Format of a file that is not recognized."),
]
FrameTimesFile = Annotated[
    Path | None, typer.Option(help="Times of frames: KITTI times.txt, TUM rgb.txt, frames.csv.")
]
FrameRate = Annotated[
    float | None, typer.Option(metavar="HZ", help="Or frames per second, with frame 0 at 0 s.")
]
MaxTimeDifference = Annotated[
    float | None,
    typer.Option(help="Seconds from a box to its pose. Default: half the interval of poses."),
]
ResultDirectory = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Directory of the results, created if needed.")
]
FirstSeed = Annotated[
    int, typer.Option(min=0, help="Seed of the first trial; the next ones count up.")
]
Jobs = Annotated[
    int | None, typer.Option(min=1, help="Processes at a time. Default: as many as cores.")
]
BackendName = Annotated[
    Literal["serial", "processes", "loky", "dask", "ray"] | None,
    typer.Option(
        "--backend",
        help="Where trials run: this process, other processes (Python's or joblib's loky), or a "
        "cluster. Default: loky if joblib is installed, else processes.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Cluster's address, for dask tcp://host:8786. Default: a cluster on this machine.",
    ),
]

# Options of commands that show results, with the truth if there is one.
TruthFile = Annotated[
    Path | None,
    typer.Option(
        help="True trajectory, in any world. Default: groundtruth.txt in DIR or beside it."
    ),
]
TrueObjectsFile = Annotated[
    Path | None,
    typer.Option(help="CSV of true objects. Default: objects.csv beside groundtruth.txt."),
]
Alignment = Annotated[
    Literal["se3", "sim3", "se2", "none"],
    typer.Option(help="Motion between both worlds: rigid, with scale, on the plane."),
]


def given_frame_times(table: Path | None, rate: float | None) -> "FrameTimes | None":
    """Return the times of frames that these two options give, if one of them is given."""
    from dqslam import io

    if table is not None and rate is not None:
        raise ValueError("--frame-times and --frame-rate both say when a frame was taken")
    if table is not None:
        return io.read_frame_times(table)
    return None if rate is None else io.frame_rate(rate)
