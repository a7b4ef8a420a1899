"""Detections from ROS bags: vision_msgs/Detection2DArray.

A box has its center and size in pixels. Whole numbers are assumed to be pixel centers counted from
0, as in CameraInfo, because vision_msgs does not specify it. A rotated box is refused. The best
hypothesis gives class and score. A class that is a number is the class id; other classes are
numbered in the order of their names. ``id`` (vision_msgs 4) or ``tracking_id`` is the track; values
that are not numbers are numbered in the order in which they occur. A frame is a message, and its
time is that of the array's header.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam.io.detections.table import NO_TRACK, DetectionTable
from dqslam.io.files import FileError
from dqslam.io.formats import Format, Progress, no_progress
from dqslam.io.frames import FrameTimes
from dqslam.io.rosbag import LOOKS, NAME, looks_like_bag, messages, stamp_seconds

KIND = "vision_msgs/msg/Detection2DArray"
COLUMNS = ("stamp", "bbox", "class_id", "score", "id")


def read_detection_arrays(
    path: str | Path,
    *,
    width: int | None = None,
    height: int | None = None,
    frames: FrameTimes | None = None,
    classes: dict[int, str] | None = None,
    topic: str | None = None,
    progress: Progress = no_progress,
) -> DetectionTable:
    """Read boxes, unchecked; names of ``classes`` override the bag's."""
    frame, line, times, boxes, scores, labels, tracks = [], [], [], [], [], [], []
    for number, (where, message) in enumerate(messages(path, KIND, topic, progress)):
        for detection in message.detections:
            if not len(detection.results):
                raise FileError(path, f"{where}: a detection without a class")
            label, score = max(
                (_hypothesis(result) for result in detection.results), key=lambda best: best[1]
            )
            frame.append(number)
            line.append(number + 1)
            times.append(stamp_seconds(message))
            boxes.append(_box(path, where, detection.bbox))
            scores.append(score)
            labels.append(label)
            tracks.append(str(getattr(detection, "id", getattr(detection, "tracking_id", ""))))
    if not boxes:
        raise FileError(path, f"holds no boxes in {KIND}")
    class_id = _numbered(labels, sorted(set(labels)))
    named = zip(class_id.tolist(), labels, strict=True)
    return DetectionTable(
        path=str(path),
        columns=COLUMNS,
        line=np.array(line),
        frame=np.array(frame, dtype=np.int64),
        timestamp=np.array(times),
        box=np.array(boxes),
        score=np.array(scores, dtype=float),
        class_id=class_id,
        class_name=tuple((classes or {}).get(number, name) for number, name in named),
        track_id=_numbered(tracks, list(dict.fromkeys(tracks))) if any(tracks) else None,
    )


def _hypothesis(result: Any) -> tuple[str, float]:
    # vision_msgs 4 wraps the fields that version 3 (string) and ROS 1 (int64) have beside the pose.
    inner = getattr(result, "hypothesis", result)
    label = getattr(inner, "class_id", None)
    return str(inner.id if label is None else label), float(inner.score)


def _box(path: str | Path, where: str, bbox: Any) -> list[float]:
    center = getattr(bbox.center, "position", bbox.center)
    x, y, w, h = center.x, center.y, bbox.size_x, bbox.size_y
    if not np.isfinite([x, y, w, h]).all():
        raise FileError(path, f"{where}: box is not finite")
    if bbox.center.theta:
        raise FileError(path, f"{where}: box is turned by {bbox.center.theta:g} rad")
    return [x - w / 2, y - h / 2, x + w / 2, y + h / 2]


def _numbered(labels: list[str], order: list[str]) -> NDArray[np.int64]:
    """Turn labels into whole numbers: their value, or their place in the order; "" means none."""
    real = [label for label in order if label]
    if all(label.isdecimal() or label == str(NO_TRACK) for label in real):
        number = {label: int(label) for label in real}
    else:
        number = {label: i for i, label in enumerate(real)}
    return np.array([number.get(label, NO_TRACK) for label in labels], dtype=np.int64)


ARRAYS = Format(NAME, LOOKS, looks_like_bag, read_detection_arrays, tells_share=True)
