"""Poses as rows of numbers, in the plane or in space."""

import numpy as np
from numpy.typing import ArrayLike

from dqslam._checks import Floats, as_floats, reject_large, reject_rows
from dqslam._core import PoseModel
from dqslam._limits import LARGEST_ANGLE_RAD, LARGEST_COORDINATE_M

_SIZES = {PoseModel.SE2: 3, PoseModel.SE3: 7}
# Digits that were rounded away cost up to 1e-3 of a quaternion's length; more is a mistake.
_NORM_TOLERANCE = 1e-3
_UNIT = 1e-6


def pose_size(pose_model: PoseModel) -> int:
    """Return d, the numbers that store one pose."""
    return _SIZES[pose_model]


def tangent_size(pose_model: PoseModel) -> int:
    """Return k, the degrees of freedom of one pose."""
    return 3 if pose_model == PoseModel.SE2 else 6


def pose_model_of(name: str, poses: ArrayLike) -> PoseModel:
    """Return the model that poses have by their width, shape (..., d)."""
    shape = np.shape(poses)
    for model, size in _SIZES.items():
        if shape and shape[-1] == size:
            return model
    raise ValueError(f"{name}: expected 3 (SE2) or 7 (SE3) numbers a pose, got shape {shape}")


def as_poses(name: str, values: ArrayLike, pose_model: PoseModel) -> Floats:
    """Return read-only poses, shape (n, d), finite; rounded quaternions become of unit length."""
    poses = as_floats(name, values, [None, pose_size(pose_model)])
    places = 2 if pose_model == PoseModel.SE2 else 3
    reject_large(name, poses[:, :places], LARGEST_COORDINATE_M, "m")
    if pose_model == PoseModel.SE2:
        reject_large(name, poses[:, 2:], LARGEST_ANGLE_RAD, "rad")
        return poses
    norms = np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    off = np.abs(norms - 1.0)
    reject_rows(name, off > _NORM_TOLERANCE, "quaternion is not of unit length", poses)
    scale = np.where(off > _UNIT, norms, 1.0)
    return as_floats(name, np.column_stack([poses[:, :3], poses[:, 3:] / scale]), [None, 7])
