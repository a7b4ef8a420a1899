"""Poses between measured poses, at constant velocity in the frame of the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.recording.odometry import Odometry

Floats = NDArray[np.float64]

# Below this angle, series replace quotients by it [rad].
SMALL_ANGLE = 1e-4


def interpolate_poses(times: Floats, poses: Floats, at: Floats) -> Floats:
    """Return the poses at some times, along the geodesic between the poses before and after.

    The robot keeps its velocity and its rate of turn between two poses: it moves along a screw, on
    the plane along an arc. At the time of a pose, that is the pose itself.

    Parameters
    ----------
    times, poses
        Increasing times (n,) s, and the poses at these, (n, 3) or (n, 7), at least two.
    at
        Times of any shape (...), s. Before the first and after the last pose, those are returned.

    Returns
    -------
    Floats
        Poses, shape (..., d).
    """
    when = np.asarray(at, dtype=float).reshape(-1)
    before = np.clip(np.searchsorted(times, when, side="right") - 1, 0, len(times) - 2)
    span = times[before + 1] - times[before]
    share = np.clip((when - times[before]) / span, 0.0, 1.0)
    found = advance(poses[before], poses[before + 1], share)
    exact = (share == 0.0) | (share == 1.0)
    found[exact] = poses[before + (share == 1.0)][exact]
    return found.reshape(*np.shape(at), poses.shape[1])


def split_steps(odometry: Odometry, times: Floats, at: Floats) -> tuple[Odometry, Floats]:
    """Add poses between those of odometry, and split the steps between them.

    The parts of a step are as uncertain together as the step: each has its share of the covariance,
    by time, as seen from where it ends.

    Parameters
    ----------
    odometry
        Of n poses.
    times
        Their times (n,), increasing, s.
    at
        Times (k,) of the poses to add, s. Those outside of the poses, and those of poses, are not.

    Returns
    -------
    tuple[Odometry, Floats]
        Odometry of more poses, and their times.
    """
    model = odometry.pose_model
    inside = (at > times[0]) & (at < times[-1])
    new = np.setdiff1d(at[inside], times)
    if not new.size:
        return odometry, times
    path = _core.dead_reckon(model, odometry.first_pose, odometry.relative)
    together = np.union1d(times, new)
    poses = interpolate_poses(times, path, together)
    poses[np.searchsorted(together, times)] = path
    step = np.searchsorted(times, together[1:], side="left") - 1
    share = np.diff(together) / (times[step + 1] - times[step])
    # The error of a part is one of the end of its step, as seen from there.
    part_from_end = _core.between(model, poses[1:], path[step + 1])
    back = _core.adjoint(model, part_from_end)
    covariance = back @ odometry.covariance[step] @ np.swapaxes(back, 1, 2)
    covariance *= share[:, None, None]
    whole = share == 1.0
    covariance[whole] = odometry.covariance[step[whole]]
    relative = _core.between(model, poses[:-1], poses[1:])
    relative[whole] = odometry.relative[step[whole]]
    split = replace(
        odometry,
        relative=relative,
        covariance=(covariance + np.swapaxes(covariance, 1, 2)) / 2,
    )
    return split, together


def advance(start: Floats, end: Floats, share: Floats) -> Floats:
    """Return the poses a share (m,) of the way from ``start`` (m, d) to ``end`` (m, d)."""
    model = _core.PoseModel.SE2 if start.shape[1] == 3 else _core.PoseModel.SE3
    twist = logarithm(_core.between(model, start, end))
    return np.asarray(_core.compose(model, start, exponential(twist * share[:, None])))


def logarithm(poses: Floats) -> Floats:
    """Return the twists (m, k) that lead from the identity to poses (m, d): translation first."""
    if poses.shape[1] == 3:
        angle = (poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
        half = angle / 2
        # (theta / 2) cot(theta / 2), which is 1 - theta^2 / 12 for small angles
        small = np.abs(angle) < SMALL_ANGLE
        along = np.where(small, 1 - angle**2 / 12, half / np.tan(np.where(small, 1.0, half)))
        x, y = poses[:, 0], poses[:, 1]
        return np.column_stack([along * x + half * y, along * y - half * x, angle])
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(poses[:, 3:]).as_rotvec()
    angle = np.linalg.norm(turn, axis=1)
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    factor = np.where(small, 1 / 12, 1 / safe**2 - 0.5 / (safe * np.tan(safe / 2)))
    moved = poses[:, :3]
    across = np.cross(turn, moved)
    moved = moved - across / 2 + factor[:, None] * np.cross(turn, across)
    return np.hstack([moved, turn])


def exponential(twists: Floats) -> Floats:
    """Return the poses (m, d) that twists (m, k) lead to from the identity."""
    if twists.shape[1] == 3:
        angle = twists[:, 2]
        small = np.abs(angle) < SMALL_ANGLE
        safe = np.where(small, 1.0, angle)
        along = np.where(small, 1 - angle**2 / 6, np.sin(safe) / safe)
        aside = np.where(small, angle / 2, (1 - np.cos(safe)) / safe)
        x, y = twists[:, 0], twists[:, 1]
        return np.column_stack([along * x - aside * y, along * y + aside * x, angle])
    from scipy.spatial.transform import Rotation

    turn = twists[:, 3:]
    angle = np.linalg.norm(turn, axis=1)
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)[:, None]
    second = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)[:, None]
    across = np.cross(turn, twists[:, :3])
    moved = twists[:, :3] + first * across + second * np.cross(turn, across)
    return np.hstack([moved, Rotation.from_rotvec(turn).as_quat()])
