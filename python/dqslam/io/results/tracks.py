"""Tracks of what moves as CSV, a row for each track in each image that shows it.

``track_id class_name behavior probability``
    What moves, the same in all rows of a track; ``behavior`` is "moves" or "stops and goes".
``timestamp``
    Seconds; it is the time of a pose in ``trajectory.txt``.
``x y z qx qy qz qw``
    The middle of the cuboid in the world [m], and its rotation: forward, left and up.
``heading speed turn_rate moving``
    About the direction up [rad], [m/s], [rad/s]; 0 where it rests in the image, else 1.
``length width height``
    Meters, the same in all rows of a track.
``cxx cxy cxz cyy cyz czz``
    Covariance of the middle [m^2], the path's uncertainty included.
``heading_sigma speed_sigma turn_rate_sigma``
    Standard deviations [rad], [m/s], [rad/s].
``log_length_sigma log_width_sigma log_height_sigma``
    Standard deviations of natural logarithms, the same in all rows of a track.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.io.csv_table import CsvTable, read_csv
from dqslam.io.files import write_text
from dqslam.track import Track

_PLACE = ("x", "y", "z")
_TURN = ("qx", "qy", "qz", "qw")
_SIDES = ("length", "width", "height")
_COVARIANCE = ("cxx", "cxy", "cxz", "cyy", "cyz", "czz")
_LOG_SIGMAS = tuple(f"log_{name}_sigma" for name in _SIDES)
_SAME = ("class_name", "behavior", "probability", *_SIDES, *_LOG_SIGMAS)
COLUMNS = (
    *("track_id", "class_name", "behavior", "probability", "timestamp", *_PLACE, *_TURN),
    *("heading", "speed", "turn_rate", "moving", *_SIDES, *_COVARIANCE),
    *("heading_sigma", "speed_sigma", "turn_rate_sigma", *_LOG_SIGMAS),
)
_UPPER = np.triu_indices(3)
_UNIT = 1e-3


def write_tracks(path: str | Path, tracks: Sequence[Track], timestamps: Floats) -> None:
    """Write tracks; ``timestamps`` (n,) are those of all poses of the estimate."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for track in tracks:
        name = " ".join(track.class_name.splitlines())  # rows are lines
        sizes = [*track.sides, *track.log_sides_sigmas]
        for row, pose in enumerate(track.pose.tolist()):
            numbers = [
                *track.centers[row],
                *track.orientations[row],
                track.headings[row],
                track.speeds[row],
                track.turn_rates[row],
                float(track.is_moving[row]),
                *sizes[:3],
                *track.center_covariances[row][_UPPER],
                track.heading_sigmas[row],
                track.speed_sigmas[row],
                track.turn_rate_sigmas[row],
                *sizes[3:],
            ]
            writer.writerow(
                [
                    *(track.track_id, name, track.behavior, repr(track.probability)),
                    repr(float(timestamps[pose])),
                    *(f"{number:.9g}" for number in numbers),
                ]
            )
    write_text(path, text.getvalue())


def read_tracks(path: str | Path, timestamps: Floats) -> tuple[Track, ...]:
    """Read tracks in a recording whose poses have the times (n,).

    Raises
    ------
    FileError
        If the file is missing or wrong, with the line.
    """
    table = read_csv(path, required=COLUMNS, allow_empty=True)
    time, ids = table.numbers("timestamp"), table.integers("track_id")
    pose = np.searchsorted(timestamps, time).clip(max=len(timestamps) - 1)
    table.reject(timestamps[pose] != time, "timestamp {} is of no pose", "timestamp")
    probability = table.numbers("probability")
    wrong = (probability < 0.0) | (probability > 1.0)
    table.reject(wrong, "probability is {}, not between 0 and 1", "probability")
    known = np.isin(table.cells("behavior"), ["moves", "stops and goes"])
    table.reject(~known, "behavior is {}, not moves or stops and goes", "behavior")
    turns = _numbers(table, _TURN)
    off = np.abs(np.linalg.norm(turns, axis=1) - 1.0) > _UNIT
    table.reject(off, "quaternion is not of unit length")
    empty = np.any(_numbers(table, _SIDES) <= 0.0, axis=1)
    table.reject(empty, "a side is not positive")
    new = np.append(True, np.diff(ids) != 0) if len(ids) else np.zeros(0, dtype=np.bool_)
    table.reject(~new & (np.diff(pose, prepend=-1) <= 0), "time does not increase in its track")
    table.reject(new & _occurred(ids), "track_id {} has rows elsewhere", "track_id")
    for name in _SAME:
        cells = np.array(table.cells(name))
        changes = ~new & np.append(False, cells[1:] != cells[:-1])
        table.reject(changes, f"{name} is {{}}, not that of the row before", name)
    groups = np.split(np.arange(len(ids)), np.flatnonzero(new)[1:]) if len(ids) else []
    return tuple(_track(table, rows, int(ids[rows[0]]), pose[rows]) for rows in groups)


def describe(track: Track, timestamps: Floats) -> dict[str, Any]:
    """Return the entry of a track in ``map.json``."""
    return {
        "id": track.track_id,
        "class_name": track.class_name,
        "behavior": track.behavior,
        "probability": track.probability,
        "images": len(track),
        "first_timestamp": float(timestamps[track.pose[0]]),
        "last_timestamp": float(timestamps[track.pose[-1]]),
        "sides": track.sides,
    }


def _track(table: CsvTable, rows: Ints, track_id: int, pose: Ints) -> Track:
    first = int(rows[0])
    upper = _numbers(table, _COVARIANCE)[rows]
    covariances = np.zeros((len(rows), 3, 3))
    covariances[:, _UPPER[0], _UPPER[1]] = covariances[:, _UPPER[1], _UPPER[0]] = upper
    return Track(
        track_id,
        table.cells("class_name")[first],
        "moves" if table.cells("behavior")[first] == "moves" else "stops and goes",
        float(table.numbers("probability")[first]),
        pose,
        _numbers(table, _PLACE)[rows],
        _numbers(table, _TURN)[rows],
        table.numbers("heading")[rows],
        table.numbers("speed")[rows],
        table.numbers("turn_rate")[rows],
        table.flags("moving")[rows],
        _numbers(table, _SIDES)[first],
        covariances,
        table.numbers("heading_sigma")[rows],
        table.numbers("speed_sigma")[rows],
        table.numbers("turn_rate_sigma")[rows],
        _numbers(table, _LOG_SIGMAS)[first],
    )


def _numbers(table: CsvTable, names: Sequence[str]) -> Floats:
    return np.column_stack([table.numbers(name) for name in names])


def _occurred(ids: Ints) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return whether each id has occurred in an earlier row, (n,)."""
    first = np.full(len(ids), True)
    first[np.unique(ids, return_index=True)[1]] = False
    return first
