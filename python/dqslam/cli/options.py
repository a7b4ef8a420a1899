"""Options that several commands share: times of frames, results, trials."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from dqslam.io import FrameTimes, TimeSpan

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
FromTime = Annotated[
    float | None,
    typer.Option(
        "--from",
        metavar="SECONDS",
        help="Leave out what is before this time, in seconds of the clock of the poses. "
        "Default: nothing.",
    ),
]
UntilTime = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Leave out what is after this time, in seconds of the same clock. Default: nothing.",
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
        help="Where trials or recordings run: this process, other processes (Python's or "
        "joblib's loky), or a cluster. Default: serial for one job, else loky if joblib is "
        "installed, else processes.",
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


def given_span(since: float | None, until: float | None) -> "TimeSpan":
    """Return the part of the time that these two options leave, all of it without either."""
    from dqslam import io

    begin, end = -math.inf if since is None else since, math.inf if until is None else until
    if not begin <= end:
        raise ValueError(f"--from {begin:g} is not before --until {end:g}")
    return io.TimeSpan(begin, end)


def given_frame_times(table: Path | None, rate: float | None) -> "FrameTimes | None":
    """Return the times of frames from these two options, or None without either."""
    from dqslam import io

    if table is not None and rate is not None:
        raise ValueError("--frame-times and --frame-rate both give the times of frames")
    if table is not None:
        return io.read_frame_times(table)
    return None if rate is None else io.frame_rate(rate)
