"""Detections as CSV: ``frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id``.

Corners in pixels, whole numbers at pixel centres, counted from 0.
The columns are found by name, in any order; others are ignored, and ``track_id`` may be absent.
An empty score is 1 (trackers give none), an empty ``track_id`` or -1 is a box that no object has
claimed. Rows may be in any order, but later frames have later times. # starts a comment line.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dqslam.io.detections.table import NO_SCORE, NO_TRACK, DetectionTable, parse_filled
from dqslam.io.files import FileError, parse_integers, parse_numbers, read_rows, write_text
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
    """Read boxes, unchecked; times of ``frames`` and names of ``classes`` go before the file's."""
    columns, cells, lines = _read_columns(path)

    def numbers(name: str) -> NDArray[np.float64]:
        return parse_numbers(path, name, cells[name], lines)

    def integers(name: str, default: int | None = None) -> NDArray[np.int64]:
        column = cells[name] if default is None else parse_filled(cells[name], default)
        return parse_integers(path, name, column, lines)

    frame, class_id = integers("frame"), integers("class_id")
    named = zip(class_id.tolist(), cells["class_name"], strict=True)
    return DetectionTable(
        path=str(path),
        columns=columns,
        line=np.array(lines),
        frame=frame,
        timestamp=numbers("timestamp") if frames is None else frames.at(path, frame, lines),
        box=np.column_stack([numbers(name) for name in BOX]),
        score=parse_numbers(path, "score", parse_filled(cells["score"], NO_SCORE), lines),
        class_id=class_id,
        class_name=tuple((classes or {}).get(number, name.strip()) for number, name in named),
        track_id=integers("track_id", NO_TRACK) if "track_id" in cells else None,
    )


def write_csv(path: str | Path, table: DetectionTable) -> None:
    """Write boxes to a millionth of a pixel; times and scores come back to the last bit."""
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
