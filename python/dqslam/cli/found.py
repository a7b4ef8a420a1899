"""Files that a command finds by itself: results in a simulated recording, and their truth."""

from __future__ import annotations

import tomllib
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from dqslam._input import InputWarning

if TYPE_CHECKING:
    from dqslam.io import Results, Trajectory, TrueObjects

GROUNDTRUTH, OBJECTS = "groundtruth.txt", "objects.csv"
EVALUATED = "evaluation.toml"  #: the options of `dqslam evaluate`, in the results


def results_in(directory: Path) -> Path:
    """Return the folder of the results; a simulated recording has it inside."""
    inside = directory / "results"
    simulated = (directory / "odometry.txt").exists() and (inside / "trajectory.txt").exists()
    return inside if simulated and not (directory / "trajectory.txt").exists() else directory


def truth_of(
    results: Path, groundtruth: Path | None, objects: Path | None
) -> tuple[Path | None, Path | None]:
    """Return the given true trajectory and objects, or else those that are known.

    These are in the results, were given to `dqslam evaluate`, or are beside the results.
    """
    if groundtruth is not None:
        return groundtruth, objects
    if not (results / GROUNDTRUTH).is_file():
        evaluated, evaluated_objects = _evaluated_with(results)
        if evaluated is not None:
            return evaluated, evaluated_objects if objects is None else objects
    folders = (results, results.resolve().parent)
    found = next((one for one in folders if (one / GROUNDTRUTH).is_file()), None)
    if found is None:
        return None, objects
    if objects is None and (found / OBJECTS).is_file():
        objects = found / OBJECTS
    return found / GROUNDTRUTH, objects


def _evaluated_with(results: Path) -> tuple[Path | None, Path | None]:
    """Return the true trajectory and objects that `dqslam evaluate` was given, if they are there.

    Its options have paths as they were given, mostly relative to the directory of the call.
    """
    options = results / EVALUATED
    if not options.is_file():
        return None, None
    try:
        settings = tomllib.loads(options.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        settings = {}
    given = [settings.get(name) for name in ("groundtruth", "objects")]
    found = [
        Path(name) if isinstance(name, str) and Path(name).is_file() else None for name in given
    ]
    for name, path in zip(given, found, strict=True):
        if path is None and name is not None:
            message = f"{options}: {name} is not there, which `dqslam evaluate` was given"
            warnings.warn(message, InputWarning, stacklevel=3)
    return found[0], found[1]


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
