"""The files of a recording's measurements other than odometry and boxes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from dqslam._checks import Ints
from dqslam.io.formats import guarded
from dqslam.io.measurements import read_absolute, read_closures, read_positions
from dqslam.recording import Recording


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
        self, recording: Recording, max_time_difference: float | None, counted: Ints | None = None
    ) -> Recording:
        """Return a recording with the measurements of the files.

        ``max_time_difference`` is the most seconds from a measurement to its pose, and ``counted``
        (k,) are the rows of the poses that the files count, by default all.
        """
        near = (recording.timestamps, max_time_difference, counted)
        for name, path, read in (
            ("positions", self.positions, read_positions),
            ("absolute", self.absolute, read_absolute),
            ("closures", self.closures, read_closures),
        ):
            if path is not None:
                measured = guarded(path, f"CSV of {name}", read, path, *near)
                recording = replace(recording, **{name: measured})
        return recording
