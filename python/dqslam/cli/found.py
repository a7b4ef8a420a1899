"""Files that a command finds by itself: results in a simulated recording, and their truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dqslam.io import Results, Trajectory, TrueObjects

GROUNDTRUTH, OBJECTS = "groundtruth.txt", "objects.csv"


def results_in(directory: Path) -> Path:
    """Return the folder of the results; a simulated recording has it inside."""
    inside = directory / "results"
    simulated = (directory / "odometry.txt").exists() and (inside / "trajectory.txt").exists()
    return inside if simulated and not (directory / "trajectory.txt").exists() else directory


def truth_of(
    results: Path, groundtruth: Path | None, objects: Path | None
) -> tuple[Path | None, Path | None]:
    """Return the given true trajectory and objects, or else those in the results or beside them."""
    if groundtruth is not None:
        return groundtruth, objects
    folders = (results, results.resolve().parent)
    found = next((one for one in folders if (one / GROUNDTRUTH).is_file()), None)
    if found is None:
        return None, objects
    if objects is None and (found / OBJECTS).is_file():
        objects = found / OBJECTS
    return found / GROUNDTRUTH, objects


def read_with_truth(
    directory: Path, groundtruth: Path | None, objects: Path | None
) -> tuple[Results, Trajectory | None, TrueObjects | None]:
    """Read results, and the true trajectory and objects if there are any."""
    from dqslam import io

    results = io.load_results(results_in(directory))
    groundtruth, objects = truth_of(results.directory, groundtruth, objects)
    return (
        results,
        None if groundtruth is None else io.read_trajectory(groundtruth, repeated_times=True),
        None if objects is None else io.read_true_objects(objects),
    )
