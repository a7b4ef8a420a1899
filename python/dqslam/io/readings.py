"""Other readings of numbers in files: poses and boxes in the conventions of other programs.

Files say numbers, and seldom what they mean. What they mean is said here: options of `dqslam run`
and `dqslam inspect` name a reading, and an inspection tries all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.io.detections.columns import MEANING, plain
from dqslam.io.detections.table import DetectionTable
from dqslam.io.trajectory.table import Trajectory

Floats = NDArray[np.float64]

#: Readings of poses, in the order in which they are applied.
POSE_READINGS = {
    "w_first": "quaternions are qw qx qy qz",
    "camera_from_world": "poses are camera_from_world",
    "opengl": "cameras look along -z, y is up",
    "body": "poses are those of a body, x forward, y left, z up, with the camera looking forward",
}
# The axes of our camera (x right, y down, z forward) in those of the file, one a column.
OPENGL_AXES = np.diag([1.0, -1.0, -1.0])
BODY_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_AXES = {"opengl": OPENGL_AXES, "body": BODY_AXES}

#: Forms of the four numbers of a box; pixels, or shares of an image of 1 x 1 px.
BOX_FORMS = ("xyxy", "xywh", "cxcywh", "yxyx")


def read_poses_as(trajectory: Trajectory, names: Sequence[str]) -> Trajectory:
    """Read the poses of a trajectory by some of POSE_READINGS.

    Raises
    ------
    ValueError
        For a name that is none of them.
    """
    from scipy.spatial.transform import Rotation

    unknown = [name for name in names if name not in POSE_READINGS]
    if unknown:
        raise ValueError(f"poses {unknown[0]!r} are none of {', '.join(POSE_READINGS)}")
    poses = trajectory.world_from_camera.copy()
    if "w_first" in names:
        poses[:, 3:] = poses[:, [4, 5, 6, 3]]
    if "camera_from_world" in names:
        poses = _core.inverse(_core.PoseModel.SE3, poses)
    for name, axes in _AXES.items():
        if name in names:
            turned = Rotation.from_quat(poses[:, 3:]) * Rotation.from_matrix(axes)
            poses[:, 3:] = turned.as_quat()
    return Trajectory(trajectory.timestamps, poses)


@dataclass(frozen=True)
class BoxReading:
    """What the numbers of boxes are, other than their format says."""

    form: str | None = None
    """One of BOX_FORMS; None is that of the format."""
    image: tuple[float, float] | None = None
    """Width and height of the image that boxes are of; 1 x 1 for shares of the image."""
    letterbox: bool = False
    """Whether that image has the camera's in its middle, with bars beside or above it."""

    def __post_init__(self) -> None:
        """Check what was chosen."""
        if self.form is not None and self.form not in BOX_FORMS:
            raise ValueError(f"box form {self.form!r} is none of {', '.join(BOX_FORMS)}")
        if self.image is not None and not min(self.image) > 0:
            raise ValueError(f"box image {self.image[0]:g}x{self.image[1]:g} is not positive")
        if self.letterbox and self.image is None:
            raise ValueError("a letterbox needs the size of its image")

    def boxes(self, table: DetectionTable, size: tuple[int, int] | None) -> Floats:
        """Return the boxes of a table as corners in pixels of an image of this size, (m, 4)."""
        box = table.box if self.form is None else in_form(table, self.form)
        if self.image is None:
            return box
        assert size is not None
        return from_image(box, self.image, size, self.letterbox)

    def read(self, table: DetectionTable, size: tuple[int, int] | None) -> DetectionTable:
        """Return the table with its boxes read so."""
        own_size = table.image_size if self.image is None else None
        return replace(table, box=self.boxes(table, size), image_size=own_size)


def form_of(table: DetectionTable) -> str:
    """Return the form that the format of a file says, by the names of its columns."""
    columns = {plain(name) for name in table.columns}
    if (
        "cx" in {MEANING.get(name) for name in columns} or {"stamp", "bbox"} <= columns
    ):  # YOLO, messages of ROS
        return "cxcywh"
    # A bbox of COCO, which has an image_id, is corner and size, and one of OA-SLAM two corners.
    of_oaslam = "bbox" in columns and "image_id" not in columns
    return "xyxy" if of_oaslam or "x2" in {MEANING.get(name) for name in columns} else "xywh"


def in_form(table: DetectionTable, form: str) -> Floats:
    """Return the boxes of a table as corners (m, 4), their numbers read in another form."""
    low, high = table.box[:, :2], table.box[:, 2:]
    stated = form_of(table)
    if stated == "xyxy":
        first, second = low, high
    elif stated == "xywh":
        first, second = low, high - low
    else:
        first, second = (low + high) / 2, high - low
    corners = {
        "xyxy": (first, second),
        "xywh": (first, first + second),
        "cxcywh": (first - second / 2, first + second / 2),
        "yxyx": (first[:, ::-1], second[:, ::-1]),
    }
    return np.hstack(corners[form])


def from_image(
    box: Floats, image: tuple[float, float], size: tuple[int, int], letterbox: bool
) -> Floats:
    """Return boxes (m, 4) of one image in pixels of another, of this size, that shows the same.

    Whole numbers are centers of pixels, so that both images begin at -0.5. Shares, of an image of
    1 x 1, begin at 0.
    """
    start = 0.0 if max(image) <= 1.0 else -0.5
    scale, bars = np.array(size) / np.array(image), np.zeros(2)
    if letterbox:
        scale = np.full(2, scale.max())
        bars = (np.array(image) - np.array(size) / scale) / 2
    moved = (box - start - np.tile(bars, 2)) * np.tile(scale, 2) - 0.5
    return np.asarray(moved)


@dataclass(frozen=True)
class Readings:
    """What the numbers in the files of a recording mean, where it is not what is usual."""

    poses: tuple[str, ...] = ()
    """Some of POSE_READINGS."""
    body_from_camera: tuple[float, ...] | None = None
    """Pose of the camera in the body whose poses the trajectory has: m and x y z w."""
    length_scale: float = 1.0
    """Meters in the unit of length of the poses: 0.001 for millimeters."""
    boxes: BoxReading = BoxReading()
    time_scale: float = 1.0
    """Seconds in the unit of the times of boxes, by the clock of the poses."""
    time_offset: float = 0.0
    """Seconds to add to the times of boxes then."""

    def __post_init__(self) -> None:
        """Check what was chosen."""
        unknown = [name for name in self.poses if name not in POSE_READINGS]
        if unknown:
            raise ValueError(f"poses {unknown[0]!r} are none of {', '.join(POSE_READINGS)}")
        for name in ("length_scale", "time_scale"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value:g}, not positive")
        if not np.isfinite(self.time_offset):
            raise ValueError(f"time_offset is {self.time_offset:g}, not finite")

    def trajectory(self, trajectory: Trajectory) -> Trajectory:
        """Return the trajectory of the camera in meters."""
        times, poses = read_poses_as(trajectory, self.poses) if self.poses else trajectory
        if self.length_scale != 1.0:
            poses = poses * np.array([self.length_scale] * 3 + [1.0] * 4)
        if self.body_from_camera is not None:
            mount = np.tile(np.array(self.body_from_camera, dtype=float), (len(times), 1))
            poses = _core.compose(_core.PoseModel.SE3, poses, mount)
        return Trajectory(times, poses)

    @property
    def changes_boxes(self) -> bool:
        """Whether boxes are read otherwise than their format says."""
        return self.boxes != BoxReading()

    def timed(self, table: DetectionTable) -> DetectionTable:
        """Return boxes at their times by the clock of the poses."""
        if self.time_scale == 1.0 and self.time_offset == 0.0:
            return table
        return replace(table, timestamp=self.time_scale * table.timestamp + self.time_offset)


#: Files mean what is usual.
AS_USUAL = Readings()
