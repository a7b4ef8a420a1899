"""Detections in memory, and the checks that all formats share.

Boxes are corners in pixels of the image as recorded, with the distortion of the lens. Whole numbers
are pixel centers, and the first pixel's center is 0, so the image spans [-0.5, width - 0.5].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dqslam.io.detections.other_classes import OtherClasses
from dqslam.io.files import FileError
from dqslam.io.labels import NO_LABEL
from dqslam.io.notes import Notes

# The values for a box without a score and for one without an object.
NO_SCORE = 1.0
NO_TRACK = NO_LABEL


@dataclass(frozen=True)
class DetectionTable:
    """The rows of a detection file.

    ``line`` (m,) number of the row's line, or of the message in a bag, from 1;
    ``timestamp`` (m,) s; ``box`` (m, 4) px, u_min v_min u_max v_max;
    ``score`` (m,) 0..1; ``class_id``, ``track_id`` (m,), -1 for none, or None without that column;
    ``files`` (m,) the file of each row, where ``path`` is a folder of several;
    ``image_size`` width and height in px, if the file has it;
    ``others`` other classes of the boxes, if the file has any;
    ``embedding`` (m, e) what each box looks like, if there is such a file;
    ``assumed_first`` whether nothing says which number the first frame has.
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
    image_size: tuple[int, int] | None = None
    others: OtherClasses | None = None
    embedding: NDArray[np.float64] | None = None
    assumed_first: bool = False

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.box)

    def error(self, row: int, message: str) -> FileError:
        """Return an error that names the file and line of a row."""
        path = self.path if self.files is None else self.files[row]
        return FileError(path, message, int(self.line[row]))

    def select(self, keep: NDArray[np.bool_]) -> DetectionTable:
        """Return the rows of a mask (m,)."""
        if keep.all():
            return self
        rows = np.flatnonzero(keep)
        return replace(
            self,
            line=self.line[rows],
            frame=self.frame[rows],
            timestamp=self.timestamp[rows],
            box=self.box[rows],
            score=self.score[rows],
            class_id=self.class_id[rows],
            class_name=tuple(self.class_name[row] for row in rows),
            track_id=None if self.track_id is None else self.track_id[rows],
            files=None if self.files is None else tuple(self.files[row] for row in rows),
            others=None if self.others is None else self.others.select(rows),
            embedding=None if self.embedding is None else self.embedding[rows],
        )


def without_bad(
    table: DetectionTable,
    bad: NDArray[np.bool_],
    reason: str,
    message: Callable[[int], str],
    notes: Notes,
    min_score: float,
) -> DetectionTable:
    """Leave out the bad boxes (m,) that count, those with a score of at least ``min_score``.

    Boxes with a lower score, from 0, are left out later, whatever else is wrong with them.
    """
    counts = ~((table.score >= 0) & (table.score < min_score)) | notes.is_strict
    worst = bad & counts
    notes.leave_out(
        table.path,
        "boxes",
        reason,
        np.flatnonzero(worst).tolist(),
        int(counts.sum()),
        lambda row: table.error(row, message(row)),
    )
    return table.select(~worst)


def checked(
    table: DetectionTable,
    *,
    width: int | None,
    height: int | None,
    cut: bool,
    min_score: float = 0.0,
    notes: Notes | None = None,
) -> DetectionTable:
    """Refuse invalid boxes, scores and sequences of times, and optionally cut boxes to the image.

    A few invalid boxes are left out, see ``Notes``. Without ``width`` and ``height`` px of the
    image, or without cutting, boxes may leave it.
    """
    notes = notes or Notes()
    _check_size(table, width, height)
    table = _check_shape(table, notes, min_score)
    table = without_bad(
        table,
        (table.score < 0) | (table.score > 1),
        "score not between 0 and 1",
        lambda row: f"score is {table.score[row]:g}, not between 0 and 1",
        notes,
        min_score,
    )
    if cut and width is not None and height is not None:
        table = cut_to_image(table, width, height, notes=notes, min_score=min_score)
    _check_times(table)
    return table


def _check_size(table: DetectionTable, width: int | None, height: int | None) -> None:
    """Refuse boxes in images of another size than the camera's."""
    if table.image_size is None or width is None or height is None:
        return
    if table.image_size != (width, height):
        own = "{} x {}".format(*table.image_size)
        message = f"its images have {own} px, those of the camera {width} x {height}"
        raise FileError(table.path, message)


def _check_shape(table: DetectionTable, notes: Notes, min_score: float) -> DetectionTable:
    box = table.box
    empty = np.any(box[:, 2:] <= box[:, :2], axis=1)
    # A few bad boxes are errors in the file, many are another format.
    many = empty.sum() > max(2, 0.1 * len(box))

    def message(row: int) -> str:
        how = "inverted" if np.any(box[row, 2:] < box[row, :2]) else "empty"
        hint = "; are they x, y, width, height?" if many else ""
        return f"{how} box {_corners(box[row])}: x1 < x2, y1 < y2{hint}"

    return without_bad(table, empty, "empty or inverted", message, notes, min_score)


def cut_to_image(
    table: DetectionTable, width: int, height: int, *, notes: Notes, min_score: float = 0.0
) -> DetectionTable:
    """Cut boxes to the image, which extends half a pixel beyond the centers of its pixels.

    A few boxes that are wholly outside are left out, see ``Notes``.
    """
    box = table.box
    last = np.array([width, height]) - 0.5
    outside = np.any((box[:, 2:] <= -0.5) | (box[:, :2] >= last), axis=1)
    table = without_bad(
        table,
        outside,
        "outside the image",
        lambda row: f"box {_corners(box[row])} is outside the image of {width} x {height} px",
        notes,
        min_score,
    )
    return replace(table, box=np.clip(table.box, -0.5, np.tile(last, 2)))


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
