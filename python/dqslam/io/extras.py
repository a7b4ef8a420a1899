"""The files of a recording's measurements other than odometry and boxes."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dqslam._checks import Floats
from dqslam.io.formats import guarded
from dqslam.io.measurements import read_absolute, read_closures, read_positions
from dqslam.recording import AbsolutePositions, LoopClosures, Recording, RelativePositions

Measured = TypeVar("Measured", RelativePositions, AbsolutePositions, LoopClosures)


@dataclass(frozen=True, kw_only=True)
class Extras:
    """Files of measurements, see ``io.measurements``; None where there are none."""

    positions: str | Path | None = None
    """Positions of objects in the camera frame."""
    absolute: str | Path | None = None
    """Positions of the camera in a frame of their own."""
    closures: str | Path | None = None
    """Relative poses of the camera between any two poses."""

    def added_to(
        self, recording: Recording, max_time_difference: float, pose_times: Floats
    ) -> Recording:
        """Return a recording with the measurements of the files.

        ``max_time_difference`` is the most seconds from a measurement to its pose. ``pose_times``
        (k,) are those of the whole trajectory, whose poses the files count. Measurements of poses
        that are before or after the recording are left out.
        """
        times = recording.timestamps
        before = pose_times[pose_times < times[0]]
        every = np.concatenate([before, times, pose_times[pose_times > times[-1]]])
        near = (every, max_time_difference, np.searchsorted(every, pose_times))
        for name, path, read in (
            ("positions", self.positions, read_positions),
            ("absolute", self.absolute, read_absolute),
            ("closures", self.closures, read_closures),
        ):
            if path is not None:
                measured = guarded(path, f"CSV of {name}", read, path, *near)
                changes: dict[str, Any] = {name: _of_part(measured, len(before), len(times))}
                recording = replace(recording, **changes)
        return recording


def _of_part(measured: Measured, first: int, count: int) -> Measured | None:
    """Return the measurements of so many poses from a first one on, whose row is then 0."""
    names = [field.name for field in fields(measured)]
    columns = {name: getattr(measured, name) for name in names}
    poses = [name for name in names if name.endswith("pose")]
    inside = np.all([(columns[n] >= first) & (columns[n] < first + count) for n in poses], axis=0)
    if not inside.any():
        return None
    kept = {name: column[inside] for name, column in columns.items()}
    return replace(measured, **kept | {name: kept[name] - first for name in poses})
