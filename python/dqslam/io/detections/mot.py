"""Detections as MOT Challenge text: ``frame,id,left,top,width,height[,conf,...]``.

Numbers are separated by commas or spaces, 6 to 10 in a line. Frames and pixels count from 1: frame
1 is frame 0 here, and 1 is subtracted from left and top. Only if a file has a frame 0 do its frames
count from 0. The width is x2 - x1. An ``id`` of -1 means none, a ``conf`` of -1 no score; with 6
numbers there is no score either.

Further columns differ: with 9 (the ground truth of MOT16 to MOT20) the 8th is the class and the
9th the visibility, which is ignored. BoxMOT writes 9 with a 7th that is 1 everywhere and the score
in the 9th; so a 9th that varies while the 7th is 1 everywhere is read as the score, which is noted.
With 7, 8 or 10 numbers, an 8th that is a whole number from 0 while those after it are -1 is the
class. Otherwise there is no class, and all boxes have class 0, "object"; the 8th to 10th number are
positions in the world, if they are not -1, and are ignored. There are no times, see
`dqslam.io.frames`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam.io.detections.csv import short
from dqslam.io.detections.records import NO_TIMES, Records, make_table
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError, in_reach, parse_floats, parse_integers, read_rows, write_text
from dqslam.io.formats import Format, Look, ReadContext

FIELDS = ("frame", "id", "left", "top", "width", "height", "conf")
EDGES = ("left", "top", "width", "height")
WIDTHS = (6, 7, 8, 9, 10)
GROUND_TRUTH = 9
LARGEST_FRAME = 1e9  #: a larger number is a time in nanoseconds
FIRST = 1  #: number of the first frame and of the first pixel
UNIT = 1e-3  #: the last four of 8 numbers have a length of 1 within this if they are a quaternion


def read_mot(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read boxes, unchecked."""
    rows, lines = read_rows(path)
    if context.frames is None:
        raise FileError(path, NO_TIMES.format("mot"))
    cells = [_cells(row) for row in rows]
    for row, line in zip(cells, lines, strict=True):
        if len(row) not in WIDTHS or len(row) != len(cells[0]):
            message = f"{len(row)} fields, not 6 to 10 alike: {','.join(FIELDS)},..."
            raise FileError(path, message, line)
    columns = list(zip(*cells, strict=True))
    left, top, across, down = (
        parse_floats(path, name, columns[2 + place], lines) for place, name in enumerate(EDGES)
    )
    frame = parse_integers(path, "frame", columns[0], lines)
    first = FIRST
    if context.first_frame is None and (frame == 0).any():
        first = 0
        context.notes.doubt(path, "there is a frame 0: frames count from 0, not from 1 as in mot")
    rest = [
        parse_floats(path, f"column {7 + i}", column, lines) for i, column in enumerate(columns[6:])
    ]
    score, class_place = _score_and_class(path, rest, context)
    records = Records(
        columns=FIELDS[: len(columns)],
        line=lines,
        frame=frame,
        box=np.column_stack([left, top, left + across, top + down]) - FIRST,
        score=None if score is None else np.where(score == -1, NO_SCORE, score),
        class_id=None if class_place is None else columns[class_place],
        track_id=columns[1],
        first_frame=first,
    )
    return make_table(path, "mot", records, context)


def _cells(row: str) -> list[str]:
    return [cell.strip() for cell in row.split(",")] if "," in row else row.split()


def _score_and_class(
    path: str | Path, rest: Sequence[Floats], context: ReadContext
) -> tuple[Floats | None, int | None]:
    """Find the score (m,), and the place of the column of the class, in those after the box."""
    if not rest:
        return None, None
    score, more = rest[0], rest[1:]
    if 6 + len(rest) == GROUND_TRUTH:
        last = more[1]
        if (score == 1).all() and (last != 1).any() and ((last >= 0) & (last <= 1)).all():
            context.notes.doubt(
                path,
                "the 7th number is 1 everywhere: the 9th is taken for the score, as in files of "
                "BoxMOT (in the ground truth of MOT it is the visibility)",
            )
            score = last
        return score, None if (more[0] == -1).all() else 7
    if more and all((column == -1).all() for column in more[1:]):
        whole = (more[0] >= 0) & (more[0] == np.floor(more[0]))
        if whole.all():
            return score, 7
    return score, None


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
        cells = [float(cell) for cell in _cells(look.first)]
    except ValueError:
        return False
    if len(cells) not in WIDTHS or cells[0] >= LARGEST_FRAME or cells[0] != int(cells[0]):
        return False
    # A pose has 8 numbers, too.
    return len(cells) != 8 or not abs(np.linalg.norm(in_reach(np.array(cells[4:]))) - 1) <= UNIT


MOT = Format(
    "mot",
    "6 to 10 numbers a line between commas or spaces, the first a whole one",
    _looks,
    read_mot,
    write_mot,
    needs_times=False,
    has_times=lambda _: False,
    endings=(".txt",),
    loses=("times", "class names"),
)
