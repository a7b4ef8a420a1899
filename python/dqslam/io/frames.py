"""Times of frames, for formats that number frames and have no times.

Frames count from 0. A file of times is one of

- a KITTI ``times.txt`` with one number per line, where line i is for frame i;
- a TUM ``rgb.txt`` with ``time filename`` per line, where line i is for frame i; a box may have the
  name of the image as well;
- CSV with the columns ``frame`` and ``timestamp``, and any other columns.

Times are seconds and increase with the frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam.io.csv_table import read_csv
from dqslam.io.files import FileError, parse_numbers, read_rows, write_text
from dqslam.io.image_names import image_name

COLUMNS = ("frame", "timestamp")


@dataclass(frozen=True, eq=False)
class FrameTimes:
    """Times of frames: a table of them, or a rate."""

    source: str
    table: dict[int, float] | None = None  #: time of each frame in seconds
    rate: float = 1.0  #: frames per second if there is no table
    names: dict[str, int] = field(
        default_factory=dict
    )  #: frame of each image, by its name without ending

    def at(
        self, path: str | Path, frames: NDArray[np.int64], lines: Sequence[int]
    ) -> NDArray[np.float64]:
        """Return the times (n,) s of ``frames`` (n,); errors name the lines of the file."""
        if self.table is None:
            return frames / self.rate
        for frame, line in zip(frames.tolist(), lines, strict=True):
            if frame not in self.table:
                hint = ""
                if frame == max(self.table, default=0) + 1 and min(frames.tolist()) > 0:
                    hint = "; if the file counts frames from 1, say --first-frame 1"
                raise FileError(path, f"{self.source} has no time for frame {frame}{hint}", line)
        return np.array([self.table[frame] for frame in frames.tolist()], dtype=float)


#: The time is the number of the frame, for a trajectory and boxes that both count frames.
BY_NUMBER = FrameTimes("the number of the frame")


def frame_rate(rate: float) -> FrameTimes:
    """Return the times of frames that come at ``rate`` Hz, frame 0 at 0 s."""
    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f"frame rate is {rate:g} Hz, not positive")
    return FrameTimes(f"a rate of {rate:g} Hz", rate=rate)


def read_frame_times(path: str | Path) -> FrameTimes:
    """Read a file of times; see the head of this module for its forms."""
    rows, lines = read_rows(path)
    names: dict[str, int] = {}
    if "," in rows[0]:
        table = read_csv(path, required=COLUMNS)
        frames, times, lines = (
            table.integers("frame"),
            table.numbers("timestamp"),
            list(table.lines),
        )
    else:
        fields = [row.split() for row in rows]
        for row, line in zip(fields, lines, strict=True):
            if len(row) not in (1, 2) or len(row) != len(fields[0]):
                raise FileError(path, f"{len(row)} fields, not time, or time and filename", line)
        frames = np.arange(len(rows))
        times = parse_numbers(path, "timestamp", [row[0] for row in fields], lines)
        if len(fields[0]) == 2:
            names = {image_name(row[1]): i for i, row in enumerate(fields)}
    late = np.flatnonzero((np.diff(times) <= 0) | (np.diff(frames) <= 0))
    if late.size:
        i = int(late[0])
        message = (
            f"frame {frames[i + 1]} at {times[i + 1].item()!r} s is not later than "
            f"frame {frames[i]} at {times[i].item()!r} s (line {lines[i]})"
        )
        raise FileError(path, message, lines[i + 1])
    by_frame = dict(zip(frames.tolist(), times.tolist(), strict=True))
    return FrameTimes(str(path), by_frame, names=names)


def write_frame_times(path: str | Path, frames: ArrayLike, times: ArrayLike) -> None:
    """Write the times (n,) s of frames (n,) as CSV for read_frame_times, each frame once."""
    write_text(path, frame_table(frames, times))


def frame_table(frames: ArrayLike, times: ArrayLike) -> list[str]:
    """Return the lines of that CSV."""
    pairs = zip(np.asarray(frames).tolist(), np.asarray(times, dtype=float).tolist(), strict=True)
    rows = [f"{frame},{time!r}\n" for frame, time in sorted(set(pairs))]
    return [",".join(COLUMNS) + "\n", *rows]
