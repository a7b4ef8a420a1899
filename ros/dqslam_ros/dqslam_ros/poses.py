"""Poses as 4 by 4 matrices, and as the seven numbers x y z, qx qy qz qw."""

from __future__ import annotations

import bisect

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

Matrix = NDArray[np.float64]


def matrix_of(pose: ArrayLike) -> Matrix:
    """Return the matrix of x y z [m], qx qy qz qw."""
    numbers = np.asarray(pose, dtype=float)
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(numbers[3:]).as_matrix()
    matrix[:3, 3] = numbers[:3]
    return matrix


def pose_of(matrix: Matrix) -> NDArray[np.float64]:
    """Return x y z [m], qx qy qz qw of a matrix."""
    turn = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    return np.concatenate([matrix[:3, 3], turn])


def covariance_in_map(
    covariance: Matrix, map_from_base: Matrix, base_from_camera: Matrix
) -> Matrix:
    """Return the covariance (6, 6) of a robot's pose as geometry_msgs/PoseWithCovariance has it.

    What is given is that of the camera in the frame of the camera. ROS has the position and the
    rotation about the axes of the map, in that order.
    """
    rotation, (x, y, z) = base_from_camera[:3, :3], base_from_camera[:3, 3]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    to_base = np.block([[rotation, cross @ rotation], [np.zeros((3, 3)), rotation]])
    to_map = np.kron(np.eye(2), map_from_base[:3, :3]) @ to_base
    return to_map @ covariance @ to_map.T


class PoseBuffer:
    """The latest poses by time, from which poses between them are interpolated."""

    def __init__(self, keep_s: float) -> None:
        self._keep_s = keep_s
        self._times: list[float] = []
        self._poses: list[NDArray[np.float64]] = []

    @property
    def latest(self) -> float:
        """The time of the latest pose [s]; minus infinity without any."""
        return self._times[-1] if self._times else -np.inf

    def add(self, time: float, pose: ArrayLike) -> None:
        """Put a pose in its place; one of a known time replaces it."""
        numbers = np.asarray(pose, dtype=float)
        place = bisect.bisect_left(self._times, time)
        if place < len(self._times) and self._times[place] == time:
            self._poses[place] = numbers
            return
        self._times.insert(place, time)
        self._poses.insert(place, numbers)
        first = bisect.bisect_left(self._times, self.latest - self._keep_s)
        del self._times[:first], self._poses[:first]

    def at(self, time: float) -> Matrix | None:
        """Return the pose at a time, None before the first and after the latest."""
        if not self._times or not self._times[0] <= time <= self._times[-1]:
            return None
        after = bisect.bisect_left(self._times, time)
        if self._times[after] == time:
            return matrix_of(self._poses[after])
        times = self._times[after - 1 : after + 1]
        share = (time - times[0]) / (times[1] - times[0])
        first, second = self._poses[after - 1 : after + 1]
        turn = Slerp([0.0, 1.0], Rotation.from_quat([first[3:], second[3:]]))([share])
        matrix = np.eye(4)
        matrix[:3, :3] = turn.as_matrix()[0]
        matrix[:3, 3] = (1 - share) * first[:3] + share * second[:3]
        return matrix
