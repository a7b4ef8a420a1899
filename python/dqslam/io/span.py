"""A part of a recording in time: the poses and the boxes between two times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.io.detections.table import DetectionTable
from dqslam.io.files import FileError
from dqslam.io.trajectory.table import Trajectory

# Times are written with six decimals: a time within this counts as equal [s].
ROUNDING = 1e-6


@dataclass(frozen=True)
class TimeSpan:
    """The time from ``begin`` to ``end``, both within, by the clock of the poses [s]."""

    begin: float = -np.inf
    end: float = np.inf

    def __post_init__(self) -> None:
        """Check both times."""
        if not self.begin <= self.end:
            raise ValueError(f"the time from {seconds(self.begin)} until {seconds(self.end)} s")

    def contains(self, times: Floats) -> Bools:
        """Return which times (n,) are within."""
        return np.asarray((times >= self.begin - ROUNDING) & (times <= self.end + ROUNDING))

    def of_path(self, trajectory: Trajectory, path: str | Path) -> Trajectory:
        """Return the poses of this time, of a trajectory from this file.

        Raises
        ------
        FileError
            If there is none.
        """
        inside = self._inside(trajectory.timestamps, path, "poses")
        return Trajectory(trajectory.timestamps[inside], trajectory.world_from_camera[inside])

    def of_boxes(self, table: DetectionTable) -> DetectionTable:
        """Return the boxes of this time.

        Raises
        ------
        FileError
            If there is none.
        """
        return table.select(self._inside(table.timestamp, table.path, "boxes"))

    def _inside(self, times: Floats, path: str | Path, what: str) -> Bools:
        inside = self.contains(times)
        if len(times) and not inside.any():
            raise FileError(
                path,
                f"none of {len(times)} {what} is {self}: they are from {seconds(times.min())} to "
                f"{seconds(times.max())} s",
            )
        return inside

    def __str__(self) -> str:
        """Say it, as in "from 12.5 until 30 s"."""
        parts = [f"from {seconds(self.begin)}"] if self.begin > -np.inf else []
        parts += [f"until {seconds(self.end)}"] if self.end < np.inf else []
        return f"{' '.join(parts)} s" if parts else "at any time"


#: The whole recording.
ALL_TIME = TimeSpan()


def seconds(time: float) -> str:
    """Write a time so that it can be given back as an option: to the microsecond."""
    return f"{time:.6f}".rstrip("0").rstrip(".") if np.isfinite(time) else f"{time:g}"
