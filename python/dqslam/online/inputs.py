"""What arrives at a step, as the core wants it: times, motions and noise, checked."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam import _core
from dqslam._checks import Floats, as_covariances
from dqslam.assumptions import BoxNoise
from dqslam.online.objects import Registry
from dqslam.online.step import Motion, StepPositions
from dqslam.recording import as_poses, pose_size, tangent_size

Int32s = NDArray[np.int32]

_NO_POSITIONS = (np.zeros(0, dtype=np.int32), np.zeros((0, 3)), np.zeros((0, 9)))


class PathBegin:
    """The first pose, and how well it is known."""

    def __init__(
        self,
        pose_model: _core.PoseModel,
        pose: ArrayLike | None,
        covariance: ArrayLike | None,
    ) -> None:
        """Check; by default it is the origin, known exactly."""
        origin = np.zeros(pose_size(pose_model))
        if pose_model == _core.PoseModel.SE3:
            origin[-1] = 1.0
        given = origin if pose is None else pose
        self.pose = as_poses("first_pose", np.atleast_2d(given), pose_model)[0]
        """world_from_robot, shape (d,)."""
        self.covariance = np.zeros((0, 0))
        """Shape (k, k), empty where it is exact."""
        if covariance is not None:
            k = tangent_size(pose_model)
            one = np.asarray(covariance, dtype=np.float64)[None]
            self.covariance = as_covariances("first_covariance", one, 1, k)[0]


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
    odometry: Motion | None, begin: PathBegin | None, covariance: Floats | None
) -> tuple[Floats, Floats]:
    """Return a motion and its covariance; of the first step, where it begins.

    ``covariance`` is believed instead of the motion's own.
    """
    if begin is not None:
        if odometry is not None:
            raise ValueError("the first step has no odometry: it is where the path begins")
        return begin.pose, begin.covariance
    if odometry is None:
        raise ValueError(
            "no odometry leads here; across a gap, give a guess and a covariance as wide"
        )
    believed = odometry.covariance if covariance is None else covariance
    return (
        np.asarray(odometry.relative, dtype=np.float64),
        np.asarray(believed, dtype=np.float64),
    )


def box_noise_rows(noise: BoxNoise, box: Floats) -> Floats:
    """Return the covariances of boxes (b, 4), shape (b, 16)."""
    rows = np.zeros((len(box), 16))
    if len(box):
        if noise.relative:
            side = np.tile(box[:, 2:] - box[:, :2], 2)
            rows[:, ::5] = noise.pixels**2 + (noise.relative * side) ** 2
        else:
            rows[:, ::5] = noise.pixels**2
    return rows


def position_rows(
    positions: StepPositions | None, registry: Registry
) -> tuple[Int32s, Floats, Floats]:
    """Return the rows of the objects (p,), their positions (p, 3) and covariances (p, 9)."""
    if positions is None:
        return _NO_POSITIONS
    ids = np.asarray(positions.object_id).tolist()
    unknown = [number for number in ids if number not in registry]
    if unknown:
        raise ValueError(f"positions: object {unknown[0]} is not in the map yet")
    rows = np.array([registry.row_of(number) for number in ids], dtype=np.int32)
    covariance = np.asarray(positions.covariance, dtype=np.float64).reshape(len(ids), 9)
    return rows, np.asarray(positions.object_in_robot, dtype=np.float64), covariance
