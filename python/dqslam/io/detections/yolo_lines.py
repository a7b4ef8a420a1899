"""The forms of a line of YOLO text. All lines of a folder together tell which form it is.

========================================  ======================================================
``class cx cy w h [score] [id]``          a box
``class x1 y1 x2 y2 x3 y3 x4 y4 ...``     a turned box, or an outline of any number of points
``class cx cy w h x y [visible] ...``     a box and its key points
========================================  ======================================================

The last two may end in a score, an id, or both. Numbers are shares of the image's width and height.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dqslam._checks import Floats
from dqslam.io.detections.table import NO_SCORE, NO_TRACK
from dqslam.io.files import FileError, parse_floats
from dqslam.io.notes import Notes

BOX = ("cx", "cy", "w", "h")
CORNERS = 4  #: points of a turned box
BEYOND = 0.02  #: share of the image by which a box may leave it
IN_BOX = 0.9  #: least share of key points within their box
PARALLEL = 0.02  #: largest deviation of a turned box from a parallelogram [share of the image]
PIXELS = 2.0  #: shares are below


class YoloLine(NamedTuple):
    """A line of a file, as its cells."""

    file: Path
    number: int
    cells: tuple[str, ...]

    def error(self, message: str) -> FileError:
        """Return an error at this line."""
        return FileError(self.file, message, self.number)


class YoloBoxes(NamedTuple):
    """Corners (m, 4) as shares of the image, scores (m,), and ids as texts or None."""

    share: Floats
    score: Floats
    track_id: list[str] | None


def split_lines(lines: Sequence[YoloLine], notes: Notes, folder: Path) -> YoloBoxes:
    """Read the boxes of all lines."""
    for line in lines:
        if len(line.cells) < 5:
            message = f"{len(line.cells)} fields, not 5 to 7: class cx cy w h score id"
            raise line.error(message)
    values = [
        parse_floats(line.file, "a number", line.cells[1:], [line.number] * (len(line.cells) - 1))
        for line in lines
    ]
    counts = {len(row) for row in values}
    if max(counts) <= 6 and not _are_triangles(values):
        boxes = _boxes(lines, values, notes, folder)
    else:
        boxes = _outlines(lines, values, notes, folder)
    large = np.flatnonzero(np.abs(boxes.share).max(axis=1) > PIXELS)
    if large.size > 0.5 * len(lines):
        message = "its numbers are pixels or percent, not shares of the image: yolo has shares"
        raise lines[large[0]].error(message)
    return boxes


def _boxes(
    lines: Sequence[YoloLine], values: Sequence[Floats], notes: Notes, folder: Path
) -> YoloBoxes:
    counts = {len(row) for row in values}
    extra = [line.cells[5:] for line in lines]
    share = _of_centers(np.array([row[:4] for row in values]))
    return YoloBoxes(share, *_extras(lines, extra, 6 not in counts, notes, folder))


def _outlines(
    lines: Sequence[YoloLine], values: Sequence[Floats], notes: Notes, folder: Path
) -> YoloBoxes:
    """Read turned boxes, outlines and key points: the box around them, or the one that is given."""
    counts = {len(row) for row in values}
    if counts & {4, 5}:
        at = next(i for i, row in enumerate(values) if len(row) in (4, 5))
        raise lines[at].error(f"{len(lines[at].cells)} fields, but other lines are outlines")
    one_count = counts.pop() if len(counts) == 1 else None
    if one_count is not None:
        pose = _key_points(np.array(values))
        if pose is not None:
            extra = [line.cells[1 + pose :] for line in lines]
            share = _of_centers(np.array([row[:4] for row in values]))
            return YoloBoxes(share, *_extras(lines, extra, True, notes, folder))
    ends = _ends(lines, values)
    points = [row[: len(row) - end].reshape(-1, 2) for row, end in zip(values, ends, strict=True)]
    share = np.array([np.concatenate([row.min(axis=0), row.max(axis=0)]) for row in points])
    outside = [i for i, row in enumerate(points) if row.min() < -BEYOND or row.max() > 1 + BEYOND]
    if len(outside) > 0.5 * len(lines) and np.abs(share).max() <= PIXELS:
        raise lines[outside[0]].error("is no box and no outline within the image")
    extra = [line.cells[len(line.cells) - end :] for line, end in zip(lines, ends, strict=True)]
    return YoloBoxes(share, *_extras(lines, extra, max(ends) < 2, notes, folder))


def _ends(lines: Sequence[YoloLine], values: Sequence[Floats]) -> list[int]:
    """Return how many numbers follow the points of each outline: a score, an id, both or none."""
    odd = [len(row) % 2 for row in values]
    if all(odd):
        return [1] * len(values)
    if any(odd):  # some lines lack the id
        return [1 if is_odd else 2 for is_odd in odd]
    scored = all(
        len(row) >= 8 and line.cells[-1].isdigit() for row, line in zip(values, lines, strict=True)
    )
    inside = all(row[-1] <= 1 for row in values)
    return [2 if scored and not inside else 0] * len(values)


def _key_points(values: Floats) -> int | None:
    """Return how many numbers box and key points have if the lines (m, n) are of this form."""
    box = _of_centers(values[:, :4])
    if values.shape[1] in (8, 9, 10):
        corners = values[:, :8].reshape(-1, CORNERS, 2)
        skew = corners[:, 0] + corners[:, 2] - corners[:, 1] - corners[:, 3]
        if np.abs(skew).max() < PARALLEL:
            return None  # a turned box
    if (box < -BEYOND).any() or (box > 1 + BEYOND).any():
        return None
    for size in (3, 2):
        for end in (0, 1, 2):
            count = values.shape[1] - 4 - end
            if count <= 0 or count % size:
                continue
            points = values[:, 4 : 4 + count].reshape(len(values), -1, size)
            seen = np.any(points[..., :2] != 0, axis=2)
            if size == 3 and (points[..., 2] < 0).any():
                continue
            inside = (points[..., :2] >= box[:, None, :2] - BEYOND) & (
                points[..., :2] <= box[:, None, 2:] + BEYOND
            )
            if seen.any() and np.mean(np.all(inside, axis=2)[seen]) >= IN_BOX:
                return int(4 + count)
    return None


def _are_triangles(values: Sequence[Floats]) -> bool:
    """Return whether lines of 7 fields are outlines of 3 points instead of box, score, id."""
    if {len(row) for row in values} != {6}:
        return False
    cells = np.array(values)
    if (cells < 0).any() or (cells > 1).any():
        return False  # an id
    box = _of_centers(cells[:, :4])
    inside = (box >= -BEYOND).all() and (box <= 1 + BEYOND).all()
    return not (inside and (cells[:, 5] == np.floor(cells[:, 5])).all())


def _extras(
    lines: Sequence[YoloLine],
    extra: Sequence[Sequence[str]],
    single: bool,
    notes: Notes,
    folder: Path,
) -> tuple[Floats, list[str] | None]:
    """Read the score and the id that follow each box; ``single`` if it is one of them at most."""
    are_ids = single and _are_ids(lines, extra)
    if are_ids:
        notes.doubt(folder, "one whole number follows each box: it is taken for the id of a track")
        extra = [(repr(NO_SCORE), *cells) if cells else () for cells in extra]
    scores = [cells[0] if cells else repr(NO_SCORE) for cells in extra]
    score = np.array(
        [
            parse_floats(line.file, "score", [cell], [line.number])[0]
            for line, cell in zip(lines, scores, strict=True)
        ]
    )
    tracks = [cells[1] if len(cells) > 1 else str(NO_TRACK) for cells in extra]
    return score, None if all(track == str(NO_TRACK) for track in tracks) else tracks


def _are_ids(lines: Sequence[YoloLine], extra: Sequence[Sequence[str]]) -> bool:
    """Return whether the numbers are ids: whole, and each only once in an image."""
    given = [(line, cells[0]) for line, cells in zip(lines, extra, strict=True) if cells]
    if not given or not all(cell.isdigit() for _, cell in given):
        return False
    if {cell for _, cell in given} == {"1"}:
        return False  # a score of labels
    return len({(line.file, cell) for line, cell in given}) == len(given)


def _of_centers(rows: Floats) -> Floats:
    """Return corners (m, 4) of boxes cx cy w h."""
    half = rows[:, 2:] / 2
    return np.hstack([rows[:, :2] - half, rows[:, :2] + half])
