"""Detections from files, one module for each format; all become corners in pixels, see `table`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dqslam._input import plain_name
from dqslam.io.detections.coco import COCO, read_categories
from dqslam.io.detections.csv import CSV
from dqslam.io.detections.flat import JSON_LINES, SUPERVISION
from dqslam.io.detections.kitti_labels import KITTI_OBJECTS, KITTI_TRACKING
from dqslam.io.detections.mot import MOT
from dqslam.io.detections.oaslam import OASLAM
from dqslam.io.detections.other_classes import OtherClasses
from dqslam.io.detections.overlap import doubt_doubles, suppress
from dqslam.io.detections.rosbag import ARRAYS
from dqslam.io.detections.table import DetectionTable, checked
from dqslam.io.detections.yolo import YOLO, read_data_names
from dqslam.io.files import FileError, read_text
from dqslam.io.formats import Progress, ReadContext, choose_format, guarded, no_progress
from dqslam.io.frames import FrameTimes
from dqslam.io.notes import Notes
from dqslam.io.rosbag import check_topic

__all__ = [
    "DETECTION_FORMATS",
    "DetectionTable",
    "OtherClasses",
    "read_class_names",
    "read_detections",
]

# A folder, and a JSON file, is of the first of these that it looks like.
DETECTION_FORMATS = (
    ARRAYS,
    KITTI_OBJECTS,
    YOLO,
    OASLAM,
    SUPERVISION,
    JSON_LINES,
    COCO,
    MOT,
    KITTI_TRACKING,
    CSV,
)


def read_detections(
    path: str | Path,
    format: str | None = None,
    *,
    width: int | None = None,
    height: int | None = None,
    frames: FrameTimes | None = None,
    first_frame: int | None = None,
    classes: dict[int, str] | None = None,
    cut: bool = True,
    check: bool = True,
    reread: Callable[[DetectionTable], DetectionTable] | None = None,
    min_score: float = 0.0,
    nms: float | None = None,
    topic: str | None = None,
    progress: Progress = no_progress,
    notes: Notes | None = None,
) -> DetectionTable:
    """Read boxes.

    Parameters
    ----------
    path
        A file, a folder of YOLO or KITTI files, the folder of a bag, or - for standard input.
    format
        One of DETECTION_FORMATS; by default it is recognized from the file.
    width, height
        Size of the image in px, for YOLO and for `cut`.
    frames
        Times of the frames, for a format that has none; they override the file's own.
    first_frame
        The number that the first frame has in the file; by default that of the format, mostly 0.
    classes
        Names of classes by id; they override the file's own.
    cut
        Whether to cut boxes at the border of the image; a box that is wholly outside is then
        bad.
    check
        Whether to find inverted boxes, scores outside of 0 to 1, and times that do not
        increase. Without it the table has the content of the file, for a search for mistakes, and
        what would be left out is only noted.
    reread
        Called with the boxes as the format has them, before they are checked and cut; returns the
        boxes that are meant.
    min_score
        Boxes with a lower score, 0 to 1, do not count: they stay, whatever else is wrong with them.
    nms
        Boxes that overlap a better one of their image by this intersection over union, 0 to 1, are
        left out, whatever their class. By default none is.
    topic
        Topic of a bag that has several.
    progress
        Called with the share of a bag or a folder that has been read.
    notes
        Collects what is left out and what is doubtful, and says how many bad boxes may be left out;
        by default these are warnings of Python, of the category ``InputWarning``.

    Raises
    ------
    FileError
        If the file is missing, in no known format, or wrong.
    """
    if nms is not None and not 0 < nms <= 1:
        raise ValueError(f"nms is {nms:g}, not between 0 and 1")
    chosen = choose_format(path, format, DETECTION_FORMATS, "detections")
    check_topic(chosen.name, topic)
    own = Notes() if notes is None else notes
    context = ReadContext(
        size=None if width is None or height is None else (width, height),
        frames=frames,
        first_frame=first_frame,
        classes=classes,
        topic=topic,
        progress=progress,
        notes=own,
    )
    table: DetectionTable = guarded(path, chosen.name, chosen.read, path, context)
    good = table = table if reread is None else reread(table)
    try:
        good = checked(table, width=width, height=height, cut=cut, min_score=min_score, notes=own)
    except FileError:
        if check:
            raise
    if check:
        table = good
    if nms is not None:
        keep = suppress(table, nms)
        reason = f"they overlap a better one by {nms:g} or more (nms)"
        own.skip(table.path, "boxes", reason, int((~keep).sum()), len(keep))
        table = table.select(keep)
    else:
        doubt_doubles(good.select(good.score >= min_score), own)
    if notes is None:
        own.warn()
    return table


def read_class_names(path: str | Path) -> dict[int, str]:
    """Read class names by id from COCO's categories, a data.yaml, or a text, one per line."""
    suffix = Path(plain_name(path)).suffix.lower()
    if suffix == ".json":
        names: dict[int, str] = guarded(path, "coco", read_categories, path)
        return names
    if suffix in (".yaml", ".yml"):
        names = guarded(path, "yaml", read_data_names, path)
        return names
    lines = read_text(path).rstrip("\n").split("\n")
    return {number: line.strip() for number, line in enumerate(lines) if line.strip()}
