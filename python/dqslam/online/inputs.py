"""Checks of what arrives at a step; arrays as the core wants them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import (
    Bools,
    Floats,
    Ints,
    as_covariances,
    as_directions,
    as_floats,
    reject_large,
    reject_rows,
)
from dqslam._limits import (
    LARGEST_ANGLE_RAD,
    LARGEST_COORDINATE_M,
    LARGEST_ID,
    LARGEST_PIXEL,
    LARGEST_STEP_VARIANCE_M2,
    LARGEST_STEP_VARIANCE_RAD2,
    LARGEST_TIME_S,
    SMALLEST_VARIANCE,
)
from dqslam.assumptions import BoxNoise
from dqslam.lens import edge_scales
from dqslam.online.integrated_odometry import identity_pose
from dqslam.online.objects import Registry
from dqslam.online.step import Motion, StepBoxes, StepMeasurements, StepPositions
from dqslam.recording import as_poses, tangent_size

LARGEST_PATH_M = 0.5 * LARGEST_COORDINATE_M
"""How far odometry may lead: an estimate that lies further out can still be saved and loaded."""
_UNIT = 1e-6  # how far a quaternion's length may be from 1


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
    after = 0.0 if last is None else last + 1.0
    time = after if timestamp is None else float(timestamp)
    if not math.isfinite(time):
        raise ValueError(f"timestamp {time} is not finite")
    if abs(time) > LARGEST_TIME_S:
        raise ValueError(f"timestamp {time:g} is beyond {LARGEST_TIME_S:g} s")
    if last is not None and time <= last:
        word = "repeats the last one" if time == last else f"is before the last, {last!r}"
        raise ValueError(f"timestamp {time!r} {word}")
    return time


def motion_arrays(
    odometry: Motion | None,
    begin: tuple[Floats, Floats] | None,
    covariance: Floats | None,
    pose_model: _core.PoseModel,
    last_poses: Floats,
) -> tuple[Floats, Floats]:
    """Return a motion and its covariance; of the first step, where it begins.

    ``covariance`` is believed instead of the motion's own. From none of the last poses, (m, d), may
    the motion lead further from the origin than files can tell.
    """
    if begin is not None:
        if odometry is not None:
            raise ValueError("the first step has no odometry: it is where the path begins")
        return begin
    if odometry is None:
        raise ValueError(
            "no odometry leads here; across a gap, give a guess and a covariance as wide"
        )
    relative = _as_numbers("odometry", odometry.relative)
    is_flat = pose_model == _core.PoseModel.SE2
    size, k, places = (3, 3, 2) if is_flat else (7, 6, 3)
    numbers = relative.tolist()
    if relative.shape != (size,) or not all(map(math.isfinite, numbers)):
        raise ValueError(f"odometry: expected {size} finite numbers")
    if not is_flat and abs(math.hypot(*numbers[3:]) - 1.0) > _UNIT:
        raise ValueError("odometry row 0: the quaternion is not unit")
    if is_flat and abs(numbers[2]) > LARGEST_ANGLE_RAD:
        raise ValueError(f"odometry: turns by {numbers[2]:g} rad, beyond {LARGEST_ANGLE_RAD:g}")
    there = _core.compose(pose_model, last_poses, relative[None].repeat(len(last_poses), axis=0))
    reach = max(max(map(abs, one[:places])) for one in there.tolist())
    if not reach <= LARGEST_PATH_M:
        raise ValueError(f"odometry: leads {reach:g} m from the origin, beyond {LARGEST_PATH_M:g}")
    own = _as_covariance("odometry_covariance", odometry.covariance, k, places)
    if covariance is None:
        return relative, own  # whether it is symmetric positive definite, the core says
    try:
        as_covariances("odometry_covariance", own[None], 1, k)
    except ValueError:
        raise ValueError("odometry_covariance: not symmetric positive definite") from None
    return relative, covariance


def _as_numbers(name: str, values: ArrayLike) -> Floats:
    """Return a float array; complex numbers are refused, and not cut."""
    array = np.asarray(values)
    if array.dtype.kind == "c":
        raise ValueError(f"{name} row 0: complex, not real")
    return array.astype(np.float64, copy=False)


def _as_covariance(name: str, values: ArrayLike, size: int, places: int) -> Floats:
    """Return the covariance (size, size) of a motion, its variances checked; first of places."""
    array = _as_numbers(name, values)
    if array.shape != (size, size) or not np.isfinite(array).all():
        raise ValueError(f"{name}: expected shape ({size}, {size}), finite")
    variance = array.diagonal().tolist()
    for part, largest, unit in (
        (variance[:places], LARGEST_STEP_VARIANCE_M2, "m^2"),
        (variance[places:], LARGEST_STEP_VARIANCE_RAD2, "rad^2"),
    ):
        if min(part) <= 0.0:
            raise ValueError(f"{name}: not symmetric positive definite")
        if not SMALLEST_VARIANCE <= min(part) <= max(part) <= largest:
            limits = f"{SMALLEST_VARIANCE:g} and {largest:g} {unit}"
            raise ValueError(f"{name}: variances not between {limits}: {part}")
    return array


@dataclass(frozen=True, eq=False)
class CheckedBoxes:
    """Boxes whose shapes fit."""

    box: Floats
    object_id: Ints
    class_name: Sequence[str]
    truncated: Bools
    embedding: Floats

    def select(self, rows: Ints) -> CheckedBoxes:
        """Return some of the boxes."""
        names = [self.class_name[row] for row in rows.tolist()]
        return CheckedBoxes(
            self.box[rows], self.object_id[rows], names, self.truncated[rows], self.embedding[rows]
        )


_NO_BOXES = CheckedBoxes(
    np.zeros((0, 4)),
    np.zeros(0, dtype=np.int64),
    (),
    np.zeros((0, 4), dtype=np.bool_),
    np.zeros((0, 0)),
)


def check_boxes(
    boxes: StepBoxes | None, camera: _core.Camera, embedding_size: int | None = None
) -> CheckedBoxes:
    """Return the boxes as arrays; ValueError names what does not fit, and its row.

    ``embedding_size`` is how long the vectors of boxes are, by default anything.
    """
    if boxes is None:
        return _NO_BOXES
    box = _as_numbers("boxes", boxes.box)
    if box.size == 0:
        return _NO_BOXES
    count = len(box)
    if box.shape != (count, 4):
        raise ValueError(f"boxes: expected shape (n, 4), got {box.shape}")
    _check_numbers(box, camera)
    object_id = np.asarray(boxes.object_id)
    if object_id.shape != (count,) or object_id.dtype.kind not in "iu":
        raise ValueError(f"object_id: expected {count} whole numbers")
    ids = object_id.tolist()  # a list of a few is faster than an array
    if min(ids) < -1 or max(ids) > LARGEST_ID:
        wrong = np.array([not -1 <= one <= LARGEST_ID for one in ids])
        reject_rows("object_id", wrong, "not an object id", object_id)
    names = boxes.class_name or ("object",) * count
    if len(names) != count:
        raise ValueError(f"class_name: expected {count} names, got {len(names)}")
    for row, name in enumerate(names):
        if not isinstance(name, str):
            raise ValueError(f"class_name row {row}: {name!r} is not a text")
    given = np.zeros((count, 4)) if boxes.truncated is None else boxes.truncated
    truncated = np.asarray(given)
    if truncated.shape != (count, 4):
        raise ValueError(f"truncated: expected shape ({count}, 4), got {truncated.shape}")
    if truncated.dtype != np.bool_:
        reject_rows("truncated", ~np.isin(truncated, [0, 1]), "not true or false", truncated)
    embedding = as_directions("embedding", boxes.embedding, count)
    length = embedding.shape[1]
    if embedding_size not in (None, length):
        raise ValueError(f"embedding: {length} numbers a box, and {embedding_size} before")
    return CheckedBoxes(
        box, object_id.astype(np.int64), names, truncated.astype(np.bool_), embedding
    )


def _check_numbers(box: Floats, camera: _core.Camera) -> None:
    """Raise a ValueError unless boxes (n, 4) are boxes in the image, at least in part."""
    last_u, last_v = camera.width - 0.5, camera.height - 0.5
    if camera.has_distortion:  # the image is no rectangle in undistorted pixels
        last_u, last_v, first = LARGEST_PIXEL, LARGEST_PIXEL, -LARGEST_PIXEL
    else:
        first = -0.5
    # Numbers of a few boxes are compared faster one by one than as arrays; so is NaN, with false.
    if all(
        -LARGEST_PIXEL <= left < right <= LARGEST_PIXEL
        and -LARGEST_PIXEL <= top < bottom <= LARGEST_PIXEL
        and left < last_u
        and top < last_v
        and right > first
        and bottom > first
        for left, top, right, bottom in box.tolist()
    ):
        return
    reject_rows("boxes", ~np.isfinite(box), "NaN or infinite", box)
    reject_rows("boxes", np.abs(box) > LARGEST_PIXEL, f"beyond {LARGEST_PIXEL:g} px", box)
    reject_rows("boxes", box[:, :2] >= box[:, 2:], "inverted or empty box", box)
    outside = (box[:, 2:] <= first) | (box[:, :2] >= [last_u, last_v])
    reject_rows("boxes", outside, "outside the image", box)


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
    ids = np.asarray(given.object_id).reshape(-1).tolist()
    unknown = [one for one in ids if one not in registry.row_of]
    if unknown:
        raise ValueError(f"{given.kind}s: object {unknown[0]} is not in the map yet")
    count, name = len(ids), f"{given.kind}s"
    value = as_floats(f"{name}.value", given.value, [None, None])
    if len(value) != count:
        raise ValueError(f"{name}.value: expected {count} rows, got {len(value)}")
    reject_large(f"{name}.value", value, LARGEST_COORDINATE_M, "")
    covariance = as_covariances(f"{name}.covariance", given.covariance, count, value.shape[1])
    return _core.MeasurementTable(
        kind=given.kind,
        pose=np.zeros(count, dtype=np.int32),
        object=np.array([registry.row_of[one] for one in ids], dtype=np.int32),
        value=value,
        covariance=covariance.reshape(count, -1),
    )
