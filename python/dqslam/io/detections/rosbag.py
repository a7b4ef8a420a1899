"""Detections from ROS bags: vision_msgs/Detection2DArray.

A box has its center and size in pixels. Whole numbers are assumed to be pixel centers counted from
0, as in CameraInfo, because vision_msgs does not specify it. A rotated box is bad. The best
hypothesis gives class and score. Classes and ids (``id`` of vision_msgs 4, ``tracking_id``) are
names, see `dqslam.io.labels`. Detections without a hypothesis are left out, unless none has one:
then all are of the class "object". A frame is a message, and its time is that of the array's
header, or, where that is 0, that of its detections. A message that is repeated is left out.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dqslam.io.detections.records import Records, make_table
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError
from dqslam.io.formats import Format, ReadContext
from dqslam.io.rosbag import LOOKS, NAME, looks_like_bag, messages, stamp_seconds

KIND = "vision_msgs/msg/Detection2DArray"
COLUMNS = ("stamp", "bbox", "class_id", "score", "id")
NO_TURN = 1e-4  #: rad; a smaller angle moves no edge by a tenth of a pixel


class Hypothesis(NamedTuple):
    """A class that a detection may have."""

    label: str
    score: float


def read_detection_arrays(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read boxes, unchecked."""
    frame, line, times, tracks = [], [], [], []
    boxes: list[list[float]] = []
    best: list[Hypothesis | None] = []
    turned: dict[int, tuple[str, float]] = {}
    seen: dict[float, list[Any]] = {}
    repeated, count = [], 0
    for number, (where, message) in enumerate(
        messages(path, KIND, context.topic, context.progress)
    ):
        count += 1
        if not len(message.detections):
            continue  # an image without boxes, and perhaps without a time
        time = _time(path, where, message)
        content = [_content(detection) for detection in message.detections]
        if time in seen:
            if content != seen[time]:
                raise FileError(path, f"{where}: other boxes at a time that was before, {time!r}")
            repeated.append((number, where, time))
            continue
        seen[time] = content
        for box, theta, hypothesis, track in content:
            if abs(math.remainder(theta, math.pi)) > NO_TURN:
                turned[len(boxes)] = (where, theta)
            frame.append(number)
            line.append(number + 1)
            times.append(time)
            boxes.append(box)
            best.append(hypothesis)
            tracks.append(track)
    context.notes.leave_out(
        path,
        "messages",
        "repeated",
        range(len(repeated)),
        count,
        lambda row: FileError(path, f"{repeated[row][1]} repeats the time {repeated[row][2]!r}"),
    )
    if not boxes:
        raise FileError(path, f"holds no boxes in {KIND}")
    bad = sorted(turned)
    context.notes.leave_out(
        path,
        "boxes",
        "turned",
        bad,
        len(boxes),
        lambda row: FileError(path, f"{turned[row][0]}: box is turned by {turned[row][1]:g} rad"),
    )
    classified = any(best)
    kept = [row for row in range(len(boxes)) if row not in turned and (best[row] or not classified)]
    nameless = sum(not one for one in best) if classified else 0
    context.notes.skip(path, "boxes", "detections without a class", nameless, len(boxes))
    if not classified:
        context.notes.doubt(path, 'no detection has a class: all are taken for the class "object"')
    kept_best = [best[row] for row in kept]
    records = Records(
        columns=COLUMNS,
        line=[line[row] for row in kept],
        box=np.array([boxes[row] for row in kept]).reshape(-1, 4),
        frame=np.array([frame[row] for row in kept], dtype=np.int64),
        time=np.array([times[row] for row in kept]),
        score=np.array([one.score if one else NO_SCORE for one in kept_best]),
        class_id=[one.label if one else "" for one in kept_best] if classified else None,
        track_id=[tracks[row] for row in kept] if any(tracks) else None,
    )
    return make_table(path, NAME, records, context)


def _time(path: str | Path, where: str, message: Any) -> float:
    """Return the time of an array in seconds."""
    time = stamp_seconds(message)
    if time != 0:
        return time
    own = {stamp_seconds(detection) for detection in message.detections}
    if len(own) > 1:
        raise FileError(path, f"{where}: no time, and its detections have {len(own)} times")
    return own.pop()


def _content(detection: Any) -> tuple[list[float], float, Hypothesis | None, str]:
    """Return corners [px], angle [rad], the best class with its score, and the id."""
    bbox = detection.bbox
    center = getattr(bbox.center, "position", bbox.center)
    x, y, w, h = center.x, center.y, bbox.size_x, bbox.size_y
    corners = [x - w / 2, y - h / 2, x + w / 2, y + h / 2]
    hypotheses = [_hypothesis(result) for result in detection.results]
    best = max(hypotheses, key=lambda one: one.score) if hypotheses else None
    track = str(getattr(detection, "id", getattr(detection, "tracking_id", "")))
    return corners, float(bbox.center.theta), best, track


def _hypothesis(result: Any) -> Hypothesis:
    # vision_msgs 4 wraps the fields that version 3 (string) and ROS 1 (int64) have beside the pose.
    inner = getattr(result, "hypothesis", result)
    label = getattr(inner, "class_id", None)
    return Hypothesis(str(inner.id if label is None else label), float(inner.score))


ARRAYS = Format(NAME, LOOKS, looks_like_bag, read_detection_arrays)
