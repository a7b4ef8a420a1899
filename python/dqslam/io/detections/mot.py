"""Detections as MOT Challenge text: ``frame,id,left,top,width,height,conf,...``.

Frames and pixels count from 1: frame 1 is frame 0 here, and 1 is subtracted from left and top. The
width is x2 - x1. An ``id`` of -1 means none. With 9 columns (their ground truth) the 8th is the
class and the 9th the visibility, which is ignored. With 7, 8 or 10 there is no class, and all boxes
have class 0, "object". A ``conf`` of -1 means no score. There are no times, see `dqslam.io.frames`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam.io.detections.csv import short
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError, parse_integers, parse_numbers, read_rows, write_text
from dqslam.io.formats import Format, Look
from dqslam.io.frames import FrameTimes

FIELDS = ("frame", "id", "left", "top", "width", "height", "conf")
WIDTHS = (7, 8, 9, 10)
WITH_CLASS = 9
LARGEST_FRAME = 1e9  #: a larger number is a time in nanoseconds
FIRST = 1  #: number of the first frame and of the first pixel


def read_mot(
    path: str | Path,
    *,
    width: int | None = None,
    height: int | None = None,
    frames: FrameTimes | None = None,
    classes: dict[int, str] | None = None,
) -> DetectionTable:
    """Read boxes, unchecked, at the times of their ``frames``."""
    rows, lines = read_rows(path)
    if frames is None:
        message = "mot has no times: give them with --frame-times FILE or --frame-rate HZ"
        raise FileError(path, message)
    cells = [row.split(",") for row in rows]
    for row, line in zip(cells, lines, strict=True):
        if len(row) not in WIDTHS or len(row) != len(cells[0]):
            message = f"{len(row)} fields, not 7 to 10 alike: {','.join(FIELDS)},..."
            raise FileError(path, message, line)
    columns = dict(zip(FIELDS, zip(*cells, strict=True), strict=False))
    edges = ("left", "top", "width", "height")
    left, top, across, down = (parse_numbers(path, name, columns[name], lines) for name in edges)
    frame = parse_integers(path, "frame", columns["frame"], lines) - FIRST
    score = parse_numbers(path, "conf", columns["conf"], lines)
    class_id = np.zeros(len(rows), dtype=np.int64)
    names = {0: "object"} | (classes or {})
    if len(cells[0]) == WITH_CLASS:
        class_id = parse_integers(path, "class", [row[7] for row in cells], lines)
        names = classes or {}
    return DetectionTable(
        path=str(path),
        columns=FIELDS,
        line=np.array(lines),
        frame=frame,
        timestamp=frames.at(path, frame, lines),
        box=np.column_stack([left, top, left + across, top + down]) - FIRST,
        score=np.where(score == -1, NO_SCORE, score),
        class_id=class_id,
        class_name=tuple(names.get(number, str(number)) for number in class_id.tolist()),
        track_id=parse_integers(path, "id", columns["id"], lines),
    )


def write_mot(path: str | Path, table: DetectionTable, *, times: bool = True) -> None:
    """Write boxes with 9 columns, the class in the 8th and visibility 1; times are not written."""
    size = table.box[:, 2:] - table.box[:, :2]
    track = np.full(len(table), -1) if table.track_id is None else table.track_id
    boxes = np.hstack([table.box[:, :2] + FIRST, size]).tolist()
    rows = zip(
        (table.frame + FIRST).tolist(),
        track.tolist(),
        boxes,
        table.score.tolist(),
        table.class_id.tolist(),
        strict=True,
    )
    write_text(
        path,
        (
            f"{frame},{number},{','.join(map(short, box))},{short(score)},{class_id},1\n"
            for frame, number, box, score, class_id in rows
        ),
    )


def _looks(look: Look) -> bool:
    try:
        cells = [float(cell) for cell in look.first.split(",")]
    except ValueError:
        return False
    return len(cells) in WIDTHS and cells[0] < LARGEST_FRAME


MOT = Format(
    "mot",
    "7 to 10 numbers a line between commas",
    _looks,
    read_mot,
    write_mot,
    needs_times=False,
    has_times=lambda _: False,
    endings=(".txt",),
    loses=("times", "class names"),
)
