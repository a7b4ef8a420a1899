"""Detections from files, one module for each format; all become corners in pixels, see `table`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dqslam.io.detections.coco import COCO, read_categories
from dqslam.io.detections.csv import CSV
from dqslam.io.detections.mot import MOT
from dqslam.io.detections.rosbag import ARRAYS
from dqslam.io.detections.table import DetectionTable, checked
from dqslam.io.detections.yolo import YOLO, read_data_names
from dqslam.io.files import read_text
from dqslam.io.formats import Progress, choose_format, no_progress
from dqslam.io.frames import FrameTimes
from dqslam.io.rosbag import topic_option

__all__ = ["DETECTION_FORMATS", "DetectionTable", "read_class_names", "read_detections"]

DETECTION_FORMATS = (ARRAYS, YOLO, COCO, MOT, CSV)


def read_detections(
    path: str | Path,
    format: str | None = None,
    *,
    width: int | None = None,
    height: int | None = None,
    frames: FrameTimes | None = None,
    classes: dict[int, str] | None = None,
    cut: bool = True,
    check: bool = True,
    topic: str | None = None,
    progress: Progress = no_progress,
) -> DetectionTable:
    """Read boxes.

    Parameters
    ----------
    path
        A file, a folder of YOLO files, or the folder of a bag.
    format
        One of DETECTION_FORMATS; by default it is recognized from the file.
    width, height
        Size of the image in px, for YOLO and for `cut`.
    frames
        Times of the frames, for a format that has none; they override the file's own.
    classes
        Names of classes by id; they override the file's own.
    cut
        Whether to cut boxes at the border of the image; a box that is wholly outside is then
        refused.
    check
        Whether to refuse inverted boxes, scores outside of 0 to 1, and times that do not
        increase. Without it the table has the content of the file, for a search for mistakes.
    topic
        Topic of a bag that has several.
    progress
        Called with the share of a bag or a folder that has been read.
    """
    chosen = choose_format(path, format, DETECTION_FORMATS, "detections")
    options: dict[str, Any] = dict(topic_option(chosen.name, topic))
    if chosen.tells_share:
        options["progress"] = progress
    table = chosen.read(path, width=width, height=height, frames=frames, classes=classes, **options)
    if not check:
        return table
    return checked(table, width=width, height=height, cut=cut)


def read_class_names(path: str | Path) -> dict[int, str]:
    """Read class names by id from COCO's categories, a data.yaml, or a text, one per line."""
    suffix = Path(path).suffix.lower()
    if suffix == ".json":
        return read_categories(path)
    if suffix in (".yaml", ".yml"):
        return read_data_names(path)
    lines = read_text(path).rstrip("\n").split("\n")
    return {number: line.strip() for number, line in enumerate(lines) if line.strip()}
