"""Checks of what arrives at a step; arrays as the core wants them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints, as_covariances, reject_rows
from dqslam.assumptions import BoxNoise
from dqslam.lens import edge_scales
from dqslam.online.integrated_odometry import identity_pose
from dqslam.online.objects import Registry
from dqslam.online.step import Motion, StepBoxes, StepMeasurements, StepPositions
from dqslam.recording import as_poses, tangent_size

Int32s = NDArray[np.int32]


def path_begin(
    pose_model: _core.PoseModel, pose: ArrayLike | None, covariance: ArrayLike | None
) -> tuple[Floats, Floats]:
    """Return the first pose, (d,), and its covariance, (k, k), empty where it is exact.

    By default it is the origin, known exactly.
    """
    given = identity_pose(pose_model) if pose is None else pose
    first = as_poses("first_pose", np.atleast_2d(given), pose_model)[0]
    if covariance is None:
        return first, np.zeros((0, 0))
    one = np.asarray(covariance, dtype=np.float64)[None]
    return first, as_covariances("first_covariance", one, 1, tangent_size(pose_model))[0]


def next_time(last: float | None, timestamp: float | None) -> float:
    """Return the time of a step [s] after the last, one second later by default."""
    if timestamp is None:
        return 0.0 if last is None else last + 1.0
    time = float(timestamp)
    if not math.isfinite(time):
        raise ValueError(f"timestamp {time} is not finite")
    if last is not None and time <= last:
        word = "repeats the last one" if time == last else f"is before the last, {last!r}"
        raise ValueError(f"timestamp {time!r} {word}")
    return time


def motion_arrays(
    odometry: Motion | None, begin: tuple[Floats, Floats] | None, covariance: Floats | None
) -> tuple[Floats, Floats]:
    """Return a motion and its covariance; of the first step, where it begins.

    ``covariance`` is believed instead of the motion's own.
    """
    if begin is not None:
        if odometry is not None:
            raise ValueError("the first step has no odometry: it is where the path begins")
        return begin
    if odometry is None:
        raise ValueError(
            "no odometry leads here; across a gap, give a guess and a covariance as wide"
        )
    believed = odometry.covariance if covariance is None else covariance
    return np.asarray(odometry.relative, np.float64), np.asarray(believed, np.float64)


@dataclass(frozen=True, eq=False)
class CheckedBoxes:
    """Boxes whose shapes fit."""

    box: Floats
    object_id: Ints
    class_name: Sequence[str]
    truncated: Bools

    def select(self, rows: Ints) -> CheckedBoxes:
        """Return some of the boxes."""
        names = [self.class_name[row] for row in rows.tolist()]
        return CheckedBoxes(self.box[rows], self.object_id[rows], names, self.truncated[rows])


_NO_BOXES = CheckedBoxes(
    np.zeros((0, 4)), np.zeros(0, dtype=np.int64), (), np.zeros((0, 4), dtype=np.bool_)
)


def check_boxes(boxes: StepBoxes | None) -> CheckedBoxes:
    """Return the boxes as arrays; ValueError names what does not fit. The core checks numbers."""
    if boxes is None:
        return _NO_BOXES
    box = np.asarray(boxes.box, dtype=np.float64)
    if box.size == 0:
        return _NO_BOXES
    count = len(box)
    if box.shape != (count, 4):
        raise ValueError(f"boxes: expected shape (n, 4), got {box.shape}")
    if not np.isfinite(box).all():
        reject_rows("boxes", ~np.isfinite(box), "NaN or infinite", box)
    object_id = np.asarray(boxes.object_id)
    if object_id.shape != (count,) or object_id.dtype.kind not in "iu":
        raise ValueError(f"object_id: expected {count} whole numbers")
    if min(object_id.tolist()) < -1:  # a list of a few is faster than an array
        reject_rows("object_id", object_id < -1, "not an object id", object_id)
    names = boxes.class_name or ("object",) * count
    if len(names) != count:
        raise ValueError(f"class_name: expected {count} names, got {len(names)}")
    given = np.zeros((count, 4)) if boxes.truncated is None else boxes.truncated
    truncated = np.asarray(given, dtype=np.bool_)
    if truncated.shape != (count, 4):
        raise ValueError(f"truncated: expected shape ({count}, 4), got {truncated.shape}")
    return CheckedBoxes(box, object_id.astype(np.int64), names, truncated)


def box_noise_rows(noise: BoxNoise, box: Floats, camera: _core.Camera) -> Floats:
    """Return the covariances of boxes (b, 4) in the pinhole's image of a camera, shape (b, 16)."""
    rows = np.zeros((len(box), 16))
    rows[:, ::5] = (noise.pixels * edge_scales(camera, box)) ** 2
    if noise.relative:
        variance = (noise.relative * (box[:, 2:] - box[:, :2])) ** 2
        rows[:, 0::10] += variance[:, :1]  # of both edges in u
        rows[:, 5::10] += variance[:, 1:]
    return rows


def measurement_tables(
    positions: StepPositions | None, measurements: Sequence[StepMeasurements], registry: Registry
) -> list[_core.MeasurementTable]:
    """Return what was measured beside boxes, one table a kind, by the rows of the objects."""
    given = list(measurements)
    if positions is not None:
        centers = StepMeasurements(
            "position", positions.object_id, positions.object_in_robot, positions.covariance
        )
        given.insert(0, centers)
    return [_measurement_table(one, registry) for one in given]


def _measurement_table(given: StepMeasurements, registry: Registry) -> _core.MeasurementTable:
    ids = np.asarray(given.object_id).tolist()
    unknown = [one for one in ids if one not in registry.row_of]
    if unknown:
        raise ValueError(f"{given.kind}s: object {unknown[0]} is not in the map yet")
    count = len(ids)
    return _core.MeasurementTable(
        kind=given.kind,
        pose=np.zeros(count, dtype=np.int32),
        object=np.array([registry.row_of[one] for one in ids], dtype=np.int32),
        value=np.asarray(given.value, dtype=np.float64),
        covariance=np.asarray(given.covariance, dtype=np.float64).reshape(count, -1),
    )
