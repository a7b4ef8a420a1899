"""Detections as CSV: ``frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id``.

Corners are in pixels, with whole numbers at pixel centers, counted from 0.
The columns are found by name, in any order, also by the names that other programs give them
(``xmin``, ``confidence``, ``name``, ...: see `columns`). Edges with such names, among them ``left
top width height``, count from the corner of the image, as those programs do, so half a pixel is
subtracted. The corners are needed, and one of
``frame``, ``timestamp`` and ``image``; boxes of one ``timestamp`` are of one image if there is
nothing else. An empty score is 1, because trackers give none. An empty ``track_id`` or -1 means
that the box has no object. Rows may be in any order, but later frames have later times.
# starts a comment line. Further classes are in ``class_id_2``, ``class_name_2``, ``score_2`` and so
on, see `other_classes`; what boxes look like is in a ``.npy`` beside the file, see `embeddings`.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam._input import is_stream
from dqslam.io.csv_table import CsvTable, delimiter_of
from dqslam.io.csv_table import read_csv as read_table
from dqslam.io.detections.columns import (
    CORNERS,
    FIRST_OTHER,
    MEANING,
    corners_of,
    counted_from_corner,
    edges_of,
    known_columns,
    plain,
)
from dqslam.io.detections.embeddings import read_embeddings, write_embeddings
from dqslam.io.detections.other_classes import NUMBERED, OtherClasses, class_columns
from dqslam.io.detections.records import Records, make_table
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError, parse_floats, write_text
from dqslam.io.formats import Format, Look, ReadContext, look_at
from dqslam.io.times import parse_times

CORNER = 0.5  #: other programs' pixel coordinates minus ours
COLUMNS = ("frame", "timestamp", *CORNERS, "score", "class_id", "class_name")


def read_csv(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read boxes, unchecked."""
    cells = read_table(path, allow_empty=True)
    names = known_columns(path, cells.columns, context.notes, cells.header)
    edges = edges_of(path, names, context.notes)
    missing = [name for name in edges if name not in names]
    if not {"frame", "timestamp", "image"} & set(names):
        missing.insert(0, "frame, timestamp or image")
    if missing:
        message = f"no column {', '.join(missing)} (it has: {', '.join(cells.columns)})"
        raise FileError(path, message, cells.header)
    if not len(cells):
        raise FileError(path, "holds no rows, only a header")

    def labels(name: str) -> tuple[str, ...] | None:
        return cells.cells(names[name]) if name in names else None

    records = Records(
        columns=tuple(cells.columns),
        line=cells.lines,
        box=_boxes(cells, edges, [names[name] for name in edges]),
        frame=cells.integers(names["frame"]) if "frame" in names else None,
        image=labels("image"),
        time=_times(cells, names["timestamp"], context) if "timestamp" in names else None,
        score=_floats(cells, names["score"], NO_SCORE) if "score" in names else None,
        class_id=labels("class_id"),
        class_name=labels("class_name"),
        track_id=labels("track_id"),
        others=class_columns(
            path, names, labels, lambda name: _floats(cells, names[name]), cells.header
        ),
        embedding=read_embeddings(path, cells.lines),
        image_size=_image_size(cells, names) if edges == CORNERS else None,
    )
    return make_table(path, "csv", records, context)


def _boxes(cells: CsvTable, edges: Sequence[str], names: Sequence[str]) -> Floats:
    """Return corners (m, 4) px."""
    box = np.column_stack([_floats(cells, name) for name in names])
    box = corners_of(box, edges)
    return box - CORNER if counted_from_corner(names) else box


def _image_size(cells: CsvTable, names: dict[str, str]) -> tuple[int, int] | None:
    """Return the size of the images if width and height beside an image are alike in all rows.

    Beside corners they may also be those of the box, which differ.
    """
    if not {"width", "height", "image"} <= set(names):
        return None
    sizes = set(zip(cells.cells(names["width"]), cells.cells(names["height"]), strict=True))
    if len(sizes) != 1:
        return None
    width, height = sizes.pop()
    return (int(width), int(height)) if width.isdecimal() and height.isdecimal() else None


def _times(cells: CsvTable, name: str, context: ReadContext) -> Floats:
    texts = [cell or "nan" for cell in cells.cells(name)]
    return parse_times(cells.path, name, texts, cells.lines, context.notes)


def _floats(cells: CsvTable, name: str, empty: float = float("nan")) -> Floats:
    """Return a column as numbers; tables of pandas have empty cells where there is no number."""
    texts = [cell or repr(empty) for cell in cells.cells(name)]
    return parse_floats(cells.path, name, texts, cells.lines)


def has_times(path: Path) -> bool:
    """Return whether there is a column of times."""
    return "timestamp" in _meanings(look_at(path))


def write_csv(path: str | Path, table: DetectionTable) -> None:
    """Write boxes and scores to a millionth, and times without loss of a bit.

    What boxes look like goes into a ``.npy`` beside the file; standard output has none.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    tracks = () if table.track_id is None else ("track_id",)
    others = 0 if table.others is None else table.others.class_id.shape[1]
    more = [f"{name}_{FIRST_OTHER + k}" for k in range(others) for name in NUMBERED]
    writer.writerow((*COLUMNS, *tracks, *more))
    columns = [
        table.frame.tolist(),
        map(repr, table.timestamp.tolist()),
        *([short(value) for value in edge] for edge in table.box.T.tolist()),
        map(short, table.score.tolist()),
        table.class_id.tolist(),
        table.class_name,
        *([] if table.track_id is None else [table.track_id.tolist()]),
        *([] if table.others is None else _other_columns(table.others)),
    ]
    writer.writerows(zip(*columns, strict=True))
    write_text(path, text.getvalue())
    if table.embedding is not None and not is_stream(path):
        write_embeddings(path, table.embedding)


def _other_columns(others: OtherClasses) -> list[list[str]]:
    """Return the columns of id, name and score of each of the other classes, in turn."""
    columns = []
    for ids, scores in zip(others.class_id.T.tolist(), others.score.T.tolist(), strict=True):
        columns.append(["" if one < 0 else str(one) for one in ids])
        columns.append([others.class_names.get(one, "") for one in ids])
        there = zip(ids, scores, strict=True)
        columns.append(["" if one < 0 else short(score) for one, score in there])
    return columns


def short(value: float) -> str:
    """Write a number to six decimals, without the zeros at its end."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _looks(look: Look) -> bool:
    return look.suffix == ".csv" or {"x1", "y1"} <= _meanings(look)


def _meanings(look: Look) -> set[str]:
    names = (plain(name.strip('"')) for name in look.first.split(delimiter_of(look.first)))
    return {MEANING[name] for name in names if name in MEANING}


CSV = Format(
    "csv",
    "its name ends in .csv, or its header has x1 and y1 (or xmin, left, ...)",
    _looks,
    read_csv,
    write_csv,
    has_times=has_times,
    endings=(".csv",),
)
