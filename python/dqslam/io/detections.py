"""Detections as CSV: ``frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id``.

Boxes are pixels in the image as recorded (distorted, where the lens does), corners counted from 0.
The columns are found by name, in any order; others are ignored, and ``track_id`` may be absent.
An empty score is 1 (trackers give none), an empty ``track_id`` or -1 is a box that no object has
claimed. Rows may be in any order, but later frames have later times. # starts a comment line.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dqslam.io.files import FileError, parse_integers, parse_numbers, read_rows

BOX = ("x1", "y1", "x2", "y2")
REQUIRED = ("frame", "timestamp", *BOX, "score", "class_id", "class_name")


@dataclass(frozen=True)
class DetectionTable:
    """The rows of a detection file, checked.

    ``timestamp`` (m,) s; ``box`` (m, 4) px, u_min v_min u_max v_max, cut to the image;
    ``score`` (m,) 0..1; ``class_id``, ``track_id`` (m,), -1 for none, or None without that column.
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


def read_detections(path: str | Path, *, width: int, height: int) -> DetectionTable:
    """Read boxes in an image of width x height px; parts outside of it are cut off."""
    columns, cells, lines = _read_columns(path)

    def numbers(name: str) -> NDArray[np.float64]:
        return parse_numbers(path, name, cells[name], lines)

    def integers(name: str) -> NDArray[np.int64]:
        return parse_integers(path, name, cells[name], lines)

    table = DetectionTable(
        path=str(path),
        columns=columns,
        line=np.array(lines),
        frame=integers("frame"),
        timestamp=numbers("timestamp"),
        box=_inside(path, np.column_stack([numbers(name) for name in BOX]), lines, width, height),
        score=parse_numbers(path, "score", _filled(cells["score"], "1"), lines),
        class_id=integers("class_id"),
        class_name=tuple(name.strip() for name in cells["class_name"]),
        track_id=(
            parse_integers(path, "track_id", _filled(cells["track_id"], "-1"), lines)
            if "track_id" in cells
            else None
        ),
    )
    bad = np.flatnonzero((table.score < 0) | (table.score > 1))
    if bad.size:
        message = f"score is {table.score[bad[0]]:g}, not between 0 and 1"
        raise FileError(path, message, lines[bad[0]])
    _check_times(table)
    return table


def _read_columns(
    path: str | Path,
) -> tuple[tuple[str, ...], dict[str, Sequence[str]], list[int]]:
    rows, lines = read_rows(path)
    try:
        header, *records = csv.reader(rows, strict=True)
    except csv.Error as error:
        raise FileError(path, f"not CSV: {error}") from None
    columns = tuple(name.strip() for name in header)
    missing = [name for name in REQUIRED if name not in columns]
    if missing:
        message = f"no column {', '.join(missing)} (it has: {', '.join(columns)})"
        raise FileError(path, message, lines[0])
    for name in (*REQUIRED, "track_id"):
        if columns.count(name) > 1:
            raise FileError(path, f"{columns.count(name)} columns are named {name}", lines[0])
    if len(records) != len(rows) - 1:
        raise FileError(path, "not CSV: a quoted field runs over the end of its line")
    if not records:
        raise FileError(path, "holds no boxes, only a header")
    for record, line in zip(records, lines[1:], strict=True):
        if len(record) != len(columns):
            raise FileError(path, f"{len(record)} fields, but {len(columns)} columns", line)
    return columns, dict(zip(columns, zip(*records, strict=True), strict=True)), lines[1:]


def _filled(cells: Sequence[str], default: str) -> list[str]:
    return [cell if cell.strip() else default for cell in cells]


def _inside(
    path: str | Path, box: NDArray[np.float64], lines: Sequence[int], width: int, height: int
) -> NDArray[np.float64]:
    """Cut boxes to the image, which spans half a pixel more than the centres of its pixels."""
    empty = np.flatnonzero(np.any(box[:, 2:] <= box[:, :2], axis=1))
    if empty.size:
        i = empty[0]
        how = "inverted" if np.any(box[i, 2:] < box[i, :2]) else "empty"
        raise FileError(path, f"{how} box {_corners(box[i])}: x1 < x2, y1 < y2", lines[i])
    last = np.array([width, height]) - 0.5
    outside = np.flatnonzero(np.any((box[:, 2:] <= -0.5) | (box[:, :2] >= last), axis=1))
    if outside.size:
        i = outside[0]
        message = f"box {_corners(box[i])} is outside the image of {width} x {height} px"
        raise FileError(path, message, lines[i])
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
    first, second = sorted(table.line[order[i : i + 2]].tolist())
    what = (
        f"frame {frame[i]} has two times, {time[i].item()!r} and {time[i + 1].item()!r}"
        if same[i]
        else f"frame {frame[i + 1]} at {time[i + 1].item()!r} s is not later than "
        f"frame {frame[i]} at {time[i].item()!r} s"
    )
    raise FileError(table.path, f"{what} (line {first})", second)
