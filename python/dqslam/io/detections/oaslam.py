"""Detections as OA-SLAM and VOOM read them: JSON, a list of images with their detections.

An image is ``{"file_name": "rgb/000042.png", "detections": [{"category_id": 41, "detection_score":
0.9, "bbox": [x1, y1, x2, y2]}]}``. The corners are those of a detector, whose pixels count from the
corner of the image, so half a pixel is subtracted. The name of the file tells the frame or the
time. Further keys, such as fitted ellipses, are not used.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dqslam.io.detections.json_list import Entry, parse_entries
from dqslam.io.detections.records import Records, make_table
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError, read_text
from dqslam.io.formats import Format, Look, ReadContext
from dqslam.io.image_names import have_times

CORNER = 0.5  #: a detector's pixel coordinates minus ours
SCORES = ("detection_score", "score")


def read_oaslam(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read boxes, unchecked."""
    images, _ = parse_entries(path, read_text(path), "images")
    boxes = [(image, box) for image in images for box in _detections(image)]
    if not boxes:
        raise FileError(path, "holds no boxes")
    scored = next((key for key in SCORES if key in boxes[0][1].fields), None)
    records = Records(
        columns=("file_name", *boxes[0][1].fields),
        line=[image.line for image, _ in boxes],
        box=np.array([box.numbers("bbox", 4) for _, box in boxes]) - CORNER,
        image=[image.text("file_name") for image, _ in boxes],
        all_images=tuple(image.text("file_name") for image in images),
        score=(
            None if scored is None else np.array([box.number(scored, NO_SCORE) for _, box in boxes])
        ),
        class_id=[box.label("category_id") for _, box in boxes],
        track_id=(
            [box.label("track_id") for _, box in boxes]
            if any("track_id" in box.fields for _, box in boxes)
            else None
        ),
    )
    return make_table(path, "oaslam", records, context)


def _detections(image: Entry) -> list[Entry]:
    content: Any = image.value("detections")
    if not isinstance(content, list) or not all(isinstance(box, dict) for box in content):
        raise image.error("detections is no list of {category_id, detection_score, bbox}")
    return [Entry(image.path, image.index, image.line, box) for box in content]


def _has_times(path: Path) -> bool:
    images, _ = parse_entries(path, read_text(path), "images")
    return have_times([image.text("file_name") for image in images])


def _looks(look: Look) -> bool:
    return look.suffix == ".json" and all(
        key in look.head for key in ('"file_name"', '"detections"')
    )


OASLAM = Format(
    "oaslam",
    "JSON, a list of images with file_name and detections",
    _looks,
    read_oaslam,
    needs_times=False,
    has_times=_has_times,
)
