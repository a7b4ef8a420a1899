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
from dqslam import _core
from dqslam_ros.messages import ImageCamera, boxes_of, seconds
from dqslam_ros.poses import Matrix, PoseBuffer, covariance_in_map, matrix_of, pose_of


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """Assumptions of a session.

    ``translation_sigma`` [m] and ``rotation_sigma`` [rad] are the noise of odometry after a meter
    and a radian, with a least value for a step; ``wait_s`` is how long an image waits for its
    odometry; ``silence_s`` is how long images or odometry may be missing before `Session.silence`
    says so; ``has_ids`` says whether detections have final ids of objects.
    """

    translation_sigma: float = 0.03
    rotation_sigma: float = 0.02
    least_translation_sigma: float = 0.002
    least_rotation_sigma: float = 0.001
    min_score: float = 0.5
    wait_s: float = 1.0
    silence_s: float = 3.0
    border_px: float = 3.0
    has_ids: bool = False


@dataclass
class Counts:
    """What became of the images."""

    steps: int = 0
    late: int = 0
    without_odometry: int = 0
    refused: list[str] = field(default_factory=list)
    """Images that were no step, and why."""
    not_located: list[str] = field(default_factory=list)
    """Images in which the camera was looked for in a map and not found, and why."""


@dataclass(frozen=True)
class MapObject:
    """An object as messages have it."""

    id: int
    class_name: str
    pose: NDArray[np.float64]
    """map_from_object, x y z [m], qx qy qz qw; the axes of the object are those of its shape."""
    size: NDArray[np.float64]
    """Its three full lengths along these axes, m."""


class Session:
    """A session that is fed with messages."""

    def __init__(self, options: SessionOptions | None = None) -> None:
        self.options = options or SessionOptions()
        self.counts = Counts()
        self.slam: dq.OnlineSlam | None = None
        self._camera: ImageCamera | None = None
        self._base_from_camera: Matrix | None = None
        self._odometry = PoseBuffer(keep_s=30.0)
        self._waiting: list[tuple[float, int, Any]] = []
        self._arrived = 0
        self._latest_image = -np.inf
        self._last: tuple[float, Matrix] | None = None
        self._map_to_load: Path | None = None
        self._is_lost = False

    @property
    def is_ready(self) -> bool:
        """Whether camera and mount are known."""
        return self._camera is not None and self._base_from_camera is not None

    @property
    def is_located(self) -> bool:
        """Whether there is a pose that can be believed: not while a map is to be located in."""
        return self._last is not None and not self._is_lost and self._map_to_load is None

    @property
    def waiting_times(self) -> list[float]:
        """The times [s] of images whose odometry is not there yet; tf may be asked for these."""
        return [time for time, _, _ in sorted(self._waiting) if self._odometry.at(time) is None]

    def set_mount(self, base_from_camera: ArrayLike) -> None:
        """Take the pose of the camera on the robot, x y z [m], qx qy qz qw, as tf has it."""
        self._base_from_camera = matrix_of(base_from_camera)

    def take_camera_info(self, message: Any) -> None:
        """Take the camera once; boxes are of the raw image, with its distortion."""
        if self._camera is None:
            self._camera = ImageCamera.of_message(message)

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
        time = seconds(message)
        self._latest_image = max(self._latest_image, time)
        heapq.heappush(self._waiting, (time, self._arrived, message))

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
        options = self.options
        try:
            boxes = boxes_of(
                message,
                self._camera,
                min_score=options.min_score,
                border_px=options.border_px,
                has_ids=options.has_ids,
            )
            self._take(time, odom_from_camera, boxes)
        except _NotLocatedError as error:
            self.counts.not_located.append(f"image at {time:.6f} s: {error}")
        except ValueError as error:  # the session goes on without this image
            self.counts.refused.append(f"image at {time:.6f} s: {error}")
        else:
            self._last = (time, odom_from_camera)
            self.counts.steps += 1

    def _take(self, time: float, odom_from_camera: Matrix, boxes: dq.StepBoxes) -> None:
        """Make a step of an image: of a new session, of one in a saved map, or of this one."""
        assert self._camera is not None
        settings = {
            "trust_ids": 1.0 if self.options.has_ids else 0.9,
            "pose_model": dq.PoseModel.SE3,
        }
        if self._map_to_load is not None:
            self.slam = _session_in_map(self._map_to_load, self._camera, boxes, time, settings)
            self._map_to_load = None
        elif self.slam is None:
            first = pose_of(odom_from_camera)
            slam = dq.OnlineSlam(self._camera.wide, first_pose=first, **settings)
            slam.add(None, boxes, timestamp=time)
            self.slam = slam
        elif self._is_lost:
            found = _relocalized(self.slam, boxes)
            relative = np.linalg.inv(matrix_of(self.slam.pose)) @ matrix_of(found.pose)
            self.slam.add(dq.Motion(pose_of(relative), found.covariance), boxes, timestamp=time)
            self._is_lost = False
        else:
            assert self._last is not None
            relative = np.linalg.inv(self._last[1]) @ odom_from_camera
            self.slam.add(self._motion(relative), boxes, timestamp=time)

    def _motion(self, relative: Matrix) -> dq.Motion:
        options, pose = self.options, pose_of(relative)
        meters = float(np.linalg.norm(pose[:3]))
        radians = float(2.0 * np.arctan2(np.linalg.norm(pose[3:6]), abs(pose[6])))
        sigma_t = max(options.least_translation_sigma, options.translation_sigma * meters)
        sigma_r = max(options.least_rotation_sigma, options.rotation_sigma * radians)
        return dq.Motion(pose, np.diag([sigma_t] * 3 + [sigma_r] * 3) ** 2)

    def map_from_odom(self) -> NDArray[np.float64] | None:
        """Return the correction of the odometry, x y z [m], qx qy qz qw; None if not located."""
        if self.slam is None or self._last is None or not self.is_located:
            return None
        return pose_of(matrix_of(self.slam.pose) @ np.linalg.inv(self._last[1]))

    def map_from_base(self) -> tuple[float, NDArray[np.float64]] | None:
        """Return the time [s] and pose of the robot at the last step; None if not located."""
        if self.slam is None or self._last is None or not self.is_located:
            return None
        assert self._base_from_camera is not None
        base = matrix_of(self.slam.pose) @ np.linalg.inv(self._base_from_camera)
        return self._last[0], pose_of(base)

    def covariance_in_map(self) -> NDArray[np.float64] | None:
        """Return the covariance of ``map_from_base`` as ROS has it, (6, 6); None if not located."""
        found = self.map_from_base()
        if found is None:
            return None
        assert self.slam is not None and self._base_from_camera is not None
        covariance = self.slam.pose_covariance
        return covariance_in_map(covariance, matrix_of(found[1]), self._base_from_camera)

    def objects(self) -> list[MapObject]:
        """Return the objects of the map."""
        if self.slam is None:
            return []
        found, all_objects = [], self.slam.objects
        shapes = _core.ellipsoid_shapes(all_objects.ellipsoids)
        for row, shape in enumerate(shapes):
            squares, axes = np.linalg.eigh(shape)
            axes[:, 0] *= np.linalg.det(axes)
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = axes, all_objects.centers[row]
            size = 2.0 * np.sqrt(squares)
            name = all_objects.class_names[row]
            found.append(MapObject(int(all_objects.object_ids[row]), name, pose_of(matrix), size))
        return found

    def silence(self, now: float) -> str | None:
        """Say whether images or odometry have been missing for long at a time [s]; None if not."""
        latest = {"images with boxes": self._latest_image, "odometry": self._odometry.latest}
        missing = [
            f"no {what} for {now - at:.1f} s"
            for what, at in latest.items()
            if np.isfinite(at) and now - at > self.options.silence_s
        ]
        return "; ".join(missing) or None

    def save(self, folder: str | Path) -> None:
        """Save map and trajectory as `dqslam run` does."""
        if self.slam is None:
            raise ValueError("there is nothing to save yet: no image was a step")
        self.slam.save(folder)

    def load(self, folder: str | Path) -> None:
        """Continue in a saved map, from the first image in which the camera is found in it.

        Until then, there are no steps and no correction of the odometry.

        Raises
        ------
        ValueError
            If the map is missing or wrong; the session goes on as it was.
        """
        dq.OnlineSlam.load(folder)
        self._map_to_load, self._is_lost = Path(folder), False

    def relocalize(self) -> None:
        """Look for the camera in the map of this session, as after odometry that has jumped.

        Until it is found, there are no steps and no correction of the odometry.
        """
        if self.slam is None:
            raise ValueError("there is no map to be located in: no image was a step")
        self._map_to_load, self._is_lost = None, True


class _NotLocatedError(Exception):
    """The boxes of an image do not tell where the camera is in the map."""


def _relocalized(slam: dq.OnlineSlam, boxes: dq.StepBoxes) -> Any:
    try:
        return slam.relocalize(boxes)
    except ValueError as error:
        raise _NotLocatedError(str(error)) from None


def _session_in_map(
    folder: Path,
    camera: ImageCamera,
    boxes: dq.StepBoxes,
    time: float,
    settings: dict[str, Any],
) -> dq.OnlineSlam:
    """Return a session that continues a map, with the step in which the camera was found."""
    known = dq.OnlineSlam.load(folder, **settings)
    names = ("fx", "fy", "cx", "cy", "width", "height")
    ours, theirs = ([getattr(one, name) for name in names] for one in (camera.wide, known.camera))
    if not np.allclose(ours, theirs, rtol=1e-6):
        raise ValueError(f"the map in {folder} was made with another camera")
    found = _relocalized(known, boxes)
    slam = dq.OnlineSlam.load(
        folder, first_pose=found.pose, first_covariance=found.covariance, **settings
    )
    slam.add(None, found.with_ids(boxes), timestamp=time)
    return slam
