"""Detections as KITTI's labels, of the tracking and of the object benchmark.

Tracking is one file with ``frame id class truncated occluded alpha left top right bottom h w l x y
z rotation [score]`` in a line, frames from 0. Objects are a folder with a file for each image,
named by its number, without ``frame`` and ``id``. Corners are in pixels from 0, with whole numbers
at pixel centers, as KITTI's cameras have them. ``DontCare`` regions are left out. There are no
times.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dqslam._input import plain_name, read_head
from dqslam.io.detections.records import NO_TIMES, Records, make_table
from dqslam.io.detections.table import DetectionTable
from dqslam.io.files import (
    FileError,
    parse_floats,
    parse_integers,
    read_rows,
    read_text,
    text_files,
)
from dqslam.io.formats import Format, Look, ReadContext

TRACKING = ("frame", "id", "class")
EDGES = ("left", "top", "right", "bottom")
# Columns of a tracking label, without and with a score; an object label lacks the first two.
WIDTHS = (17, 18)
CLASS, BOX, SCORE = 2, 6, 17  #: places in a tracking label
NOTHING = "DontCare"


def read_tracking(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read the labels of a sequence, unchecked."""
    rows, lines = read_rows(path)
    cells = [row.split() for row in rows]
    for row, line in zip(cells, lines, strict=True):
        if len(row) not in WIDTHS:
            raise FileError(path, f"{len(row)} fields, not 17 or 18: frame id class ...", line)
    kept = _kept(path, cells, context)
    return _table(path, "kitti-tracking", cells, lines, kept, context, files=None)


def read_objects(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read a folder of labels, unchecked."""
    cells: list[list[str]] = []
    lines: list[int] = []
    files: list[Path] = []
    all_files = text_files(Path(path))
    for done, file in enumerate(all_files, start=1):
        context.progress(done / len(all_files))
        if not read_text(file, may_be_blank=True).strip():
            continue  # an image without objects
        for row, line in zip(*read_rows(file), strict=True):
            fields = row.split()
            if len(fields) + 2 not in WIDTHS:
                raise FileError(file, f"{len(fields)} fields, not 15 or 16: class ...", line)
            cells.append(["0", "-1", *fields])
            lines.append(line)
            files.append(file)
    kept = _kept(path, cells, context)
    return _table(path, "kitti-objects", cells, lines, kept, context, files=files)


def _kept(path: str | Path, cells: Sequence[Sequence[str]], context: ReadContext) -> list[int]:
    """Return the rows that are objects."""
    kept = [row for row, fields in enumerate(cells) if fields[CLASS] != NOTHING]
    count = len(cells) - len(kept)
    context.notes.skip(path, "boxes", f"regions {NOTHING}", count, len(cells))
    if not kept:
        raise FileError(path, "holds no boxes")
    if context.frames is None:
        raise FileError(path, NO_TIMES.format("kitti"))
    return kept


def _table(
    path: str | Path,
    name: str,
    cells: Sequence[Sequence[str]],
    lines: Sequence[int],
    kept: Sequence[int],
    context: ReadContext,
    files: Sequence[Path] | None,
) -> DetectionTable:
    rows = [cells[row] for row in kept]
    places = [lines[row] for row in kept]
    own = [str(path)] * len(kept) if files is None else [str(files[row]) for row in kept]

    def numbers(name: str, place: int) -> list[float]:
        return [
            float(parse_floats(file, name, [row[place]], [line])[0])
            for file, row, line in zip(own, rows, places, strict=True)
        ]

    scored = {len(row) for row in rows} == {SCORE + 1}
    records = Records(
        columns=(*(TRACKING if files is None else TRACKING[2:]), *EDGES),
        line=places,
        box=np.column_stack([numbers(edge, BOX + i) for i, edge in enumerate(EDGES)]),
        frame=(
            parse_integers(path, "frame", [row[0] for row in rows], places)
            if files is None
            else None
        ),
        image=None if files is None else [plain_name(file) for file in own],
        all_images=() if files is None else [plain_name(file) for file in text_files(Path(path))],
        score=np.array(numbers("score", SCORE)) if scored else None,
        class_name=[row[CLASS] for row in rows],
        track_id=[row[1] for row in rows] if files is None else None,
        files=None if files is None else own,
        first_frame=0,
    )
    return make_table(path, name, records, context)


def _is_label(fields: Sequence[str]) -> bool:
    """Return whether these fields, without frame and id, are a label."""
    if len(fields) + 2 not in WIDTHS or not fields[0].isidentifier():
        return False
    try:
        return len([float(field) for field in fields[1:]]) == len(fields) - 1
    except ValueError:
        return False


def _looks_like_tracking(look: Look) -> bool:
    fields = look.first.split()
    return len(fields) in WIDTHS and fields[0].isdigit() and _is_label(fields[2:])


def _looks_like_objects(look: Look) -> bool:
    if not look.path.is_dir():
        return False
    for file in text_files(look.path):
        first = next((line for line in read_head(file).split("\n") if line.strip()), None)
        if first is not None:
            return _is_label(first.split())
    return False


KITTI_TRACKING = Format(
    "kitti-tracking",
    "17 or 18 fields a line: frame id class ...",
    _looks_like_tracking,
    read_tracking,
    needs_times=False,
    has_times=lambda _: False,
)
KITTI_OBJECTS = Format(
    "kitti-objects",
    "a folder of .txt files with 15 or 16 fields a line: class ...",
    _looks_like_objects,
    read_objects,
    needs_times=False,
    has_times=lambda _: False,
)
