"""Detections in memory, and the checks that all formats share.

Boxes are corners in pixels of the image as recorded, with the distortion of the lens. Whole numbers
are pixel centers, and the first pixel's center is 0, so the image spans [-0.5, width - 0.5].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dqslam.io.files import FileError

# The values for a box without a score and for one without an object.
NO_SCORE = 1.0
NO_TRACK = -1


@dataclass(frozen=True)
class DetectionTable:
    """The rows of a detection file.

    ``line`` (m,) number of the row's line, or of the message in a bag, from 1;
    ``timestamp`` (m,) s; ``box`` (m, 4) px, u_min v_min u_max v_max;
    ``score`` (m,) 0..1; ``class_id``, ``track_id`` (m,), -1 for none, or None without that column;
    ``files`` (m,) the file of each row, where ``path`` is a folder of several.
    """

    path: str
    columns: tuple[str, ...]
    line: NDArray[np.int64]
    frame: NDArray[np.int64]
    timestamp: NDArray[np.float64]
    box: NDArray[np.float64]
    score: NDArray[np.float64]
    class_id: NDArray[np.int64]
    class_name: tuple[str, ...]
    track_id: NDArray[np.int64] | None
    files: tuple[str, ...] | None = None

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.box)

    def error(self, row: int, message: str) -> FileError:
        """Return an error that names the file and line of a row."""
        path = self.path if self.files is None else self.files[row]
        return FileError(path, message, int(self.line[row]))


def checked(
    table: DetectionTable, *, width: int | None, height: int | None, cut: bool
) -> DetectionTable:
    """Refuse invalid boxes, scores and sequences of times, and optionally cut boxes to the image.

    Without ``width`` and ``height`` px of the image, or without cutting, boxes may leave it.
    """
    _check_shape(table)
    if cut and width is not None and height is not None:
        table = replace(table, box=_inside(table, width, height))
    bad = np.flatnonzero((table.score < 0) | (table.score > 1))
    if bad.size:
        row = int(bad[0])
        raise table.error(row, f"score is {table.score[row]:g}, not between 0 and 1")
    _check_times(table)
    return table


def _check_shape(table: DetectionTable) -> None:
    box = table.box
    empty = np.flatnonzero(np.any(box[:, 2:] <= box[:, :2], axis=1))
    if empty.size:
        row = int(empty[0])
        how = "inverted" if np.any(box[row, 2:] < box[row, :2]) else "empty"
        message = f"{how} box {_corners(box[row])}: x1 < x2, y1 < y2"
        # A single bad box is an error in the file, many are another format.
        if empty.size > max(2, 0.1 * len(box)):
            message += f" ({empty.size} of {len(box)} boxes are so: are they x, y, width, height?)"
        raise table.error(row, message)


def _inside(table: DetectionTable, width: int, height: int) -> NDArray[np.float64]:
    """Cut boxes to the image, which extends half a pixel beyond the centers of its pixels."""
    box = table.box
    last = np.array([width, height]) - 0.5
    outside = np.flatnonzero(np.any((box[:, 2:] <= -0.5) | (box[:, :2] >= last), axis=1))
    if outside.size:
        row = int(outside[0])
        message = f"box {_corners(box[row])} is outside the image of {width} x {height} px"
        raise table.error(row, message)
    return np.clip(box, -0.5, np.tile(last, 2))


def _corners(box: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:g}" for value in box)


def _check_times(table: DetectionTable) -> None:
    """Refuse a frame with two times, and a frame that is not later than the one before."""
    order = np.lexsort((table.timestamp, table.frame))
    frame, time = table.frame[order], table.timestamp[order]
    same = frame[1:] == frame[:-1]
    bad = np.flatnonzero(np.where(same, time[1:] != time[:-1], time[1:] <= time[:-1]))
    if not bad.size:
        return
    i = bad[0]
    first, second = sorted(order[i : i + 2].tolist())
    what = (
        f"frame {frame[i]} has two times, {time[i].item()!r} and {time[i + 1].item()!r}"
        if same[i]
        else f"frame {frame[i + 1]} at {time[i + 1].item()!r} s is not later than "
        f"frame {frame[i]} at {time[i].item()!r} s"
    )
    raise table.error(second, f"{what} (line {table.line[first]})")
