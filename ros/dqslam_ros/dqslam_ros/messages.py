"""What messages of ROS say: times, boxes of an image, classes, ids."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dqslam as dq
from dqslam.io.camera.rosbag import camera_of_message
from dqslam.lens import undistorted_or_nan
from dqslam.pipeline.lens import wide_camera


@dataclass(frozen=True)
class ImageCamera:
    """The camera of the raw image, and that of a session, whose image has all that a lens shows."""

    raw: dq.Camera
    wide: dq.Camera
    offset: NDArray[np.float64]
    """From the pinhole's image of the raw camera to that of the wide one, px, shape (2,)."""

    @classmethod
    def of_message(cls, message: Any) -> ImageCamera:
        """Take a sensor_msgs/CameraInfo.

        Raises
        ------
        ValueError
            If it is not calibrated, or of a lens model that is not known.
        """
        return cls.of(camera_of_message(message))

    @classmethod
    def of(cls, camera: dq.Camera) -> ImageCamera:
        """Take a camera of the raw image."""
        if not camera.has_distortion:
            return cls(camera, camera, np.zeros(2))
        wide, offset = wide_camera(camera, np.zeros((0, 2)))
        return cls(camera, wide, offset)

    def undistorted(self, box: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return boxes (m, 4) of the raw image in the wide one; NaN beyond range or image."""
        if not self.raw.has_distortion or not len(box):
            return box
        found = undistorted_or_nan(self.raw, box) + np.tile(self.offset, 2)
        size = np.array([self.wide.width, self.wide.height] * 2) - 0.5
        with np.errstate(invalid="ignore"):
            inside = ((found >= -0.5) & (found <= size)).all(axis=1)
        found[~inside] = np.nan
        return found


def seconds(message: Any) -> float:
    """Return the stamp of a message in seconds, of ROS 2 or ROS 1."""
    stamp = message.header.stamp
    whole = getattr(stamp, "sec", None)
    if whole is None:
        return float(stamp.secs) + 1e-9 * float(stamp.nsecs)
    return float(whole) + 1e-9 * float(stamp.nanosec)


def boxes_of(
    message: Any, camera: ImageCamera, *, min_score: float, border_px: float, has_ids: bool
) -> dq.StepBoxes:
    """Return the boxes of an image that are good enough, undistorted, with their cut edges.

    Boxes beyond the range of the lens are left out.
    """
    corners, names, ids = [], [], []
    for detection in message.detections:
        name, score = _best(detection)
        if score < min_score:
            continue
        center = getattr(detection.bbox.center, "position", detection.bbox.center)
        half = 0.5 * np.array([detection.bbox.size_x, detection.bbox.size_y])
        middle = np.array([center.x, center.y])
        corners.append(np.concatenate([middle - half, middle + half]))
        names.append(name)
        ids.append(_id(detection) if has_ids else -1)
    box = np.array(corners).reshape(-1, 4)
    size = np.array([camera.raw.width, camera.raw.height] * 2) - 0.5
    low = box <= border_px - 0.5
    high = box >= size - border_px
    cut = np.where([True, True, False, False], low, high)
    box = camera.undistorted(np.clip(box, -0.5, size))
    rows = np.flatnonzero(np.isfinite(box).all(axis=1))
    return dq.StepBoxes(
        box[rows],
        np.array(ids, dtype=np.int64)[rows],
        [names[row] for row in rows.tolist()],
        cut[rows],
    )


def _best(detection: Any) -> tuple[str, float]:
    """Return class and score of the best hypothesis, of vision_msgs 4 or earlier."""
    found = [("object", 1.0)] if not detection.results else []
    for result in detection.results:
        inner = getattr(result, "hypothesis", result)
        label = getattr(inner, "class_id", None)
        found.append((str(inner.id if label is None else label), float(inner.score)))
    return max(found, key=lambda one: one[1])


def _id(detection: Any) -> int:
    text = str(getattr(detection, "id", getattr(detection, "tracking_id", "")))
    return int(text) if text.isdecimal() else -1
