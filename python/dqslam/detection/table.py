"""The boxes of a detector as the CSV that ``dqslam run`` reads."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from dqslam._files import write_text
from dqslam.detection.detect import Found
from dqslam.io.detections.csv import CORNER, short
from dqslam.io.files import FileError

COLUMNS = ("frame", "timestamp", "image", "x1", "y1", "x2", "y2", "score", "class_id", "class_name")


def write_found(path: str | Path, found: Found) -> None:
    """Write boxes to a millionth of a pixel, with whole numbers at pixel centers.

    The columns ``timestamp`` and ``image`` are left out where nothing tells them.

    Raises
    ------
    FileError
        If there are no boxes, which would be no recording, or the file cannot be written.
    """
    if not len(found):
        message = f"is not written: the detector has found nothing in {len(found.frame)} images"
        raise FileError(path, message)
    has = {"timestamp": bool(found.time), "image": any(found.name)}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([name for name in COLUMNS if has.get(name, True)])
    for row, boxes in enumerate(found.boxes):
        head = [
            found.frame[row],
            *([repr(found.time[row])] if found.time else []),
            *([found.name[row]] if has["image"] else []),
        ]
        corners = (boxes.corner - CORNER).tolist()
        for corner, score, number in zip(corners, boxes.score, boxes.class_id, strict=True):
            edges = map(short, corner)
            writer.writerow([*head, *edges, short(score), number, found.class_name(int(number))])
    write_text(path, text.getvalue())
