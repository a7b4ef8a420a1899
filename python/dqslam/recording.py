"""What an estimator may see (Recording) and what it may not (Truth).

Conventions are those of the core (blocks.h): SE(2) poses [x, y, theta], SE(3) poses
[tx, ty, tz, qx, qy, qz, qw], meters, radians, pixels, seconds; boxes [u_min, v_min, u_max, v_max]
with whole numbers at pixel centers. d is the pose size (3 or 7), k the tangent size (3 or 6).
Every array is copied, checked and made read-only; what is wrong is named by array and row.
"""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from dqslam._checks import Bools, Floats, Ints, as_covariances, as_floats, as_ints, reject_rows
from dqslam._core import Camera, PoseModel


def pose_size(pose_model: PoseModel) -> int:
    """Return d, the numbers that store one pose."""
    return 3 if pose_model == PoseModel.SE2 else 7


def tangent_size(pose_model: PoseModel) -> int:
    """Return k, the degrees of freedom of one pose."""
    return 3 if pose_model == PoseModel.SE2 else 6


def as_poses(name: str, values: ArrayLike, pose_model: PoseModel) -> Floats:
    """Return read-only poses, shape (n, d), finite and with unit quaternions."""
    poses = as_floats(name, values, [None, pose_size(pose_model)])
    if pose_model == PoseModel.SE3:
        norms = np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        reject_rows(name, np.abs(norms - 1.0) > 1e-6, "quaternion is not of unit length", poses)
    return poses


def _set(instance: object, **arrays: object) -> None:
    """Assign fields of a frozen dataclass while it is made."""
    for name, value in arrays.items():
        object.__setattr__(instance, name, value)


@dataclass(frozen=True, eq=False)
class Odometry:
    """Relative motions between successive poses."""

    pose_model: PoseModel
    first_pose: Floats
    """world_from_robot of pose 0, shape (d,)."""
    relative: Floats
    """next_in_previous, shape (n - 1, d)."""
    covariance: Floats
    """In the tangent at `relative`, translation [m] first, then rotation [rad],
    both in the frame of the next pose; shape (n - 1, k, k)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        model = self.pose_model
        first_pose = as_poses("odometry.first_pose", np.atleast_2d(self.first_pose), model)
        if len(first_pose) != 1:
            raise ValueError(f"odometry.first_pose: expected one pose, got {len(first_pose)}")
        relative = as_poses("odometry.relative", self.relative, model)
        covariance = as_covariances(
            "odometry.covariance", self.covariance, len(relative), tangent_size(model)
        )
        _set(self, first_pose=first_pose[0], relative=relative, covariance=covariance)


@dataclass(frozen=True, eq=False)
class Detections:
    """Boxes that a detector drew, one row each."""

    pose: Ints
    """Row of the pose it was seen from, shape (m,)."""
    box: Floats
    """[u_min, v_min, u_max, v_max] in undistorted pixels, shape (m, 4)."""
    score: Floats
    """Confidence of the detector, shape (m,)."""
    class_id: Ints
    """Shape (m,)."""
    object_id: Ints
    """Which object it shows, -1 when unknown; shape (m,)."""
    class_names: dict[int, str] = field(default_factory=dict)
    """Name of every class id that occurs."""
    truncated: Bools = field(default_factory=lambda: np.zeros((0, 4), dtype=np.bool_))
    """Which edges are the border of the image, which the object leaves; shape (m, 4), none by
    default."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        box = as_floats("detections.box", self.box, [None, 4])
        reject_rows("detections.box", box[:, :2] >= box[:, 2:], "inverted or empty box", box)
        count = len(box)
        class_id = as_ints("detections.class_id", self.class_id, count)
        unnamed = ~np.isin(class_id, list(self.class_names))
        reject_rows("detections.class_id", unnamed, "class has no name", class_id)
        object_id = as_ints("detections.object_id", self.object_id, count)
        reject_rows("detections.object_id", object_id < -1, "not an object id", object_id)
        _set(
            self,
            pose=as_ints("detections.pose", self.pose, count),
            box=box,
            score=as_floats("detections.score", self.score, [count]),
            class_id=class_id,
            object_id=object_id,
            truncated=_as_edges("detections.truncated", self.truncated, count),
        )

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.box)

    def select(self, rows: Ints | Bools) -> Self:
        """Return some of the boxes: their rows, or a flag for each box (m,)."""
        names = ("pose", "box", "score", "class_id", "object_id", "truncated")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


@dataclass(frozen=True, eq=False)
class RelativePositions:
    """Measured centers of objects relative to the robot, as a depth camera gives them."""

    pose: Ints
    """Row of the pose it was seen from, shape (p,)."""
    object_id: Ints
    """Shape (p,)."""
    object_in_robot: Floats
    """Meters, shape (p, 3)."""
    covariance: Floats
    """Square meters, shape (p, 3, 3)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        object_in_robot = as_floats("positions.object_in_robot", self.object_in_robot, [None, 3])
        count = len(object_in_robot)
        _set(
            self,
            pose=as_ints("positions.pose", self.pose, count),
            object_id=as_ints("positions.object_id", self.object_id, count),
            object_in_robot=object_in_robot,
            covariance=as_covariances("positions.covariance", self.covariance, count, 3),
        )

    def __len__(self) -> int:
        """Return the number of measurements."""
        return len(self.object_in_robot)

    def select(self, rows: Ints | Bools) -> Self:
        """Return some of the measurements: their rows, or a flag for each (p,)."""
        names = ("pose", "object_id", "object_in_robot", "covariance")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements of one kind between poses and objects, m numbers each.

    Kinds are those of the core: "position" (m = 3, the center in the robot frame, meters) and
    "range" (m = 1, the distance from the robot to the center, meters).
    """

    kind: str
    pose: Ints
    """Row of the pose it was measured from, shape (p,)."""
    object_id: Ints
    """Shape (p,)."""
    value: Floats
    """Shape (p, m)."""
    covariance: Floats
    """Shape (p, m, m)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers; the core knows the kinds."""
        value = as_floats(f"{self.kind}s.value", self.value, [None, None])
        count, size = value.shape
        _set(
            self,
            pose=as_ints(f"{self.kind}s.pose", self.pose, count),
            object_id=as_ints(f"{self.kind}s.object_id", self.object_id, count),
            value=value,
            covariance=as_covariances(f"{self.kind}s.covariance", self.covariance, count, size),
        )

    def __len__(self) -> int:
        """Return the number of measurements."""
        return len(self.value)


@dataclass(frozen=True, eq=False)
class Recording:
    """All that an estimator may see."""

    camera: Camera
    timestamps: Floats
    """Strictly increasing seconds, shape (n,)."""
    odometry: Odometry
    detections: Detections
    positions: RelativePositions | None = None
    measurements: tuple[Measurements, ...] = ()
    """Beside boxes and positions, one entry a kind."""

    def __post_init__(self) -> None:
        """Check that the parts belong together."""
        timestamps = as_floats("timestamps", self.timestamps, [None])
        stalls = np.concatenate([[False], np.diff(timestamps) <= 0.0])[: len(timestamps)]
        reject_rows("timestamps", stalls, "time does not increase", timestamps)
        count = len(self.odometry.relative) + 1
        if len(timestamps) != count:
            raise ValueError(
                f"timestamps: expected {count}, one more than odometry.relative has rows, "
                f"got {len(timestamps)}"
            )
        _check_poses("detections.pose", self.detections.pose, count)
        if self.positions is not None:
            _check_poses("positions.pose", self.positions.pose, count)
        for measured in self.measurements:
            _check_poses(f"{measured.kind}s.pose", measured.pose, count)
        self._check_boxes_meet_image()
        _set(self, timestamps=timestamps)

    def _check_boxes_meet_image(self) -> None:
        if self.camera.has_distortion:
            return  # the image is no rectangle in undistorted pixels
        box = self.detections.box
        last = np.array([self.camera.width, self.camera.height]) - 0.5
        outside = (box[:, 2:] <= -0.5) | (box[:, :2] >= last)
        reject_rows("detections.box", outside, "box outside the image", box)


def _as_edges(name: str, values: ArrayLike, count: int) -> Bools:
    """Return read-only flags of the four edges of each box, shape (count, 4); none by default."""
    flags = np.array(values)
    if not flags.size:
        flags = np.zeros((count, 4), dtype=np.bool_)
    if flags.shape != (count, 4):
        raise ValueError(f"{name}: expected shape ({count}, 4), got {flags.shape}")
    reject_rows(name, ~np.isin(flags, [0, 1]), "not true or false", flags)
    edges = flags.astype(np.bool_)
    edges.setflags(write=False)
    return edges


def _check_poses(name: str, rows: Ints, count: int) -> None:
    reject_rows(name, (rows < 0) | (rows >= count), f"no such pose (there are {count})", rows)


@dataclass(frozen=True, eq=False)
class Truth:
    """The answer that a simulator knows: for evaluation only."""

    pose_model: PoseModel
    poses: Floats
    """world_from_robot, shape (n, d)."""
    object_id: Ints
    """Of every object of the world, detected or not; shape (o,)."""
    center: Floats
    """In the world, meters, shape (o, 3)."""
    volume: Floats
    """Cubic meters, shape (o,)."""
    class_name: tuple[str, ...]
    """One per object."""
    ellipsoids: Floats | None = None
    """Center and log-Cholesky shape, shape (o, 9); None when the objects are no ellipsoids."""
    box_object_id: Ints | None = None
    """Which object each box of the recording shows, whatever its id says; shape (m,)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        object_id = as_ints("truth.object_id", self.object_id)
        count = len(object_id)
        if len(set(object_id.tolist())) != count:
            raise ValueError("truth.object_id: an id occurs twice")
        if len(self.class_name) != count:
            raise ValueError(f"truth.class_name: expected {count}, got {len(self.class_name)}")
        volume = as_floats("truth.volume", self.volume, [count])
        reject_rows("truth.volume", volume <= 0.0, "not positive", volume)
        ellipsoids = self.ellipsoids
        if ellipsoids is not None:
            ellipsoids = as_floats("truth.ellipsoids", ellipsoids, [count, 9])
        box_object_id = self.box_object_id
        if box_object_id is not None:
            box_object_id = as_ints("truth.box_object_id", box_object_id)
            unknown = ~np.isin(box_object_id, object_id)
            reject_rows("truth.box_object_id", unknown, "no such object", box_object_id)
        _set(
            self,
            poses=as_poses("truth.poses", self.poses, self.pose_model),
            object_id=object_id,
            center=as_floats("truth.center", self.center, [count, 3]),
            volume=volume,
            class_name=tuple(self.class_name),
            ellipsoids=ellipsoids,
            box_object_id=box_object_id,
        )
