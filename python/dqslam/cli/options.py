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
    typer.Option("--format", metavar="NAME", help="Of a file, where its look does not tell."),
]
FrameTimesFile = Annotated[
    Path | None, typer.Option(help="Times of frames: KITTI times.txt, TUM rgb.txt, frames.csv.")
]
FrameRate = Annotated[
    float | None, typer.Option(metavar="HZ", help="Or frames per second, frame 0 at 0 s.")
]
MaxTimeDifference = Annotated[
    float | None,
    typer.Option(help="Seconds from a box to its pose. Default: half the interval of poses."),
]
ResultDirectory = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Directory of the results, made if need be.")
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
        help="Where trials run: in this process; in others, by Python's own pool or joblib's loky; "
        "on a cluster. Default: loky where joblib is installed, else processes.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Of the cluster: tcp://host:8786 of dask, or of ray. Default: one on this machine.",
    ),
]

# Of commands that look at results, with the truth where there is any.
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
