"""The true tracks of what moves as CSV, a row for each thing at each time.

Columns are found by name, in any order, and others are ignored; # starts a comment line. The
``tracks.csv`` of another estimate is such a file, too:

``track_id`` (or ``object_id``, ``id``)
    Whole number, the same in all rows of a thing, which need not be together.
``timestamp``
    Seconds, increasing for each thing.
``x y z``
    Center in the world, meters.
``speed``
    Meters per second, optional; by default it follows from the centers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.io.csv_table import read_csv
from dqslam.io.files import FileError
from dqslam.io.truth import IDS

# Without speeds, that of a time is the mean one over so many seconds before and after it.
SPEED_OVER_S = 0.5


@dataclass(frozen=True, eq=False)
class TrueTrack:
    """Where a thing was; times increase."""

    track_id: int
    timestamps: Floats
    """Seconds, shape (n,)."""
    centers: Floats
    """In the world, meters, shape (n, 3)."""
    speeds: Floats
    """Meters per second, shape (n,); NaN where there is only one time."""


def read_true_tracks(path: str | Path) -> tuple[TrueTrack, ...]:
    """Read the true tracks of a recording, in order of their ids.

    Raises
    ------
    FileError
        If the file is missing or wrong, with the line.
    """
    table = read_csv(path, required=("timestamp", "x", "y", "z"))
    name = next((one for one in IDS if one in table), None)
    if name is None:
        raise FileError(path, f"no column track_id (it has: {', '.join(table.columns)})")
    ids, times = table.integers(name), table.numbers("timestamp")
    centers = np.column_stack([table.numbers(axis) for axis in "xyz"])
    told = table.numbers("speed") if "speed" in table else None
    tracks = []
    for number in np.unique(ids).tolist():
        rows: Ints = np.flatnonzero(ids == number)
        late = np.zeros(len(ids), dtype=np.bool_)
        late[rows[1:]] = np.diff(times[rows]) <= 0.0
        table.reject(late, f"time does not increase in track {number}")
        speeds = _speeds(times[rows], centers[rows]) if told is None else np.abs(told[rows])
        tracks.append(TrueTrack(number, times[rows], centers[rows], speeds))
    return tuple(tracks)


def _speeds(times: Floats, centers: Floats) -> Floats:
    """Return the mean speeds [m/s] around each of some times (n,)."""
    slack = 1e-6  # times that are this late are on time
    before = np.searchsorted(times, times - SPEED_OVER_S - slack)
    after = np.searchsorted(times, times + SPEED_OVER_S + slack, side="right") - 1
    run = np.linalg.norm(centers[after] - centers[before], axis=1)
    taken = times[after] - times[before]
    return np.where(taken > 0.0, run / np.where(taken > 0.0, taken, 1.0), np.nan)
