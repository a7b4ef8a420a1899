"""Trajectories in columns: a time, a position and a quaternion in a line, in any order.

A header tells the order, in its first row or in a comment: see `header`. Without one, it is that of
TUM, ``t tx ty tz qx qy qz qw``, and RTAB-Map's id of the node may follow. Columns are separated by
spaces, commas, semicolons or tabs; more columns are ignored and noted.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam.io.files import FileError, parse_floats, read_rows, read_text
from dqslam.io.formats import ReadContext
from dqslam.io.notes import Notes
from dqslam.io.times import parse_times
from dqslam.io.trajectory.header import FIELDS, Header, find_header, split_row, unit_of
from dqslam.io.trajectory.table import Trajectory, make_trajectory

PLAIN = Header(dict(zip(FIELDS, range(8), strict=True)), {}, len(FIELDS), ())
WITH_ID = 9  #: columns of RTAB-Map's poses without a header, the last one the id of the node
SILENT = ("id", "node_id", "frame", "seq", "")  #: more columns that say nothing about the pose


def read_columns(path: str | Path, context: ReadContext) -> Trajectory:
    """Read a trajectory in columns; it has times, so those of frames are not used."""
    rows, lines = read_rows(path)
    comments = [line for line in read_text(path).split("\n", 50)[:50] if line.startswith("#")]
    header = find_header(comments, rows[0]) or PLAIN
    if header is PLAIN and "," in rows[0]:
        context.notes.doubt(path, "no header: the quaternion is read as x y z w, as in TUM")
    is_row = header is not PLAIN and not _is_number(split_row(rows[0])[-1])
    if is_row:
        rows, lines = rows[1:], lines[1:]
    if not rows:
        raise FileError(path, "holds no poses, only a header")
    missing = [name for name in FIELDS if name not in header.columns]
    if missing:
        angles = ", ".join(header.angles)
        instead = f", but {angles}: angles are not read, quaternions are" if angles else ""
        raise FileError(path, f"its header has no {', '.join(missing)}{instead}")
    cells = [split_row(row) for row in rows]
    count, others = header.count, header.others
    if header is PLAIN and len(cells[0]) == WITH_ID:
        count = WITH_ID
    elif header.words and len(cells[0]) == len(FIELDS):
        count, others = len(FIELDS), ()
    for row, line in zip(cells, lines, strict=True):
        if len(row) != count:
            raise FileError(path, f"{len(row)} fields, not {count}: {' '.join(FIELDS)}", line)
    unused = [name for name in others if name.lower() not in SILENT]
    if unused:
        context.notes.doubt(path, f"not used: {', '.join(unused[:12])}")
    stamps = [row[header.columns["t"]] for row in cells]
    times = _times(path, header, stamps, lines, context.notes)
    poses = [
        parse_floats(path, name, [row[header.columns[name]] for row in cells], lines)
        * (unit_of(path, header, name) if name in ("tx", "ty", "tz") else 1.0)
        for name in FIELDS[1:]
    ]
    return make_trajectory(path, times, np.column_stack(poses), lines, context)


def _times(
    path: str | Path, header: Header, cells: Sequence[str], lines: Sequence[int], notes: Notes
) -> Floats:
    """Return times in seconds, in the unit of the header if it has one."""
    divisor = round(1 / unit_of(path, header, "t")) if header.units.get("t") else None
    return parse_times(path, "t", cells, lines, notes, divisor)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
