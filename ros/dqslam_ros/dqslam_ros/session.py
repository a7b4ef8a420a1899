"""What the node does, without ROS: messages in, a map and a correction of the odometry out.

Messages are objects with the fields of ROS, whichever library they come from. Times are their
stamps, in seconds. The session is in the frame of the camera: a step is an image with boxes, its
motion that of the camera by the odometry and the mount. Images wait until the odometry has reached
their time, and are then taken in the order of their times. An image that comes later than a step
that was taken is left out and counted.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import dqslam as dq
from dqslam_ros.poses import Matrix, PoseBuffer, matrix_of, pose_of


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """Assumptions of a session.

    ``translation_sigma`` [m] and ``rotation_sigma`` [rad] are the noise of odometry after a meter
    and a radian, with a least value for a step; ``wait_s`` is how long an image waits for its
    odometry; ``has_ids`` says whether detections have final ids of objects.
    """

    translation_sigma: float = 0.03
    rotation_sigma: float = 0.02
    least_translation_sigma: float = 0.002
    least_rotation_sigma: float = 0.001
    min_score: float = 0.5
    wait_s: float = 1.0
    border_px: float = 3.0
    has_ids: bool = False


@dataclass
class Counts:
    """What became of the images."""

    steps: int = 0
    late: int = 0
    without_odometry: int = 0
    refused: list[str] = field(default_factory=list)


class Session:
    """A session that is fed with messages."""

    def __init__(self, options: SessionOptions | None = None) -> None:
        self.options = options or SessionOptions()
        self.counts = Counts()
        self.slam: dq.OnlineSlam | None = None
        self._camera: dq.Camera | None = None
        self._base_from_camera: Matrix | None = None
        self._odometry = PoseBuffer(keep_s=30.0)
        self._waiting: list[tuple[float, int, Any]] = []
        self._arrived = 0
        self._last: tuple[float, Matrix] | None = None

    @property
    def is_ready(self) -> bool:
        """Whether camera and mount are known."""
        return self._camera is not None and self._base_from_camera is not None

    def set_mount(self, base_from_camera: ArrayLike) -> None:
        """Take the pose of the camera on the robot, x y z [m], qx qy qz qw, as tf has it."""
        self._base_from_camera = matrix_of(base_from_camera)

    def take_camera_info(self, message: Any) -> None:
        """Take the camera once; boxes are of the raw image, with its distortion."""
        if self._camera is not None:
            return
        k = getattr(message, "k", None)
        k = np.asarray(message.K if k is None else k, dtype=float)
        d = getattr(message, "d", None)
        d = np.asarray(message.D if d is None else d, dtype=float)
        if message.distortion_model not in ("", "plumb_bob") or len(d) > 5:
            raise ValueError(f"camera_info: no lens model {message.distortion_model!r} here yet")
        distortion = np.zeros(5)
        distortion[: len(d)] = d
        if k[0] <= 0:
            raise ValueError("camera_info: the camera is not calibrated, its focal length is 0")
        size = (int(message.width), int(message.height))
        self._camera = dq.Camera(k[0], k[4], k[2], k[5], *size, distortion=distortion)

    def take_odometry(self, message: Any) -> None:
        """Take a nav_msgs/Odometry."""
        pose = message.pose.pose
        self.take_pose(seconds(message), pose.position, pose.orientation)

    def take_pose(self, time: float, position: Any, orientation: Any) -> None:
        """Take odom_from_base, of a message or of tf."""
        p, q = position, orientation
        self._odometry.add(time, [p.x, p.y, p.z, q.x, q.y, q.z, q.w])

    def take_detections(self, message: Any) -> None:
        """Take a vision_msgs/Detection2DArray of either layout."""
        self._arrived += 1
        heapq.heappush(self._waiting, (seconds(message), self._arrived, message))

    def step(self) -> int:
        """Take all images whose odometry is there, in order, and return how many were steps."""
        if not self.is_ready:
            return 0
        before = self.counts.steps
        while self._waiting:
            time, _, message = self._waiting[0]
            odom_from_base = self._odometry.at(time)
            if odom_from_base is None and time > self._odometry.latest - self.options.wait_s:
                break  # it may still come
            heapq.heappop(self._waiting)
            if odom_from_base is None:
                self.counts.without_odometry += 1
            elif self._last is not None and time <= self._last[0]:
                self.counts.late += 1
            else:
                self._add(time, odom_from_base, message)
        return self.counts.steps - before

    def _add(self, time: float, odom_from_base: Matrix, message: Any) -> None:
        assert self._camera is not None and self._base_from_camera is not None
        odom_from_camera = odom_from_base @ self._base_from_camera
        motion = None
        if self.slam is None:
            first = pose_of(odom_from_camera)
            trust = 1.0 if self.options.has_ids else 0.9
            self.slam = dq.OnlineSlam(self._camera, first_pose=first, trust_ids=trust)
        elif self._last is not None:
            motion = self._motion(np.linalg.inv(self._last[1]) @ odom_from_camera)
        try:
            boxes = boxes_of(message, self._camera, self.options)
            self.slam.add(motion, boxes, timestamp=time)
        except ValueError as error:  # the session goes on without this image
            self.counts.refused.append(f"image at {time:.6f} s: {error}")
            return
        self._last = (time, odom_from_camera)
        self.counts.steps += 1

    def _motion(self, relative: Matrix) -> dq.Motion:
        options, pose = self.options, pose_of(relative)
        meters = float(np.linalg.norm(pose[:3]))
        radians = float(2.0 * np.arctan2(np.linalg.norm(pose[3:6]), abs(pose[6])))
        sigma_t = max(options.least_translation_sigma, options.translation_sigma * meters)
        sigma_r = max(options.least_rotation_sigma, options.rotation_sigma * radians)
        return dq.Motion(pose, np.diag([sigma_t] * 3 + [sigma_r] * 3) ** 2)

    def map_from_odom(self) -> NDArray[np.float64] | None:
        """Return the correction of the odometry, x y z [m], qx qy qz qw; None before a step."""
        if self.slam is None or self._last is None:
            return None
        return pose_of(matrix_of(self.slam.pose) @ np.linalg.inv(self._last[1]))

    def map_from_base(self) -> tuple[float, NDArray[np.float64]] | None:
        """Return the time [s] and pose of the robot at the last step."""
        if self.slam is None or self._last is None or self._base_from_camera is None:
            return None
        base = matrix_of(self.slam.pose) @ np.linalg.inv(self._base_from_camera)
        return self._last[0], pose_of(base)

    def save(self, folder: str | Path) -> None:
        """Save map and trajectory as `dqslam run` does."""
        if self.slam is None:
            raise ValueError("there is nothing to save yet: no image was a step")
        self.slam.save(folder)


def seconds(message: Any) -> float:
    """Return the stamp of a message in seconds, of ROS 2 or ROS 1."""
    stamp = message.header.stamp
    whole = getattr(stamp, "sec", None)
    if whole is None:
        return float(stamp.secs) + 1e-9 * float(stamp.nsecs)
    return float(whole) + 1e-9 * float(stamp.nanosec)


def boxes_of(message: Any, camera: dq.Camera, options: SessionOptions) -> dq.StepBoxes:
    """Return the boxes of an image that are good enough, undistorted, with their cut edges."""
    corners, names, ids = [], [], []
    for detection in message.detections:
        name, score = _best(detection)
        if score < options.min_score:
            continue
        center = getattr(detection.bbox.center, "position", detection.bbox.center)
        half = 0.5 * np.array([detection.bbox.size_x, detection.bbox.size_y])
        middle = np.array([center.x, center.y])
        corners.append(np.concatenate([middle - half, middle + half]))
        names.append(name)
        ids.append(_id(detection) if options.has_ids else -1)
    box = np.array(corners).reshape(-1, 4)
    size = np.array([camera.width, camera.height] * 2) - 0.5
    low = box <= options.border_px - 0.5
    high = box >= size - options.border_px
    cut = np.where([True, True, False, False], low, high)
    box = np.clip(box, -0.5, size)
    if camera.has_distortion and len(box):
        box = camera.undistort_boxes(box)
    return dq.StepBoxes(box, np.array(ids, dtype=np.int64), names, cut)


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
