"""Detections as CSV: ``frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id``.

Corners are in pixels, with whole numbers at pixel centers, counted from 0.
The columns are found by name, in any order; others are ignored, and ``track_id`` may be absent.
An empty score is 1, because trackers give none. An empty ``track_id`` or -1 means that the box has
no object. Rows may be in any order, but later frames have later times. # starts a comment line.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from dqslam.io.csv_table import read_csv as read_table
from dqslam.io.detections.table import NO_SCORE, NO_TRACK, DetectionTable
from dqslam.io.files import parse_numbers, write_text
from dqslam.io.formats import Format, Look
from dqslam.io.frames import FrameTimes

BOX = ("x1", "y1", "x2", "y2")
REQUIRED = ("frame", "timestamp", *BOX, "score", "class_id", "class_name")


def read_csv(
    path: str | Path,
    *,
    width: int | None = None,
    height: int | None = None,
    frames: FrameTimes | None = None,
    classes: dict[int, str] | None = None,
) -> DetectionTable:
    """Read boxes, unchecked; times of ``frames`` and names of ``classes`` override the file's."""
    cells = read_table(path, required=REQUIRED)
    frame, class_id = cells.integers("frame"), cells.integers("class_id")
    scores = [score or str(NO_SCORE) for score in cells.cells("score")]
    tracked = "track_id" in cells
    named = zip(class_id.tolist(), cells.cells("class_name"), strict=True)
    return DetectionTable(
        path=str(path),
        columns=tuple(cells.columns),
        line=np.array(cells.lines),
        frame=frame,
        timestamp=(
            cells.numbers("timestamp") if frames is None else frames.at(path, frame, cells.lines)
        ),
        box=np.column_stack([cells.numbers(name) for name in BOX]),
        score=parse_numbers(path, "score", scores, cells.lines),
        class_id=class_id,
        class_name=tuple((classes or {}).get(number, name) for number, name in named),
        track_id=cells.integers("track_id", empty=str(NO_TRACK)) if tracked else None,
    )


def write_csv(path: str | Path, table: DetectionTable) -> None:
    """Write boxes to a millionth of a pixel, and times and scores without loss of a bit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    tracks = () if table.track_id is None else ("track_id",)
    writer.writerow((*REQUIRED, *tracks))
    columns = [
        table.frame.tolist(),
        map(repr, table.timestamp.tolist()),
        *([short(value) for value in edge] for edge in table.box.T.tolist()),
        map(short, table.score.tolist()),
        table.class_id.tolist(),
        table.class_name,
        *([] if table.track_id is None else [table.track_id.tolist()]),
    ]
    writer.writerows(zip(*columns, strict=True))
    write_text(path, text.getvalue())


def short(value: float) -> str:
    """Write a number to six decimals, without the zeros at its end."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _looks(look: Look) -> bool:
    return look.suffix == ".csv" or {"x1", "y1"} <= set(look.first.replace(" ", "").split(","))


CSV = Format(
    "csv",
    "its name ends in .csv, or its header has x1 and y1",
    _looks,
    read_csv,
    write_csv,
    endings=(".csv",),
)
