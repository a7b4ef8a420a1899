"""Boxes as a file says them, and the table that they make: frames get times, names get numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._limits import IN_REACH
from dqslam.io.detections.classes import number_classes
from dqslam.io.detections.other_classes import ClassColumn, joined_labels, other_classes
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError, in_reach
from dqslam.io.formats import ReadContext
from dqslam.io.frames import FrameTimes
from dqslam.io.image_names import ImageNameError, frames_of_images, image_name
from dqslam.io.labels import LabelError, numbered

NO_TIMES = "{} has no times: give them with --frame-times FILE or --frame-rate HZ"


@dataclass(frozen=True, kw_only=True, eq=False)
class Records:
    """The boxes of a file, a row each; what the format lacks is None.

    ``box`` (m, 4) px, corners in this package's convention, NaN where the file has no number;
    ``frame`` (m,) as the file counts; ``time`` (m,) s and ``score`` (m,), NaN where it has none;
    ``image`` (m,) the name of the image, which tells the frame or the time if there is no frame;
    ``class_id``, ``class_name``, ``track_id`` (m,) as the file has them.
    """

    columns: tuple[str, ...]
    line: Sequence[int]
    box: Floats
    frame: Ints | None = None
    image: Sequence[str] | None = None
    time: Floats | None = None
    score: Floats | None = None
    class_id: Sequence[str] | None = None
    class_name: Sequence[str] | None = None
    track_id: Sequence[str] | None = None
    files: Sequence[str] | None = None
    others: Sequence[ClassColumn] = ()  #: other classes of the boxes, the likeliest first
    embedding: Floats | None = None  #: what each box looks like, shape (m, e)
    all_images: Sequence[str] = ()  #: names of all images, also of those without boxes
    first_frame: int | None = None  #: the number of the first frame, if the format has one
    image_size: tuple[int, int] | None = None
    class_names: Mapping[str, str] = field(default_factory=dict)  #: of the whole file, by class_id

    def error(self, path: str | Path, row: int, message: str) -> FileError:
        """Return an error that names the file and line of a row."""
        return FileError(path if self.files is None else self.files[row], message, self.line[row])


def make_table(
    path: str | Path, format_name: str, records: Records, context: ReadContext
) -> DetectionTable:
    """Make a table of boxes, unchecked; boxes without numbers are left out.

    Raises
    ------
    FileError
        If there are no boxes or no times, if frames cannot be told, or if more boxes have no
        numbers than may be left out.
    """
    if not len(records.line):
        raise FileError(path, "holds no boxes")
    frame, named_time = _frames(path, records, context)
    time = _times(path, format_name, records, context, frame, named_time)
    count = len(records.line)
    ids, names = joined_labels(path, records.class_id, records.class_name, records.others)
    class_id, class_name = number_classes(
        path,
        ids,
        names,
        dict(records.class_names),
        len(ids or names or records.line),
        context,
        lambda row, message: records.error(path, row % count, message),
    )
    others = other_classes(
        records.others,
        class_id,
        class_name,
        lambda row, message: records.error(path, row, message),
    )
    track = None
    if records.track_id is not None:
        track = _numbers(path, records, "track_id", records.track_id)
    score = np.full(len(time), NO_SCORE) if records.score is None else records.score
    table = DetectionTable(
        path=str(path),
        columns=records.columns,
        line=np.array(records.line, dtype=np.int64),
        frame=frame,
        timestamp=time,
        box=records.box,
        score=score,
        class_id=class_id[:count],
        class_name=class_name[:count],
        track_id=track,
        files=None if records.files is None else tuple(records.files),
        image_size=records.image_size,
        others=others,
        embedding=records.embedding,
        assumed_first=context.first_frame is None
        and named_time is None
        and context.frames is not None
        and context.frames.table is None,
    )
    return _with_numbers(table, context)


def _with_numbers(table: DetectionTable, context: ReadContext) -> DetectionTable:
    """Leave out boxes whose corners, score or time are no finite numbers."""
    cells = np.column_stack([table.timestamp, table.box, table.score])
    good = ~np.isnan(in_reach(cells))
    bad = ~np.asarray(good.all(axis=1))
    names = ("timestamp", "x1", "y1", "x2", "y2", "score")

    def error(row: int) -> FileError:
        column = int(np.flatnonzero(~good[row])[0])
        return table.error(row, f"{names[column]} is not {IN_REACH}")

    rows = np.flatnonzero(bad).tolist()
    context.notes.leave_out(table.path, "boxes", "not finite", rows, len(table), error)
    return table.select(~bad)


def _frames(path: str | Path, records: Records, context: ReadContext) -> tuple[Ints, Floats | None]:
    """Return the frame of each box, from 0, and its time if the name of the image is one."""
    if records.image is not None and records.frame is not None:
        _check_images(path, records, records.frame, records.image)
    if records.image is not None and records.frame is None:
        if context.frames is not None and context.frames.names:
            return _looked_up(path, records, records.image, context.frames), None
        frame, time = _named(path, records, records.image)
        if time is not None:
            if context.frames is not None:
                context.notes.doubt(
                    path, f"the names of images are times: {context.frames.source} is not used"
                )
            return frame, time
    elif records.frame is not None:
        frame = records.frame
    else:
        assert records.time is not None
        # Without numbers, boxes of one time are of one image.
        return np.unique(records.time, return_inverse=True)[1].astype(np.int64), None
    first = context.first_frame
    if first is None:
        first = records.first_frame or 0
    early = np.flatnonzero(frame < first)
    if early.size and first > 0:
        message = f"frame {frame[early[0]]} is before the first one, {first}"
        raise records.error(path, int(early[0]), message)
    return frame - first, None


def _check_images(path: str | Path, records: Records, frame: Ints, images: Sequence[str]) -> None:
    """Refuse a frame that has two images."""
    names: dict[int, str] = {}
    for row, (number, image) in enumerate(zip(frame.tolist(), images, strict=True)):
        if names.setdefault(number, image) != image:
            message = f"two images are frame {number}: {names[number]} and {image}"
            raise records.error(path, row, message)


def _named(path: str | Path, records: Records, images: Sequence[str]) -> tuple[Ints, Floats | None]:
    """Return the frame that the name of each image tells, or its place in time and the time."""
    names = [*images, *records.all_images]
    try:
        frame, time = frames_of_images(names)
    except ImageNameError as error:
        message = f"{error}; --frame-times FILE with the names of the images tells their times"
        if error.row >= len(images):
            raise FileError(path, f"{names[error.row]}: {message}") from None
        raise records.error(path, error.row, message) from None
    return frame[: len(images)], None if time is None else time[: len(images)]


def _looked_up(
    path: str | Path, records: Records, images: Sequence[str], frames: FrameTimes
) -> Ints:
    """Return the place of each image in a list of images and times."""
    found = []
    names: dict[str, str] = {}
    for row, image in enumerate(images):
        name = image_name(image)
        if name not in frames.names:
            raise records.error(path, row, f"{frames.source} has no image {image}")
        if names.setdefault(name, image) != image:
            message = f"two images are {name}: {names[name]} and {image}"
            raise records.error(path, row, message)
        found.append(frames.names[name])
    return np.array(found, dtype=np.int64)


def _times(
    path: str | Path,
    format_name: str,
    records: Records,
    context: ReadContext,
    frame: Ints,
    named: Floats | None,
) -> Floats:
    if named is not None:
        return named
    if context.frames is None:
        if records.time is None:
            raise FileError(path, NO_TIMES.format(format_name))
        return records.time
    if records.frame is None and records.image is None:
        message = f"its boxes have times and no frames: {context.frames.source} is of no use"
        raise FileError(path, message)
    if records.files is None:
        return context.frames.at(path, frame, records.line)
    if context.frames.table is None:
        return context.frames.at(path, frame, records.line)
    parts = [  # an error names the right file
        context.frames.at(file, frame[row : row + 1], records.line[row : row + 1])
        for row, file in enumerate(records.files)
    ]
    return np.concatenate(parts)


def _numbers(path: str | Path, records: Records, name: str, labels: Sequence[str]) -> Ints:
    try:
        return numbered(labels)
    except LabelError as error:
        message = f"{name} is {error.label}, not a whole number"
        raise records.error(path, error.row, message) from None
