"""Recordings with fewer poses, and back: odometry composed, its noise carried on, gaps filled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.recording import Recording
from dqslam.recording.odometry import compose_covariance


def thin_recording(recording: Recording, keyframes: NDArray[np.int64]) -> Recording:
    """Keep some of the poses and their boxes; odometry between them is composed."""
    odometry, detections = recording.odometry, recording.detections
    model = odometry.pose_model
    path = _core.dead_reckon(model, odometry.first_pose, odometry.relative)
    row = np.full(len(path), -1)
    row[keyframes] = np.arange(len(keyframes))
    kept = detections.select(row[detections.pose] >= 0)
    return replace(
        recording,
        timestamps=recording.timestamps[keyframes],
        odometry=replace(
            odometry,
            first_pose=path[keyframes[0]],
            relative=_core.between(model, path[keyframes[:-1]], path[keyframes[1:]]),
            covariance=compose_covariance(odometry, odometry.covariance, keyframes),
        ),
        detections=replace(kept, pose=row[kept.pose]),
    )


def fill_in(
    recording: Recording, keyframes: NDArray[np.int64], poses: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return all poses (n, d) from those of the keyframes: odometry, its errors shared evenly."""
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    return bend_path(odometry.pose_model, path, keyframes, poses)


def bend_path(
    model: _core.PoseModel,
    path: NDArray[np.float64],
    keyframes: NDArray[np.int64],
    poses: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return a path (n, d) bent so that its keyframes (f,) are at some poses (f, d)."""
    part = np.searchsorted(keyframes, np.arange(len(path)), side="right") - 1
    part = part.clip(min=0)
    first = keyframes[part]
    last = keyframes[(part + 1).clip(max=len(keyframes) - 1)]
    ahead = _core.compose(model, poses[part], _core.between(model, path[first], path))
    # What is left at the next keyframe, carried back to where we are.
    to_next = _core.between(model, path, path[last])
    next_key = poses[(part + 1).clip(max=len(keyframes) - 1)]
    missed = _core.minus(model, next_key, _core.compose(model, ahead, to_next))
    back = (_core.adjoint(model, to_next) @ missed[:, :, None])[:, :, 0]
    share = (np.arange(len(path)) - first) / np.maximum(last - first, 1)
    return _core.plus(model, ahead, back * share[:, None])
