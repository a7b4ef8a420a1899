"""The input of an estimator."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, as_floats, assign, reject_large, reject_rows
from dqslam._core import Camera
from dqslam._limits import LARGEST_TIME_S
from dqslam._repr import counted
from dqslam.recording.closures import AbsolutePositions, LoopClosures, check_rows
from dqslam.recording.detections import Detections, in_words
from dqslam.recording.measurements import Measurements
from dqslam.recording.odometry import Odometry
from dqslam.recording.poses import as_poses
from dqslam.recording.positions import RelativePositions


@dataclass(frozen=True, eq=False)
class Recording:
    """Everything that an estimator may use.

    Examples
    --------
    A robot with a camera that looks ahead passes an object, and a detector finds it three times:

    >>> import dqslam as dq
    >>> import numpy as np
    >>> ahead = [0.2, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5]  # mount of the camera on the robot
    >>> camera = dq.Camera(500, 500, 319.5, 239.5, 640, 480, robot_from_camera=ahead)
    >>> poses = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]
    >>> odometry = dq.Odometry.from_poses(poses, covariance=np.diag([0.02, 0.02, 0.01]) ** 2)
    >>> xyxy = [[400, 200, 450, 260], [415, 195, 475, 268], [440, 188, 515, 278]]
    >>> boxes = dq.Detections.from_xyxy([0, 1, 2], xyxy, object_id=0)
    >>> dq.Recording(camera, [0.0, 0.5, 1.0], odometry, boxes)
    Recording(SE2, 3 poses, 3 boxes of 1 object, 1 class)
    """

    camera: Camera
    timestamps: Floats
    """Strictly increasing seconds, shape (n,)."""
    odometry: Odometry
    detections: Detections
    positions: RelativePositions | None = None
    measurements: tuple[Measurements, ...] = ()
    """Other measurements, with one entry per kind."""
    absolute: AbsolutePositions | None = None
    closures: LoopClosures | None = None

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        timestamps = as_floats("timestamps", self.timestamps, [None])
        reject_large("timestamps", timestamps, LARGEST_TIME_S, "s")
        stalls = np.concatenate([[False], np.diff(timestamps) <= 0.0])[: len(timestamps)]
        reject_rows("timestamps", stalls, "time does not increase", timestamps)
        count = len(self.odometry.relative) + 1
        if len(timestamps) != count:
            raise ValueError(
                f"timestamps: expected {count}, one more than odometry.relative has rows, "
                f"got {len(timestamps)}"
            )
        check_rows("detections.pose", self.detections.pose, count)
        if self.positions is not None:
            check_rows("positions.pose", self.positions.pose, count)
        for measured in self.measurements:
            check_rows(f"{measured.kind}s.pose", measured.pose, count)
        if self.absolute is not None:
            check_rows("absolute.pose", self.absolute.pose, count)
        if self.closures is not None:
            check_rows("closures.from_pose", self.closures.from_pose, count)
            check_rows("closures.to_pose", self.closures.to_pose, count)
            as_poses("closures.relative", self.closures.relative, self.odometry.pose_model)
        self._check_boxes_meet_image()
        assign(self, timestamps=timestamps)

    def _check_boxes_meet_image(self) -> None:
        if self.camera.has_distortion:
            return  # the image is no rectangle in undistorted pixels
        box = self.detections.box
        last = np.array([self.camera.width, self.camera.height]) - 0.5
        outside = (box[:, 2:] <= -0.5) | (box[:, :2] >= last)
        reject_rows("detections.box", outside, "box outside the image", box)

    def __repr__(self) -> str:
        """Show the pose model, and how many poses, boxes, objects and classes there are."""
        parts = [self.odometry.pose_model.name, counted(len(self.timestamps), "pose")]
        parts.append(in_words(self.detections))
        if self.positions is not None:
            parts.append(counted(len(self.positions), "position"))
        parts += [counted(len(measured), measured.kind) for measured in self.measurements]
        if self.absolute is not None:
            parts.append(counted(len(self.absolute), "absolute position"))
        if self.closures is not None:
            parts.append(counted(len(self.closures), "closure"))
        return f"Recording({', '.join(parts)})"
